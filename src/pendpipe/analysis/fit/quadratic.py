"""Small quadratic problems with bounds: steps that stay inside, and variances."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray

_SINGULAR: Final = 1e12
"""Of the scaled inverse: beyond, it is mostly rounding."""


class Bounds(NamedTuple):
    """Least and greatest value of each entry, infinite where there is none; shape (n,) each."""

    lower: FloatArray
    upper: FloatArray

    def about(self, value: FloatArray) -> Bounds:
        """The bounds of a step from `value`."""
        return Bounds(self.lower - value, self.upper - value)

    def hold(self, value: FloatArray) -> bool:
        """Whether all entries lie within, to rounding."""
        slack = 1e-12
        low = value >= self.lower - slack * np.abs(self.lower)
        return bool(np.all(low & (value <= self.upper + slack * np.abs(self.upper))))

    def clip(self, value: FloatArray) -> FloatArray:
        """Put each entry within its bounds."""
        return np.clip(value, self.lower, self.upper)

    def walls(self, free: Sequence[int]) -> list[tuple[int, float]]:
        """The finite bounds of the free entries: index and value."""
        return [(j, float(side[j])) for j in free for side in self if math.isfinite(side[j])]

    def distance(self, value: FloatArray) -> FloatArray:
        """How far each entry is from its nearer bound."""
        return np.minimum(value - self.lower, self.upper - value)


def bounded_step(
    normal: FloatArray,
    gradient: FloatArray,
    bounds: Bounds,
    held: Sequence[int] = (),
) -> FloatArray:
    """Minimise ``d' H d/2 - g' d`` with some entries of d bounded.

    Sets of active bounds are tried, the smallest first, until one is optimal: there are
    three or four bounds, hence some 20 small systems at most, and usually one.

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
    free = [j for j in range(len(gradient)) if j not in held]
    walls = bounds.walls(free)
    for size in range(len(walls) + 1):
        for active in combinations(walls, size):
            on = [index for index, _ in active]
            if len(set(on)) < size:
                continue
            step = np.zeros(len(gradient))
            step[on] = [wall for _, wall in active]
            rest = [index for index in free if index not in on]
            block = normal[rest]
            step[rest] = solved(block[:, rest], gradient[rest] - block[:, on] @ step[on])
            if bounds.hold(step) and _best(normal[on] @ step - gradient[on], step[on], bounds, on):
                return bounds.clip(step)
    # Rounding has hidden the answer: the free step, put within the bounds, will do.
    step = np.zeros(len(gradient))
    step[free] = solved(normal[np.ix_(free, free)], gradient[free])
    return bounds.clip(step)


def _best(slope: FloatArray, wall: FloatArray, bounds: Bounds, on: list[int]) -> bool:
    """Whether at every active bound the slope points outwards: then no other set is better."""
    upper = wall == bounds.upper[on]
    return bool(np.all(np.where(upper, slope <= 0.0, slope >= 0.0)))


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
