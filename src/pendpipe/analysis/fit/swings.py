"""Half swings of a pendulum with sin x: whether there is one, and where its fit begins.

Turning points are counted, so that the phase of a law can't slip against them, whatever its
amplitude: the law's own turning points are fitted to them, times and angles together. The search
begins at the frequency of the elliptic integral and at the losses that balance the energy of
each half swing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.minimise import Minimum, Quadratic, minimise
from pendpipe.analysis.fit.period import period_excess
from pendpipe.analysis.fit.quadratic import Bounds, bounded_step
from pendpipe.analysis.fit.result import Restoring
from pendpipe.analysis.fit.waveform import BOUNDS, OFFSET, Waveform
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import turning_points_with_jacobian

_LARGE: Final = 0.2
"""Of the largest amplitude: below, sin x lengthens the period by 4 % of what it does there."""
_FEWEST: Final = 6
_SEEN: Final = 3.0
"""Standard deviations from which an amplitude, or a coefficient, is seen, and up to which the
coefficient may be off."""
_AGREES: Final = 2.0
"""Standard deviations within which the coefficient agrees with 1 where it has to tell by itself."""
_NEAR: Final = 0.2
"""How near to 1 it must be where sin x removes most of chi^2."""
_PENDULUM: Final = 0.25
"""Amplitude in rad from which sin x lengthens the period by 0.4 %, more than frequencies wander:
what swings so far is taken for a pendulum unless its half cycles speak against it."""
_BLOCKS: Final = 8
_STOP: Final = 6.0
"""In widths of the Coulomb stop: amplitudes below are left out."""
_TOP: Final = 3.13
"""Amplitude in rad beyond which a half swing says nothing of the frequency."""


LOSSES: Final = (0, 1, 2, 4, 6, 7)
"""Indices of what the amplitudes tell: a, b, c, the first angle, the level, b's share."""
CLOCK: Final = (3, 5)
"""Of what the times tell: omega, and when it starts."""


class Coefficient(NamedTuple):
    """How much of sin x the times of the turning points ask for: 0 nothing, 1 all of it."""

    value: float
    sd: float
    """From parts of the decay left out in turn, and from what a drift of the frequency would do."""
    scatter: float
    """The part of `sd` that is no drift."""
    removed: float
    """Part of chi^2 of the times that the whole of sin x removes."""

    @property
    def agrees(self) -> bool:
        """Whether the times alone ask for sin x.

        The coefficient is seen and agrees with 1; or sin x removes most of chi^2, and what else
        there is moves the coefficient by less than 0.2.
        """
        near = abs(self.value - 1.0) < _AGREES * self.scatter and self.value > _SEEN * self.scatter
        return near or (self.removed > 0.5 and abs(self.value - 1.0) < _NEAR)

    @property
    def excludes_sine(self) -> bool:
        """Whether the whole of sin x contradicts the times, a drift of the frequency granted."""
        return abs(self.value - 1.0) > _SEEN * self.sd


class LawStart(NamedTuple):
    """Eq. 8 with one torque, from half periods and energies; the motion itself is not fitted."""

    restoring: Restoring
    rates: FloatArray
    """a, b, c of Eq. 13, shape (3,)."""
    angular_frequency: float
    """omega, rad/s: with sin x that of small amplitudes."""
    angle_rad: float
    """Signed angle of the first turning point, about the offset."""
    time_s: float
    """When that is."""
    offset_rad: float
    slip_rad: float
    """Largest phase by which the law's turning points and the measured ones part."""

    @property
    def value(self) -> FloatArray:
        """The same in the order of `waveform.NAMES`, b half hysteretic; shape (8,)."""
        return np.array(
            [*self.rates, self.angular_frequency, self.angle_rad, self.time_s, self.offset_rad, 0.5]
        )


class Start(NamedTuple):
    """What half periods and energies tell before any motion is fitted."""

    linear: LawStart
    sine: LawStart | None
    """None where the readings are no angles, or the half cycles are too few."""
    favoured: Restoring
    """The torque that the half cycles favour."""
    coefficient: Coefficient
    """Of sin x, set free: a torque (1 - eta) x + eta sin x, as far as the period goes."""


def start_of(points: TurningPoints, *, stated: bool = True) -> Start:
    """Find where fits of the linear and of the sine law begin, and which the half cycles favour.

    Parameters
    ----------
    points
        The turning points; gaps between them are allowed.
    stated
        Whether it is known that the readings are angles. If so, swings beyond 0.25 rad are a
        pendulum's unless the half cycles exclude sin x; else the half cycles must ask for it.

    Returns
    -------
    Start
        For each law a, b, c, omega, angle and time of the first turning point, and the offset;
        the favoured law; the coefficient of sin x, set free, with its standard deviation.

    Notes
    -----
    A half swing from A to A' takes [K(A) + K(A')]/omega and loses omega^2 (cos A' - cos A); with
    the linear law pi/omega and omega^2 (A^2 - A'^2)/2. Two half swings are taken together, so that
    an error of the level, and sides that differ, cancel. omega and the first time come from the
    straight line through the times against the half swings counted so; the losses from
    non-negative least squares (`balance`).

    Examples
    --------
    >>> from pendpipe import turning_points
    >>> points = turning_points("examples/rod-pendulum.csv")
    >>> start = start_of(points)
    >>> start.favoured, round(start.linear.angular_frequency, 3)
    ('linear', 5.485)
    """
    linear = _law_start(points, "linear")
    coefficient = sine_coefficient(points)
    inside = points.unit == "rad" and float(np.max(points.amplitude_rad)) < math.pi
    sine = _law_start(points, "sine") if inside and len(_clear(points)) >= _FEWEST else None
    favoured: Restoring = "linear"
    if sine is not None and (
        coefficient.agrees
        or (stated and abs(sine.angle_rad) > _PENDULUM and not coefficient.excludes_sine)
    ):
        favoured = "sine"
    return Start(linear, sine, favoured, coefficient)


def elliptic(m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Complete elliptic integrals K and E of the parameter m = k^2 < 1, by Gauss's means."""
    a, b = np.ones_like(m), np.sqrt(1.0 - m)
    total, power = 0.5 * m, 0.5
    for _ in range(40):
        difference = 0.5 * (a - b)
        a, b = 0.5 * (a + b), np.sqrt(a * b)
        power *= 2.0
        total = total + power * difference**2
        if float(np.max(np.abs(difference), initial=0.0)) < 1e-17:
            break
    k = 0.5 * math.pi / a
    return k, k * (1.0 - total)


class Energies(NamedTuple):
    """What the half swings' energy balance tells."""

    angular_frequency: float
    rates: FloatArray
    """a, b, c of Eq. 13, shape (3,)."""


def balance(points: TurningPoints, restoring: Restoring = "sine") -> Energies:
    """Find omega and the losses from amplitudes and half periods.

    With sin x a half swing from A to A' takes (K + K')/omega, and loses
    omega^2 (cos A' - cos A) = omega (A + A') [pi c/2 + pi b_h s + 2 pi a s^2]
    + 16 omega b_v [E - (1 - s^2) K], with s = sin((A + A')/4) and the elliptic integrals of
    modulus s; b counts as half hysteretic and half viscous. Linear: small s.
    """
    sd = points.angle_sd_rad
    swings = np.diff(points.half_cycle).astype(np.float64)
    if restoring == "sine":
        amplitude = np.clip(points.amplitude_rad, 0.0, _TOP)
        s = np.sin(0.25 * (amplitude[1:] + amplitude[:-1]))
        k, e = elliptic(s**2)
        viscous = 8.0 * (e - (1.0 - s**2) * k)
        energy, slope = -np.cos(amplitude), np.sin(amplitude)
    else:
        amplitude = np.maximum(points.amplitude_rad, 0.0)
        s = 0.25 * (amplitude[1:] + amplitude[:-1])
        viscous = 2.0 * math.pi * s**2
        energy, slope = 0.5 * amplitude**2, amplitude
    both = amplitude[1:] + amplitude[:-1]
    # Two half swings together, where there are two.
    together = 2 if len(points) > _FEWEST else 1
    lasts = np.diff(points.time_s)
    turns = quarters(amplitude, restoring) * swings
    omega = float(np.median(_sums(turns, together) / _sums(lasts, together)))
    columns = np.stack(
        [2.0 * math.pi * both * s**2, 0.5 * math.pi * both * s + viscous, 0.5 * math.pi * both]
    )
    columns = np.stack([_sums(each * swings / omega, together) for each in columns], axis=1)
    lost = energy[:-together] - energy[together:]
    error = np.hypot(slope[together:] * sd[together:], slope[:-together] * sd[:-together])
    weight = 1.0 / (error + 0.03 * np.abs(np.median(lost)) + 1e-300) ** 2
    normal = columns.T @ (weight[:, None] * columns)
    gradient = columns.T @ (weight * lost)
    rates = bounded_step(normal, gradient, Bounds(np.zeros(3), np.full(3, np.inf)))
    return Energies(omega, np.maximum(rates, 0.0))


def _sums(values: FloatArray, together: int) -> FloatArray:
    """Each value with the next ones."""
    return np.asarray(np.convolve(values, np.ones(together), "valid"))


def quarters(amplitude: FloatArray, restoring: Restoring) -> FloatArray:
    """Phase omega t of the half swings between neighbours: two quarter periods, or pi."""
    if restoring == "linear":
        return np.full(len(amplitude) - 1, math.pi)
    quarter = elliptic(np.sin(0.5 * np.clip(amplitude, 0.0, _TOP)) ** 2)[0]
    return np.asarray(quarter[1:] + quarter[:-1])


def _clear(points: TurningPoints, least: float = 0.0) -> TurningPoints:
    """Those that stand out of the noise, and above a part of the largest."""
    amplitude = points.amplitude_rad
    seen = (amplitude > _SEEN * points.angle_sd_rad) & (amplitude < _TOP)
    return points.chosen(seen & (amplitude > least * np.max(amplitude, where=seen, initial=0.0)))


def _counted(
    points: TurningPoints, restoring: Restoring
) -> tuple[FloatArray, FloatArray, Energies]:
    """Phase from the first turning point to each by a law without losses; what they add."""
    unit = restoring if points.unit == "rad" else "linear"
    found = balance(points, unit)
    swings = np.diff(points.half_cycle).astype(np.float64)
    amplitude = points.amplitude_rad
    a, b, c = found.rates.tolist()
    mean = 0.5 * (amplitude[1:] + amplitude[:-1])
    excess = period_excess(mean, found.angular_frequency, a, b, c, 0.5)
    phase = swings * quarters(amplitude, unit)
    return (
        np.concatenate([[0.0], np.cumsum(phase)]),
        np.concatenate([[0.0], np.cumsum(math.pi * excess * swings)]),
        found,
    )


def _law_start(points: TurningPoints, restoring: Restoring) -> LawStart:
    """The start of one law: times on a straight line against the phase."""
    part = _clear(points) if restoring == "sine" else points
    phase, excess, found = _counted(part, restoring)
    design = np.stack([np.ones_like(phase), phase + excess], axis=1) / part.time_sd_s[:, None]
    late = part.time_s - part.time_s[0]
    first, slope = np.linalg.lstsq(design, late / part.time_sd_s, rcond=None)[0].tolist()
    slip = np.max(np.abs(late - first - slope * (phase + excess))) / slope
    return LawStart(
        restoring, found.rates, 1.0 / slope, float(part.angle_rad[0]),
        float(part.time_s[0]) + first, float(np.mean(points.level_rad)), float(slip),
    )  # fmt: skip


def sine_coefficient(points: TurningPoints) -> Coefficient:
    """Fit the times with a free coefficient of sin x, at the larger amplitudes.

    A half swing lasts [pi (1 + losses) + eta (K + K' - pi)]/omega: the times are linear in
    1/omega and in eta/omega. The level's error makes them alternate.

    The coefficient's error does not trust that the times scatter independently: an eighth of the
    decay is left out in turn, the phase beyond it free. And by what it changes if the frequency may
    drift in time, it is uncertain too.
    """
    part = _clear(points, _LARGE)
    if len(part) < _FEWEST or points.unit != "rad":
        return Coefficient(0.0, math.inf, math.inf, 0.0)
    phase, excess, _ = _counted(part, "sine")
    plain = math.pi * (part.half_cycle - part.half_cycle[0])
    weight = 1.0 / part.time_sd_s
    columns = np.stack([plain + excess, phase - plain, np.ones_like(phase), part.side], axis=1)
    columns *= weight[:, None]
    right = (part.time_s - part.time_s[0]) * weight

    def eta(design: FloatArray, use: FloatArray | slice = slice(None)) -> float:
        values = np.linalg.lstsq(design[use], right[use], rcond=1e-13)[0]
        return float(values[1] / values[0])

    def square(design: FloatArray) -> float:
        values = np.linalg.lstsq(design, right, rcond=1e-13)[0]
        return float(np.sum((right - design @ values) ** 2))

    value, count = eta(columns), len(part)
    blocks = min(_BLOCKS, count // 3)
    edges = np.linspace(0, count, blocks + 1).astype(int).tolist()
    without = []
    for low, high in pairwise(edges):
        use = np.ones(count, dtype=bool)
        use[low:high] = False
        step = weight * (np.arange(count) >= high)
        inner = low > 0 and high < count
        without.append(eta(np.column_stack([columns, step]) if inner else columns, use))
    scatter = math.sqrt((blocks - 1) * float(np.var(without)))
    slower = np.cumsum(np.linspace(-1.0, 1.0, count) * np.diff(plain, prepend=0.0))
    drift = eta(np.column_stack([columns, weight * slower])) - value
    linear, bent = square(columns[:, [0, 2, 3]]), columns[:, [0, 2, 3]]
    bent[:, 0] += columns[:, 1]
    removed = 1.0 - square(bent) / linear if linear > 0.0 else 0.0
    return Coefficient(value, math.hypot(scatter, drift), scatter, removed)


@dataclass(frozen=True)
class Swings(Waveform):
    """chi^2 of turning points, times and angles, against those of a law.

    Parameters
    ----------
    points
        The turning points; the motion starts at the first.
    stretch
        Factors of the standard deviations of angles and times; what is infinitely uncertain
        does not count.
    """

    points: TurningPoints = field(kw_only=True)
    stretch: tuple[float, float] = (1.0, 1.0)

    def residuals_and_jacobian(self, value: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Angles and times less the law's, over their errors, shape (2 k,); and (2 k, 8).

        None where the law stops before the last of them, or does not move.
        """
        points = self.points
        model, release = self.model(value)
        index = points.half_cycle - points.half_cycle[0]
        if not np.isfinite(model.stop_rad) or not 0.0 < abs(release.angle_rad) < math.pi:
            return None
        try:
            law, by_time, by_angle = turning_points_with_jacobian(
                model, release, int(index[-1]) + 1
            )
        except ValueError:
            # Overdamped.
            return None
        if len(law.time_s) <= int(index[-1]):
            return None
        level = float(value[OFFSET] - np.mean(points.level_rad))
        angle = points.angle_rad - (law.angle_rad[index] - release.offset_rad)
        angle -= points.level_coupling * level
        change = self.change(value)
        by_angle = by_angle[index] @ change
        by_angle[:, OFFSET] = points.level_coupling
        error = np.concatenate(
            [self.stretch[0] * points.angle_sd_rad, self.stretch[1] * points.time_sd_s]
        )
        residual = np.concatenate([angle, points.time_s - law.time_s[index]]) / error
        jacobian = np.concatenate([by_angle, by_time[index] @ change]) / error[:, None]
        return residual, jacobian

    def evaluate(self, value: FloatArray) -> Quadratic:
        """chi^2, gradient and normal matrix, with the priors of the share and of the level."""
        found = self.residuals_and_jacobian(value)
        if found is None:
            return Quadratic(np.inf, np.zeros(8), np.eye(8))
        residual, jacobian = found
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual
        least = 1e-9 * float(np.max(np.abs(self.points.angle_rad)))
        certainty = 1.0 / max(self.points.level_sd_rad, least) ** 2
        off = float(value[OFFSET] - np.mean(self.points.level_rad))
        normal[OFFSET, OFFSET] += certainty
        gradient[OFFSET] -= certainty * off
        chi2 = float(residual @ residual) + certainty * off**2
        return self._with_prior(value, Quadratic(chi2, gradient, normal))

    def stretched(self, value: FloatArray) -> tuple[float, float]:
        """By what the errors of angles and of times are too small, at the best values."""
        found = replace(self, stretch=(1.0, 1.0)).residuals_and_jacobian(value)
        if found is None:
            return 1.0, 1.0
        count = len(self.points)
        square = found[0] ** 2
        freedom = max(count - 4, 1)
        return (
            max(1.0, math.sqrt(float(square[:count].sum()) / freedom)),
            max(1.0, math.sqrt(float(square[count:].sum()) / freedom)),
        )


class SwingsFit(NamedTuple):
    """A law's turning points fitted to the measured ones."""

    problem: Swings
    minimum: Minimum
    held: tuple[int, ...]

    def by_amplitudes(self) -> SwingsFit:
        """The same with the losses from the amplitudes alone, as Eq. 14 has them.

        The times tell the amplitudes too, through the period, and far better; but that rests on
        the angles' scale. So they are left to tell omega and the phase.
        """
        value, (high, late) = self.minimum.value, self.problem.stretch
        minimum, normal = self.minimum, np.zeros((8, 8))
        for stretch, others in 2 * [((high, math.inf), CLOCK), ((math.inf, late), LOSSES)]:
            problem = replace(self.problem, stretch=stretch)
            held = tuple({*self.held, *others})
            minimum = minimise(problem.evaluate, value, BOUNDS, held=held)
            value = minimum.value
        both = replace(self.problem, stretch=self.problem.stretched(value))
        normal = both.evaluate(value).normal.copy()
        # What the times say of the losses is not used.
        angles = replace(both, stretch=(both.stretch[0], math.inf)).evaluate(value).normal
        normal[np.ix_(LOSSES, LOSSES)] = angles[np.ix_(LOSSES, LOSSES)]
        normal[np.ix_(LOSSES, CLOCK)] = 0.0
        normal[np.ix_(CLOCK, LOSSES)] = 0.0
        quadratic = Quadratic(minimum.quadratic.chi2, np.zeros(8), normal)
        return SwingsFit(both, minimum._replace(quadratic=quadratic), self.held)


def fit_swings(
    points: TurningPoints,
    *,
    fixed: Mapping[int, float] | None = None,
    held: tuple[int, ...] = (),
    parts: Mapping[str, float] | None = None,
) -> SwingsFit | None:
    """Fit a pendulum with sin x to turning points.

    Parameters
    ----------
    points
        Half cycles that follow one another; those near the stop and in the noise are left out.
    fixed
        Values that are known, by their index in `waveform.NAMES`.
    held
        Indices of what is not fitted.
    parts
        The parts of b that are held, see `waveform.Waveform`.

    Returns
    -------
    SwingsFit or None
        None where there are too few turning points, or no motion through them is found.
    """
    seen = points.amplitude_rad > _SEEN * points.angle_sd_rad
    if np.count_nonzero(seen) < _FEWEST:
        return None
    points = points.first(int(np.flatnonzero(seen)[-1]) + 1)
    omega, rates = balance(points)
    width = 0.5 * math.pi * float(rates[2]) / omega
    far = np.flatnonzero(points.amplitude_rad > _STOP * width)
    points = points.first(max(int(far[-1]) + 1 if len(far) else 0, _FEWEST))
    start = np.array(
        [*rates, omega, float(points.angle_rad[0]), float(points.time_s[0]),
         float(np.mean(points.level_rad)), 0.5]
    )  # fmt: skip
    start[4] = math.copysign(min(abs(start[4]), _TOP), start[4])
    for index, value in (fixed or {}).items():
        start[index] = math.copysign(value, start[4]) if index == 4 else value
    problem = Swings(
        points.time_s, points.angle_rad, 1.0, parts or {}, restoring="sine", points=points
    )
    # The times of few swings are far better known than the start: their errors come later.
    minimum = None
    for stretch in (None, 1, 2):
        if stretch is None:
            late = 0.02 / omega / float(np.median(points.time_sd_s))
            high = 0.01 * float(points.amplitude_rad[0]) / float(np.median(points.angle_sd_rad))
            problem = replace(problem, stretch=(max(high, 1.0), max(late, 1.0)))
        else:
            problem = replace(problem, stretch=problem.stretched(start))
        if not math.isfinite(problem.evaluate(start).chi2):
            start = _moving(problem, start)
        minimum = minimise(problem.evaluate, start, BOUNDS, held=held)
        if not math.isfinite(minimum.quadratic.chi2):
            return None
        start = minimum.value
    return None if minimum is None else SwingsFit(problem, minimum, held)


def _moving(problem: Swings, start: FloatArray) -> FloatArray:
    """Less friction, until the law reaches the last turning point."""
    value = start.copy()
    for _ in range(12):
        value[:3] *= 0.7
        if math.isfinite(problem.evaluate(value).chi2):
            break
    return value
