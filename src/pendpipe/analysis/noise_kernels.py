"""The loops of `noise.py`."""

from __future__ import annotations

import numpy as np
from numba import njit

from pendpipe.arrays import FloatArray


@njit(cache=True, fastmath={"contract", "reassoc"}, nogil=True)
def fourth_square(values: FloatArray) -> float:
    """Sum of the squares of the fourth differences."""
    total = 0.0
    for i in range(len(values) - 4):
        difference = (
            values[i] + values[i + 4] - 4.0 * (values[i + 1] + values[i + 3]) + 6.0 * values[i + 2]
        )
        total += difference * difference
    return total


@njit(cache=True, nogil=True)
def block_squares(values: FloatArray, blocks: int, length: int) -> FloatArray:
    """Mean squares of the fourth differences of evenly spread blocks, in ascending order."""
    squares = np.empty(blocks)
    for k in range(blocks):
        start = (len(values) - length) * k // max(blocks - 1, 1)
        squares[k] = fourth_square(values[start : start + length]) / (length - 4)
    squares.sort()
    return squares


@njit(cache=True, nogil=True)
def extent(values: FloatArray) -> tuple[bool, float, float]:
    """Say whether all are finite, and return the least and the greatest of those that are."""
    finite, low, high = True, np.inf, -np.inf
    for i in range(len(values)):
        value = values[i]
        # Neither holds for a nan.
        if -np.inf < value < np.inf:
            low, high = min(low, value), max(high, value)
        else:
            finite = False
    return finite, low, high


@njit(cache=True, nogil=True)
def stays(values: FloatArray, extreme: float) -> tuple[int, int]:
    """Count the readings at an extreme, and the runs that they come in."""
    count, runs, before = 0, 0, False
    for i in range(len(values)):
        at = values[i] == extreme
        count += at
        runs += at and not before
        before = at
    return count, runs
