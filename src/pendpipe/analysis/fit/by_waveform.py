"""Eq. 8 on all the readings of a free decay: chi^2, the search, its laws and the result.

`start` says where it begins; the derivatives are the engine's exact ones. How b divides into its
two parts is a parameter with a prior.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Final, NamedTuple, cast

import numpy as np

from pendpipe.analysis.demodulation import normal_equations
from pendpipe.analysis.fit.fitted import Agreement, Baseline, DragForm, Form, view
from pendpipe.analysis.fit.fixed import Held
from pendpipe.analysis.fit.goodness import Goodness, Left, combined, judge
from pendpipe.analysis.fit.result import FitResult, result_of
from pendpipe.analysis.fit.rounding import rounded
from pendpipe.analysis.fit.start import Start, start_values, usable_span
from pendpipe.analysis.misfit import beyond_noise
from pendpipe.analysis.noise import before_rounding, scatter
from pendpipe.analysis.torque import TOP
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import turning_points_with_jacobian
from pendpipe.dynamics.eq8 import BASELINE, OFFSET, OMEGA, SHARE, START, TIME, A, B, C, Restoring
from pendpipe.dynamics.eq8_model import (
    DRIFT,
    LOWER,
    SHARES,
    UPPER,
    Eq8Model,
    Followed,
    Seen,
    known_losses,
)
from pendpipe.estimate import Estimate
from pendpipe.quantities import with_error
from pendpipe.solve import (
    AS_PROMISED,
    Bounds,
    Minimum,
    NoStartError,
    Problem,
    Quadratic,
    Summed,
    covariance,
    intervals95,
    minimise,
)

_PIECE: Final = 1 << 18
"""Readings whose Jacobian is in memory at a time: 16 MB."""
_WINDOW: Final = 256
"""Readings whose Jacobian stays in the processor's nearest cache: 18 kB."""
_DITHERED: Final = 0.4
"""Noise over step from which the rounding is as good as random."""
_TOLERANCE: Final = 1e-2
"""Of chi^2: a last step of a tenth of a standard deviation, which leaves far less."""
_ROUNDS: Final = 2
"""Times that the noise before rounding and the fit follow each other."""
_MOST: Final = 12
"""Minima at most until the noise is their own."""
_OTHER: Final = 0.9
"""Of the noise that was weighed with: below, the minimum was not looked for closely enough."""
_EXACT: Final = 1e-10
"""Of the largest reading, as exactly as `dynamics` computes a motion: no less is taken as noise."""
_DRIFTS: Final = 1e-4
"""Probability of the level's answers below which a straight drift of the zero is fitted."""
_CLEAR_DRIFT: Final = 5.0
"""Standard deviations from which it stays."""
ODDS: Final = math.log(1000.0)
"""Logarithm of the likelihood ratio from which one of two laws is believed."""


@dataclass(frozen=True)
class Waveform(Eq8Model):
    """chi^2 of the readings against Eq. 8, with that of the share's prior.

    Parameters
    ----------
    values
        The readings, shape (n,).
    noise_rms
        Standard deviation of one.
    step
        The step of readings whose rounding is not random (see `rounding`); `noise_rms` is
        then that before the rounding. Zero: the readings scatter as `noise_rms` says.
    """

    values: FloatArray
    noise_rms: float
    step: float = 0.0
    _residuals: list[tuple[FloatArray, FloatArray]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    @property
    def bounds(self) -> Bounds:
        """Of the nine parameters: the start is before all readings, with sin x below the top."""
        low, high = np.append(LOWER, -np.inf), np.append(UPPER, np.inf)
        high[TIME] = self.time_s[0]
        if self.restoring == "sine":
            low[START], high[START] = -TOP, TOP
        return Bounds(low, high)

    def residual(self, value: FloatArray) -> FloatArray:
        """Readings less model, shape (n,)."""
        last = self._residuals
        if not (last and np.array_equal(last[0][0], value)):
            self.quadratic(value)
        return last[0][1]

    def _pieces(self, value: FloatArray) -> Iterator[tuple[slice, Followed]]:
        """The model along the record, piece by piece."""
        for first in range(0, len(self.values), _PIECE):
            piece = slice(first, first + _PIECE)
            yield piece, Followed(self, value, self.time_s[piece])

    def _has_motion(self, value: FloatArray) -> bool:
        """Whether there is a motion from before the readings on, and one that they can show."""
        try:
            law, release = self.motion_of(value)
        except ValueError:
            return False
        turns = law.angular_frequency * (self.time_s[-1] - release.time_s) / np.pi
        # Of more half cycles than two a reading nothing is seen, and they would never end.
        seen = turns < 2.0 * len(self.values) and bool(np.isfinite(law.stop_rad))
        return seen and release.time_s <= self.time_s[0]

    def at(self, value: FloatArray) -> Summed | None:
        """chi^2 at some values; None where nothing moves, or it is overdamped."""
        # Nearly every step is taken, and the next one needs the derivatives there.
        try:
            there = self.quadratic(value) if self._has_motion(value) else None
        except ValueError:
            return None
        if there is None or not math.isfinite(there.chi2):
            return None
        return Summed(value, there.chi2, lambda _: there, len(self.values))

    def deviance(self, residual: FloatArray) -> float:
        """Return -2 ln likelihood of some residuals."""
        if self.step == 0.0:
            return float(residual @ residual) / self.noise_rms**2
        unused = np.empty_like(residual), np.empty_like(residual)
        return float(rounded(residual, 0.5 * self.step, self.noise_rms, *unused))

    def quadratic(self, value: FloatArray) -> Quadratic:
        """chi^2, gradient and normal matrix, summed over pieces of the record."""
        chi2, slope, normal = 0.0, np.zeros(len(value)), np.zeros((len(value), len(value)))
        left = []
        for piece, there in self._pieces(value):
            reading, jacobian = there.by_engine
            residual = self.values[piece] - reading
            left.append(residual)
            if self.step == 0.0:
                # Windows that stay in the nearest cache: BLAS takes half as long again.
                sums = normal_equations(jacobian.T, residual, np.arange(0, len(residual), _WINDOW))
                part, (gram, score) = (
                    float(residual @ residual),
                    (each.sum(axis=0) for each in sums),
                )
            else:
                pull, weights = np.empty_like(residual), np.empty_like(residual)
                part = rounded(residual, 0.5 * self.step, self.noise_rms, pull, weights)
                gram, score = jacobian.T @ (jacobian * weights[:, None]), jacobian.T @ pull
            chi2, slope, normal = chi2 + part, slope + score, normal + gram
        self._residuals[:] = [(value.copy(), np.concatenate(left))]
        unit = self.noise_rms**-2 if self.step == 0.0 else 1.0
        chi2, slope, normal = unit * chi2, unit * slope, unit * normal
        prior, row = SHARES.residual(value), SHARES.rows(len(value))
        slope = self.by_values(value, slope)
        normal = self.by_values(value, self.by_values(value, normal).T)
        return Quadratic(chi2 + float(prior @ prior), slope + row.T @ prior, normal + row.T @ row)


@dataclass(frozen=True)
class Fitted:
    """A law at its minimum.

    Parameters
    ----------
    problem, minimum
        What was minimised, and where.
    held
        Indices that were not fitted.
    start
        Where the search began.
    """

    problem: Waveform
    minimum: Minimum[Summed]
    held: tuple[int, ...]
    start: Start

    value = cast("FloatArray", view("minimum.point.value", "The nine parameters."))
    chi2 = cast("float", view("minimum.point.chi2", "In units of the noise that was weighed with."))

    @property
    def noise_rms(self) -> float:
        """What the fit leaves, as if all of it were noise."""
        if self.problem.step:
            return self.problem.noise_rms
        freedom = len(self.problem.values) - 9 + len(self.held)
        return self.problem.noise_rms * scatter(max(self.chi2, 1e-300), freedom)

    def better_by(self, other: Fitted) -> float:
        """Logarithm of the likelihood over another law's, the noise being the better fit's.

        It is that of the readings to which both were fitted: where a law ends, and so what is
        seen of its motion, is its own.
        """
        first = max(each.problem.time_s[0] for each in (self, other))
        last = min(each.problem.time_s[-1] for each in (self, other))
        own, others = (each.chi2_between(first, last) for each in (self, other))
        if self.problem.step or other.problem.step:
            return 0.5 * (others - own)
        own, others = own * self.problem.noise_rms**2, others * other.problem.noise_rms**2
        return 0.5 * (others - own) / min(self.noise_rms, other.noise_rms) ** 2

    def quadratic(self, goodness: Goodness | None = None) -> Quadratic:
        """Chi^2 there, for the noise that a test of fit found.

        Of rounded readings the likelihood has its own noise. What is known of the share beforehand
        is as it was, and that no loss is more than the whole.
        """
        noise = goodness.noise_rms if goodness else self.noise_rms
        scale = 1.0 if self.problem.step else (self.problem.noise_rms / noise) ** 2
        chi2, gradient, normal = self.minimum.point.quadratic
        of_share = SHARES.rows(len(self.value))
        known = of_share.T @ of_share
        normal = scale * (normal - known) + known + known_losses(self.value)
        return Quadratic(scale * chi2, scale * gradient, normal)

    def chi2_between(self, first_s: float, last_s: float) -> float:
        """Chi^2 of the readings of a span."""
        problem = self.problem
        if first_s <= problem.time_s[0] and problem.time_s[-1] <= last_s:
            return self.chi2
        inside = (problem.time_s >= first_s) & (problem.time_s <= last_s)
        return problem.deviance(problem.residual(self.value)[inside])


class Forms(NamedTuple):
    """A law with the likelier form of its drag, its test of fit, and with the other form."""

    fitted: Fitted
    goodness: Goodness
    other: Fitted | None


def fitted_waveform(
    samples: Samples,
    points: TurningPoints,
    *,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    restoring: Restoring = "linear",
    length_m: float | None = None,
) -> Forms | None:
    """Fit Eq. 8 to the readings, starting from the turning points.

    Parameters
    ----------
    samples
        The readings (`pendpipe.analysis.turning_points.measure.prepare`).
    points
        The turning points of the angle.
    baseline
        ``"eq8"``, or ``"viscous"`` for Eq. 3.
    fixed
        Parameters that are held, by name.
    restoring
        ``"linear"`` (Eq. 8), or ``"sine"``: the torque of sin x.
    length_m
        The length of a pendulum whose position is read.

    Returns
    -------
    Forms
        None where no motion of the law comes near the readings.

    Notes
    -----
    The motion is started at a turning point before the first reading, so that every reading
    counts; with sin x and a large amplitude at the first turning point, since there may be none
    before it below pi. b is one parameter, and its hysteretic share another, with a prior.
    """
    fixed_values = Held(fixed or {}, baseline, points.apparent_frequency_hz)
    held = fixed_values.places
    start = start_values(points, fixed_values, restoring, samples=samples)
    span = usable_span(samples, points, start.value, at_release=start.before == 0)
    seen: Seen = "position" if length_m else "rate" if samples.unit == "rad/s" else "angle"
    problem = Waveform(
        samples.time_s[span],
        samples.values[span],
        points.noise_rms_rad,
        parts=fixed_values.parts,
        restoring=restoring,
        seen=seen,
        length_m=length_m or 1.0,
    )
    found = _settled(_fitted(problem, start.value, (*held, DRIFT), start), samples)
    if not math.isfinite(found.chi2):
        return None
    forms = _with_drag(found, samples, points)
    if OFFSET in held or combined(forms.goodness.p_values[:2]) >= _DRIFTS:
        return forms
    drifting = _settled(_fitted(problem, found.value, held, start), samples)
    if not drifting.minimum.converged:
        return forms
    sd = math.sqrt(covariance(drifting.quadratic().normal, held)[DRIFT, DRIFT])
    is_clear = abs(float(drifting.value[DRIFT])) > _CLEAR_DRIFT * sd
    return _with_drag(drifting, samples, points) if is_clear else forms


def _with_drag(found: Fitted, samples: Samples, points: TurningPoints) -> Forms:
    """Ask for the other form of the drag: a step from the first one's minimum tells how likely."""
    own = cache(partial(_judged, found, samples, points))
    without = found.value[A] <= 0.0
    if A in found.held or not found.minimum.converged or (without and own().misfit == 1.0):
        return Forms(found, own(), None)
    begun = found.start.value if without else found.value
    other = replace(found.problem, drag="speed")
    speed = _fitted(other, begun, found.held, found.start, found.chi2)
    if speed.better_by(found) > -ODDS or own().misfit > 1.0:
        speed = _settled(speed, samples)
    if not speed.minimum.converged:
        return Forms(found, own(), None)
    if speed.better_by(found) < 0.0:
        return Forms(found, own(), speed)
    return Forms(speed, _judged(speed, samples, points), found)


def _fitted(
    problem: Waveform,
    value: FloatArray,
    held: tuple[int, ...],
    start: Start,
    bar: float | None = None,
) -> Fitted:
    """Minimise chi^2 from a value on, as far as it may be better than a rival's.

    A release that is a half period earlier would be another turning point.
    """
    low, high = problem.bounds
    low[TIME] = value[TIME] - math.pi / value[OMEGA]
    try:
        minimum = minimise(
            Problem(problem.at, Bounds(low, high), moved=problem.curved),
            value,
            held=held,
            tolerance=_TOLERANCE,
            trust=AS_PROMISED,
            useful=math.inf if bar is None else bar,
        )
    except NoStartError:
        minimum = Minimum(Summed(value, math.inf, problem.quadratic), converged=False)
    return Fitted(problem, minimum, held, start)


def _settled(found: Fitted, samples: Samples) -> Fitted:
    """Minimise until noise and rounding are those of the minimum."""
    for _ in range(_MOST):
        problem = found.problem
        if not math.isfinite(found.chi2):
            return found
        # Below what motions are computed to, rounding errors would lead the search.
        exact = _EXACT * float(np.max(np.abs(problem.values)))
        if not exact < found.noise_rms < _OTHER * problem.noise_rms:
            break
        problem = replace(problem, noise_rms=found.noise_rms)
        found = _fitted(problem, found.value, found.held, found.start)
    return _rounded(found, samples)


def _judged(fitted: Fitted, samples: Samples, points: TurningPoints) -> Goodness:
    """Noise and test of fit of what a minimum leaves."""
    value, held, problem = fitted.value, fitted.held, fitted.problem
    at_bound = [j for j in (A, B, C) if j not in held and value[j] <= 0.0]
    lines = 2 - (OFFSET in held) - (DRIFT in held)
    free = 9 - len({*held, *at_bound, SHARE, OFFSET, DRIFT})
    largest = float(np.max(np.abs(problem.values)))
    # Angles are positive at even numbers; their rates are a quarter of a cycle ahead.
    first = float(points.side[0] < 0.0) - points.half_cycle[0] + 0.5 * (problem.seen == "rate")
    return judge(
        problem.time_s,
        problem.residual(value),
        points.time_s,
        points.half_cycle + first,
        fitted=free,
        lines=lines,
        amplitude=points.amplitude_rad * problem.amplitude_scale(value),
        step=samples.step,
        floor=_EXACT * largest,
    )


def _rounded(fitted: Fitted, samples: Samples) -> Fitted:
    """Take the rounding for what it is, where noise does not make it random.

    Only where Eq. 8 describes the readings to within the step: else every misfit would be
    blamed on the rounding.
    """
    step, problem, found = samples.step, fitted.problem, fitted
    dithered = math.hypot(_DITHERED, math.sqrt(1.0 / 12.0))
    if step is None or problem.step or not fitted.noise_rms < dithered * step:
        return fitted
    free = 9 - len(fitted.held)
    for _ in range(_ROUNDS):
        left = problem.residual(found.value)
        noise = before_rounding(scatter(float(left @ left), len(left) - free), step)
        problem = replace(problem, noise_rms=noise, step=step)
        found = _fitted(problem, found.value, found.held, found.start)
        if not math.isfinite(found.chi2):
            return fitted
    return found


def waveform_result(
    forms: Forms,
    samples: Samples,
    points: TurningPoints,
    baseline: Baseline,
    fixed: Mapping[str, float],
) -> FitResult:
    """Put the numbers of the likelier form of the drag together, with errors that cover both."""
    fitted, goodness, other = forms
    problem, start_s = fitted.problem, float(samples.time_s[0])
    value, ends, by_own = _numbers(fitted, goodness, start_s)
    own = _covariance(fitted, goodness)
    matrix = by_own @ own @ by_own.T
    form: DragForm = problem.drag
    if other is not None and fitted.better_by(other) < ODDS:
        form = "undecided"
        others, other_ends, _ = _numbers(other, goodness, start_s)
        apart = others - value
        apart[5] = math.remainder(apart[5], math.tau)
        matrix = matrix + np.outer(apart, apart)
        pairs = zip(ends, other_ends, strict=True)
        ends = [(min(one[0], two[0]), max(one[1], two[1])) for one, two in pairs]
    residual = problem.residual(fitted.value)
    times = problem.time_s
    inside = (points.time_s >= times[0]) & (points.time_s <= times[-1])
    drift, said = None, [*fitted.start.warnings]
    if DRIFT not in fitted.held:
        sd = math.sqrt(own[DRIFT, DRIFT])
        drift = Estimate(float(fitted.value[DRIFT]), sd, f"{samples.unit}/s")
        per = with_error(drift.value, drift.sd, drift.unit, short=True)
        said.append(f"the zero drifts by {per}; it is followed by a line")
    return result_of(
        value,
        matrix,
        ends,
        fitted.held,
        points.chosen(inside),
        problem.motion_of(fitted.value)[0],
        goodness=goodness,
        said=said,
        fixed=fixed,
        form=Form(baseline, drag_form=form, zero_drift=drift),
        agreement=Agreement(
            residual_rms_rad=math.sqrt(float(residual @ residual) / len(residual)),
            samples=len(residual),
            turning_points=len(points),
            # A motion that has lost its phase has no frequency of its own, or none that moves.
            settled=fitted.minimum.converged
            and value[4] > 0.0
            and (OMEGA in fitted.held or matrix[3, 3] > 0.0),
        ),
        method="waveform",
        minimum=(problem.eq8, fitted.value[: len(BASELINE)].copy()),
    )


def _numbers(
    fitted: Fitted, goodness: Goodness, start_s: float
) -> tuple[FloatArray, list[tuple[float, float]], FloatArray]:
    """The seven parameters, the intervals of a, b, c, and derivatives of the seven by ours."""
    value, bounds = fitted.value, fitted.problem.bounds
    _, gradient, normal = fitted.quadratic(goodness)
    (amplitude, phase), jacobian = _first_turning_point(fitted, start_s)
    numbers = np.array([*value[:3], value[OMEGA] / math.tau, amplitude, phase, value[OFFSET]])
    ends = intervals95(value, normal, gradient, bounds, range(3), fitted.held)
    return numbers, ends, jacobian


def _covariance(fitted: Fitted, goodness: Goodness) -> FloatArray:
    """Covariance of our nine parameters, by the noise and by what the law misses."""
    left, noise = goodness.left, goodness.noise_rms
    beyond = None if left is None else _beyond_noise(fitted, left, noise)
    return covariance(fitted.quadratic(goodness).normal, fitted.held, beyond)


def _beyond_noise(fitted: Fitted, left: Left, noise_rms: float) -> FloatArray:
    """What a misfit adds to the covariance of the gradient, shape (9, 9)."""
    rows = Followed(fitted.problem, fitted.value, left.time_s).jacobian
    rows *= np.sqrt(left.readings)[:, None] / noise_rms
    return beyond_noise(rows, left.phase, left.sizes)


def _first_turning_point(fitted: Fitted, start_s: float) -> tuple[tuple[float, float], FloatArray]:
    """Amplitude at the first turning point kept, phase at the first reading; derivatives.

    Returns
    -------
    amplitude_and_phase
        In rad.
    jacobian
        Of the seven parameters of the result by ours, shape (7, 9).
    """
    value = fitted.value
    model, release = fitted.problem.motion_of(value)
    count = fitted.start.before + 1
    turning, by_time, by_angle = turning_points_with_jacobian(model, release, count)
    late, high = fitted.problem.by_values(value, np.stack([by_time[-1], by_angle[-1]]))
    time, side = float(turning.time_s[-1]), math.copysign(1.0, release.angle_rad)
    side *= -1.0 if fitted.start.before % 2 else 1.0
    omega = float(value[OMEGA])
    amplitude = side * (float(turning.angle_rad[-1]) - release.offset_rad)
    jacobian = np.zeros((7, 9))
    jacobian[0, 0] = jacobian[1, 1] = jacobian[2, 2] = jacobian[6, OFFSET] = 1.0
    jacobian[3, OMEGA] = 0.5 / math.pi
    jacobian[4, :DRIFT] = side * high
    jacobian[4, OFFSET] -= side
    jacobian[5, :DRIFT] = -omega * late
    jacobian[5, OMEGA] += start_s - time
    phase = omega * (start_s - time) + (0.0 if side > 0 else math.pi)
    return (amplitude, math.remainder(phase, 2.0 * math.pi)), jacobian
