"""Eq. 8 on all the readings of a free decay, by Gauss-Newton with the engine's exact sensitivities.

How b divides into its two parts is not told: any roots of them are as likely beforehand.

Rounded readings say only between which limits the angle lay. With noise of rms s before the
rounding, a reading r stands for the interval r -+ step/2, and its probability is
Phi((r + step/2 - m)/s) - Phi((r - step/2 - m)/s) for a model m. Where s is half a step or more
this is the usual chi^2 with variance s^2 + step^2/12; below, that would take the rounding for
random, which it is not, least of all in the tail.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from pendpipe.analysis.fit.by_points import (
    envelope_and_period,
    held_values,
    loss_rates_of,
    share_of,
)
from pendpipe.analysis.fit.goodness import Goodness, combined, judge
from pendpipe.analysis.fit.least_squares import (
    AS_PROMISED,
    Bounds,
    Minimum,
    Quadratic,
    covariance,
    intervals95,
    minimise,
)
from pendpipe.analysis.fit.period import Period
from pendpipe.analysis.fit.result import Baseline, DragForm, FitResult, result_of
from pendpipe.analysis.torque import TOP, Apart, clear, period_excess, swing_phase
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import (
    Eq8,
    Release,
    sample,
    sample_with_jacobian,
    turning_points_with_jacobian,
)
from pendpipe.dynamics.eq8 import OFFSET, OMEGA, PLACES, SHARE, START, TIME, A, B, C, Restoring
from pendpipe.dynamics.kernel import kernel
from pendpipe.estimate import Estimate
from pendpipe.physics.decay import amplitude, time_at
from pendpipe.quantities import with_error

Drag = Literal["energy", "speed"]
Seen = Literal["angle", "rate", "position"]

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


DRIFT: Final = 8
"""Behind the engine's eight: by how much the zero rises in a second."""
BOUNDS: Final = Bounds(
    np.array([0.0, 0.0, 0.0, 0.0, 1e-12, -np.inf, -np.inf, -np.inf, -np.inf]),
    np.array([np.inf] * 3 + [1.0] + [np.inf] * 5),
)
_PIECE: Final = 1 << 18
"""Readings whose Jacobian is in memory at a time: 16 MB."""
_BY_SHARE: Final = 0.5 - 4.0 / 3.0 + math.pi**2 / 8.0
"""(omega/b)^2 times the relative lengthening of the period by the square of b's hysteretic share
(`by_points.period_excess`)."""
_BESIDE: Final = 2e-3
"""Phase between the two motions that tell the velocity: 1e-13 of it is lost in the sixth power."""


@dataclass(frozen=True)
class Waveform:
    """chi^2 of the readings against Eq. 8.

    Parameters
    ----------
    time_s, values
        The readings, shape (n,).
    noise_rms
        Standard deviation of one.
    split
        What is told of b's parts: ``"hysteretic"`` or ``"viscous"`` with its rate (1/s)
        held fixed; empty when the share is marginalised.
    step
        The step of readings whose rounding is not random (see above); `noise_rms` is
        then that before the rounding. Zero: the readings scatter as `noise_rms` says.
    restoring, drag
        The law's restoring torque, and the form of its drag.
    seen
        What is read: the angle, its rate, or a position L sin x.
    length_m
        L of a position.
    """

    time_s: FloatArray
    values: FloatArray
    noise_rms: float
    split: Mapping[str, float]
    step: float = 0.0
    restoring: Restoring = "linear"
    drag: Drag = "energy"
    seen: Seen = "angle"
    length_m: float = 1.0
    _last: list[tuple[FloatArray, FloatArray, FloatArray]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )
    _left: list[tuple[FloatArray, FloatArray]] = field(
        default_factory=list, init=False, repr=False, compare=False
    )

    def model(self, value: FloatArray) -> tuple[Eq8, Release]:
        """What moves, and from where, for a set of parameters."""
        a, b, c, share, omega, angle, time, offset = value[:DRIFT].tolist()
        told = share_of(self.split, b, "eq8")
        share = share if told is None else told
        law = Eq8(omega, a, share * b, (1.0 - share) * b, c, self.restoring)
        if self.drag == "speed":
            law = replace(law, drag="speed")
        return law, Release(time, angle, offset if self.seen == "angle" else 0.0)

    @property
    def bounds(self) -> Bounds:
        """Of the nine parameters: the start is before all readings, with sin x below the top."""
        low, high = BOUNDS.lower.copy(), BOUNDS.upper.copy()
        high[TIME] = self.time_s[0]
        if self.restoring == "sine":
            low[START], high[START] = -TOP, TOP
        return Bounds(low, high)

    def _zero(self, value: FloatArray, time_s: FloatArray) -> FloatArray | float:
        """What the zero adds beyond the engine's offset."""
        middle = 0.5 * float(self.time_s[0] + self.time_s[-1])
        drift = value[DRIFT] * (time_s - middle) if value[DRIFT] != 0.0 else 0.0
        return drift if self.seen == "angle" else drift + value[OFFSET]

    def residual(self, value: FloatArray) -> FloatArray:
        """Readings less model, shape (n,)."""
        if not (self._left and np.array_equal(self._left[0][0], value)):
            self._left[:] = [(value.copy(), self._residual(value))]
        return self._left[0][1]

    def _residual(self, value: FloatArray) -> FloatArray:
        model, release = self.model(value)
        if self.seen == "rate":
            pieces = range(0, len(self.time_s), _PIECE)
            times = [self.time_s[first : first + _PIECE] for first in pieces]
            found = np.concatenate([self.read(value, each)[0] for each in times])
            return np.asarray(self.values - found)
        # Before it is let go it is held; a search that got there is no minimum, but has a residual.
        angle = sample(model, release, np.maximum(self.time_s, release.time_s))
        read = self.length_m * np.sin(angle) if self.seen == "position" else angle
        return np.asarray(self.values - read - self._zero(value, self.time_s))

    def _has_motion(self, value: FloatArray) -> bool:
        """Whether there is a motion from before the readings on, and one that they can show."""
        try:
            model, release = self.model(value)
        except ValueError:
            return False
        turns = model.angular_frequency * (self.time_s[-1] - release.time_s) / np.pi
        # Of more half cycles than two a reading nothing is seen, and they would never end.
        seen = turns < 2.0 * len(self.values) and bool(np.isfinite(model.stop_rad))
        return seen and release.time_s <= self.time_s[0]

    def chi2(self, value: FloatArray) -> float:
        """What `evaluate` has, without the derivatives."""
        try:
            left = self.residual(value) if self._has_motion(value) else None
        except ValueError:
            left = None
        return math.inf if left is None else self.unlikely(left)

    def unlikely(self, left: FloatArray) -> float:
        """Return -2 ln likelihood of some residuals."""
        if self.step == 0.0:
            return float(left @ left) / self.noise_rms**2
        unused = np.empty_like(left), np.empty_like(left)
        return float(rounded(left, 0.5 * self.step, self.noise_rms, *unused))

    def read(self, value: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Readings of the law, shape (n,), and their derivatives by the engine's parameters.

        The motion depends on the time since its release alone, so that its rate is the derivative
        by the release's time, with the other sign.
        """
        model, release = self.model(value)
        if self.seen != "rate":
            reading, jacobian = sample_with_jacobian(model, release, time_s)
            if self.seen == "position":
                slope = self.length_m * np.cos(reading)
                reading, jacobian = self.length_m * np.sin(reading), jacobian * slope[:, None]
                jacobian[:, -1] = 1.0
            return reading + self._zero(value, time_s), jacobian
        beside = _BESIDE / model.angular_frequency
        earlier = replace(release, time_s=release.time_s - beside)
        later = replace(release, time_s=release.time_s + beside)
        after, by_after = sample_with_jacobian(model, earlier, time_s)
        before, by_before = sample_with_jacobian(model, later, time_s)
        jacobian = (by_after - by_before) / (2.0 * beside)
        # Both means of the rate miss it by its second derivative, one by three times the other.
        mean = -0.5 * (by_after[:, -2] + by_before[:, -2])
        rate = 1.5 * (after - before) / (2.0 * beside) - 0.5 * mean
        jacobian[:, -1] = 1.0
        return rate + self._zero(value, time_s), jacobian

    def curved(self, value: FloatArray, step: FloatArray) -> FloatArray:
        """Return where a step ends: omega makes up for the square of what b's share changes."""
        end = value + step
        if step[OMEGA] != 0.0:  # else it is held
            end[OMEGA] += _BY_SHARE * value[B] ** 2 / value[OMEGA] * step[SHARE] ** 2
        return end

    def evaluate(self, value: FloatArray) -> Quadratic:
        """chi^2, gradient and normal matrix, summed over pieces of the record."""
        refused = Quadratic(np.inf, np.zeros(len(value)), np.eye(len(value)))
        if not self._has_motion(value):
            return refused
        chi2, gradient, normal = 0.0, np.zeros(8), np.zeros((8, 8))
        by_drift, drifts = np.zeros(8), np.zeros(2)
        middle = 0.5 * float(self.time_s[0] + self.time_s[-1])
        for first in range(0, len(self.values), _PIECE):
            piece = slice(first, first + _PIECE)
            try:
                reading, jacobian = self.read(value, self.time_s[piece])
            except ValueError:
                # Overdamped: far from anything that turns.
                return refused
            left, weights = self.values[piece] - reading, None
            if self.step == 0.0:
                chi2 += self.noise_rms**-2 * float(left @ left)
                score = left
            else:
                score, weights = np.empty_like(left), np.empty_like(left)
                chi2 += float(rounded(left, 0.5 * self.step, self.noise_rms, score, weights))
            weighted = jacobian if weights is None else jacobian * weights[:, None]
            late = self.time_s[piece] - middle
            gradient += jacobian.T @ score
            normal += jacobian.T @ weighted
            by_drift += weighted.T @ late
            own = late if weights is None else late * weights
            drifts += float(late @ score), float(late @ own)
        if self.step == 0.0:
            unit = self.noise_rms**-2
            gradient, normal = unit * gradient, unit * normal
            by_drift, drifts = unit * by_drift, unit * drifts
        full, slope = np.zeros((9, 9)), np.zeros(9)
        full[:DRIFT, :DRIFT], slope[:DRIFT] = normal, gradient
        full[DRIFT, :DRIFT] = full[:DRIFT, DRIFT] = by_drift
        slope[DRIFT], full[DRIFT, DRIFT] = drifts
        self._last[:] = [(value.copy(), slope, full)]
        change = self.change(value)
        return Quadratic(chi2, change.T @ slope, change.T @ full @ change)

    def by_parts(self, value: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gradient and normal matrix by the engine's parameters, the two parts of b among them.

        The readings are as good as linear in these, however far the share goes.
        """
        at, gradient, normal = self._last[0]
        return gradient - normal @ (self.parts(value) - self.parts(at)), normal

    def parts(self, value: FloatArray) -> FloatArray:
        """Return a, both parts of b, c, omega, the start's angle and time, offset and drift."""
        law, release = self.model(value)
        start = release.angle_rad, release.time_s, value[OFFSET], value[DRIFT]
        return np.array([*law.rates(), law.angular_frequency, *start])

    def parts_of_b(self, share: float) -> tuple[float, float]:
        """How a change of b goes to its parts: what is told of one leaves it to the other."""
        if self.split:
            share = float("viscous" in self.split)
        return share, 1.0 - share

    def change(self, value: FloatArray) -> FloatArray:
        """Derivative of the engine's parameters by ours, shape (9, 9)."""
        by_share = 0.0 if self.split else float(value[B])
        change = np.zeros((9, 9))
        change[[0, 3, 4, 5, 6, 7, 8], [A, C, OMEGA, START, TIME, OFFSET, DRIFT]] = 1.0
        change[1:3, B] = self.parts_of_b(float(value[SHARE]))
        change[1:3, SHARE] = by_share, -by_share
        return change


_SLIP: Final = 0.7
"""Phase in rad by which the law's turning points may part from the measured ones."""
_SLIPPED: Final = (
    "the period changes with the amplitude or the time as Eq. 8's does not:"
    " {:.2g} rad of phase along the record"
)
_HIGH: Final = 2.0
"""Amplitude in rad beyond which no turning point before the first is looked for with sin x."""
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
    *,
    samples: Samples | None = None,
) -> Start:
    """Turn a fit of the turning points into the waveform's eight parameters.

    The release is a turning point before the first reading (a virtual one, if need be),
    unless the amplitude is held: then it is the first turning point itself. So it is with sin x
    where the one before would be so large that there may be none below pi.
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
        restoring,
        at_first="amplitude" in fixed,
    )
    if restoring == "sine":
        angle = math.copysign(min(abs(angle), TOP), angle)
    # The level is that of the readings, its error that of angles.
    angles = samples is None or samples.unit == points.unit
    offset = fixed.get("offset", float(np.mean(points.level_rad)) - (level if angles else 0.0))
    value = np.array([a, b, c, middle_share, period.angular_frequency, angle, time, offset])
    return Start(value, before, (_SLIPPED.format(np.ptp(late)),) if slipped else ())


def _release(
    points: TurningPoints,
    values: tuple[float, float, float, float],
    share: float,
    period: Period,
    restoring: Restoring,
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
        if restoring == "sine" and earlier > _HIGH:
            return side * y0, first_s, 0
        lasts = float(swing_phase(np.array([earlier, last]), restoring)[0]) / omega
        middle = np.array([0.5 * (last + earlier)])
        back += lasts * (1.0 + float(period_excess(middle, omega, a, b, c, share)[0]))
    return side * (-1.0) ** before * earlier, first_s - back, before


def usable_span(samples: Samples, points: TurningPoints, start: Start) -> slice:
    """The readings that are compared: while the motion is seen, and not about the stop.

    Where Coulomb friction has stopped the pendulum is a discontinuous function of the
    parameters; so the last half cycles before the stop are left out.
    """
    a, b, c, _, omega, _, time, *_ = start.value.tolist()
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
_SAME: Final = 1.01
"""Of a noise: within, errors are the same."""
_SETTLED: Final = 0.1
"""Standard deviations by which the mean share may change when the others have followed it."""
_SHARES: Final = 33
"""Shares at which the likelihood is looked at, in a range that narrows until some of them count."""
_ENOUGH: Final = 8
_UNLIKELY: Final = 0.02
"""Of the most likely, below which a share does not count."""
_LEAST: Final = 1e-60
_SUBSETS: Final = np.array(list(product((1.0, 0.0), repeat=3)))
"""Of a, b, c that are not at their bound."""
_SLACK: Final = 1e-12
_RIDGE: Final = 1e-13
"""For what the readings do not tell apart."""
_ZOOMS: Final = 12
_MOST: Final = 12
_OTHER: Final = 0.9
"""Of the noise that was weighed with: below, the minimum was not looked for closely enough."""
_DRIFTS: Final = 1e-4
"""Probability of the level's answers below which a straight drift of the zero is fitted."""
_CLEAR_DRIFT: Final = 5.0
"""Standard deviations from which it stays."""
ODDS: Final = math.log(1000.0)
"""Logarithm of the likelihood ratio from which one of two laws is believed."""


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
    shared
        The average over b's share there, where it was taken.
    """

    problem: Waveform
    minimum: Minimum
    held: tuple[int, ...]
    start: Start
    shared: _Shared | None = None

    @property
    def value(self) -> FloatArray:
        """The nine parameters."""
        return self.minimum.value

    @property
    def chi2(self) -> float:
        """Of the readings, in units of the noise that was weighed with."""
        return self.minimum.quadratic.chi2

    @property
    def noise_rms(self) -> float:
        """What the fit leaves, as if all of it were noise."""
        if self.problem.step:
            return self.problem.noise_rms
        freedom = max(len(self.problem.values) - 9 + len(self.held), 1)
        return self.problem.noise_rms * math.sqrt(max(self.chi2, 1e-300) / freedom)

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

    def rival(self, value: FloatArray, **law: Any) -> Fitted:
        """Another law beside this one: of the same readings and noise, at the share they favour."""
        problem = replace(self.problem, **law)
        minimum = _minimised(problem, value, self.held, self.chi2)
        return replace(self, problem=problem, minimum=minimum, shared=None)

    def with_torque(self, restoring: Restoring, points: TurningPoints, apart: Apart) -> Fitted:
        """The other torque's motion that is most like this one."""
        value, linear = self.value.copy(), restoring == "linear"
        wide, late = (apart.pace, apart.late) if linear else (math.pi, -apart.late)
        value[TIME] = points.time_s[0] + (late - self.start.before * wide) / value[OMEGA]
        value[OMEGA] *= math.pi / apart.pace if linear else apart.pace / math.pi
        return self.rival(value, restoring=restoring)

    def chi2_between(self, first_s: float, last_s: float) -> float:
        """Chi^2 of the readings of a span."""
        problem = self.problem
        if first_s <= problem.time_s[0] and problem.time_s[-1] <= last_s:
            return self.chi2
        inside = (problem.time_s >= first_s) & (problem.time_s <= last_s)
        return problem.unlikely(problem.residual(self.value)[inside])


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
    before it below pi. b is one parameter; how it divides into hysteretic and viscous is
    marginalised, the roots of both as likely beforehand.
    """
    fixed = fixed or {}
    held_rates, parts = held_values(fixed, baseline, points.apparent_frequency_hz)
    held = held_places(held_rates, fixed, parts, baseline)
    start = start_values(points, held_rates, fixed, baseline, restoring, samples=samples)
    span = usable_span(samples, points, start)
    seen: Seen = "position" if length_m else "rate" if samples.unit == "rad/s" else "angle"
    problem = Waveform(
        samples.time_s[span],
        samples.values[span],
        points.noise_rms_rad,
        parts,
        restoring=restoring,
        seen=seen,
        length_m=length_m or 1.0,
    )
    first = np.append(start.value, 0.0)

    def fitted(value: FloatArray, held: tuple[int, ...]) -> Fitted:
        return _settled(Fitted(problem, _at_share(problem, value, held), held, start), samples)

    found = fitted(first, (*held, DRIFT))
    if not math.isfinite(found.chi2):
        return None
    forms = _with_drag(found, first, samples, points)
    if OFFSET in held or combined(forms.goodness.p_values[:2]) >= _DRIFTS:
        return forms
    drifting = fitted(found.value, held)
    clear_drift = drifting.minimum.converged and _drifts(drifting)
    return _with_drag(drifting, first, samples, points) if clear_drift else forms


def _with_drag(found: Fitted, first: FloatArray, samples: Samples, points: TurningPoints) -> Forms:
    """Ask for the other form of the drag: a step from the first one's minimum tells how likely."""
    goodness = _judged(found, samples, points)
    without, plain = found.value[A] <= 0.0, goodness.enlarged == 1.0
    if A in found.held or not found.minimum.converged or (without and plain):
        return Forms(found, goodness, None)
    speed = found.rival(first if without else found.value, drag="speed")
    if not plain or speed.better_by(found) > -ODDS:
        speed = _settled(speed, samples)
    if not speed.minimum.converged:
        return Forms(found, goodness, None)
    if speed.better_by(found) < 0.0:
        return Forms(found, goodness, speed)
    return Forms(speed, _judged(speed, samples, points), found)


def _drifts(fitted: Fitted) -> bool:
    """Whether the zero's drift is clear."""
    sd = math.sqrt(_over_shares(fitted).covariance[DRIFT, DRIFT])
    return abs(float(fitted.value[DRIFT])) > _CLEAR_DRIFT * sd


def _minimised(
    problem: Waveform, value: FloatArray, held: tuple[int, ...], bar: float = math.inf
) -> Minimum:
    return minimise(
        problem.evaluate,
        value,
        problem.bounds,
        held=held,
        tolerance=_TOLERANCE,
        chi2=problem.chi2,
        curved=problem.curved,
        bar=bar,
    )


def _at_share(problem: Waveform, value: FloatArray, held: tuple[int, ...]) -> Minimum:
    return _minimised(problem, value, (*held, SHARE))


def _settled(found: Fitted, samples: Samples) -> Fitted:
    """Minimise until noise, rounding and share are those of the minimum."""
    settled = SHARE in found.held
    for _ in range(_MOST):
        problem = found.problem
        if not math.isfinite(found.chi2):
            return found
        if found.noise_rms < _OTHER * problem.noise_rms:
            problem = replace(problem, noise_rms=found.noise_rms)
        elif settled:
            break
        else:
            found = _at_mean_share(found)
            if settled := found.shared is not None:
                continue
        minimum = _at_share(problem, found.value, found.held)
        found = replace(found, problem=problem, minimum=minimum, shared=None)
        settled = SHARE in found.held
    return _rounded(found, samples)


def _at_mean_share(found: Fitted) -> Fitted:
    """Move to where the share is what the readings expect of it.

    Without `shared` where chi^2 is not as expected there: it is to be minimised from there.
    """
    minimum, problem, shared = found.minimum, found.problem, _over_shares(found)
    step = shared.value - minimum.value
    if abs(step[SHARE]) <= _SETTLED * math.sqrt(shared.covariance[SHARE, SHARE]):
        return replace(found, shared=shared)
    at = problem.bounds.clip(problem.curved(minimum.value, step))
    expected = minimum.quadratic.chi2 + shared.chi2
    settled = minimum.converged and abs(problem.chi2(at) - expected) < AS_PROMISED
    there = Minimum(at, minimum.quadratic._replace(chi2=expected), minimum.converged)
    return replace(found, minimum=there, shared=shared if settled else None)


def _judged(fitted: Fitted, samples: Samples, points: TurningPoints) -> Goodness:
    """Noise and test of fit of what a minimum leaves."""
    value, held, problem = fitted.value, fitted.held, fitted.problem
    at_bound = [j for j in (A, B, C) if j not in held and value[j] <= 0.0]
    lines = 2 - (OFFSET in held) - (DRIFT in held)
    free = 9 - len({*held, *at_bound, SHARE, OFFSET, DRIFT})
    largest = float(np.max(np.abs(problem.values)))
    return judge(
        problem.time_s,
        problem.residual(value),
        points.time_s,
        points.half_cycle.astype(np.float64),
        fitted=free,
        lines=lines,
        amplitude=points.amplitude_rad,
        step=samples.step,
        floor=1e-15 * largest,
    )


class _Shared(NamedTuple):
    """The parameters where b's hysteretic share is what the readings expect of it.

    Any roots of both parts are as likely beforehand (Jeffreys' prior of rates): one part alone is
    no rarity.
    """

    value: FloatArray
    """Shape (9,), the share among them."""
    covariance: FloatArray
    """With what the unknown share adds, shape (9, 9)."""
    gradient: FloatArray
    """Of -chi^2/2 at the mean share, shape (9,)."""
    chi2: float
    """Above the fit's."""


def _over_shares(fitted: Fitted, noise_rms: float | None = None, enlarged: float = 1.0) -> _Shared:
    """Average over the share: at each the others are at their bounded minimum."""
    losses = _Losses.of(fitted, noise_rms or fitted.noise_rms, enlarged)
    low, high = (0.0, 0.5 * math.pi) if SHARE not in fitted.held else (0.0, 0.0)
    for _ in range(_ZOOMS):
        arc = np.linspace(low, high, _SHARES if low < high else 1)
        shares = np.sin(arc) ** 2 if low < high else fitted.value[[SHARE]]
        found = losses.at(shares)
        # At a share b counts as wide as it is known.
        width = np.sqrt(np.maximum(found.covariance[:, B, B], _LEAST))
        likely = width * np.exp(0.5 * (found.chi2.min() - found.chi2))
        likely /= likely.max()
        inside = np.flatnonzero(likely > _UNLIKELY)
        if len(inside) >= min(_ENOUGH, len(shares)):
            break
        first, last = max(int(inside[0]) - 1, 0), min(int(inside[-1]) + 1, _SHARES - 1)
        low, high = float(arc[first]), float(arc[last])
    likely[[0, -1]] *= 0.5
    likely /= likely.sum()
    share = float(likely @ shares)
    return losses.averaged(share, losses.at(np.array([share])), shares, found, likely)


def _shared_of(fitted: Fitted, goodness: Goodness) -> _Shared:
    """The average for the noise that was found, and what enlarges it."""
    same = goodness.enlarged == 1.0 and goodness.noise_rms < _SAME * fitted.noise_rms
    if same and fitted.shared is not None:
        return fitted.shared
    return _over_shares(fitted, goodness.noise_rms, goodness.enlarged)


class _AtShares(NamedTuple):
    """At k shares: steps of a, b, c to their bounded minimum, and what they leave."""

    step: FloatArray
    """Shape (k, 3)."""
    parts: FloatArray
    """Steps of a, both parts of b, and c, shape (k, 4)."""
    change: FloatArray
    """Of the latter by the former, shape (k, 4, 3)."""
    chi2: FloatArray
    """Above the fit's, shape (k,)."""
    covariance: FloatArray
    """Of a, b, c, shape (k, 3, 3)."""
    gradient: FloatArray
    """Of -chi^2/2, shape (k, 3)."""


@dataclass(frozen=True)
class _Losses:
    """Chi^2 as a function of the losses alone, all else at its minimum."""

    fitted: Fitted
    value: FloatArray
    free: FloatArray
    """Which of a, b, c are fitted, 1 or 0."""
    normal: FloatArray
    gradient: FloatArray
    """Of a, both parts of b, c, all else following, shapes (4, 4) and (4,)."""
    rest: list[int]
    """What else is fitted."""
    following: FloatArray
    """Derivative of the rest by the four, shape (r, 4)."""
    own: FloatArray
    """Covariance of the rest at known losses, shape (r, r)."""
    settling: FloatArray
    """What the rest moves by at the same losses, shape (r,)."""

    @classmethod
    def of(cls, fitted: Fitted, noise_rms: float, enlarged: float) -> _Losses:
        """Eliminate what is no loss."""
        problem, value, held = fitted.problem, fitted.value, fitted.held
        gradient, normal = problem.by_parts(value)
        scale = (1.0 if problem.step else (problem.noise_rms / noise_rms) ** 2) / enlarged
        gradient, normal = gradient * scale, normal * scale
        rest = [j for j in range(OMEGA, DRIFT + 1) if j not in held]
        size = 1.0 / np.sqrt(np.maximum(normal[rest, rest], _LEAST))
        within = normal[np.ix_(rest, rest)] * size[:, None] * size + _RIDGE * np.eye(len(rest))
        own = np.linalg.inv(within) * size[:, None] * size
        following, settling = -own @ normal[rest, :4], own @ gradient[rest]
        # Of what is known at all: what the rest leaves of it may be rounding.
        ridge = np.diag(_RIDGE * normal.diagonal()[:4] + _LEAST)
        return cls(
            fitted,
            value,
            np.array([float(j not in held) for j in (A, B, C)]),
            ridge + normal[:4, :4] + normal[:4, rest] @ following,
            gradient[:4] - normal[:4, rest] @ settling,
            rest,
            following,
            own,
            settling,
        )

    def at(self, shares: FloatArray) -> _AtShares:
        """Minimise over a, b, c within their bounds at each share."""
        value, change = self.value, np.zeros((len(shares), 4, 3))
        change[:, [0, 3], [A, C]] = 1.0
        change[:, 1:3, B] = [self.fitted.problem.parts_of_b(share) for share in shares.tolist()]
        # Only the parts of b differ, by as much as each other.
        off = np.zeros((len(shares), 4))
        off[:, 1] = value[B] * (shares - value[SHARE])
        off[:, 2] = -off[:, 1]
        normal = change.swapaxes(1, 2) @ self.normal @ change
        gradient = np.einsum("kqp,kq->kp", change, self.gradient - off @ self.normal)
        step = _not_negative(normal, gradient, value[:3], self.free)
        off += np.einsum("kpq,kq->kp", change, step)
        chi2 = np.einsum("kp,pq,kq->k", off, self.normal, off) - 2.0 * off @ self.gradient
        y = abs(float(value[START]))
        loss = float(value[A]) * y + float(value[B]) + float(value[C]) / y
        # No loss is more than the whole.
        whole = np.array([y, 1.0, 1.0 / y]) ** 2 / max(loss**2, 1e-200)
        both = np.outer(self.free, self.free)
        spread = np.linalg.inv((normal + np.diag(whole)) * both + np.diag(1.0 - self.free)) * both
        left = gradient - np.einsum("kpq,kq->kp", normal, step)
        return _AtShares(step, off, change, chi2, spread, left)

    def averaged(
        self,
        share: float,
        mean: _AtShares,
        shares: FloatArray,
        found: _AtShares,
        weight: FloatArray,
    ) -> _Shared:
        """All parameters at the mean share, and what theirs at the others scatter."""
        others = found.parts @ self.following.T + self.settling
        (own,), (settled,) = mean.step, mean.parts @ self.following.T + self.settling
        best, matrix, gradient = self.value.copy(), np.zeros((9, 9)), np.zeros(9)
        best[:3], best[SHARE], gradient[:3] = best[:3] + own, share, mean.gradient[0]
        best[self.rest] += settled
        places = [*range(3), *self.rest]
        tied = np.zeros((len(shares), len(places), 3))
        tied[:, :3], tied[:, 3:] = np.eye(3), self.following @ found.change
        each = (weight[:, None, None] * tied) @ found.covariance @ tied.swapaxes(1, 2)
        matrix[np.ix_(places, places)] = each.sum(axis=0)
        matrix[np.ix_(self.rest, self.rest)] += self.own
        off = np.zeros((len(shares), 9))
        off[:, :3], off[:, SHARE] = found.step - own, shares - share
        off[:, self.rest] = others - settled
        matrix += (weight[:, None] * off).T @ off
        return _Shared(best, matrix, gradient, float(mean.chi2[0]))


def _not_negative(
    normal: FloatArray, gradient: FloatArray, value: FloatArray, free: FloatArray
) -> FloatArray:
    """Steps of a, b, c that minimise ``d' H d/2 - g' d`` and leave none below zero, shape (k, 3).

    The best of those with any of them at its bound.
    """
    step, least = np.zeros_like(gradient), np.full(len(gradient), np.inf)
    subsets = _SUBSETS[(free >= _SUBSETS).all(axis=1)]
    # Most shares have the same ones at their bound.
    subsets = subsets[np.argsort(np.abs(subsets - (value > 0.0)).sum(axis=1), kind="stable")]
    left = np.arange(len(gradient))
    for chosen in subsets:
        own, pull = normal[left], gradient[left]
        at_zero = (free - chosen) * -value
        system = own * np.outer(chosen, chosen) + np.diag(1.0 - chosen)
        right = (pull - own @ at_zero) * chosen + at_zero
        tried = np.linalg.solve(system, right[..., None])[..., 0]
        slope = pull - np.einsum("kpq,kq->kp", own, tried)
        cost = -np.sum(tried * (pull + slope), 1)
        inside = (tried >= -value - _SLACK * np.abs(value)).all(axis=1)
        better = inside & (cost < least[left])
        step[left[better]], least[left[better]] = tried[better], cost[better]
        # A minimum: what is at its bound is pulled beyond it.
        left = left[~(inside & (slope * (free - chosen) <= 0.0).all(axis=1))]
        if not len(left):
            break
    return np.maximum(step, -value)


def _rounded(fitted: Fitted, samples: Samples) -> Fitted:
    """Take the rounding for what it is, where noise does not make it random.

    Only where Eq. 8 describes the readings to within the step: else every misfit would be
    blamed on the rounding.
    """
    step, problem, found = samples.step, fitted.problem, fitted
    dithered = math.hypot(_DITHERED, math.sqrt(1.0 / 12.0))
    if step is None or problem.step or not fitted.noise_rms < dithered * step:
        return fitted
    for _ in range(_ROUNDS):
        noise = best_noise(problem.residual(found.value), step, 0.1 * step)
        problem = replace(problem, noise_rms=noise, step=step)
        minimum = _at_share(problem, found.value, found.held)
        if not math.isfinite(minimum.quadratic.chi2):
            return fitted
        found = replace(found, problem=problem, minimum=minimum, shared=None)
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
    value, matrix, ends = _numbers(fitted, goodness, start_s)
    form: DragForm = problem.drag
    if other is not None and fitted.better_by(other) < ODDS:
        form = "undecided"
        others, _, other_ends = _numbers(other, goodness, start_s)
        apart = others - value
        apart[5] = math.remainder(apart[5], math.tau)
        matrix = matrix + np.outer(apart, apart)
        pairs = zip(ends, other_ends, strict=True)
        ends = [(min(one[0], two[0]), max(one[1], two[1])) for one, two in pairs]
    residual = problem.residual(fitted.value)
    times = problem.time_s
    inside = (points.time_s >= times[0]) & (points.time_s <= times[-1])
    drift = None
    if DRIFT not in fitted.held:
        shared = _shared_of(fitted, goodness)
        sd = math.sqrt(shared.covariance[DRIFT, DRIFT])
        drift = Estimate(float(fitted.value[DRIFT]), sd, f"{samples.unit}/s")
    said = [*fitted.start.warnings]
    if drift is not None:
        per = with_error(drift.value, drift.sd, drift.unit, short=True)
        said.append(f"the zero drifts by {per}; it is followed by a line")
    return result_of(
        value,
        matrix,
        ends,
        fitted.held,
        points.chosen(inside),
        problem.model(fitted.value)[0],
        goodness=goodness,
        said=said,
        fixed=fixed,
        method="waveform",
        baseline=baseline,
        residual_rms_rad=math.sqrt(float(residual @ residual) / len(residual)),
        samples=len(residual),
        turning_points=len(points),
        # A motion that has lost its phase has no frequency of its own, or none that moves.
        settled=fitted.minimum.converged
        and value[4] > 0.0
        and (OMEGA in fitted.held or matrix[3, 3] > 0.0),
        drag_form=form,
        zero_drift=drift,
        motion=problem.model(fitted.value),
    )


def held_places(
    held_rates: Mapping[str, float],
    fixed: Mapping[str, float],
    parts: Mapping[str, float],
    baseline: Baseline,
) -> tuple[int, ...]:
    """Indices of what is not fitted."""
    held = [PLACES[name] for name in held_rates]
    if "frequency" in fixed:
        held.append(OMEGA)
    if parts or baseline == "viscous" or held_rates.get("b") == 0.0:
        held.append(SHARE)
    return tuple(held)


def _numbers(
    fitted: Fitted, goodness: Goodness, start_s: float
) -> tuple[FloatArray, FloatArray, list[tuple[float, float]]]:
    """The seven parameters, their covariance, and the intervals of a, b, c."""
    value, held = fitted.value, fitted.held
    shared = _shared_of(fitted, goodness)
    own, gradient = shared.covariance, shared.gradient
    normal = covariance(own, held)
    (amplitude, phase), jacobian = _first_turning_point(fitted, start_s)
    frequency = 0.5 * value[OMEGA] / math.pi
    numbers = np.array([*value[:3], frequency, amplitude, phase, value[OFFSET]])
    ends = intervals95(value, normal, gradient, fitted.problem.bounds, range(3), held, own)
    return numbers, jacobian @ own @ jacobian.T, ends


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
    model, release = fitted.problem.model(value)
    count = fitted.start.before + 1
    turning, by_time, by_angle = turning_points_with_jacobian(model, release, count)
    change = fitted.problem.change(value)
    late, high = by_time[-1] @ change[:8, :8], by_angle[-1] @ change[:8, :8]
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
