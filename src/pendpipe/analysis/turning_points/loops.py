"""Loops over readings and extremes: find them, count them, smooth their times."""

from __future__ import annotations

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.kernel import Matrix, kernel


def find_extremes(
    values: FloatArray, least: float, *, start: float | None = None, stride: int = 1
) -> tuple[IntArray, int]:
    """Find alternating extremes: each is followed by a return of more than a threshold.

    Nothing need be known of level or period.

    Parameters
    ----------
    values
        Readings, shape (n,).
    least
        The threshold. The first reading can be an extreme; and how far the motion went after
        the last one is an extreme too, though no return follows.
    start
        Where given, this is the first threshold, later it is a quarter of the median of the last
        five swings, and `least` (a multiple of the noise) is never undercut. Single wild
        readings are then no extremes, and each needs a return.
    stride
        Every how many-th reading is looked at.

    Returns
    -------
    index, first
        Positions of the extremes; `first` is +1 if the first one is a maximum.
    """
    found = np.empty(len(values) // stride + 2, dtype=np.int64)
    fixed = start is None
    first = least if start is None else start
    values = np.ascontiguousarray(values, dtype=np.float64)
    count = _find_extremes(values, stride, first, least, fixed, found, np.empty(5), np.empty(5))
    return found[: abs(count)].copy(), (count > 0) - (count < 0)


@kernel
def _find_extremes(
    values: FloatArray,
    stride: int,
    start: float,
    least: float,
    fixed: int,
    found: IntArray,
    swings: FloatArray,
    ordered: FloatArray,
) -> int:
    """Fill `found`; return how many there are, negative if the first one is a minimum."""
    swings[:] = np.inf
    count, direction, first = 0, 0, 0
    threshold = max(start, least)
    edge = 0 if fixed else stride
    high, low = edge, edge
    top, bottom = -np.inf, np.inf
    for i in range(edge, values.size - edge, stride):
        x = values[i]
        if not fixed:
            # The median of three: a glitch of one sample is no extreme.
            p, r = values[i - stride], values[i + stride]
            x = max(min(p, x), min(max(p, x), r))
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
        elif not fixed:
            swings[count % 5] = abs(values[extreme] - values[found[count - 1]])
            threshold = max(least, 0.25 * _median(swings, ordered, min(count, 5)))
        found[count] = extreme
        count += 1
        direction, high, low, top, bottom = turned, i, i, x, x
    if fixed and direction != 0:
        found[count] = high if direction > 0 else low
        count += 1
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
    middle: float = 0.5 * (ordered[(known - 1) // 2] + ordered[known // 2])
    return middle


@kernel
def solve_in_place(matrix: Matrix, right: FloatArray, size: int) -> None:
    """Solve a small positive definite system; `right` becomes the solution."""
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


def smooth_times(
    number: IntArray, time_s: FloatArray, weight: FloatArray, wanted: float, at: IntArray
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
    centre, slope = np.empty(len(at)), np.empty(len(at))
    room = np.empty((3, 3)), np.empty(3), np.empty(3)
    _smooth_times(number, time_s, weight, wanted, at, centre, slope, *room)
    return centre, slope


@kernel
def _smooth_times(
    number: IntArray,
    time_s: FloatArray,
    weight: FloatArray,
    wanted: float,
    at: IntArray,
    centre: FloatArray,
    slope: FloatArray,
    normal: Matrix,
    right: FloatArray,
    power: FloatArray,
) -> None:
    """Fill `centre` and `slope`; the last three are room to work in."""
    last = number.size - 1
    middle = 0
    for k in range(at.size):
        while middle > 0 and number[middle - 1] >= at[k]:
            middle -= 1
        while middle <= last and number[middle] < at[k]:
            middle += 1
        lo, hi = max(middle - 2, 0), min(middle + 2, last)
        lo, hi = max(min(lo, hi - 3), 0), min(max(hi, lo + 3), last)
        total = 0.0
        for j in range(lo, hi + 1):
            total += weight[j]
        while total < wanted and hi - lo < 80 and (lo > 0 or hi < last):
            if lo > 0:
                lo -= 1
                total += weight[lo]
            if hi < last:
                hi += 1
                total += weight[hi]
        size = 3 if hi - lo >= 4 else 2
        normal[:, :] = 0.0
        right[:] = 0.0
        power[0] = 1.0
        for j in range(lo, hi + 1):
            u = float(number[j] - at[k])
            for p in range(1, size):
                power[p] = power[p - 1] * u
            for p in range(size):
                right[p] += weight[j] * power[p] * (time_s[j] - time_s[lo])
                for q in range(size):
                    normal[p, q] += weight[j] * power[p] * power[q]
        solve_in_place(normal, right, size)
        centre[k] = time_s[lo] + right[0]
        slope[k] = right[1]


@kernel
def count_half_cycles(
    time_s: FloatArray, sign: IntArray, gap_before: IntArray, period: float, number: IntArray
) -> int:
    """Number the extremes, counting those that a gap in the data has swallowed.

    Parameters
    ----------
    time_s, sign
        Of each extreme; `sign` is +1 for a maximum.
    gap_before
        1 where samples are missing between an extreme and the one before it.
    period
        Half period at first.
    number
        To be filled: the number of each half cycle from 0.

    Returns
    -------
    int
        How many extremes from the start hang together (an interval of three half cycles
        without a gap ends the motion).
    """
    number[0] = 0
    for k in range(1, time_s.size):
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
    return time_s.size
