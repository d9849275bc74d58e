"""The loops of `noise.py`."""

from __future__ import annotations

import numpy as np
from numba import njit

from pendpipe.arrays import FloatArray, IntArray


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
def block_squares(values: FloatArray, starts: IntArray, length: int) -> FloatArray:
    """Mean squares of the fourth differences of blocks, shape (blocks,), in ascending order."""
    squares = np.empty(len(starts))
    for k in range(len(starts)):
        squares[k] = fourth_square(values[starts[k] : starts[k] + length]) / (length - 4)
    squares.sort()
    return squares
