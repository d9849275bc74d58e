"""Loops over readings and extremes: find them, count them, smooth their times."""

from __future__ import annotations

import numpy as np
from numba import njit

from pendpipe.arrays import FloatArray, IntArray


@njit(cache=True)
def extremes(values: FloatArray, stride: int, start: float, least: float) -> tuple[IntArray, int]:
    """Find alternating extremes: each is followed by a return of at least a threshold.

    Parameters
    ----------
    values, stride
        Readings, of which every `stride`-th is looked at; nothing need be known of level
        or period.
    start
        The first threshold; later it is a quarter of the median of the last five swings.
    least
        Threshold that is never undercut (a multiple of the noise).

    Returns
    -------
    index, first
        Positions of the extremes; `first` is +1 if the first one is a maximum.
    """
    found = np.empty(len(values) // (2 * stride) + 2, dtype=np.int64)
    swings = np.full(5, np.nan)
    count, direction, first = 0, 0, 0
    threshold = max(start, least)
    high, low = 0, 0
    top, bottom = -np.inf, np.inf
    for i in range(stride, len(values) - stride, stride):
        # The median of three: a glitch of one sample is no extreme.
        p, q, r = values[i - stride], values[i], values[i + stride]
        x = max(min(p, q), min(max(p, q), r))
        if x > top:
            high, top = i, x
        if x < bottom:
            low, bottom = i, x
        if direction >= 0 and top - x > threshold:
            extreme, turned = high, -1
        elif direction <= 0 and x - bottom > threshold:
            extreme, turned = low, 1
        else:
            continue
        if direction == 0:
            first = -turned
        else:
            swings[count % 5] = abs(values[extreme] - values[found[count - 1]])
            known = swings[~np.isnan(swings)]
            threshold = max(least, 0.25 * np.median(known))
        found[count] = extreme
        count += 1
        direction, high, low, top, bottom = turned, i, i, x, x
    return found[:count].copy(), first


@njit(cache=True)
def solve_in_place(matrix: FloatArray, right: FloatArray) -> None:
    """Solve a small positive definite system; `right` becomes the solution.

    numba's own ``linalg`` would import scipy, which costs more than all of this.
    """
    size = len(right)
    for p in range(size):
        for q in range(p + 1, size):
            factor = matrix[q, p] / matrix[p, p]
            for r in range(p, size):
                matrix[q, r] -= factor * matrix[p, r]
            right[q] -= factor * right[p]
    for p in range(size - 1, -1, -1):
        for q in range(p + 1, size):
            right[p] -= matrix[p, q] * right[q]
        right[p] /= matrix[p, p]


@njit(cache=True)
def smooth_times(
    number: FloatArray, time_s: FloatArray, weight: FloatArray, wanted: float, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Smooth the times of turning points over as many neighbours as it takes.

    A weighted local parabola in the number of the half cycle; the window grows until the
    weights sum to `wanted` (the inverse variance that is good enough), between 2 and 40
    neighbours to each side.

    Returns
    -------
    centre_s, half_period_s
        Smoothed time and slope at each number in `at`.
    """
    centre = np.empty(len(at))
    slope = np.empty(len(at))
    last = len(number) - 1
    for k in range(len(at)):
        middle = np.searchsorted(number, at[k])
        lo, hi = max(middle - 2, 0), min(middle + 2, last)
        lo, hi = max(min(lo, hi - 3), 0), min(max(hi, lo + 3), last)
        total = weight[lo : hi + 1].sum()
        while total < wanted and hi - lo < 80 and (lo > 0 or hi < last):
            if lo > 0:
                lo -= 1
                total += weight[lo]
            if hi < last:
                hi += 1
                total += weight[hi]
        degree = 2 if hi - lo >= 4 else 1
        normal = np.zeros((degree + 1, degree + 1))
        right = np.zeros(degree + 1)
        power = np.ones(degree + 1)
        for j in range(lo, hi + 1):
            u = number[j] - at[k]
            for p in range(1, degree + 1):
                power[p] = power[p - 1] * u
            for p in range(degree + 1):
                right[p] += weight[j] * power[p] * (time_s[j] - time_s[lo])
                for q in range(degree + 1):
                    normal[p, q] += weight[j] * power[p] * power[q]
        solve_in_place(normal, right)
        centre[k] = time_s[lo] + right[0]
        slope[k] = right[1]
    return centre, slope


@njit(cache=True)
def count_half_cycles(
    time_s: FloatArray, sign: IntArray, gap_before: IntArray
) -> tuple[IntArray, int]:
    """Number the extremes, counting those that a gap in the data has swallowed.

    Parameters
    ----------
    time_s, sign
        Of each extreme; `sign` is +1 for a maximum.
    gap_before
        1 where samples are missing between an extreme and the one before it.

    Returns
    -------
    number, good
        Number of each half cycle from 0; and how many extremes from the start hang
        together (an interval of three half cycles without a gap ends the motion).
    """
    number = np.zeros(len(time_s), dtype=np.int64)
    if len(time_s) < 2:
        return number, len(time_s)
    period = np.median(np.diff(time_s[: min(6, len(time_s))]))
    for k in range(1, len(time_s)):
        interval = time_s[k] - time_s[k - 1]
        odd = sign[k] != sign[k - 1]
        whole = round(interval / period)
        if (whole % 2 == 1) != odd:
            whole += 1 if interval / period > whole else -1
        whole = max(whole, 1 if odd else 2)
        if whole > 2 and gap_before[k] == 0:
            return number, k
        number[k] = number[k - 1] + whole
        if whole == 1:
            period += 0.3 * (interval - period)
    return number, len(time_s)
