"""Maximum-likelihood fit of a model by Gauss-Newton steps, also from start values far away.

If chi^2 stays far above the noise, the model is still wrong. Names and errors are then compared
with the unknown function that is left (`analysis.misfit`), not with the noise: `Remainder`.

Readings are compared with a model's motion cycle by cycle: amplitude, phase, and the residual along
it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe.analysis.demodulation import lock_in
from pendpipe.analysis.misfit import beyond_noise, misfit_of
from pendpipe.arrays import FloatArray, scaled_qr
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.dynamics.any_law import NoMotionError
from pendpipe.dynamics.eq8 import OMEGA, SHARE, B
from pendpipe.dynamics.eq8_model import SHARES, known_losses
from pendpipe.effects.model import Evaluated, Model
from pendpipe.files import fields_of
from pendpipe.solve import Bounds, NoStartError, Problem, Search, Squares, covariance

LARGE_PHASE_ERROR: Final = 0.1
"""Phase difference e in rad, and relative difference of amplitude, from which a model has lost the
motion: first order misses e^2/2 of the amplitude, 0.5 %."""
_CYCLE_SHARE: Final = 0.6
"""Part of a cycle's readings that must be present."""
_NOISE_SD: Final = 5.0
"""Standard deviations below which a cycle's phase and amplitude differences count as zero."""


class Alignment(NamedTuple):
    """Difference of the readings from a model in each cycle, shape (k,)."""

    log_ratio: FloatArray
    """Log ratio of the amplitudes."""
    phase: FloatArray
    """Phase by which the readings are ahead, rad, with whole turns."""
    middle: FloatArray
    """The model's phase in the middle of the cycle's readings, rad."""


_NO_CYCLES: Final = Alignment(np.zeros(0), np.zeros(0), np.zeros(0))
"""Where the motion has none that can be compared."""


def anchored(data: Data, at: Evaluated) -> tuple[float, float]:
    """Return a time near the beginning and the readings' phase then, with whole turns.

    The model must be in phase with the first cycles, as a start from turning points is.
    """
    _, phase, centre = alignment(data, at, data.residual(at.reading))
    if not len(phase):
        return float(at.sampled.time_s[0]), float(at.sampled.phase[0])
    when = float(np.interp(centre[0], at.sampled.phase, at.sampled.time_s))
    return when, float(centre[0] + phase[0])


def unwrapped(data: Data, at: Evaluated) -> tuple[FloatArray, float]:
    """Return readings minus model, linear in what changes amplitude and phase.

    In each cycle the readings are compared with the model's cosine and sine. The ratio of the
    amplitudes and the phase between them, unwrapped along the record, align the model with the
    readings. The residual is the difference from the aligned model plus the alignment times the
    model's derivatives: the difference for a model linear in amplitude and phase.

    Returns
    -------
    residual
        Shape (n,).
    max_phase_error_rad
        The largest phase difference of model and readings; 0 where it is obviously small.
    """
    if at.parts:
        parts = [unwrapped(one, part.at) for one, part in zip(data.each(), at.parts, strict=True)]
        return np.concatenate([part for part, _ in parts]), max(slip for _, slip in parts)
    difference = data.residual(at.reading)
    # Where all residuals are small, no cycle's phase can differ, but for whole turns.
    small = np.max(np.abs(difference) * data.weight) <= 0.5 * LARGE_PHASE_ERROR * np.min(
        at.sampled.amplitude
    )
    if small and abs(_turned(data, at)) < math.pi:
        return difference, 0.0
    log_ratio, phase, centre = alignment(data, at, difference)
    slip = float(np.max(np.abs(phase), initial=0.0))
    if slip < LARGE_PHASE_ERROR and np.max(np.abs(log_ratio), initial=0.0) < LARGE_PHASE_ERROR:
        return difference, slip
    sampled = at.sampled
    by_log = np.interp(sampled.phase, centre, log_ratio)
    by_phase = np.interp(sampled.phase, centre, phase)
    amplitude = sampled.motion.upwards * sampled.amplitude
    moved = amplitude * np.exp(by_log) * np.cos(sampled.phase + by_phase)
    omega = sampled.motion.angular_frequency
    linear = sampled.angle * by_log + sampled.velocity / omega * by_phase
    return difference + sampled.angle - moved + linear, slip


def _turned(data: Data, at: Evaluated) -> float:
    """Return the phase by which the readings are ahead at the anchor; 0 without an anchor."""
    if data.anchor is None:
        return 0.0
    when, turned = data.anchor
    return turned - float(np.interp(when, at.sampled.time_s, at.sampled.phase))


def alignment(data: Data, at: Evaluated, difference: FloatArray) -> Alignment:
    """Compare readings with a model cycle by cycle; empty if there are too few cycles.

    Parameters
    ----------
    data, at
        The readings, and the model at them.
    difference
        Result of `data.residual`, shape (n,).
    """
    sampled = at.sampled
    try:
        found = lock_in(difference + sampled.angle, data.weight, sampled, _CYCLE_SHARE)
    except np.linalg.LinAlgError:
        return _NO_CYCLES
    if len(found.number) < 2:
        return _NO_CYCLES
    phase = found.phase
    turns = np.round((phase[0] - _turned(data, at)) / (2.0 * math.pi))
    phase = phase - 2.0 * math.pi * turns
    ratio = np.log(np.maximum(np.hypot(found.cosine, found.sine), 1e-3))
    # Differences within the noise count as zero.
    chance = _NOISE_SD * data.noise_rms / np.sqrt(np.maximum(found.strength, 1e-300))
    phase = np.where(np.abs(phase) > chance, phase, 0.0)
    ratio = np.where(np.abs(ratio) > chance, ratio, 0.0)
    return Alignment(ratio, phase, found.middle)


SETTLED: Final = 0.02
"""Expected fall of chi^2 below which a step is the last."""
_LARGEST_RATIO: Final = 1.5
"""By which a scale (a time, a speed, a length) may change in one step."""
_LARGEST_CHANGE: Final = 0.05
"""Of the frequency in one step."""


_KEPT: Final = 100_000
"""Readings up to which fits keep motion and derivatives: 350 bytes each, in forty fits 1.4 GB."""


@dataclass(frozen=True)
class Evaluation(Squares):
    """A model evaluated at some values; shapes are those of `refine.Fit`.

    Parameters
    ----------
    value, residual
        Of the model, and what it leaves, whitened.
    at, max_phase_error_rad
        The model there, and the largest phase error.
    model, noise
        From which the Jacobian is computed when it is needed.
    """

    at: Evaluated
    max_phase_error_rad: float
    model: Model
    noise: Noise

    @property
    def unit(self) -> float:
        """The chi^2 that counts as 1: of one of the numbers that a misfit is described by."""
        return max(1.0, (self.chi2 - len(self.residual)) / _NUMBERS)

    @cached_property
    def columns(self) -> FloatArray:
        """The Jacobian."""
        columns = np.empty((len(self.residual), self.model.size), order="F")
        columns[:-1] = self.noise.whiten(self.at.jacobian)
        columns[-1:] = SHARES.rows(self.model.size)
        # If one part of b is held, changing b changes the share.
        columns[:, B] += self.model.share_by_b(self.value) * columns[:, SHARE]
        return columns

    def __getattr__(self, name: str) -> Evaluated:
        """The model evaluated again, where that was forgotten."""
        if name != "at":
            raise AttributeError(name)
        found = vars(self)["at"] = self.model.evaluate(self.value)
        return found

    def rest(self) -> None:
        """Forget, of very many readings, what can be computed again."""
        super().rest()
        if len(self.residual) > _KEPT:
            for name in ("at", "columns"):
                vars(self).pop(name, None)
            self.model.rest()


def _shapes(model: Model) -> list[int]:
    """Return the indices of the values on which the readings do not depend linearly."""
    return [
        index
        for effect, position in model.places()
        for index in range(
            position.start + (1 if effect.parameter_free else effect.sizes), position.stop
        )
    ]


ROUNDS: Final = 14
"""Largest number of steps of a fit."""
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
        held = [index for index in range(len(self.value)) if index not in self.free]
        normal = self.jacobian.T @ self.jacobian
        beyond = None if self.scatter is None else self.scatter - normal
        return covariance(normal + known_losses(self.value), held, beyond)


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


def span_of(columns: FloatArray, least: float = 1e-9) -> FloatArray:
    """Return an orthonormal basis of what columns span, but for a `least` part of the largest."""
    left, small, _ = scaled_qr(columns)
    mixing, sizes, _ = np.linalg.svd(small)
    return np.asarray(left @ mixing[:, sizes > least * sizes[0]])


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
    search = searching(model, data, noise, start, held=held)
    search.go(rounds, useful)
    return fitted(search)


def fitted(search: Search[Evaluation]) -> Fit:
    """The fit so far."""
    return Fit(search.here, tuple(search.free.tolist()), search.converged)


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
                begun.append(searching(model, data, noise, start, held=fixed))
                begun[-1].here.rest()
    for search in sorted(begun, key=lambda each: each.here.chi2):
        with suppress(NoMotionError, np.linalg.LinAlgError):
            search.go(ROUNDS, useful)
            found = better(found, fitted(search))
            if search.converged or search.hopeless or search.here.chi2 < useful < math.inf:
                break
    return found


def better(one: Fit | None, other: Fit | None) -> Fit | None:
    """Return the fit of the smaller chi^2; None where there is neither."""
    if one is None or other is None:
        return one or other
    return one if one.chi2 <= other.chi2 else other


def searching(
    model: Model,
    data: Data,
    noise: Noise,
    start: FloatArray,
    *,
    held: Iterable[int] = (),
    little: float = SETTLED,
) -> Search[Evaluation]:
    """Begin a search for the values of a model; parameters are those of `refine` and `Search`.

    Raises
    ------
    NoMotionError
        If the model can't be evaluated at the start.
    """
    bounds, shapes = Bounds(*model.bounds()), np.array(_shapes(model), dtype=np.int64)
    # A shape that must be positive is a scale: a speed, a time or a length.
    scales = shapes[bounds.lower[shapes] > 0.0]

    def at(value: FloatArray) -> Evaluation | None:
        value = model.settled(value)
        try:
            there = model.evaluate(value)
        except NoMotionError:
            return None
        difference, slip = unwrapped(data, there)
        residual = np.append(noise.whiten(difference), SHARES.residual(value))
        found = Evaluation(value, residual, there, slip, model, noise)
        return found if math.isfinite(found.chi2) else None

    def room(value: FloatArray) -> Bounds:
        """The readings are linear in a scale over a fraction of it at most.

        While an effect is still small the step in its scale is arbitrary.
        """
        low, high = (each.copy() for each in bounds)
        low[scales] = np.maximum(low[scales], value[scales] / _LARGEST_RATIO)
        high[scales] = np.minimum(high[scales], value[scales] * _LARGEST_RATIO)
        low[OMEGA] = max(low[OMEGA], (1.0 - _LARGEST_CHANGE) * value[OMEGA])
        high[OMEGA] = min(high[OMEGA], (1.0 + _LARGEST_CHANGE) * value[OMEGA])
        return Bounds(low, high).about(value)

    # Along the others, the frequency of a line or an instant, chi^2 has many minima.
    problem = Problem(at, bounds, room, places=np.setdiff1d(shapes, scales))
    fixed = {*held, *model.held()}
    try:
        return Search(problem, start, held=fixed, tolerance=SETTLED, little=little)
    except NoStartError:
        raise NoMotionError("its chi^2 is not finite") from None


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


CLEAN: Final = 1.3
"""chi^2 per reading up to which hardly more than noise is left: the noise itself is known much
better, from between the harmonics."""
GROSS: Final = 2.0
"""chi^2 per degree of freedom above which first-order scores are meaningless."""


def is_gross(fit: Fit, data: Data) -> bool:
    """Return whether a misfit is too large for a linear approximation."""
    return fit.chi2 > GROSS * data.used or loses_phase(fit)


def loses_phase(fit: Fit) -> bool:
    """Return whether a model is so far out of phase that first-order scores mean nothing."""
    return fit.max_phase_error_rad > LARGE_PHASE_ERROR


def fitted_from(
    model: Model, data: Data, noise: Noise, start: FloatArray, *, held: Iterable[int] = ()
) -> Fit | None:
    """Fit at once, and in a growing window where that loses the phase; return the better one."""
    fixed = tuple(held)
    fit = best_fit(model, data, noise, [start], held=fixed)
    if fit and fit.converged and not loses_phase(fit):
        return fit
    return better(fit, fit_in_growing_window(model, data, noise, start, held=fixed))


INCOMPLETE: Final = math.sqrt(CLEAN)
"""Residual over noise above which a model is incomplete."""


@dataclass(frozen=True)
class Remainder:
    """The misfit that remains.

    Parameters
    ----------
    excess
        chi^2 beyond the degrees of freedom; never negative.
    over_noise
        Square root of chi^2 per degree of freedom.
    numbers
        Number of independent numbers that describe it.
    shares
        Parts of `excess` in the offset, the amplitude and the phase of the motion, its higher
        harmonics, and between them.
    sizes
        Mean square of the numbers of each of these parts, in units of the noise's; 1 at least.
    """

    excess: float
    over_noise: float
    numbers: float = field(metadata={"json": "independent_numbers"})
    shares: Mapping[str, float] = field(default_factory=dict)
    sizes: tuple[float, ...] = ()

    @property
    def systematic(self) -> bool:
        """Whether the model is incomplete."""
        return self.over_noise > INCOMPLETE

    @property
    def error_scale(self) -> float:
        """Factor on standard deviations: 1 if only noise is left."""
        if not self.systematic:
            return 1.0
        return math.sqrt(max(self.excess / self.numbers, self.over_noise**2, 1.0))

    def as_json(self) -> dict[str, Any]:
        """Return its part of ``diagnosis.json``."""
        more = {"error_factor": self.error_scale, "systematic": self.systematic}
        return {**fields_of(self), **more}


def remainder_of(fit: Fit, data: Data, noise: Noise) -> Remainder:
    """Analyse a fit's residual by cycle and harmonic, and by its change over cycles."""
    freedom = max(data.used - len(fit.free), 1)
    excess = max(fit.chi2 - freedom, 0.0)
    over = math.sqrt(fit.chi2 / freedom)
    if over <= INCOMPLETE:
        return Remainder(excess, over, float(freedom))
    in_sds = data.residual(fit.at.reading) * data.weight / noise.sd
    left = misfit_of(in_sds, fit.at.sampled.phase)
    return Remainder(excess, over, min(left.numbers, float(freedom)), left.shares, left.sizes)


def with_errors(fit: Fit, data: Data, noise: Noise) -> Fit:
    """Return a fit with errors that allow for what it leaves beyond the noise (`misfit`)."""
    left = remainder_of(fit, data, noise)
    if not left.systematic:
        return replace(fit, error_scale=1.0, scatter=None)
    beyond = beyond_noise(fit.jacobian[:-1], fit.at.sampled.phase, left.sizes)
    scatter = fit.jacobian.T @ fit.jacobian + beyond
    return replace(fit, error_scale=left.error_scale, scatter=scatter)
