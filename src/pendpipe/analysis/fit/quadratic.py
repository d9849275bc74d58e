"""Small quadratic problems with bounds: steps that stay inside, intervals that are honest there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray

CHI2_95: Final = 3.841458820694124
"""95 % point of chi^2 with one degree of freedom."""


def bounded_step(
    normal: FloatArray,
    gradient: FloatArray,
    lowest: FloatArray,
    held: Sequence[int] = (),
) -> FloatArray:
    """Minimise ``d' H d/2 - g' d`` with some entries of d bounded from below.

    Every subset of the bounds is tried: there are three or four, hence at most 16 small
    systems, and in the usual case, where no bound is met, one.

    Parameters
    ----------
    normal, gradient
        H, shape (n, n), positive definite in what is free, and g, shape (n,).
    lowest
        The least value of each entry of d, -inf where there is none, shape (n,).
    held
        Entries that stay zero.
    """
    free = np.array([j for j in range(len(gradient)) if j not in held], dtype=np.int64)
    step = np.zeros(len(gradient))
    step[free] = _solve(normal[np.ix_(free, free)], gradient[free])
    if np.all(step >= lowest):
        return step
    bounded = [int(j) for j in free if np.isfinite(lowest[j])]
    best, least = step, math.inf
    for size in range(1, len(bounded) + 1):
        for active in combinations(bounded, size):
            trial = np.zeros(len(gradient))
            on = np.array(active)
            trial[on] = lowest[on]
            rest = np.array([j for j in free if j not in active], dtype=np.int64)
            right = gradient[rest] - normal[np.ix_(rest, on)] @ trial[on]
            trial[rest] = _solve(normal[np.ix_(rest, rest)], right)
            value = 0.5 * trial @ normal @ trial - gradient @ trial
            if value < least and np.all(trial >= lowest - 1e-12 * np.abs(lowest)):
                best, least = trial, value
    return np.maximum(best, lowest)


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


def interval95(
    value: FloatArray,
    normal: FloatArray,
    gradient: FloatArray,
    lower: FloatArray,
    index: int,
    held: Sequence[int] = (),
) -> tuple[float, float]:
    """Profile-likelihood interval of one parameter, the others refitted within their bounds.

    Parameters
    ----------
    value
        The bounded optimum, shape (n,).
    normal, gradient
        Of chi^2/2 there; the gradient (-d chi^2/2) is not zero at a bound that is met.
    lower
        The bounds, -inf where there is none.
    index
        The parameter.
    held
        Parameters that are not fitted.

    Notes
    -----
    chi^2 is taken as quadratic. Where truth lies on a bound the interval covers it in at
    least 95 % of the cases (97.5 % with one bound), never less.
    """
    sd = math.sqrt(max(float(covariance(normal, held)[index, index]), 0.0))
    half = math.sqrt(CHI2_95) * sd
    near = [
        j for j in range(len(value))
        if np.isfinite(lower[j]) and j not in held
        and value[j] - lower[j] < 8.0 * math.sqrt(float(covariance(normal, held)[j, j]))
    ]  # fmt: skip
    if not near or sd == 0.0:
        return value[index] - half, value[index] + half

    def rise(distance: float) -> float:
        """Rise of chi^2 when the parameter is moved and the others follow."""
        pulled = gradient - normal[:, index] * distance
        step = bounded_step(normal, pulled, lower - value, (*held, index))
        step[index] = distance
        return float(step @ normal @ step - 2.0 * gradient @ step)

    ends = []
    for sign in (-1.0, 1.0):
        reach = sign * 12.0 * sd
        if sign < 0 and value[index] + reach < lower[index]:
            reach = float(lower[index] - value[index])
        ends.append(value[index] + _crossing(rise, reach))
    return ends[0], ends[1]


def _crossing(rise: object, reach: float) -> float:
    """Where the rise comes to the 95 % point between 0 and `reach`; `reach` if it does not."""
    assert callable(rise)
    if rise(reach) <= CHI2_95:
        return reach
    low, high = 0.0, reach
    for _ in range(50):
        middle = 0.5 * (low + high)
        if rise(middle) > CHI2_95:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)
