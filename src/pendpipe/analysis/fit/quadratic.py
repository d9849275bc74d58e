"""Small quadratic problems with bounds: steps that stay inside, and variances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray

_BEYOND: Final = 1e-9
"""Standard deviations by which rounding may put a step beyond its bound."""
_SINGULAR: Final = 1e12
"""Of the scaled inverse: beyond, it is mostly rounding."""


class Bounds(NamedTuple):
    """Least and greatest value of each entry, infinite where there is none; shape (n,) each."""

    lower: FloatArray
    upper: FloatArray

    def about(self, value: FloatArray) -> Bounds:
        """The bounds of a step from `value`."""
        return Bounds(self.lower - value, self.upper - value)

    def clip(self, value: FloatArray) -> FloatArray:
        """Put each entry within its bounds."""
        return np.clip(value, self.lower, self.upper)


def bounded_step(
    normal: FloatArray,
    gradient: FloatArray,
    bounds: Bounds,
    held: Sequence[int] = (),
) -> FloatArray:
    """Minimise ``d' H d/2 - g' d`` with some entries of d bounded.

    The step is found as if nothing were bounded; what then lies beyond its bound is put there, and
    what its bound holds back no more is let go, until the step stays.

    Parameters
    ----------
    normal, gradient
        H, shape (n, n), positive definite in what is free, and g, shape (n,).
    bounds
        Of d.
    held
        Entries that stay zero.
    """
    if len(held) == 0:
        step = solved(normal, gradient)
        if bool(((step >= bounds.lower) & (step <= bounds.upper)).all()):
            return step
    step, on = np.zeros(len(gradient)), dict[int, float]()
    for _ in range(4 * len(step)):
        free = [j for j in range(len(step)) if j not in held and j not in on]
        step = np.zeros(len(step))
        step[list(on)] = list(on.values())
        pulled = gradient - normal @ step
        step[free] = solved(normal[np.ix_(free, free)], pulled[free])
        if not exchanged(on, free, step, normal, gradient, bounds):
            break
    return bounds.clip(step)


def exchanged(
    on: dict[int, float], free: Sequence[int], step: FloatArray, normal: FloatArray,
    gradient: FloatArray, bounds: Bounds,
) -> bool:  # fmt: skip
    """Let go what leaves its bound by itself, or put at its bound what is farthest beyond it.

    Parameters
    ----------
    on
        What is at a bound, and where that is: changed.
    free
        What may be put at one.
    step, normal, gradient, bounds
        Of the problem; bounds of the step.

    Returns
    -------
    bool
        False where the step is the best.
    """
    slope = normal @ step - gradient
    idle = [j for j, wall in on.items() if (slope[j] < 0.0) == (wall == bounds.lower[j])]
    beyond = np.maximum(bounds.lower - step, step - bounds.upper) * np.sqrt(normal.diagonal())
    worst = max(free, key=lambda j: float(beyond[j]), default=None)
    if idle:
        del on[idle[0]]
    elif worst is not None and beyond[worst] > _BEYOND:
        below = step[worst] < bounds.lower[worst]
        on[worst] = float((bounds.lower if below else bounds.upper)[worst])
    else:
        return False
    return True


def solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a positive definite system whose parameters differ by many orders of size."""
    scale = 1.0 / np.sqrt(np.maximum(matrix.diagonal(), 1e-300))
    scaled = matrix * scale[:, None] * scale
    try:
        return np.asarray(np.linalg.solve(scaled, right * scale) * scale)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(scaled, right * scale, rcond=1e-14)[0] * scale)


def covariance(normal: FloatArray, held: Sequence[int] = ()) -> FloatArray:
    """Invert the normal matrix; rows and columns of what is held are zero.

    A bound is not used: what it would take off the standard deviations depends on where
    the truth lies, so they are those of the free estimate.
    """
    free = [j for j in range(len(normal)) if j not in held]
    part = normal if len(free) == len(normal) else normal[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.maximum(part.diagonal(), 1e-300))
    scales = scale[:, None] * scale
    scaled = part * scales
    try:
        inverse = np.linalg.inv(scaled)
        sound = bool(np.abs(inverse).max(initial=0.0) < _SINGULAR)
    except np.linalg.LinAlgError:
        sound = False
    if not sound:
        inverse = np.linalg.pinv(scaled, rcond=1e-14, hermitian=True)
    inverse *= scales
    if len(free) == len(normal):
        return np.asarray(inverse)
    result = np.zeros_like(normal)
    result[np.ix_(free, free)] = inverse
    return result
