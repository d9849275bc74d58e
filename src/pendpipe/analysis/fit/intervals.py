"""95 % intervals that are honest at a bound, by the profile of a quadratic chi^2."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from pendpipe.analysis.fit.quadratic import Bounds, bounded_step, covariance, solved
from pendpipe.arrays import FloatArray

CHI2_95: Final = 3.841458820694124
"""95 % point of chi^2 with one degree of freedom."""
_FAR: Final = 8.0
"""Standard deviations from which a bound is out of sight."""


def intervals95(
    value: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
    bounds: Bounds,
    indices: Sequence[int],
    held: Sequence[int] = (),
    matrix: FloatArray | None = None,
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
    matrix
        The covariance, where it is known.

    Notes
    -----
    chi^2 is taken as quadratic. Where truth lies on a bound the interval covers it in at
    least 95 % of the cases (97.5 % with one bound), never less.
    """
    matrix = covariance(normal, held) if matrix is None else matrix
    deviations = np.sqrt(np.maximum(matrix.diagonal(), 0.0))
    pull = np.abs(gradient * deviations)
    fitted = [j for j in range(len(value)) if j not in held]
    at_rest = bool((pull if len(held) == 0 else pull[fitted]).max(initial=0.0) < 1e-2)
    half = math.sqrt(CHI2_95) * deviations
    room = bounds.about(value)
    if at_rest and bool(((room.lower <= -half) & (half <= room.upper)).all()):
        # None can come to a bound, since following another moves it by 1.96 of its own at most.
        return [(float(value[j] - half[j]), float(value[j] + half[j])) for j in indices]
    # The others follow a parameter that is moved to an end of its interval.
    sizes = np.where(deviations > 0.0, deviations, 1.0)
    step = matrix[:, indices] * (half / sizes**2)[indices]
    inside = (
        (-step >= room.lower[:, None]) & (-step <= room.upper[:, None]),
        (step >= room.lower[:, None]) & (step <= room.upper[:, None]),
    )
    ok = [at_rest & side.all(axis=0) for side in inside]
    result = []
    for position, index in enumerate(indices):
        width = float(half[index])
        ends = [float(value[index]) - width, float(value[index]) + width]
        if width > 0.0:
            for k, sign in enumerate((-1.0, 1.0)):
                if not ok[k][position]:
                    reach = sign * _FAR * float(deviations[index])
                    ends[k] = _profiled_end(value, normal, gradient, bounds, index, held, reach)
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
        carried = np.stack([solved(normal[np.ix_(gone, gone)], each) for each in both.T], axis=1)
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
