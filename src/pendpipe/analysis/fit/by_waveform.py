"""Eq. 8 on all the readings of a free decay, by Gauss-Newton with the engine's exact sensitivities.

How b divides into its two parts is not told: any share is as likely beforehand.

Rounded readings say only between which limits the angle lay. With noise of rms s before the
rounding, a reading r stands for the interval r -+ step/2, and its probability is
Phi((r + step/2 - m)/s) - Phi((r - step/2 - m)/s) for a model m. Where s is half a step or more
this is the usual chi^2 with variance s^2 + step^2/12; below, that would take the rounding for
random, which it is not, least of all in the tail.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.by_points import (
    clear,
    envelope_and_period,
    held_values,
    loss_rates_of,
    share_of,
)
from pendpipe.analysis.fit.least_squares import (
    Bounds,
    Minimum,
    Quadratic,
    covariance,
    intervals95,
    minimise,
)
from pendpipe.analysis.fit.period import TOP, Period, period_excess
from pendpipe.analysis.fit.result import Baseline, FitResult, Restoring, misfit, result_of
from pendpipe.analysis.noise import quantisation_rms, white_rms
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics import (
    Eq8,
    Release,
    sample,
    sample_with_jacobian,
    turning_points_with_jacobian,
)
from pendpipe.dynamics.eq8 import OFFSET, OMEGA, SHARE, START, TIME, A, B, C
from pendpipe.dynamics.kernel import kernel
from pendpipe.physics.decay import amplitude, time_at

ROOT_HALF = math.sqrt(0.5)
DENSITY = 1.0 / math.sqrt(2.0 * math.pi)
_FAR = 25.0
"""Standard deviations beyond which the tail's probability is taken from its series."""


@kernel()
def rounded(
    residual: FloatArray, half_step: float, noise: float, score: FloatArray, weight: FloatArray
) -> float:
    """Return -2 ln likelihood, and fill in its derivatives by the model.

    Parameters
    ----------
    residual
        Readings less model, shape (n,).
    half_step, noise
        Half the step of the readings; rms of the noise before the rounding.
    score, weight
        To be filled: d ln P/dm and -d^2 ln P/dm^2 (never negative), shape (n,).
    """
    total = 0.0
    for i in range(len(residual)):
        low, high = (residual[i] - half_step) / noise, (residual[i] + half_step) / noise
        # By symmetry the interval lies about zero or above it.
        sign = 1.0
        if low + high < 0.0:
            low, high, sign = -high, -low, -1.0
        if low > _FAR:
            # ln P ~ -low^2/2 - ln(low sqrt(2 pi)): the far limit adds nothing.
            total += low * low + 2.0 * math.log(low / DENSITY)
            score[i] = sign * (low + 1.0 / low) / noise
            weight[i] = (1.0 - 1.0 / low**2) / noise**2
            continue
        if low > 0.0:
            chance = 0.5 * (math.erfc(low * ROOT_HALF) - math.erfc(high * ROOT_HALF))
        else:
            chance = 0.5 * (math.erf(high * ROOT_HALF) - math.erf(low * ROOT_HALF))
        at_low = DENSITY * math.exp(-0.5 * low * low) / chance
        at_high = DENSITY * math.exp(-0.5 * high * high) / chance
        slope = at_low - at_high
        total -= 2.0 * math.log(chance)
        score[i] = sign * slope / noise
        weight[i] = max(slope * slope - low * at_low + high * at_high, 0.0) / noise**2
    return total


def best_noise(residual: FloatArray, step: float, start: float) -> float:
    """The most likely noise before the rounding, between step/25 and step.

    Its logarithm is where a parabola through the three best of nine has its vertex.
    """
    score, weight = np.empty_like(residual), np.empty_like(residual)

    def unlikely(logarithm: float) -> float:
        return float(rounded(residual, 0.5 * step, math.exp(logarithm), score, weight))

    grid = np.linspace(math.log(0.04 * step), math.log(max(step, 2.0 * start)), 9)
    costs = [unlikely(each) for each in grid.tolist()]
    best = min(max(int(np.argmin(costs)), 1), 7)
    before, least, after = costs[best - 1 : best + 2]
    bend = before - 2.0 * least + after
    turn = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return math.exp(grid[best] + min(max(turn, -1.0), 1.0) * (grid[1] - grid[0]))


BOUNDS: Final = Bounds(
    np.array([0.0, 0.0, 0.0, 0.0, 1e-12, -np.inf, -np.inf, -np.inf]),
    np.array([np.inf] * 3 + [1.0] + [np.inf] * 4),
)
_PIECE: Final = 1 << 18
"""Readings whose Jacobian is in memory at a time: 16 MB."""
PRIOR_SHARE: Final = 0.5
PRIOR_INVERSE: Final = 12.0
"""Anything from 0 to 1 is as likely: mean 1/2, variance 1/12."""
_SLIGHT: Final = 0.1
"""Of chi^2 in a half cycle: a smaller misfit is not seen in the noise."""
_BY_SHARE: Final = 0.5 - 4.0 / 3.0 + math.pi**2 / 8.0
"""(omega/b)^2 times the relative lengthening of the period by the square of b's hysteretic share
(`by_points.period_excess`)."""
_ENDS: Final = 10.0
"""By which the square of a phase's change is greater at the record's end than its mean."""


@dataclass(frozen=True)
class Waveform:
    """chi^2 of the readings against Eq. 8.

    Parameters
    ----------
    time_s, values
        The readings, shape (n,).
    noise_rms
        Standard deviation of one.
    step
        The step of readings whose rounding is not random (see above); `noise_rms` is
        then that before the rounding. Zero: the readings scatter as `noise_rms` says.
    restoring
        The restoring torque.
    split
        What is told of b's parts: ``"hysteretic"`` or ``"viscous"`` with its rate (1/s)
        held fixed; empty when the share is marginalised over its prior.
    """

    time_s: FloatArray
    values: FloatArray
    noise_rms: float
    split: Mapping[str, float]
    step: float = 0.0
    restoring: Restoring = "linear"

    def model(self, value: FloatArray) -> tuple[Eq8, Release]:
        """What moves, and from where, for a set of parameters."""
        a, b, c, share, omega, angle, time, offset = value.tolist()
        told = share_of(self.split, b, "eq8")
        share = share if told is None else told
        law = Eq8(omega, a, share * b, (1.0 - share) * b, c, self.restoring)
        return law, Release(time, angle, offset)

    def residual(self, value: FloatArray) -> FloatArray:
        """Readings less model, shape (n,)."""
        return self.values - sample(*self.model(value), self.time_s)

    def predict_remaining(
        self, value: FloatArray, trial: FloatArray, quadratic: Quadratic, promised: float
    ) -> float:
        """Predict what chi^2 a Gauss-Newton step leaves to be gained (too high rather than low).

        The model is as linear as the motion stays what it was: where the step changes it by a part
        e, rms, it is wrong by about e of itself. And what `curved` makes up for is known to first
        order in b/omega. Infinite where the residuals from which the step begins would not do for
        those at its end.
        """
        omega, b = float(trial[OMEGA]), float(trial[B])
        half_cycles = omega * float(self.time_s[-1] - self.time_s[0]) / np.pi
        if self.step != 0.0 or promised > _SLIGHT * half_cycles:
            return np.inf
        signal = len(self.values) * float(np.var(self.values)) / self.noise_rms**2
        slower = _BY_SHARE * b**3 / omega**2 * float(trial[SHARE] - value[SHARE]) ** 2
        at_ends = _ENDS * promised**2 / signal
        return at_ends + float(quadratic.normal[OMEGA, OMEGA]) * slower**2

    def curved(self, value: FloatArray, step: FloatArray) -> FloatArray:
        """Return where a step ends: omega makes up for the square of what b's share changes."""
        end = value + step
        if step[OMEGA] != 0.0:  # else it is held
            end[OMEGA] += _BY_SHARE * value[B] ** 2 / value[OMEGA] * step[SHARE] ** 2
        return end

    def evaluate(self, value: FloatArray) -> Quadratic:
        """chi^2, gradient and normal matrix, summed over pieces of the record."""
        refused = Quadratic(np.inf, np.zeros(8), np.eye(8))
        model, release = self.model(value)
        turns = model.angular_frequency * (self.time_s[-1] - release.time_s) / np.pi
        # Of more half cycles than two a reading nothing is seen, and they would never end.
        lost = not turns < 2.0 * len(self.values) or not np.isfinite(model.stop_rad)
        if release.time_s > self.time_s[0] or lost:
            return refused
        chi2, gradient, normal = 0.0, np.zeros(8), np.zeros((8, 8))
        for first in range(0, len(self.values), _PIECE):
            piece = slice(first, first + _PIECE)
            try:
                angle, jacobian = sample_with_jacobian(model, release, self.time_s[piece])
            except ValueError:
                # Overdamped: far from anything that turns.
                return refused
            left, weight = self.values[piece] - angle, self.noise_rms**-2
            if self.step == 0.0:
                chi2 += weight * float(left @ left)
                gradient += weight * (jacobian.T @ left)
                normal += weight * (jacobian.T @ jacobian)
            else:
                score, weights = np.empty_like(left), np.empty_like(left)
                chi2 += float(rounded(left, 0.5 * self.step, self.noise_rms, score, weights))
                gradient += jacobian.T @ score
                normal += jacobian.T @ (jacobian * weights[:, None])
        # From the engine's parameters to ours; and the prior.
        change, off = self.change(value), float(value[SHARE]) - PRIOR_SHARE
        gradient, normal = change.T @ gradient, change.T @ normal @ change
        gradient[SHARE] -= PRIOR_INVERSE * off
        normal[SHARE, SHARE] += PRIOR_INVERSE
        return Quadratic(chi2 + PRIOR_INVERSE * off**2, gradient, normal)

    def change(self, value: FloatArray) -> FloatArray:
        """Derivative of the engine's parameters by ours, shape (8, 8)."""
        # What is told of one part of b leaves its changes to the other.
        told = [part in self.split for part in ("hysteretic", "viscous")]
        share = float(told[1]) if any(told) else float(value[SHARE])
        by_share = 0.0 if any(told) else float(value[B])
        change = np.zeros((8, 8))
        change[[0, 3, 4, 5, 6, 7], [A, C, OMEGA, START, TIME, OFFSET]] = 1.0
        change[1:3, B] = share, 1.0 - share
        change[1:3, SHARE] = by_share, -by_share
        return change


_SLIP: Final = 0.7
"""Phase in rad by which the law's turning points may part from the measured ones."""
_SLIPPED: Final = (
    "the period changes with the amplitude or the time as Eq. 8's does not:"
    " {:.2g} rad of phase along the record"
)
_STOP: Final = 6.0
"""In widths delta = pi c/(2 omega) of the Coulomb stop: amplitudes below are left out."""


class Start(NamedTuple):
    """Where the search begins."""

    value: FloatArray
    before: int
    """Half cycles from the release to the first turning point kept."""
    warnings: tuple[str, ...]


def start_values(
    points: TurningPoints,
    held: Mapping[str, float],
    fixed: Mapping[str, float],
    baseline: Baseline,
    restoring: Restoring = "linear",
) -> Start:
    """Turn a fit of the turning points into the waveform's eight parameters.

    The release is a turning point before the first reading (a virtual one, if need be),
    unless the amplitude is held: then it is the first turning point itself. So it is with sin x:
    there may be none before it below pi.
    """
    points = points if restoring == "linear" else clear(points)
    omega = 2.0 * math.pi * fixed["frequency"] if "frequency" in fixed else None
    parts = loss_rates_of(fixed, points.apparent_frequency_hz)
    envelope, period, share = envelope_and_period(
        points, held, parts, fixed, baseline, restoring, start=True
    )
    a, b, c, y0, level = (float(number) for number in envelope.value)
    # What is not known to a fraction of a radian accuses nobody.
    late = period.late_rad[period.angular_frequency * points.time_sd_s < 0.2]
    slipped = omega is None and np.max(np.abs(late), initial=0.0) > _SLIP
    middle_share = 0.5 if share is None else share
    angle, time, before = _release(
        points,
        (a, b, c, y0),
        middle_share,
        period,
        at_first="amplitude" in fixed or restoring == "sine",
    )
    if restoring == "sine":
        angle = math.copysign(min(abs(angle), TOP), angle)
    offset = float(np.mean(points.level_rad)) - level
    value = np.array([a, b, c, middle_share, period.angular_frequency, angle, time, offset])
    return Start(value, before, (_SLIPPED.format(np.ptp(late)),) if slipped else ())


def _release(
    points: TurningPoints,
    values: tuple[float, float, float, float],
    share: float,
    period: Period,
    *,
    at_first: bool,
) -> tuple[float, float, int]:
    """Angle and time of the release, and half cycles from it to the first turning point."""
    a, b, c, y0 = values
    omega, first_s = period.angular_frequency, period.time_s
    side = float(points.side[0])
    if at_first:
        return side * y0, first_s, 0
    half_period = math.pi / omega
    before = max(1, math.ceil((first_s - points.start_s) / half_period + 0.05))
    earlier, back = y0, 0.0
    for step in range(before):
        last = earlier
        earlier = float(amplitude(-(step + 1.0) * half_period, y0, a, b, c))
        if not earlier < 1.5 * last:
            earlier = last * math.exp(min((a * last + b + c / last) * half_period, 0.4))
        middle = np.array([0.5 * (last + earlier)])
        back += half_period * (1.0 + float(period_excess(middle, omega, a, b, c, share)[0]))
    return side * (-1.0) ** before * earlier, first_s - back, before


def usable_span(samples: Samples, points: TurningPoints, start: Start) -> slice:
    """The readings that are compared: while the motion is seen, and not about the stop.

    Where Coulomb friction has stopped the pendulum is a discontinuous function of the
    parameters; so the last half cycles before the stop are left out.
    """
    a, b, c, _, omega, _, time, _ = start.value.tolist()
    half_period = math.pi / omega
    first = time + 0.05 * half_period if start.before == 0 else samples.time_s[0]
    last = float(points.time_s[-1]) + 0.5 * half_period
    width = 0.5 * half_period * c
    y0, end = abs(float(points.angle_rad[0])), abs(float(points.angle_rad[-1]))
    if 0.0 < _STOP * width < y0 and end < 2.0 * _STOP * width:
        last = min(last, float(points.time_s[0]) + float(time_at(_STOP * width, y0, a, b, c)))
    least = float(points.time_s[min(3, len(points) - 1)])
    begin = int(np.searchsorted(samples.time_s, first))
    return slice(begin, int(np.searchsorted(samples.time_s, max(last, least), side="right")))


_DITHERED: Final = 0.4
"""Noise over step from which the rounding is as good as random."""
_TOLERANCE: Final = 1e-2
"""Of chi^2: a last step of a tenth of a standard deviation, which leaves far less."""
_ROUNDS: Final = 2


class _Fitted(NamedTuple):
    problem: Waveform
    minimum: Minimum
    held: tuple[int, ...]
    start: Start


def fit_waveform(
    samples: Samples,
    points: TurningPoints,
    *,
    baseline: Baseline = "eq8",
    fixed: Mapping[str, float] | None = None,
    restoring: Restoring = "linear",
) -> FitResult:
    """Fit Eq. 8 to the readings, starting from the turning points.

    Parameters
    ----------
    samples
        The readings (`pendpipe.analysis.turning_points.measure.prepare`).
    points
        Their turning points.
    baseline
        ``"eq8"``, or ``"viscous"`` for Eq. 3.
    fixed
        Parameters that are held, by name.

    restoring
        ``"linear"`` (Eq. 8), or ``"sine"``: the torque of sin x.

    Returns
    -------
    FitResult
        Without ``cuts`` and ``provenance``, which the caller knows.

    Notes
    -----
    The motion is started at a turning point before the first reading, so that every reading
    counts; with sin x, at the first turning point, since there may be none before it below pi.
    b is one parameter; how it divides into hysteretic and viscous is marginalised: any share from
    0 to 1 is as likely beforehand.
    """
    fixed = fixed or {}
    held_rates, parts = held_values(fixed, baseline, points.apparent_frequency_hz)
    held = _held(held_rates, fixed, parts, baseline)
    start = start_values(points, held_rates, fixed, baseline, restoring)
    span = usable_span(samples, points, start)
    problem = Waveform(
        samples.time_s[span],
        samples.values[span],
        points.noise_rms_rad,
        parts,
        restoring=restoring,
    )
    minimum = minimise(
        problem.evaluate,
        start.value,
        BOUNDS,
        held=held,
        tolerance=_TOLERANCE,
        predict_remaining=problem.predict_remaining,
        curved=problem.curved,
    )
    fitted = _refined(_Fitted(problem, minimum, held, start), samples)
    return _result(fitted, samples, points, baseline, fixed)


def _result(
    fitted: _Fitted,
    samples: Samples,
    points: TurningPoints,
    baseline: Baseline,
    fixed: Mapping[str, float],
) -> FitResult:
    """Judge what the fit has left; return the result."""
    residual = fitted.problem.residual(fitted.minimum.value)
    dof = len(residual) - 8 + len(fitted.held)
    noise, slow = judge_noise(samples, points, residual, fitted.problem)
    rms = math.sqrt(float(residual @ residual) / len(residual))
    chi2_per_dof = rms**2 * len(residual) / dof / noise**2
    # What rounding leaves is slow by nature; its likelihood knows that already.
    random = fitted.problem.step == 0.0
    stretched = max(misfit(chi2_per_dof, dof), slow if random else 1.0)
    # The search weighed the readings by its own first guess of the noise.
    scale = ((fitted.problem.noise_rms / noise) ** 2 if random else 1.0) / stretched
    value, matrix, ends = _numbers(fitted, scale, float(samples.time_s[0]))
    times = fitted.problem.time_s
    inside = (points.time_s >= times[0]) & (points.time_s <= times[-1])
    return result_of(
        value,
        matrix,
        ends,
        fitted.held,
        points.chosen(inside),
        fitted.problem.model(fitted.minimum.value)[0],
        stretched=stretched,
        said=fitted.start.warnings,
        fixed=fixed,
        method="waveform",
        baseline=baseline,
        noise_rms_rad=noise,
        residual_rms_rad=rms,
        chi2_per_dof=chi2_per_dof,
        samples=len(residual),
        turning_points=len(points),
        settled=fitted.minimum.converged,
    )


def _refined(fitted: _Fitted, samples: Samples) -> _Fitted:
    """Take the rounding for what it is, where noise does not make it random.

    Only where Eq. 8 describes the readings to within the step: else every misfit would be
    blamed on the rounding.
    """
    step, problem, value = samples.step, fitted.problem, fitted.minimum.value
    if step is None:
        return fitted
    residual = problem.residual(value)
    rms = math.sqrt(float(residual @ residual) / len(residual))
    if not rms < math.hypot(_DITHERED, math.sqrt(1.0 / 12.0)) * step:
        return fitted
    for _ in range(_ROUNDS):
        noise = best_noise(problem.residual(value), step, 0.1 * step)
        problem = replace(problem, noise_rms=noise, step=step)
        minimum = minimise(
            problem.evaluate,
            value,
            BOUNDS,
            held=fitted.held,
            tolerance=_TOLERANCE,
            curved=problem.curved,
        )
        if not math.isfinite(minimum.quadratic.chi2):
            return fitted
        value = minimum.value
    return fitted._replace(problem=problem, minimum=minimum)


def _held(
    held_rates: Mapping[str, float],
    fixed: Mapping[str, float],
    parts: Mapping[str, float],
    baseline: Baseline,
) -> tuple[int, ...]:
    """Indices of what is not fitted."""
    index = {"a": A, "b": B, "c": C, "amplitude": START, "offset": OFFSET}
    held = [index[name] for name in held_rates]
    if "frequency" in fixed:
        held.append(OMEGA)
    if parts or baseline == "viscous" or held_rates.get("b") == 0.0:
        held.append(SHARE)
    return tuple(held)


def _numbers(
    fitted: _Fitted, scale: float, start_s: float
) -> tuple[FloatArray, FloatArray, list[tuple[float, float]]]:
    """The seven parameters, their covariance, and the intervals of a, b, c."""
    value, held = fitted.minimum.value, fitted.held
    quadratic = fitted.minimum.quadratic
    normal, gradient = quadratic.normal * scale, quadratic.gradient * scale
    normal[SHARE, SHARE] += (1.0 - scale) * PRIOR_INVERSE
    (amplitude, phase), jacobian = _first_turning_point(fitted, start_s)
    own = covariance(normal, held)
    frequency = 0.5 * value[OMEGA] / math.pi
    numbers = np.array([*value[:3], frequency, amplitude, phase, value[OFFSET]])
    ends = intervals95(value, normal, gradient, BOUNDS, range(3), held, own)
    return numbers, jacobian @ own @ jacobian.T, ends


def _first_turning_point(fitted: _Fitted, start_s: float) -> tuple[tuple[float, float], FloatArray]:
    """Amplitude at the first turning point kept, phase at the first reading; derivatives.

    Returns
    -------
    amplitude_and_phase
        In rad.
    jacobian
        Of the seven parameters of the result by ours, shape (7, 8).
    """
    value = fitted.minimum.value
    model, release = fitted.problem.model(value)
    count = fitted.start.before + 1
    turning, by_time, by_angle = turning_points_with_jacobian(model, release, count)
    change = fitted.problem.change(value)
    late, high = by_time[-1] @ change, by_angle[-1] @ change
    time, side = float(turning.time_s[-1]), math.copysign(1.0, release.angle_rad)
    side *= -1.0 if fitted.start.before % 2 else 1.0
    omega = float(value[OMEGA])
    amplitude = side * (float(turning.angle_rad[-1]) - release.offset_rad)
    jacobian = np.zeros((7, 8))
    jacobian[0, 0] = jacobian[1, 1] = jacobian[2, 2] = jacobian[6, OFFSET] = 1.0
    jacobian[3, OMEGA] = 0.5 / math.pi
    jacobian[4] = side * high
    jacobian[4, OFFSET] -= side
    jacobian[5] = -omega * late
    jacobian[5, OMEGA] += start_s - time
    phase = omega * (start_s - time) + (0.0 if side > 0 else math.pi)
    return (amplitude, math.remainder(phase, 2.0 * math.pi)), jacobian


_CHANCE: Final = 5.0
_COARSE: Final = 12.0
"""Readings in a half cycle below which differences would see the motion's own misfit."""


def judge_noise(
    samples: Samples, points: TurningPoints, residual: FloatArray, problem: Waveform
) -> tuple[float, float]:
    """Estimate the noise from what the fit leaves.

    The white part comes from fourth differences, which a slow misfit cannot touch, and is
    never taken below step/sqrt(12). What a, b, c suffer from is the noise at the motion's
    own frequency: drifts and misfits show there as scatter of the half cycles' residual
    amplitudes.

    Returns
    -------
    rms
        Of one reading.
    slow
        Variance of the half cycles' amplitudes over what white noise makes of it; 1 where chance
        explains the difference.
    """
    floor = quantisation_rms(samples.step)
    per_half_cycle = len(residual) / max(len(points), 1)
    if samples.counts or per_half_cycle < _COARSE:
        rms = points.noise_rms_rad
    else:
        rms = white_rms(residual)
    largest = max(float(problem.values.max()), -float(problem.values.min()))
    rms = max(rms, floor, 1e-15 * largest)
    return rms, _slow_noise(points, residual, problem.time_s, rms)


def _slow_noise(points: TurningPoints, residual: FloatArray, time: FloatArray, rms: float) -> float:
    """Scatter of the residual's amplitude in each half cycle against white noise's.

    Each is the residual's product with a parabola that vanishes at the middles between
    turning points (a half wave, near enough), over the root of the parabola's square.
    """
    middles = 0.5 * (points.time_s[1:] + points.time_s[:-1])
    edges = np.searchsorted(time, middles)
    readings = np.diff(edges)
    if len(middles) < 10 or readings.min() < 3:
        return 1.0
    ratio = _mean_square(middles, edges, time, residual) / rms**2
    return ratio if ratio > 1.0 + _CHANCE * math.sqrt(2.0 / len(readings)) else 1.0


@kernel(any_order=True)
def _mean_square(
    middles: FloatArray, edges: IntArray, time_s: FloatArray, residual: FloatArray
) -> float:
    """Return the mean square of the half cycles' residual amplitudes; see `_slow_noise`."""
    total = 0.0
    for k in range(middles.size - 1):
        inverse, product, square = 1.0 / (middles[k + 1] - middles[k]), 0.0, 0.0
        for i in range(edges[k], edges[k + 1]):
            share = (time_s[i] - middles[k]) * inverse
            parabola = share * (1.0 - share)
            product += residual[i] * parabola
            square += parabola * parabola
        total += product * product / square
    return total / (middles.size - 1)
