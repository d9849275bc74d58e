"""Loops over the readings of plain records; `plain.py` calls them. See `kernels.py`."""

from __future__ import annotations

import math
from typing import Any

from numba import njit

from pendpipe.analysis.turning_points.kernels import kernel
from pendpipe.arrays import FloatArray

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
