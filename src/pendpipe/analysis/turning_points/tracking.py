"""One pass over a very long, evenly sampled record: a phase-locked loop of least squares.

Every half cycle is fitted with a cosine and a sine over an odd number of readings about the
one nearest to its expected turning. There the two are orthogonal, so that the fit is two
products with tables made once a block; the fraction of a reading between that one and the
turning is made up for by turning the result, cos(p + q) = cos p cos q - sin p sin q.
"""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from pendpipe.analysis.turning_points.shape import LANES, LEVEL_BLOCK
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.views import matrix

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
_KEPT: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}


@njit(**_KEPT, fastmath=True)
def _products(piece: FloatArray, tables: FloatArray, level: float) -> tuple[float, float, float]:
    """Sums of readings less level times each of the tables."""
    even, odd, rest = 0.0, 0.0, 0.0
    cosine, sine, rests = tables[0], tables[1], tables[2]
    for i in range(piece.size):
        x = piece[i] - level
        even += x * cosine[i]
        odd += x * sine[i]
        rest += x * rests[i]
    return even, odd, rest


@njit(**_KEPT, fastmath=True)
def _squares(piece: FloatArray, level: float) -> float:
    """Sum of the squares of readings less level."""
    total = 0.0
    for i in range(piece.size):
        total += (piece[i] - level) ** 2
    return total


@njit(**_KEPT, fastmath=True)
def _fit_batch(
    values: FloatArray, first: float, period: float, reach: int, step: float,
    tables: FloatArray, level: float, found: FloatArray,
) -> int:  # fmt: skip
    """Fit the half cycles expected at the readings `first`, `first` + `period`, ...

    Fills `found` with factors of cosine and sine about the expected turning, and the sum of
    what they leave, a column each; returns how many lie among the readings.
    """
    number, length = 2 * reach + 1, tables.shape[1]
    for j in range(found.shape[1]):
        at = first + j * period
        middle = math.floor(at + 0.5)
        lo = middle - reach
        if lo < 0 or lo + number > values.size:
            return j
        if lo + length <= values.size:
            even, odd, rest = _products(values[lo : lo + length], tables, level)
        else:
            even, odd, rest = _products(values[lo : lo + number], tables[:, :number], level)
        phase = (middle - at) * step
        square = phase * phase
        cosine = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square * (1.0 / 720.0)))
        sine = phase * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square / 5040.0)))
        found[0, j] = even * cosine - odd * sine
        found[1, j] = even * sine + odd * cosine
        found[2, j] = rest
    return int(found.shape[1])


@njit(**_KEPT)
def _fill_tables(reach: int, step: float, tables: FloatArray) -> tuple[float, float, float]:
    """Write the weights of the readings from -reach to reach about a turning, `step` apart.

    Rows of `tables`: for the cosine's factor, the sine's, and the sum of what they leave.

    Returns
    -------
    flat, even, odd
        Sums of the cosine, its square, and the sine's square.
    """
    number = 2 * reach + 1
    flat, even, odd = 0.0, 0.0, 0.0
    for i in range(tables.shape[1]):
        cosine = math.cos((i - reach) * step) if i < number else 0.0
        sine = math.sin((i - reach) * step) if i < number else 0.0
        tables[0, i], tables[1, i] = cosine, sine
        flat, even, odd = flat + cosine, even + cosine * cosine, odd + sine * sine
    for i in range(tables.shape[1]):
        cosine = tables[0, i]
        tables[2, i] = 1.0 - cosine * (flat / even) if i < number else 0.0
        tables[0, i] = cosine / even
        tables[1, i] /= odd
    return flat, even, odd


@njit(**_KEPT)
def track(
    values: FloatArray, start: FloatArray, columns: FloatArray, first: int, room: int,
    result: FloatArray, work: FloatArray,
) -> int:  # fmt: skip
    """Fit half cycle after half cycle, each placed by those before it.

    Parameters
    ----------
    values
        Readings, evenly spaced.
    start
        See `plain.track`: the time of the first reading and the interval; time of turning,
        half period, side and level of the first half cycle; the noise; a, b, c.
    columns
        To be filled from column `first` on, `room` columns at most: time, its sd, signed
        angle, its sd, level.
    result
        To be filled: sum of squares about some of the fits, and its degrees of freedom.
    work
        Room for the tables and a batch; the loop ends if the half period outgrows it.

    Returns
    -------
    int
        Half cycles measured: up to the end, or to where the lock is lost.
    """
    start_s, interval_s, centre_s, half_period_s = start[0], start[1], start[2], start[3]
    side, level, noise, rates = start[4], start[5], start[6], start[7:10]
    table = columns[:, first : first + room]
    count, residual, freedom = 0, 0.0, 0.0
    period, locked = half_period_s, True
    batch, rest = matrix(work, 3, _BATCH), work[3 * _BATCH :]
    while locked and count < room:
        w = math.pi / half_period_s
        reach = int(0.5 * (half_period_s / interval_s - 1.0))
        number = 2 * reach + 1
        length = (number + LANES - 1) // LANES * LANES
        if 3 * length > rest.size:
            break
        tables = matrix(rest, 3, length)
        flat, even, odd = _fill_tables(reach, w * interval_s, tables)
        sd, late_sd = noise / math.sqrt(even), noise / (math.sqrt(odd) * w)
        second, in_time = noise * noise / odd, 1.0 / w
        score, block = 0.0, count
        while locked and count < room and count - block < LEVEL_BLOCK:
            found = batch[:, : min(_BATCH, room - count)]
            at = (centre_s - start_s) / interval_s
            size = _fit_batch(
                values, at, period / interval_s, reach, w * interval_s, tables, level, found
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
