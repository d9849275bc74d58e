"""Linear least squares of a few values within bounds, by active sets (Stark and Parker 1995).

scipy has it; importing its optimisers for this would take as long as a whole fit.
"""

from __future__ import annotations

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray

_SLACK = 1e-9
"""Of the gradient: what is rounding."""


def bounded_least_squares(
    matrix: FloatArray, right: FloatArray, floor: FloatArray, ceiling: FloatArray
) -> FloatArray:
    """Minimise |matrix x - right| with floor <= x <= ceiling.

    Values walk from zero (which must lie within) towards the best of those that are free;
    what meets its bound on the way is held there, and let go where that lowers the sum.

    Parameters
    ----------
    matrix, right
        Shapes (m, n) and (m,).
    floor, ceiling
        Shape (n,); infinite where there is no bound.
    """
    x = np.clip(np.zeros(len(floor)), floor, ceiling)
    held = np.zeros(len(floor), dtype=bool)
    for _ in range(10 * len(floor) + 10):
        goal = x.copy()
        rest = right - matrix[:, held] @ x[held]
        goal[~held] = np.linalg.lstsq(matrix[:, ~held], rest, rcond=1e-11)[0]
        met, share = _first_met(x, goal, floor, ceiling, ~held)
        x = np.clip(x + share * (goal - x), floor, ceiling)
        if met is not None:
            x[met] = floor[met] if goal[met] < x[met] else ceiling[met]
            held[met] = True
            continue
        pull = matrix.T @ (right - matrix @ x)
        inwards = np.where(x <= floor, pull, -pull) * held
        freed = int(np.argmax(inwards))
        if inwards[freed] <= _SLACK * (1.0 + float(np.abs(right).max())):
            break
        held[freed] = False
    return x


def _first_met(
    x: FloatArray, goal: FloatArray, floor: FloatArray, ceiling: FloatArray, free: BoolArray
) -> tuple[int | None, float]:
    """The first free value that meets its bound on the way, and after what part of it."""
    out = free & ((goal < floor) | (goal > ceiling))
    if not out.any():
        return None, 1.0
    wall = np.where(goal < floor, floor, ceiling)
    share = np.full(len(x), np.inf)
    share[out] = (wall[out] - x[out]) / (goal[out] - x[out])
    met = int(np.argmin(share))
    return met, max(float(share[met]), 0.0)
