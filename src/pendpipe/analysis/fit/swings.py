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
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.minimise import Minimum, Quadratic, minimise
from pendpipe.analysis.fit.period import period_excess
from pendpipe.analysis.fit.quadratic import Bounds, bounded_step
from pendpipe.analysis.fit.waveform import BOUNDS, OFFSET, Waveform
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import turning_points_with_jacobian

_LARGE: Final = 0.2
"""Of the largest amplitude: below, sin x lengthens the period by 4 % of what it does there."""
_FEWEST: Final = 6
_SEEN: Final = 3.0
"""Standard deviations from which an amplitude, or a coefficient, is seen."""
_AGREES: Final = 2.0
"""Standard deviations within which the free coefficient agrees with 1."""
_NEAR: Final = 0.2
"""How near to 1 it must be where sin x removes most of chi^2."""
_STOP: Final = 6.0
"""In widths of the Coulomb stop: amplitudes below are left out."""
_TOP: Final = 3.13
"""Amplitude in rad beyond which a half swing says nothing of the frequency."""


LOSSES: Final = (0, 1, 2, 4, 6, 7)
"""Indices of what the amplitudes tell: a, b, c, the first angle, the level, b's share."""
CLOCK: Final = (3, 5)
"""Of what the times tell: omega, and when it starts."""


class SineCoefficient(NamedTuple):
    """How much of sin x the times of the turning points ask for: 0 nothing, 1 all of it."""

    value: float
    sd: float
    removed: float
    """Part of chi^2 of the times that the whole of sin x removes."""

    @property
    def asks_for_sine(self) -> bool:
        """Whether the restoring torque is sin x rather than x, by these times.

        The coefficient is seen and agrees with 1; or sin x removes most of chi^2, and what else
        there is moves the coefficient by less than 0.2.
        """
        agrees = abs(self.value - 1.0) < _AGREES * self.sd and self.value > _SEEN * self.sd
        return agrees or (self.removed > 0.5 and abs(self.value - 1.0) < _NEAR)


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


def balance(points: TurningPoints) -> Energies:
    """Find omega and the losses from amplitudes and half periods, with sin x.

    A half swing from A to A' takes 2 K/omega, and loses
    omega^2 (cos A' - cos A) = omega (A + A') [pi c/2 + pi b_h s + 2 pi a s^2]
    + 16 omega b_v [E - (1 - s^2) K], with s = sin((A + A')/4) and the elliptic integrals of
    modulus s; b counts as half hysteretic and half viscous.
    """
    amplitude, sd = np.clip(points.amplitude_rad, 0.0, _TOP), points.angle_sd_rad
    swings = np.diff(points.half_cycle).astype(np.float64)
    both = amplitude[1:] + amplitude[:-1]
    s = np.sin(0.25 * both)
    k, e = elliptic(s**2)
    omega = float(np.median(2.0 * k * swings / np.diff(points.time_s)))
    lost = np.cos(amplitude[1:]) - np.cos(amplitude[:-1])
    linear = 0.5 * math.pi * both * s + 8.0 * (e - (1.0 - s**2) * k)
    columns = np.stack([2.0 * math.pi * both * s**2, linear, 0.5 * math.pi * both], axis=1)
    columns *= swings[:, None] / omega
    error = np.hypot(np.sin(amplitude[1:]) * sd[1:], np.sin(amplitude[:-1]) * sd[:-1])
    weight = 1.0 / (error + 0.03 * np.abs(np.median(lost)) + 1e-300) ** 2
    normal = columns.T @ (weight[:, None] * columns)
    gradient = columns.T @ (weight * lost)
    rates = bounded_step(normal, gradient, Bounds(np.zeros(3), np.full(3, np.inf)))
    return Energies(omega, np.maximum(rates, 0.0))


def sine_coefficient(points: TurningPoints) -> SineCoefficient:
    """Fit the times with a free coefficient of sin x, at the larger amplitudes.

    A half swing lasts (pi/omega) [1 + losses + eta (2 K/pi - 1)]: the times are linear in
    pi/omega and in eta pi/omega.
    """
    amplitude = points.amplitude_rad
    seen = (amplitude > _SEEN * points.angle_sd_rad) & (amplitude < _TOP)
    seen &= amplitude > _LARGE * np.max(amplitude, where=seen, initial=0.0)
    if np.count_nonzero(seen) < _FEWEST:
        return SineCoefficient(0.0, math.inf, 0.0)
    part = points.chosen(seen)
    omega, rates = balance(part)
    swings = np.diff(part.half_cycle).astype(np.float64)
    mean = 0.5 * (part.amplitude_rad[1:] + part.amplitude_rad[:-1])
    slower = 2.0 / math.pi * elliptic(np.sin(0.5 * mean) ** 2)[0] - 1.0
    a, b, c = rates.tolist()
    excess = period_excess(mean, omega, a, b, c, 0.5)
    counted = np.stack([np.cumsum((1.0 + excess) * swings), np.cumsum(slower * swings)], axis=1)
    columns = np.ones((len(part), 3))
    columns[:, 1:] = np.concatenate([np.zeros((1, 2)), counted])
    weight = 1.0 / part.time_sd_s
    design, right = columns * weight[:, None], (part.time_s - part.time_s[0]) * weight

    def left(held: FloatArray, free: FloatArray) -> tuple[FloatArray, FloatArray]:
        values = np.linalg.lstsq(held, free, rcond=1e-12)[0]
        return np.asarray(values), np.asarray(free - held @ values)

    values, residual = left(design, right)
    plain = float(np.sum(left(design[:, :2], right)[1] ** 2))
    bent = float(
        np.sum(left(np.stack([design[:, 0], design[:, 1] + design[:, 2]], axis=1), right)[1] ** 2)
    )
    square, freedom = float(residual @ residual), max(len(part) - 3, 1)
    alike = min(max(float(residual[1:] @ residual[:-1]) / max(square, 1e-300), 0.0), 0.8)
    scatter = max(1.0, square / freedom) * (1.0 + alike) / (1.0 - alike)
    alone = float(np.linalg.norm(left(design[:, :2], design[:, 2])[1]))
    eta = float(values[2] / values[1])
    sd = math.sqrt(scatter) / max(alone * abs(float(values[1])), 1e-300)
    return SineCoefficient(eta, sd, 1.0 - bent / plain if plain > 0.0 else 0.0)


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
