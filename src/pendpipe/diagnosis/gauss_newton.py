"""Gauss-Newton steps towards the best values of a model, within their bounds."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.optimize import brentq

from pendpipe.analysis.fit.least_squares import bounded_least_squares
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.unwrapped import unwrapped
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.baseline import OMEGA, SHARE, B, share_by_b
from pendpipe.effects.model import Evaluated, Model, jacobian

SETTLED: Final = 0.02
"""Expected fall of chi^2 below which a step is the last."""
_LARGEST_RATIO: Final = 1.5
"""By which a scale (a time, a speed, a length) may change in one step."""
_PRECISE: Final = 1e-11
"""Singular value over the largest from which a direction is seen."""
_RADIUS_MET: Final = 0.01
"""Relative precision of the damping that gives a step its length."""
_SHARE_SD: Final = 0.3
"""Prior about 0.5: one recording hardly constrains the hysteretic share of b."""


@dataclass(frozen=True)
class Evaluation:
    """A model evaluated at some values; shapes are those of `refine.Fit`.

    Parameters
    ----------
    value
        Of the model.
    at, residual, max_phase_error_rad
        The model there, the whitened residual, and the largest phase error.
    model, noise
        From which the Jacobian is computed when it is needed.
    """

    value: FloatArray
    at: Evaluated
    residual: FloatArray
    max_phase_error_rad: float
    model: Model
    noise: Noise

    @cached_property
    def chi2(self) -> float:
        """Sum of squares."""
        return float(self.residual @ self.residual)

    @cached_property
    def columns(self) -> FloatArray:
        """The Jacobian."""
        columns = np.empty((len(self.residual), self.model.size))
        columns[:-1] = self.noise.whiten(jacobian(self.model, self.value, self.at))
        columns[-1] = 0.0
        columns[-1, SHARE] = 1.0 / _SHARE_SD
        # If one part of b is held, changing b changes the share.
        columns[:, B] += share_by_b(self.value, self.model.held_parts()) * columns[:, SHARE]
        return columns

    @cached_property
    def factored(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """QR factors of the Jacobian with columns of unit length, and their lengths.

        Raises
        ------
        NoMotionError
            If a derivative is not finite.
        """
        if not np.all(np.isfinite(self.columns)):
            raise NoMotionError("its derivatives are not finite")
        scale = np.linalg.norm(self.columns, axis=0)
        scale[scale == 0.0] = 1.0
        return *np.linalg.qr(self.columns / scale), scale


class GaussNewton:
    """Gauss-Newton steps of one model on one set of readings."""

    def __init__(self, model: Model, data: Data, noise: Noise) -> None:
        self._model, self._data, self._noise = model, data, noise
        self._low, self._high = model.bounds()
        self._shapes = np.array(_shapes(model), dtype=np.int64)
        # A shape that must be positive is a scale: a speed, a time or a length.
        self._scales = self._shapes[self._low[self._shapes] > 0.0]

    def without_places(self, free: IntArray) -> IntArray:
        """Return the values without those along which chi^2 has many minima.

        These are the shapes that are no scales: the frequency of a line, an instant.
        """
        return free[~np.isin(free, np.setdiff1d(self._shapes, self._scales))]

    def evaluate_within_bounds(self, value: FloatArray) -> Evaluation:
        """Evaluate the model at values, clipped to the bounds."""
        return self.evaluate(self._model.settled(np.clip(value, self._low, self._high)))

    def evaluate(self, value: FloatArray) -> Evaluation:
        """Evaluate the model at exactly these values.

        Raises
        ------
        NoMotionError
            If the model has no motion there, or its chi^2 is not finite.
        """
        at = self._model.evaluate(value)
        residual, slip = _residual(self._data, self._noise, at, value)
        if not math.isfinite(float(residual @ residual)):
            raise NoMotionError("its chi^2 is not finite")
        return Evaluation(value, at, residual, slip, self._model, self._noise)

    def step(
        self,
        here: Evaluation,
        free: IntArray,
        radius: float = math.inf,
        origin: Evaluation | None = None,
    ) -> tuple[FloatArray, float]:
        """Return the best step of a linear model, with the derivatives at `origin` or here.

        The length, at most `radius`, is that of the changes that each value makes by itself in the
        whitened readings (More 1978): values that compensate each other have long steps.
        """
        low, high = self._low.copy(), self._high.copy()
        # The readings are linear in a scale over a fraction of it at most, and while the effect
        # is still small the step in its scale is arbitrary.
        scales = self._scales
        low[scales] = np.maximum(low[scales], here.value[scales] / _LARGEST_RATIO)
        high[scales] = np.minimum(high[scales], here.value[scales] * _LARGEST_RATIO)
        return _step(origin or here, free, here.residual, here.value, low, high, radius)

    def moved(self, here: Evaluation, step: FloatArray) -> Evaluation | None:
        """Evaluate the model a step away, within the bounds; None where it has no motion."""
        try:
            return self.evaluate_within_bounds(here.value + step)
        except NoMotionError:
            return None


def _shapes(model: Model) -> list[int]:
    """Return the indices of the values on which the readings do not depend linearly."""
    return [
        index
        for effect, position in model.places()
        for index in range(
            position.start + (1 if effect.parameter_free else effect.sizes), position.stop
        )
    ]


def _residual(
    data: Data, noise: Noise, at: Evaluated, value: FloatArray
) -> tuple[FloatArray, float]:
    """Return the whitened residual with the prior's entry, and the largest phase error."""
    difference, slip = unwrapped(data, at)
    prior = (0.5 - value[SHARE]) / _SHARE_SD
    return np.append(noise.whiten(difference), prior), slip


def _step(
    origin: Evaluation,
    free: IntArray,
    residual: FloatArray,
    value: FloatArray,
    low: FloatArray,
    high: FloatArray,
    radius: float,
) -> tuple[FloatArray, float]:
    """Solve for the step, the best within the bounds and no longer than `radius`."""
    basis, triangle, scales = origin.factored
    step, scale, matrix = np.zeros(len(value)), scales[free], triangle[:, free]
    floor, ceiling = (low - value)[free] * scale, (high - value)[free] * scale
    right = basis.T @ residual
    left, singular, turned = np.linalg.svd(matrix, full_matrices=False)
    seen = singular > _PRECISE * np.max(singular, initial=0.0)
    pull, squares = (singular * (left.T @ right))[seen], singular[seen] ** 2
    damping = damping_for(pull, squares, radius)
    best = turned[seen].T @ (pull / (squares + damping))
    if np.any(best < floor) or np.any(best > ceiling):
        matrix = np.vstack([matrix, math.sqrt(damping) * np.eye(len(free))])
        best = bounded_least_squares(matrix, np.append(right, 0.0 * free), floor, ceiling)
    step[free] = best / scale
    limit = 0.05 * value[OMEGA]
    if abs(step[OMEGA]) > limit:
        step *= limit / abs(step[OMEGA])
    return step, float(np.linalg.norm(best))


def damping_for(pull: FloatArray, squares: FloatArray, radius: float) -> float:
    """Return the least damping with which a step is no longer than `radius`."""

    def longer(damping: float) -> float:
        return float(np.linalg.norm(pull / (squares + damping))) - radius

    # Without a limit there is nothing to damp, and the length may overflow.
    if math.isinf(radius) or longer(0.0) <= 0.0:
        return 0.0
    # The step is shorter than the gradient over the damping.
    return float(brentq(longer, 0.0, float(np.linalg.norm(pull)) / radius, rtol=_RADIUS_MET))
