"""Levenberg-Marquardt within bounds, for a handful of parameters.

scipy's optimisers cost more to import (0.7 s) than a thousand of these fits, and none of
them combines bounds, a prior and normal equations summed piece by piece.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.quadratic import Bounds, bounded_step
from pendpipe.arrays import FloatArray

_DAMPING: Final = (0.0, 1e-3, 1e-2, 0.1, 1.0, 1e2, 1e4, 1e6)
_PREDICTED: Final = 1e-2
"""Of chi^2: a tenth of a standard deviation, of an estimate of what is left that is high."""


class Quadratic(NamedTuple):
    """chi^2 at a point, with minus half its gradient and its normal matrix."""

    chi2: float
    gradient: FloatArray
    normal: FloatArray


class Minimum(NamedTuple):
    """Where the search ended."""

    value: FloatArray
    quadratic: Quadratic
    converged: bool
    at: FloatArray
    """Where chi^2 was evaluated: `value`, or where the last, unverified step began."""
    gained: float = 0.0
    """By what that step lowers chi^2."""


def minimise(
    evaluate: Callable[[FloatArray], Quadratic],
    start: FloatArray,
    bounds: Bounds,
    *,
    held: Sequence[int] = (),
    tolerance: float = 1e-5,
    predict_remaining: Callable[[FloatArray, FloatArray, Quadratic, float], float] | None = None,
    most: int = 60,
) -> Minimum:
    """Minimise chi^2 by damped Gauss-Newton steps that respect bounds.

    Parameters
    ----------
    evaluate
        chi^2, gradient and normal matrix at a point; an infinite chi^2 refuses it.
    start, bounds
        Where to begin, shape (n,), and within what.
    held
        Entries that are not fitted.
    tolerance
        The search ends when the next step would lower chi^2 by less: 1e-5 is 0.003
        standard deviations. That step is still accepted, unverified.
    predict_remaining
        What a step leaves to be gained, from its two ends, the quadratic at the first and
        what that promises. Below 1e-2 the step is accepted unverified.
    most
        Greatest number of evaluations.
    """
    value = bounds.clip(start)
    now = evaluate(value)
    level = 0
    for _ in range(most - 1):
        damped = now.normal
        if level > 0:
            damped = damped + _DAMPING[level] * np.diag(np.diag(damped))
        step = bounded_step(damped, now.gradient, bounds.about(value), held)
        promised = float(2.0 * now.gradient @ step - step @ now.normal @ step)
        if promised < tolerance and level < 3:
            return Minimum(bounds.clip(value + step), _moved(now, step), True, value, promised)
        trial = bounds.clip(value + step)
        if (
            predict_remaining is not None
            and level == 0
            and predict_remaining(value, trial, now, promised) < _PREDICTED
        ):
            return Minimum(trial, _moved(now, step), True, value, promised)
        then = evaluate(trial)
        if np.isfinite(then.chi2) and then.chi2 <= now.chi2 + 0.1 * tolerance:
            if now.chi2 - then.chi2 < 1e-12 * now.chi2 and promised < 1e-6 * now.chi2:
                return Minimum(trial, then, True, trial)
            value, now = trial, then
            level = max(level - 2, 0)
        elif level == len(_DAMPING) - 1:
            return Minimum(value, now, False, value)
        else:
            level += 1
    return Minimum(value, now, False, value)


def _moved(quadratic: Quadratic, step: FloatArray) -> Quadratic:
    """The quadratic about a point a step further."""
    chi2 = quadratic.chi2 - 2.0 * quadratic.gradient @ step + step @ quadratic.normal @ step
    return Quadratic(float(chi2), quadratic.gradient - quadratic.normal @ step, quadratic.normal)
