"""Small quadratic problems with bounds: steps that stay inside, intervals that are honest there."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray

CHI2_95: Final = 3.841458820694124
"""95 % point of chi^2 with one degree of freedom."""
_FAR: Final = 8.0
"""Standard deviations from which a bound is out of sight."""


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
            step[rest] = _solve(block[:, rest], gradient[rest] - block[:, on] @ step[on])
            if bounds.hold(step) and _best(normal[on] @ step - gradient[on], step[on], bounds, on):
                return bounds.clip(step)
    # Rounding has hidden the answer: the free step, put within the bounds, will do.
    step = np.zeros(len(gradient))
    step[free] = _solve(normal[np.ix_(free, free)], gradient[free])
    return bounds.clip(step)


def _best(slope: FloatArray, wall: FloatArray, bounds: Bounds, on: list[int]) -> bool:
    """Whether at every active bound the slope points outwards: then no other set is better."""
    upper = wall == bounds.upper[on]
    return bool(np.all(np.where(upper, slope <= 0.0, slope >= 0.0)))


def _solve(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a positive definite system whose parameters differ by many orders of size."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
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
    free = np.array([j for j in range(len(normal)) if j not in held], dtype=np.int64)
    part = normal[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.maximum(np.diag(part), 1e-300))
    inverse = np.linalg.pinv(part * scale[:, None] * scale, rcond=1e-14, hermitian=True)
    result = np.zeros_like(normal)
    result[np.ix_(free, free)] = inverse * scale[:, None] * scale
    return result


def intervals95(
    value: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
    bounds: Bounds,
    indices: Sequence[int],
    held: Sequence[int] = (),
) -> list[tuple[float, float]]:
    """Profile-likelihood intervals of some parameters, the others refitted within their bounds.

    Parameters
    ----------
    value
        The bounded optimum, shape (n,).
    normal, gradient
        Of chi^2/2 there; the gradient (-d chi^2/2) is not zero at a bound that is met.
    bounds
        Of the parameters.
    indices
        The parameters whose intervals are wanted.
    held
        Parameters that are not fitted.

    Notes
    -----
    chi^2 is taken as quadratic. Where truth lies on a bound the interval covers it in at
    least 95 % of the cases (97.5 % with one bound), never less.
    """
    matrix = covariance(normal, held)
    deviations = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    fitted = [j for j in range(len(value)) if j not in held]
    at_rest = bool(np.all(np.abs(gradient * deviations)[fitted] < 1e-2))
    result = []
    for index in indices:
        sd = float(deviations[index])
        half = math.sqrt(CHI2_95) * sd
        ends = [float(value[index]) - half, float(value[index]) + half]
        if sd > 0.0:
            follow = matrix[:, index] / matrix[index, index]
            for k, step in enumerate((-half, half)):
                if not (at_rest and bounds.hold(value + step * follow)):
                    ends[k] = _profiled_end(
                        value, normal, gradient, bounds, index, held, math.copysign(_FAR * sd, step)
                    )
        result.append((ends[0], ends[1]))
    return result


def _profiled_end(
    value: FloatArray, normal: FloatArray, gradient: FloatArray, bounds: Bounds, index: int,
    held: Sequence[int], reach: float,
) -> float:  # fmt: skip
    """One end of an interval that a bound takes part in."""
    normal, gradient, bounds, value, index = _bounded_part(
        normal, gradient, bounds, value, index, held
    )

    def rise(distance: float) -> float:
        """Rise of chi^2 when the parameter is moved and the others follow."""
        pulled = gradient - normal[:, index] * distance
        step = bounded_step(normal, pulled, bounds.about(value), (index,))
        step[index] = distance
        return float(step @ normal @ step - 2.0 * gradient @ step)

    low, high = float(bounds.lower[index]), float(bounds.upper[index])
    reach = min(max(reach, low - float(value[index])), high - float(value[index]))
    return float(value[index]) + _crossing(rise, reach)


def _bounded_part(
    normal: FloatArray, gradient: FloatArray, bounds: Bounds, value: FloatArray, index: int,
    held: Sequence[int],
) -> tuple[FloatArray, FloatArray, Bounds, FloatArray, int]:  # fmt: skip
    """Eliminate what has no bounds (it follows freely), and drop what is held."""
    free = [j for j in range(len(value)) if j not in held]
    walled = [j for j, _ in bounds.walls(free)]
    kept = [j for j in free if j == index or j in walled]
    gone = [j for j in free if j not in kept]
    block, cross = normal[np.ix_(kept, kept)], normal[np.ix_(gone, kept)]
    if gone:
        both = np.concatenate([cross, gradient[gone][:, None]], axis=1)
        carried = np.stack([_solve(normal[np.ix_(gone, gone)], each) for each in both.T], axis=1)
        block = block - cross.T @ carried[:, :-1]
        gradient = gradient[kept] - cross.T @ carried[:, -1]
    else:
        gradient = gradient[kept]
    part = Bounds(bounds.lower[kept], bounds.upper[kept])
    return block, gradient, part, value[kept], kept.index(index)


def _crossing(rise: Callable[[float], float], reach: float) -> float:
    """Where the rise comes to the 95 % point between 0 and `reach`; `reach` if it does not.

    By the rule of false position on its root, which is nearly a straight line.
    """
    goal = math.sqrt(CHI2_95)
    low, below = 0.0, -goal
    high, above = reach, math.sqrt(max(rise(reach), 0.0)) - goal
    if above <= 0.0:
        return reach
    side = 0
    for _ in range(40):
        middle = low - below * (high - low) / (above - below)
        now = math.sqrt(max(rise(middle), 0.0)) - goal
        if abs(now) < 1e-4:
            return middle
        if now > 0.0:
            high, above = middle, now
            below *= 0.5 if side > 0 else 1.0
            side = 1
        else:
            low, below = middle, now
            above *= 0.5 if side < 0 else 1.0
            side = -1
    return 0.5 * (low + high)
