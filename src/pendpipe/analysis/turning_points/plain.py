"""The loops of `plain_loops.py` and `tracking.py` as functions of arrays, kept as machine code."""

from __future__ import annotations

import math

import numpy as np

from pendpipe.analysis.turning_points.compiled import entries, numbers
from pendpipe.analysis.turning_points.shape import LANES
from pendpipe.arrays import FloatArray


def fourth_square(values: FloatArray) -> float:
    """Sum of the squares of the fourth differences."""
    result = np.empty(1)
    entries()["fourth_square"](numbers(values), len(values), result)
    return float(result[0])


def block_squares(values: FloatArray, blocks: int, length: int) -> FloatArray:
    """Mean squares of the fourth differences of evenly spread blocks, in ascending order."""
    squares = np.empty(blocks)
    entries()["block_squares"](numbers(values), len(values), length, squares, blocks)
    squares.sort()
    return squares


def extent(values: FloatArray) -> tuple[bool, float, float]:
    """Say whether all are finite, and return the least and the greatest of those that are."""
    if len(values):
        # Where all are finite, numpy's own are the quicker, and tell a nan as well.
        low, high = float(values.min()), float(values.max())
        if math.isfinite(high - low):
            return True, low, high
    result = np.empty(2)
    finite = entries()["extent"](numbers(values), len(values), result)
    return finite == 1, float(result[0]), float(result[1])


def stays(values: FloatArray, extreme: float) -> tuple[int, int]:
    """Count the readings at an extreme, and the runs that they come in."""
    result = np.empty(2)
    entries()["stays"](numbers(values), len(values), extreme, result)
    return int(result[0]), int(result[1])


def half_cycle_scatter(
    middles: FloatArray, time_s: FloatArray, residual: FloatArray
) -> tuple[float, int]:
    """Return the mean square of the half cycles' residual amplitudes, in units of the noise's.

    Each is the residual's product with a parabola that vanishes at the `middles` between
    turning points (a half wave, near enough), over the root of the parabola's square.

    Returns
    -------
    ratio, half_cycles
        0 half cycles if one of them has fewer than three readings.
    """
    result = np.empty(1)
    count = entries()["half_cycle_scatter"](
        numbers(middles), len(middles), numbers(time_s), numbers(residual), len(time_s), result
    )
    return float(result[0]), count


def track(
    values: FloatArray, start: FloatArray, columns: FloatArray, first: int, room: int
) -> tuple[int, float, float]:
    """Fit half cycle after half cycle of evenly spaced readings, each placed by those before it.

    Parameters
    ----------
    values
        The readings.
    start
        Time of the first reading, interval; time of turning, half period, side (+1 above the
        level) and level of the first half cycle; rms of one reading; a, b, c of Eq. 13, so
        small that they shift times only (see `shape.py`).
    columns
        To be filled from column `first` on, `room` columns at most: time, its sd, signed
        angle, its sd, level; shape (5, n). The level is estimated anew every
        `shape.LEVEL_BLOCK` half cycles.

    Returns
    -------
    count
        Half cycles measured: up to the end, or to where the lock is lost.
    residual_square, freedom
        Sum of squares about some of the fits, and its degrees of freedom.
    """
    assert columns.shape[0] == 5
    assert first + room <= columns.shape[1]
    result = np.empty(2)
    work = np.empty(24 + 3 * (int(1.5 * start[3] / start[1]) + 2 * LANES))
    count = entries()["track"](
        numbers(values), len(values), numbers(start), columns, columns.shape[1], first, room,
        result, work, len(work),
    )  # fmt: skip
    return count, float(result[0]), float(result[1])
