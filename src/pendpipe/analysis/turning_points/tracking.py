"""One pass over a very long, evenly sampled record: a phase-locked loop of least squares.

Every half cycle is fitted with a cosine and a sine over an odd number of readings about the
one nearest to its expected turning. There the two are orthogonal, so that the fit is two
products with tables made once a block; the fraction of a reading between that one and the
turning is made up for by turning the result, cos(p + q) = cos p cos q - sin p sin q.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from pendpipe.arrays import FloatArray

LEVEL_BLOCK = 256
"""Half cycles over which level and period are one number each."""
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
_LANES = 16
"""The tables are filled up with zeros to a multiple of this: the compiler's loop has no rest."""


# No reference counts: two threads that count on one array wait for each other.
_TIGHT: dict[str, Any] = {
    "cache": True, "nogil": True, "_nrt": False, "fastmath": True, "error_model": "numpy",
}  # fmt: skip


@njit(**_TIGHT)
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


@njit(**_TIGHT)
def _squares(piece: FloatArray, level: float) -> float:
    """Sum of the squares of readings less level."""
    total = 0.0
    for i in range(piece.size):
        total += (piece[i] - level) ** 2
    return total


@njit(**_TIGHT)
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


@njit(cache=True, nogil=True)
def _tables(reach: int, step: float) -> tuple[FloatArray, float, float, float]:
    """Weights of the readings from -reach to reach about a turning, `step` of phase apart.

    Returns
    -------
    tables
        For the cosine's factor, the sine's, and the sum of what they leave.
    flat, even, odd
        Sums of the cosine, its square, and the sine's square.
    """
    number = 2 * reach + 1
    tables = np.zeros((3, -(-number // _LANES) * _LANES))
    phase = (np.arange(number) - reach) * step
    cosine, sine = np.cos(phase), np.sin(phase)
    flat, even, odd = np.sum(cosine), np.sum(cosine * cosine), np.sum(sine * sine)
    tables[0, :number] = cosine / even
    tables[1, :number] = sine / odd
    tables[2, :number] = 1.0 - cosine * (flat / even)
    return tables, flat, even, odd


@njit(cache=True, nogil=True, error_model="numpy")
def track(
    values: FloatArray,
    start_s: float,
    interval_s: float,
    centre_s: float,
    half_period_s: float,
    side: float,
    level: float,
    rates: FloatArray,
    noise: float,
    columns: FloatArray,
) -> tuple[int, float, float]:
    """Fit half cycle after half cycle, each placed by those before it.

    Parameters
    ----------
    values, start_s, interval_s
        Readings, evenly spaced.
    centre_s, half_period_s, side
        The first half cycle: time of its turning, half period, +1 above the level.
    level
        Where the level is at first; it is estimated anew every `LEVEL_BLOCK` half cycles.
    rates
        a, b, c of Eq. 13, so small that they shift times only (see `shape.py`).
    noise
        Rms of one reading.
    columns
        To be filled: time, its sd, signed angle, its sd, level; shape (5, room).

    Returns
    -------
    count
        Half cycles measured: up to the end, or to where the lock is lost.
    residual_square, freedom
        Sum of squares about some of the fits, and its degrees of freedom.
    """
    room, count, residual, freedom = columns.shape[1], 0, 0.0, 0.0
    period, locked = half_period_s, True
    batch = np.empty((3, _BATCH))
    while locked and count < room:
        w = math.pi / half_period_s
        reach = int(0.5 * (half_period_s / interval_s - 1.0))
        number = 2 * reach + 1
        tables, flat, even, odd = _tables(reach, w * interval_s)
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
                residual -= found[0, 0] ** 2 * even + found[1, 0] ** 2 * odd
                freedom += number - 2
            total, measured = 0.0, 0
            for j in range(size):
                a, b = side * found[0, j], side * found[1, j]
                inverse = 1.0 / max(a, 1e-300)
                late = b * inverse
                if not (a > _CLEAR * sd and abs(late) < _LOST):
                    break
                shift = (rates[0] * a + 0.75 * rates[1] + rates[2] * inverse) * in_time
                columns[0, count] = centre_s + j * period + (late - shift) * in_time
                columns[1, count] = late_sd * inverse
                columns[2, count] = side * (a + 0.5 * (b * late - second * inverse))
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
                columns[2, k] -= flat / even * shift
                columns[3, k] = sd
                columns[4, k] = level
        half_period_s = period
    return count, residual, freedom
