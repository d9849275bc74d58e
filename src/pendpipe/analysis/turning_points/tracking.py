"""One pass over a very long, evenly sampled record: a phase-locked loop of least squares.

Every half cycle is fitted with a cosine and a sine about its expected turning. Their
values at whole numbers of readings from there are tabulated, and turned by the fraction
that remains, cos(p + q) = cos p cos q - sin p sin q, so that a reading costs three
multiplications.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pendpipe.arrays import FloatArray

LEVEL_BLOCK = 256
"""Half cycles over which level and period are one number each."""
_FOLLOW, _LEARN = 0.2, 0.02
"""Share of a phase error that moves the next half cycle, and that changes the period."""
_LOST = 0.3
"""Phase error in rad at which the lock counts as lost."""
_CLEAR = 8.0
"""Standard deviations by which an amplitude must stand out for its phase to be used."""
_SAMPLED = 16
"""Every how many-th half cycle tells the noise."""


@njit(cache=True, fastmath=True, nogil=True)
def _products(
    piece: FloatArray, cosine: FloatArray, sine: FloatArray, level: float
) -> tuple[float, float, float]:
    """Sums of readings less level: alone, times cosine, times sine."""
    alone, even, odd = 0.0, 0.0, 0.0
    for i in range(len(piece)):
        x = piece[i] - level
        alone += x
        even += x * cosine[i]
        odd += x * sine[i]
    return alone, even, odd


@njit(cache=True, fastmath=True, nogil=True)
def _squares(piece: FloatArray, level: float) -> float:
    """Sum of the squares of readings less level."""
    total = 0.0
    for i in range(len(piece)):
        total += (piece[i] - level) ** 2
    return total


@njit(cache=True)
def _running(column: FloatArray) -> FloatArray:
    """Running sum, from zero."""
    total = np.zeros(len(column) + 1)
    for i in range(len(column)):
        total[i + 1] = total[i] + column[i]
    return total


@njit(cache=True, nogil=True)
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
    period = half_period_s
    while count < room:
        # The tables of one block of half cycles.
        w = math.pi / half_period_s
        reach = int(0.5 * half_period_s / interval_s) + 3
        phases = (np.arange(2 * reach + 1) - reach) * (w * interval_s)
        cosines, sines = np.cos(phases), np.sin(phases)
        sum_c, sum_s = _running(cosines), _running(sines)
        sum_cc, sum_cs = _running(cosines * cosines), _running(cosines * sines)
        information, score, coupling, block = 0.0, 0.0, 0.0, count
        while count < room and count - block < LEVEL_BLOCK:
            lo = math.ceil((centre_s - 0.5 * half_period_s - start_s) / interval_s)
            hi = math.ceil((centre_s + 0.5 * half_period_s - start_s) / interval_s)
            middle = round((centre_s - start_s) / interval_s)
            if lo < 0 or hi > len(values):
                break
            p, q = lo - middle + reach, hi - middle + reach
            piece = values[lo:hi]
            alone, even, odd = _products(piece, cosines[p:q], sines[p:q], level)
            rest = w * (start_s + middle * interval_s - centre_s)
            co, si = math.cos(rest), math.sin(rest)
            n = hi - lo
            c_, s_ = sum_c[q] - sum_c[p], sum_s[q] - sum_s[p]
            cc, cs = sum_cc[q] - sum_cc[p], sum_cs[q] - sum_cs[p]
            ss = n - cc
            f1, s1 = co * c_ - si * s_, si * c_ + co * s_
            ff = co * co * cc - 2.0 * co * si * cs + si * si * ss
            fs = co * si * (cc - ss) + (co * co - si * si) * cs
            ss = n - ff
            xf, xs = co * even - si * odd, si * even + co * odd
            determinant = ff * ss - fs * fs
            a = side * (xf * ss - xs * fs) / determinant
            b = side * (xs * ff - xf * fs) / determinant
            sd = noise * math.sqrt(ss / determinant)
            late = b / a
            if not (a > _CLEAR * sd and abs(late) < _LOST):
                break
            shift = (rates[0] * a + 0.75 * rates[1] + rates[2] / a) / w
            columns[0, count] = centre_s + (late - shift) / w
            columns[1, count] = noise * math.sqrt(ff / determinant) / (a * w)
            columns[2, count] = side * (a + 0.5 * b * late - 0.5 * noise * noise / (ss * a))
            columns[3, count] = sd
            columns[4, count] = level
            coupling = (f1 * ss - s1 * fs) / determinant
            information += n - f1 * coupling - s1 * (s1 * ff - f1 * fs) / determinant
            score += alone - side * (a * f1 + b * s1)
            if count % _SAMPLED == 0:
                residual += _squares(piece, level) - side * (a * xf + b * xs)
                freedom += n - 2
            count += 1
            centre_s += period + _FOLLOW * late / w
            period += _LEARN * late / w
            side = -side
        if count == block:
            break
        shift = score / information
        level += shift
        for k in range(block, count):
            columns[2, k] -= coupling * shift
            columns[4, k] += shift
        if count - block < LEVEL_BLOCK:
            break
        half_period_s = period
    return count, residual, freedom
