"""Loops over readings and extremes: find them, count them, smooth their times.

Compiled to be kept (`compiled.py` calls them): they allocate nothing, but fill what they
are given, and raise nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.views import matrix

_F = TypeVar("_F", bound=Callable[..., Any])


def kernel(function: _F, *, fastmath: bool = False) -> _F:
    """Compile a function that neither allocates nor raises."""
    options: dict[str, Any] = {"_nrt": False, "error_model": "numpy", "fastmath": fastmath}
    return njit(**options)(function)  # type: ignore[no-any-return]


@kernel
def extremes(
    values: FloatArray, stride: int, start: float, least: float, found: IntArray, work: FloatArray
) -> int:
    """Find alternating extremes: each is followed by a return of at least a threshold.

    Parameters
    ----------
    values, stride, start, least
        See `compiled.extremes`.
    found
        To be filled: positions of the extremes.
    work
        Room for 10 numbers.

    Returns
    -------
    int
        How many were found; negative if the first one is a minimum.
    """
    swings, ordered = work[:5], work[5:10]
    swings[:] = np.inf
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
            threshold = max(least, 0.25 * _median(swings, ordered, min(count, 5)))
        found[count] = extreme
        count += 1
        direction, high, low, top, bottom = turned, i, i, x, x
    return first * count


@kernel
def _median(values: FloatArray, ordered: FloatArray, known: int) -> float:
    """Median of five values of which only `known` are finite; `ordered` is room for them."""
    for i in range(5):
        j = i
        while j > 0 and ordered[j - 1] > values[i]:
            ordered[j] = ordered[j - 1]
            j -= 1
        ordered[j] = values[i]
    lower, upper = ordered[(known - 1) // 2], ordered[known // 2]
    return float(0.5 * (lower + upper))


@kernel
def solve_in_place(matrix: FloatArray, right: FloatArray) -> None:
    """Solve a small positive definite system; `right` becomes the solution."""
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


@kernel
def smooth_times(
    number: FloatArray, time_s: FloatArray, weight: FloatArray, wanted: float, at: FloatArray,
    centre: FloatArray, slope: FloatArray, work: FloatArray,
) -> None:  # fmt: skip
    """Smooth the times of turning points over as many neighbours as it takes.

    Parameters
    ----------
    number, time_s, weight, wanted, at
        See `compiled.smooth_times`.
    centre, slope
        To be filled: smoothed time and slope at each number in `at`.
    work
        Room for 15 numbers.
    """
    last = len(number) - 1
    middle = 0
    for k in range(len(at)):
        while middle > 0 and number[middle - 1] >= at[k]:
            middle -= 1
        while middle <= last and number[middle] < at[k]:
            middle += 1
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
        size = 3 if hi - lo >= 4 else 2
        normal, right, power = matrix(work, size, size), work[9 : 9 + size], work[12 : 12 + size]
        normal[:, :] = 0.0
        right[:] = 0.0
        power[0] = 1.0
        for j in range(lo, hi + 1):
            u = number[j] - at[k]
            for p in range(1, size):
                power[p] = power[p - 1] * u
            for p in range(size):
                right[p] += weight[j] * power[p] * (time_s[j] - time_s[lo])
                for q in range(size):
                    normal[p, q] += weight[j] * power[p] * power[q]
        solve_in_place(normal, right)
        centre[k] = time_s[lo] + right[0]
        slope[k] = right[1]


@kernel
def count_half_cycles(
    time_s: FloatArray, sign: IntArray, gap_before: IntArray, period: float, number: IntArray
) -> int:
    """Number the extremes, counting those that a gap in the data has swallowed.

    Parameters
    ----------
    time_s, sign, gap_before
        See `compiled.count_half_cycles`.
    period
        Half period at first.
    number
        To be filled: the number of each half cycle from 0.

    Returns
    -------
    int
        How many extremes from the start hang together.
    """
    number[0] = 0
    for k in range(1, len(time_s)):
        interval = time_s[k] - time_s[k - 1]
        odd = sign[k] != sign[k - 1]
        whole = round(interval / period)
        if (whole % 2 == 1) != odd:
            whole += 1 if interval / period > whole else -1
        whole = max(whole, 1 if odd else 2)
        if whole > 2 and gap_before[k] == 0:
            return k
        number[k] = number[k - 1] + whole
        if whole == 1:
            period += 0.3 * (interval - period)
    return len(time_s)
