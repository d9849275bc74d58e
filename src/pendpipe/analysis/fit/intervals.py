"""95 % intervals that are honest at a bound, by the profile of a quadratic chi^2."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from pendpipe.analysis.fit.quadratic import Bounds, covariance, exchanged, solved
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
    return [
        (
            _profiled_end(value, normal, gradient, bounds, j, held, -_FAR * float(deviations[j])),
            _profiled_end(value, normal, gradient, bounds, j, held, _FAR * float(deviations[j])),
        )
        if deviations[j] > 0.0
        else (float(value[j]), float(value[j]))
        for j in indices
    ]


def _profiled_end(
    value: FloatArray, normal: FloatArray, gradient: FloatArray, bounds: Bounds, index: int,
    held: Sequence[int], reach: float,
) -> float:  # fmt: skip
    """One end of an interval that a bound takes part in, at most `reach` away.

    The end is found as if nothing were bounded; what then lies beyond its bound is put there, and
    what its bound holds back no more is let go, until the end stays.
    """
    room, on = bounds.about(value), dict[int, float]()
    low, high = sorted((0.0, reach))
    low, high = max(low, float(room.lower[index])), min(high, float(room.upper[index]))
    others = [j for j in range(len(value)) if j not in held and j != index]
    for _ in range(3 * len(value)):
        free = [j for j in others if j not in on] + [index]
        step = np.zeros(len(value))
        step[list(on)] = list(on.values())
        pulled = gradient - normal @ step
        risen = float(step @ normal @ step - 2.0 * gradient @ step)
        block = normal[np.ix_(free, free)]
        best = solved(block, pulled[free])
        follow = solved(block, (np.array(free) == index).astype(np.float64))
        left = CHI2_95 - risen + float(pulled[free] @ best)
        end = float(best[-1]) + math.copysign(math.sqrt(max(left * follow[-1], 0.0)), reach)
        end = min(max(end, low), high)
        step[free] = best + follow / follow[-1] * (end - best[-1])
        if not exchanged(on, free[:-1], step, normal, gradient, room):
            break
    return float(value[index]) + end
