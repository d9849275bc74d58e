"""Maximum-likelihood fit of a model, also from start values far away."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.gauss_newton import SETTLED, Evaluation, GaussNewton
from pendpipe.diagnosis.noise import Noise
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.baseline import C
from pendpipe.effects.model import Evaluated, Model

ROUNDS: Final = 14
"""Largest number of steps of a fit."""
_LINEAR_WITHIN: Final = 0.02
"""Relative difference between the expected and the actual gain up to which the model counts as
linear."""
_SLOW_GAIN: Final = 0.25
"""Fall of chi^2: a fit ends after three rounds that gain less."""
_LAST_STEPS: Final = 3
"""Last steps from which the gain of further ones is extrapolated."""
_NUMBERS: Final = 100.0
"""What a misfit beyond the noise is described by at most: chi^2 counts against each of them."""
_FAR_BEYOND_SD: Final = 3.0
"""Standard deviations beyond a bound from which the value counts as known: the bound."""


@dataclass(frozen=True)
class Fit:
    """A model at its best values.

    Parameters
    ----------
    evaluation
        The values, and the model evaluated there.
    free
        Indices of the values that were fitted.
    converged
        Whether the last step was negligible.
    error_scale
        Factor on all standard deviations, for a misfit beyond the noise.
    """

    evaluation: Evaluation
    free: tuple[int, ...]
    converged: bool
    error_scale: float = 1.0

    @property
    def model(self) -> Model:
        """The model."""
        return self.evaluation.model

    @property
    def value(self) -> FloatArray:
        """Its values."""
        return self.evaluation.value

    @property
    def at(self) -> Evaluated:
        """The model there."""
        return self.evaluation.at

    @property
    def chi2(self) -> float:
        """Sum of squares of the whitened residual, with the share's prior."""
        return self.evaluation.chi2

    @property
    def residual(self) -> FloatArray:
        """Whitened; one entry more than there are readings (the prior), shape (n + 1,)."""
        return self.evaluation.residual

    @property
    def jacobian(self) -> FloatArray:
        """Of the whitened readings by all values, with the prior's row, shape (n + 1, size)."""
        return self.evaluation.columns

    @property
    def max_phase_error_rad(self) -> float:
        """The largest phase difference between model and readings."""
        return self.evaluation.max_phase_error_rad

    def covariance(self) -> FloatArray:
        """Of all values; zero for those held, shape (size, size)."""
        matrix = np.zeros((len(self.value), len(self.value)))
        part = self.jacobian[:, self.free]
        scale = np.linalg.norm(part, axis=0)
        scale[scale == 0.0] = 1.0
        inverse = np.linalg.pinv(np.linalg.qr(part / scale, mode="r"), rcond=1e-12)
        matrix[np.ix_(self.free, self.free)] = inverse @ inverse.T / np.outer(scale, scale)
        return self.error_scale**2 * matrix


def pulled(fit: Fit) -> list[int]:
    """Return the indices of fitted values that the readings pull far beyond a bound."""
    low, high = fit.model.bounds()
    found = []
    for index in fit.free:
        if low[index] < fit.value[index] < high[index]:
            continue
        column = fit.jacobian[:, index]
        length = float(np.linalg.norm(column))
        others = [k for k in fit.free if k != index and low[k] < fit.value[k] < high[k]]
        part = fit.jacobian[:, others]
        rest = column - part @ np.linalg.lstsq(part, column, rcond=1e-11)[0]
        alone = float(np.linalg.norm(rest))
        if alone > 1e-9 * length and abs(float(rest @ fit.residual)) > _FAR_BEYOND_SD * alone:
            found.append(index)
    return found


def refine(
    model: Model,
    data: Data,
    noise: Noise,
    start: FloatArray,
    *,
    held: Iterable[int] = (),
    rounds: int = ROUNDS,
    useful: float = math.inf,
) -> Fit:
    """Minimise chi^2 by Gauss-Newton steps, within the bounds.

    Where model and readings are far out of phase, the residual is taken along the motion
    (amplitude and unwrapped phase, cycle by cycle), so that it stays linear. A fit that
    can't reach a chi^2 of `useful` stops early.

    Raises
    ------
    NoMotionError
        If the model can't be evaluated at the start.
    """
    refining = Refining(model, data, noise, start, held=held)
    refining.go(rounds, useful)
    return refining.fit


def best_fit(
    model: Model,
    data: Data,
    noise: Noise,
    starts: Sequence[FloatArray],
    *,
    held: Iterable[int] = (),
    useful: float = math.inf,
) -> Fit | None:
    """Refine from the best of several starts, and from the next best where that gets stuck.

    None if the model has no motion from any. A start with values of another model is left out.
    """
    fixed, found, begun = tuple(held), None, []
    for start in starts:
        with suppress(NoMotionError, np.linalg.LinAlgError):
            if len(start) == model.size:
                begun.append(Refining(model, data, noise, start, held=fixed))
    for refining in sorted(begun, key=lambda each: each.chi2):
        with suppress(NoMotionError, np.linalg.LinAlgError):
            refining.go(ROUNDS, useful)
            found = better(found, refining.fit)
            if refining.fit.converged:
                break
    return found


def better(one: Fit | None, other: Fit | None) -> Fit | None:
    """Return the fit of the smaller chi^2; None where there is neither."""
    if one is None or other is None:
        return one or other
    return one if one.chi2 <= other.chi2 else other


class Refining:
    """A fit that can be interrupted and resumed; parameters are those of `refine`.

    It ends after two rounds that gain less than `little`, or three that gain less than 0.25.
    """

    def __init__(
        self,
        model: Model,
        data: Data,
        noise: Noise,
        start: FloatArray,
        *,
        held: Iterable[int] = (),
        little: float = SETTLED,
    ) -> None:
        fixed = {*held, *model.held()}
        self._free = np.array([k for k in range(model.size) if k not in fixed])
        self._steps = GaussNewton(model, data, noise)
        self._here = self._steps.evaluate_within_bounds(start)
        self._gains: list[float] = []
        self._stalled = ((2, little), (3, max(little, _SLOW_GAIN)))
        self._ended = self._converged = False

    @property
    def chi2(self) -> float:
        """The current chi^2."""
        return self._here.chi2

    @property
    def fit(self) -> Fit:
        """The fit so far."""
        return Fit(self._here, tuple(self._free.tolist()), self._converged)

    @property
    def _unit(self) -> float:
        """The chi^2 that counts as 1: of one of the numbers that a misfit is described by."""
        return max(1.0, (self.chi2 - len(self._here.residual)) / _NUMBERS)

    def go(self, rounds: int, useful: float = math.inf) -> None:
        """Run some rounds, or fewer if the fit converges or becomes hopeless.

        Parameters
        ----------
        rounds
            How many.
        useful
            Largest chi^2 that is of any use: the fit stops where the remaining rounds, gaining
            what the last ones did, would not reach it.
        """
        for left in range(rounds, 0, -1):
            if self._ended or self._hopeless(left, useful):
                break
            self._round()
        self._steps.forget()

    def _hopeless(self, left: int, useful: float) -> bool:
        last = self._gains[-_LAST_STEPS:]
        return len(last) == _LAST_STEPS and self.chi2 - left * sum(last) / _LAST_STEPS > useful

    def _round(self) -> None:
        here, free, steps = self._here, self._free, self._steps
        settled = SETTLED * self._unit
        step = steps.step(here, free)
        expected = _expected(here, here.columns, step)
        better = steps.line_search(here, step, free, expected)
        direct = better is not None
        if better is None and C in free:
            # More friction would stop the motion before the last reading: move the others first.
            others = free[free != C]
            step = steps.step(here, others)
            better = steps.line_search(here, step, others, _expected(here, here.columns, step))
        if better is None:
            self._ended, self._converged = True, expected < 10.0 * settled
            return
        self._here = better
        gained = here.chi2 - better.chi2
        self._gains.append(gained)
        if expected < settled or (gained < settled and expected < 50.0 * settled):
            self._ended = self._converged = True
        elif direct and abs(expected - gained) < _LINEAR_WITHIN * expected:
            self._settle(here)
        self._ended |= self._stalls()

    def _stalls(self) -> bool:
        """Whether steps no longer gain what is expected.

        A derivative is wrong there (that of an instant, say), the motion stops just beyond, or two
        values compensate each other.
        """
        return any(
            len(self._gains) >= rounds and max(self._gains[-rounds:]) < little * self._unit
            for rounds, little in self._stalled
        )

    def _settle(self, before: Evaluation) -> None:
        """Take the last, negligible step with the derivatives of the step before.

        They are as good as new ones where the step before gained what was expected.
        """
        here = self._here
        if not np.all(np.any(before.columns[:, self._free], axis=0)):
            # The shape of an effect had no influence while its size was zero.
            return
        step = self._steps.step(here, self._free, before.columns)
        expected = _expected(here, before.columns, step)
        if expected < SETTLED * self._unit:
            self._here = self._steps.line_search(here, step, self._free, expected) or here
            self._ended = self._converged = True


def _expected(here: Evaluation, columns: FloatArray, step: FloatArray) -> float:
    """Return the fall of chi^2 along a step of a linear model."""
    return here.chi2 - float(np.sum((here.residual - columns @ step) ** 2))


def misfit(model: Model, data: Data, noise: Noise, value: FloatArray) -> float:
    """Return chi^2 at given values.

    Raises
    ------
    NoMotionError
        If the model can't be evaluated there.
    """
    return GaussNewton(model, data, noise).evaluate(value).chi2
