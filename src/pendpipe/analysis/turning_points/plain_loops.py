"""Loops over the readings of plain records; `plain.py` calls them. See `kernels.py`."""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from pendpipe.analysis.turning_points.kernels import kernel, solve_in_place
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.views import matrix

_ADDER: dict[str, Any] = {
    "_nrt": False, "error_model": "numpy", "fastmath": {"contract", "reassoc"},
}  # fmt: skip


@njit(**_ADDER)
def fourth_square(values: FloatArray) -> float:
    """Sum of the squares of the fourth differences."""
    total = 0.0
    for i in range(values.size - 4):
        difference = (
            values[i] + values[i + 4] - 4.0 * (values[i + 1] + values[i + 3]) + 6.0 * values[i + 2]
        )
        total += difference * difference
    return total


@kernel
def block_squares(values: FloatArray, length: int, squares: FloatArray) -> None:
    """Write the mean squares of the fourth differences of evenly spread blocks."""
    for k in range(squares.size):
        start = (values.size - length) * k // max(squares.size - 1, 1)
        squares[k] = fourth_square(values[start : start + length]) / (length - 4)


@kernel
def extent(values: FloatArray, result: FloatArray) -> int:
    """Write the least and the greatest of the finite; return whether all are."""
    finite, low, high = 1, math.inf, -math.inf
    for i in range(values.size):
        value = values[i]
        # Neither holds for a nan.
        if -math.inf < value < math.inf:
            low, high = min(low, value), max(high, value)
        else:
            finite = 0
    result[0], result[1] = low, high
    return finite


@kernel
def stays(values: FloatArray, extreme: float, result: FloatArray) -> None:
    """Count the readings at an extreme, and the runs that they come in."""
    count, runs, before = 0, 0, False
    for i in range(values.size):
        at = values[i] == extreme
        if at:
            count += 1
            if not before:
                runs += 1
        before = at
    result[0], result[1] = count, runs


@njit(**_ADDER)
def _against_parabola(
    time_s: FloatArray, residual: FloatArray, start_s: float, stop_s: float
) -> tuple[float, float]:
    """Sums of the residual times a parabola, and of the parabola's square."""
    inverse, product, square = 1.0 / (stop_s - start_s), 0.0, 0.0
    for i in range(time_s.size):
        share = (time_s[i] - start_s) * inverse
        form = share * (1.0 - share)
        product += residual[i] * form
        square += form * form
    return product, square


@kernel
def half_cycle_scatter(
    middles: FloatArray, time_s: FloatArray, residual: FloatArray, result: FloatArray
) -> int:
    """Write the mean square of the half cycles' residual amplitudes; return how many."""
    total, first, guess = 0.0, 0, 0
    while first < time_s.size and time_s[first] < middles[0]:
        first += 1
    for k in range(middles.size - 1):
        last = min(first + guess, time_s.size)
        while last > first and not time_s[last - 1] < middles[k + 1]:
            last -= 1
        while last < time_s.size and time_s[last] < middles[k + 1]:
            last += 1
        if last < first + 3:
            return 0
        product, square = _against_parabola(
            time_s[first:last], residual[first:last], middles[k], middles[k + 1]
        )
        total += product * product / square
        first, guess = last, last - first
    result[0] = total / (middles.size - 1)
    return middles.size - 1


@kernel
def decay(
    time_s: FloatArray, y: FloatArray, sd: float, result: FloatArray, work: FloatArray
) -> None:
    """Solve Eq. 13's integral, y0 - y = a S y^2 + b S y + c t, for a, b, c >= 0 and y0.

    The integrals are trapezoids with the end correction h^2/12 f'. `work` is room for 44
    numbers.
    """
    normal, trial = matrix(work, 4, 4), matrix(work[16:], 4, 4)
    right, solution, column = work[32:36], work[36:40], work[40:44]
    work[:] = 0.0
    column[3] = 1.0
    weight = 1.0 / (sd * sd + (3e-4 * y[0]) ** 2)
    slope = (y[1] - y[0]) / (time_s[1] - time_s[0])
    for k in range(y.size):
        if k > 0:
            step = time_s[k] - time_s[k - 1]
            last = min(k + 1, y.size - 1)
            next_slope = (y[last] - y[k - 1]) / (time_s[last] - time_s[k - 1])
            squares = y[k] ** 2 + y[k - 1] ** 2
            bent = 2.0 * (y[k - 1] * slope - y[k] * next_slope)
            column[0] -= 0.5 * step * squares + step * step / 12.0 * bent
            column[1] -= 0.5 * step * (y[k] + y[k - 1]) + step * step / 12.0 * (slope - next_slope)
            column[2] -= step
            slope = next_slope
        for p in range(4):
            right[p] += weight * column[p] * y[k]
            for q in range(4):
                normal[p, q] += weight * column[p] * column[q]
    for attempt in range(4):
        # All free; without c; without a; without both.
        for p in range(4):
            solution[p] = right[p]
            for q in range(4):
                trial[p, q] = normal[p, q]
            trial[p, p] *= 1.0 + 1e-13
        for j in range(0, 3, 2):
            if (j == 0 and attempt >= 2) or (j == 2 and attempt % 2 == 1):
                for p in range(4):
                    trial[j, p], trial[p, j] = 0.0, 0.0
                trial[j, j], solution[j] = 1.0, 0.0
        solve_in_place(trial, solution)
        if solution[0] >= 0.0 and solution[1] >= 0.0 and solution[2] >= 0.0:
            break
    for p in range(4):
        result[p] = max(solution[p], 0.0)


@kernel
def excess(y: float, omega: float, rates: FloatArray) -> float:
    """Relative lengthening of a half period (`fit.period.period_excess`), half b hysteretic."""
    a, b, c = rates[0], rates[1], rates[2]
    slope = 2.0 * a * y + 0.5 * b
    friction = a * y + 0.5 * b + c / y
    total = 0.125 * b * b + 2.0 / 3.0 * b * slope + math.pi**2 / 8.0 * slope * friction
    return float(total / omega**2)


@kernel
def line(time_s: FloatArray, y: FloatArray, result: FloatArray) -> None:
    """Fit a half period and a first time, the losses in `result` allowed for.

    They go to result[4] and result[5].
    """
    a, b, c = result[0], result[1], result[2]
    omega = math.pi * (y.size - 1) / (time_s[y.size - 1] - time_s[0])
    at, before = 0.0, excess(y[0], omega, result)
    w, wn, wnn, wt, wnt = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(y.size):
        if k > 0:
            now = excess(y[k], omega, result)
            at += 1.0 + 0.5 * (now + before)
            before = now
        # What the losses shift the fitted cosine by, against the turning point.
        t = time_s[k] - time_s[0] - (a * y[k] + 0.75 * b + c / y[k]) / omega**2
        weight = y[k] * y[k]
        w, wn, wnn = w + weight, wn + weight * at, wnn + weight * at * at
        wt, wnt = wt + weight * t, wnt + weight * at * t
    half_period = (w * wnt - wn * wt) / (w * wnn - wn * wn)
    result[4], result[5] = half_period, time_s[0] + (wt - wn * half_period) / w
