"""Maximum-likelihood fit of a model by Gauss-Newton steps, also from start values far away."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.optimize import brentq

from pendpipe.analysis.fit.least_squares import bounded_least_squares
from pendpipe.arrays import FloatArray, IntArray, scaled_qr
from pendpipe.diagnosis.unwrapped import unwrapped
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.effects.baseline import OMEGA, SHARE, B, share_by_b
from pendpipe.effects.model import Evaluated, Model, jacobian

if TYPE_CHECKING:
    from pendpipe.diagnosis.data import Data
    from pendpipe.diagnosis.noise import Noise

SETTLED: Final = 0.02
"""Expected fall of chi^2 below which a step is the last."""
_LARGEST_RATIO: Final = 1.5
"""By which a scale (a time, a speed, a length) may change in one step."""
_PRECISE: Final = 1e-11
"""Singular value over the largest from which a direction is seen."""
_RADIUS_MET: Final = 0.01
"""Relative precision of the damping that gives a step its length."""
_SHARE_SD: Final = 8.0**-0.5
"""Prior of the hysteretic share of b about 0.5: of the fit's, flat in the roots of both parts."""


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
        return scaled_qr(self.columns)


def _shapes(model: Model) -> list[int]:
    """Return the indices of the values on which the readings do not depend linearly."""
    return [
        index
        for effect, position in model.places()
        for index in range(
            position.start + (1 if effect.parameter_free else effect.sizes), position.stop
        )
    ]


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


ROUNDS: Final = 14
"""Largest number of steps of a fit."""
_LINEAR_WITHIN: Final = 0.02
"""Relative difference between the expected and the actual gain up to which the model counts as
linear."""
_SLOW_GAIN: Final = 0.25
"""Fall of chi^2: a fit ends after three rounds that gain less."""
_LAST_STEPS: Final = 3
"""Last steps from which the gain of further ones is extrapolated."""
_TRIES: Final = 6
"""Lengths of one step that are tried: from a tenth each, six reach 1e-6 of it."""
_POOR: Final = 0.25
_GOOD: Final = 0.75
"""Parts of the expected gain below (above) which a step was too long (may be longer)."""
_SHORTER: Final = (0.1, 0.5)
"""Least and usual part of a step by which it is shortened, as More (1978) has them."""
_LONGER: Final = 2.0
"""Radius of the next step over the length of the last; with the two above as More (1978) has."""
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
        Factor on standard deviations for a misfit beyond the noise, in the mean.
    scatter
        Covariance of J'r for that misfit, shape (size, size); None where noise alone is left.
    """

    evaluation: Evaluation
    free: tuple[int, ...]
    converged: bool
    error_scale: float = 1.0
    scatter: FloatArray | None = None

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

    def beside(self, columns: FloatArray, own: Collection[int]) -> FloatArray:
        """Return what the derivatives by the free values, but for its `own`, leave of columns."""
        others = self.jacobian[:, [k for k in self.free if k not in own]]
        others = others / np.maximum(np.linalg.norm(others, axis=0), 1e-300)
        return np.asarray(columns - others @ np.linalg.lstsq(others, columns, rcond=1e-11)[0])

    def covariance(self) -> FloatArray:
        """Of all values; zero for those held, shape (size, size)."""
        matrix = np.zeros((len(self.value), len(self.value)))
        _, triangle, scale = scaled_qr(self.jacobian[:, self.free])
        inverse = np.linalg.pinv(triangle, rcond=1e-12)
        own = inverse @ inverse.T / np.outer(scale, scale)
        if self.scatter is not None:
            own = own @ self.scatter[np.ix_(self.free, self.free)] @ own
        matrix[np.ix_(self.free, self.free)] = own
        return matrix


def pulled(fit: Fit) -> list[int]:
    """Return the indices of fitted values that the readings pull far beyond a bound."""
    low, high = fit.model.bounds()
    inside = (low < fit.value) & (fit.value < high)
    bound = [index for index in fit.free if not inside[index]]
    found = []
    for index in bound:
        column = fit.jacobian[:, index]
        rest = fit.beside(column, bound)
        alone = float(np.linalg.norm(rest))
        seen = alone > 1e-9 * float(np.linalg.norm(column))
        if seen and abs(float(rest @ fit.residual)) > _FAR_BEYOND_SD * alone:
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
    """Minimise chi^2 by Gauss-Newton steps, within the bounds and a radius of trust.

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

    The others are not tried where even the best can't reach a chi^2 of `useful`, or has reached it.
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
            if refining.fit.converged or refining.hopeless or refining.chi2 < useful < math.inf:
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
        self._model, self._data, self._noise = model, data, noise
        self._low, self._high = model.bounds()
        shapes = np.array(_shapes(model), dtype=np.int64)
        # A shape that must be positive is a scale: a speed, a time or a length.
        self._scales = shapes[self._low[shapes] > 0.0]
        # Along the others, the frequency of a line or an instant, chi^2 has many minima.
        self._places = np.setdiff1d(shapes, self._scales)
        self._here = self._evaluate(start)
        self._gains: list[float] = []
        self._radius = math.inf
        self._stalled = ((2, little), (3, max(little, _SLOW_GAIN)))
        self._ended = self._converged = self.hopeless = False

    def _evaluate(self, value: FloatArray) -> Evaluation:
        """Evaluate the model at values, clipped to the bounds.

        Raises
        ------
        NoMotionError
            If the model has no motion there, or its chi^2 is not finite.
        """
        value = self._model.settled(np.clip(value, self._low, self._high))
        at = self._model.evaluate(value)
        difference, slip = unwrapped(self._data, at)
        prior = (0.5 - value[SHARE]) / _SHARE_SD
        residual = np.append(self._noise.whiten(difference), prior)
        if not math.isfinite(float(residual @ residual)):
            raise NoMotionError("its chi^2 is not finite")
        return Evaluation(value, at, residual, slip, self._model, self._noise)

    def _moved(self, here: Evaluation, step: FloatArray) -> Evaluation | None:
        """Evaluate the model a step away, within the bounds; None where it has no motion."""
        try:
            return self._evaluate(here.value + step)
        except NoMotionError:
            return None

    def _step(
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
            self.hopeless = self._cannot_reach(useful, left)
            if self._ended or self.hopeless:
                break
            self._round()
        # The factors are as large as the derivatives; a fit that is kept needs only those.
        vars(self._here).pop("factored", None)

    def _cannot_reach(self, useful: float, left: int) -> bool:
        last = self._gains[-_LAST_STEPS:]
        return len(last) == _LAST_STEPS and self.chi2 - left * sum(last) / _LAST_STEPS > useful

    def _round(self) -> None:
        """Go one step: the whole one if chi^2 falls by what it promises, else a shorter one."""
        here, free = self._here, self._free
        settled, still = SETTLED * self._unit, free[~np.isin(free, self._places)]
        tries = 0
        while True:
            step, length = self._step(here, free, self._radius)
            expected = _expected(here, here.columns, step)
            there = self._moved(here, step)
            if tries == 0 and len(still) < len(free) and (not there or there.chi2 > here.chi2):
                # Along a place chi^2 has many minima: it stays, unless the gain is its own.
                shorter, _ = self._step(here, still, self._radius)
                if _expected(here, here.columns, shorter) > _POOR * expected:
                    tries, free = 1, still
                    continue
            there = self._corrected(there, free, expected)
            gained = here.chi2 - there.chi2 if there else -math.inf
            if gained < _POOR * expected:
                # Where the parabola through chi^2 here, its slope, and chi^2 there is least.
                least = expected / (2.0 * expected - gained) if expected > 0.0 else 0.0
                self._radius = min(max(least, _SHORTER[0]), _SHORTER[1]) * length
            elif gained > _GOOD * expected:
                self._radius = max(self._radius, _LONGER * length)
            if gained > -0.5 * SETTLED:
                break
            tries += 1
            if tries > (_TRIES if expected > self._unit else 1) or expected < settled:
                self._ended, self._converged = True, expected < 10.0 * settled
                return
        assert there is not None
        self._here = there
        self._gains.append(gained)
        if expected < settled or (gained < settled and expected < 50.0 * settled):
            self._ended = self._converged = True
        elif tries == 0 and abs(expected - gained) < _LINEAR_WITHIN * expected:
            self._settle(here)
        self._ended |= self._stalls()

    def _corrected(
        self, there: Evaluation | None, free: IntArray, expected: float
    ) -> Evaluation | None:
        """Step back to where chi^2 is what it should be, with the derivatives at the start.

        Two laws of friction that replace each other leave the motion unchanged to first order; to
        second order the frequency changes, which accumulates over the record. A correction no
        longer than what was not expected of the readings leaves the exchange as it is.
        """
        here = self._here
        while there is not None:
            missing = expected - (here.chi2 - there.chi2)
            if missing <= (1.0 - _POOR) * max(expected, 0.0):
                break
            step, _ = self._step(there, free, math.sqrt(missing), here)
            nearer = self._moved(there, step)
            if nearer is None or expected - (here.chi2 - nearer.chi2) > _POOR * missing:
                break
            there = nearer
        return there

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
        step, _ = self._step(here, self._free, origin=before)
        expected = _expected(here, before.columns, step)
        if expected < SETTLED * self._unit:
            there = self._moved(here, step)
            if there and there.chi2 < here.chi2 + 0.5 * SETTLED:
                self._here = there
            self._ended = self._converged = True


def _expected(here: Evaluation, columns: FloatArray, step: FloatArray) -> float:
    """Return the fall of chi^2 along a step of a linear model."""
    return here.chi2 - float(np.sum((here.residual - columns @ step) ** 2))


_FIRST_CYCLES: Final = 4
"""Cycles in the first window."""
_FEWEST_READINGS: Final = 24
"""Readings of the first window: three for each of the eight values of the baseline."""
_GROWTH: Final = 1.6
"""Of the window at each step: what is uncertain of the phase grows by its square, 2.6, at most."""
_GROWING_ROUNDS: Final = 8
"""Rounds in each window: its end need only lie within the next one's reach."""


def fit_in_growing_window(
    model: Model, data: Data, noise: Noise, start: FloatArray, *, held: Iterable[int] = ()
) -> Fit | None:
    """Fit the first part of a record, then more and more of it, then all.

    Over a whole record at large amplitude the phase of a wrong start is off by many turns, too far
    for Gauss-Newton steps. Over the first cycles it is not: each fit begins at the last result.

    Parameters
    ----------
    model
        The baseline with effects.
    data, noise
        All readings, and their noise.
    start
        Values that hold for the first cycles at least (from turning points).
    held
        Indices of values that are not fitted.

    Returns
    -------
    Fit or None
        None where the model has no such motion.
    """
    value, fixed = start, tuple(held)
    cycle = 2.0 * np.pi / value[OMEGA] / data.interval_s
    count = max(int(_FIRST_CYCLES * cycle), _FEWEST_READINGS)
    try:
        while count < len(data):
            part = data.first(count)
            short, white = model.at_times(part.time_s), noise.white(part)
            value = refine(short, part, white, value, held=fixed, rounds=_GROWING_ROUNDS).value
            count = int(_GROWTH * count) + 1
        return refine(model, data, noise, value, held=fixed)
    except (NoMotionError, np.linalg.LinAlgError):
        return None


GROSS: Final = 2.0
"""chi^2 per degree of freedom above which first-order scores are meaningless."""
LARGE_PHASE_ERROR: Final = 0.1
"""Phase error in rad from which a model has lost the motion."""


def fitted_from(
    model: Model, data: Data, noise: Noise, start: FloatArray, *, held: Iterable[int] = ()
) -> Fit | None:
    """Fit at once, and in a growing window where that loses the phase; return the better one."""
    fixed = tuple(held)
    fit = best_fit(model, data, noise, [start], held=fixed)
    if fit and fit.converged and fit.max_phase_error_rad < LARGE_PHASE_ERROR:
        return fit
    return better(fit, fit_in_growing_window(model, data, noise, start, held=fixed))
