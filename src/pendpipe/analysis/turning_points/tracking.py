"""One pass over a very long, evenly sampled record: a phase-locked loop of least squares.

Every half cycle is fitted with a cosine and a sine over an odd number of readings about the
one nearest to its expected turning. There the two are orthogonal, so that the fit is two
products with tables made once a block; the fraction of a reading between that one and the
turning is made up for by turning the result, cos(p + q) = cos p cos q - sin p sin q.
"""

from __future__ import annotations

import math

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.kernel import Matrix, kernel

LEVEL_BLOCK = 256
"""Half cycles over which level and period are one number each."""
_LANES = 16
"""Tables are filled up with zeros to a multiple of this."""
_BATCH = 8
"""Half cycles that are measured where the loop expects them, before it looks where they were.

One by one each would wait for the one before, and the processor with them."""
_FOLLOW, _LEARN = 0.7, 0.3
"""Share of a batch's mean phase error that moves the next, and that changes the period."""
_LOST = 0.3
"""Phase error in rad at which the lock counts as lost."""
_CLEAR = 8.0
"""Standard deviations by which an amplitude must stand out for its phase to be used."""
_SAMPLED = 16
"""Every how many-th half cycle tells the noise."""


@kernel(any_order=True)
def _products(piece: FloatArray, tables: Matrix, level: float) -> tuple[float, float, float]:
    """Sums of readings less level times each of the tables."""
    even, odd, rest = 0.0, 0.0, 0.0
    cosine, sine, rests = tables[0], tables[1], tables[2]
    for i in range(piece.size):
        x = piece[i] - level
        even += x * cosine[i]
        odd += x * sine[i]
        rest += x * rests[i]
    return even, odd, rest


@kernel(any_order=True)
def _squares(piece: FloatArray, level: float) -> float:
    """Sum of the squares of readings less level."""
    total = 0.0
    for i in range(piece.size):
        total += (piece[i] - level) ** 2
    return total


@kernel(any_order=True)
def _fit_batch(
    values: FloatArray,
    first: float,
    period: float,
    reach: int,
    step: float,
    tables: Matrix,
    level: float,
    count: int,
    found: Matrix,
) -> int:
    """Fit the half cycles expected at the readings `first`, `first` + `period`, ...

    Fills `count` columns of `found` with factors of cosine and sine about the expected turning,
    and the sum of what they leave; returns how many lie among the readings.
    """
    number, length = 2 * reach + 1, _length(reach)
    for j in range(count):
        at = first + j * period
        middle = math.floor(at + 0.5)
        lo = middle - reach
        if lo < 0 or lo + number > values.size:
            return j
        last = lo + length if lo + length <= values.size else lo + number
        even, odd, rest = _products(values[lo:last], tables, level)
        phase = (middle - at) * step
        square = phase * phase
        cosine = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0)))
        sine = phase * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square / 5040.0)))
        found[0, j] = even * cosine - odd * sine
        found[1, j] = even * sine + odd * cosine
        found[2, j] = rest
    return count


@kernel
def _length(reach: int) -> int:
    """Return how many numbers of a table are used: a loop over them has no rest."""
    return (2 * reach + _LANES) // _LANES * _LANES


@kernel
def _fill_tables(reach: int, step: float, tables: Matrix) -> tuple[float, float, float]:
    """Write the weights of the readings from -reach to reach about a turning, `step` apart.

    Rows of `tables`: for the cosine's factor, the sine's, and the sum of what they leave.

    Returns
    -------
    flat, even, odd
        Sums of the cosine, its square, and the sine's square.
    """
    number = 2 * reach + 1
    flat, even, odd = 0.0, 0.0, 0.0
    for i in range(_length(reach)):
        cosine = math.cos((i - reach) * step) if i < number else 0.0
        sine = math.sin((i - reach) * step) if i < number else 0.0
        tables[0, i], tables[1, i] = cosine, sine
        flat, even, odd = flat + cosine, even + cosine * cosine, odd + sine * sine
    for i in range(_length(reach)):
        cosine = tables[0, i]
        tables[2, i] = 1.0 - cosine * (flat / even) if i < number else 0.0
        tables[0, i] = cosine / even
        tables[1, i] /= odd
    return flat, even, odd


def track(values: FloatArray, start: FloatArray, columns: Matrix) -> tuple[int, float, float]:
    """Fit half cycle after half cycle of evenly spaced readings, each placed by those before it.

    Parameters
    ----------
    values
        The readings.
    start
        Time of the first reading, interval; time of turning, half period, side (+1 above the
        level) and level of the first half cycle; rms of one reading; a, b, c of Eq. 13, so
        small that they shift times only (see `shape.py`).
    columns
        To be filled: time, its sd, signed angle, its sd, level; shape (5, n). The level is
        estimated anew every `LEVEL_BLOCK` half cycles.

    Returns
    -------
    count
        Half cycles measured: up to the end, or to where the lock is lost.
    residual_square, freedom
        Sum of squares about some of the fits, and its degrees of freedom.
    """
    result = np.empty(2)
    tables = np.empty((3, int(1.5 * start[3] / start[1]) + 2 * _LANES))
    values = np.ascontiguousarray(values, dtype=np.float64)
    count = _track(values, start, columns, result, np.empty((3, _BATCH)), tables)
    return count, float(result[0]), float(result[1])


@kernel
def _track(
    values: FloatArray,
    start: FloatArray,
    table: Matrix,
    result: FloatArray,
    found: Matrix,
    tables: Matrix,
) -> int:
    """Do what `track` does; the loop ends if the half period outgrows its `tables`."""
    start_s, interval_s, centre_s, half_period_s = start[0], start[1], start[2], start[3]
    side, level, noise, rates = start[4], start[5], start[6], start[7:10]
    end, count, residual, freedom = table.shape[1], 0, 0.0, 0.0
    period, locked = half_period_s, True
    while locked and count < end:
        w = math.pi / half_period_s
        reach = int(0.5 * (half_period_s / interval_s - 1.0))
        number = 2 * reach + 1
        if _length(reach) > tables.shape[1]:
            break
        flat, even, odd = _fill_tables(reach, w * interval_s, tables)
        sd, late_sd = noise / math.sqrt(even), noise / (math.sqrt(odd) * w)
        second, in_time = noise * noise / odd, 1.0 / w
        score, block = 0.0, count
        while locked and count < end and count - block < LEVEL_BLOCK:
            at = (centre_s - start_s) / interval_s
            size = _fit_batch(
                values,
                at,
                period / interval_s,
                reach,
                w * interval_s,
                tables,
                level,
                min(_BATCH, end - count),
                found,
            )
            if size > 0 and count % _SAMPLED == 0:
                lo = math.floor(at + 0.5) - reach
                residual += _squares(values[lo : lo + number], level)
                # About the reading, where cosine and sine are orthogonal: turned back.
                back = (math.floor(at + 0.5) - at) * w * interval_s
                about = found[0, 0] * math.cos(back) + found[1, 0] * math.sin(back)
                aside = found[1, 0] * math.cos(back) - found[0, 0] * math.sin(back)
                residual -= about * about * even + aside * aside * odd
                freedom += number - 2
            total, measured = 0.0, 0
            for j in range(size):
                a, b = side * found[0, j], side * found[1, j]
                inverse = 1.0 / max(a, 1e-300)
                late = b * inverse
                if not (a > _CLEAR * sd and abs(late) < _LOST):
                    break
                shift = (rates[0] * a + 0.75 * rates[1] + rates[2] * inverse) * in_time
                table[0, count] = centre_s + j * period + (late - shift) * in_time
                table[1, count] = late_sd * inverse
                table[2, count] = side * (a + 0.5 * (b * late - second * inverse))
                score += found[2, j]
                total += late
                count += 1
                measured += 1
                side = -side
            locked = measured == _BATCH
            if measured > 0:
                late = total / measured
                centre_s += measured * period + _FOLLOW * late / w
                period += _LEARN * late / (w * _BATCH)
        if count > block:
            shift = score / ((count - block) * (number - flat * flat / even))
            level += shift
            for k in range(block, count):
                table[2, k] -= flat / even * shift
                table[3, k] = sd
                table[4, k] = level
        half_period_s = period
    result[0], result[1] = residual, freedom
    return count
