"""Which restoring torque the turning points ask for: a pendulum's sin x, or a spring's x."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.analysis.half_cycles import LEAST_HALF_CYCLES
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.measure import loss_rates
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.dynamics.eq8 import Restoring
from pendpipe.physics.lengthening import SEEN, Coefficient, elliptic, sine_share

TORQUES: Final[tuple[Restoring, Restoring]] = ("linear", "sine")
TOP: Final = 3.13
"""Amplitude in rad beyond which a half swing says nothing of the frequency."""


_FEWEST: Final = 6
"""Turning points: the times have four numbers, among them the coefficient and a drift."""


def swing_phase(amplitude: FloatArray, restoring: Restoring) -> FloatArray:
    """Phase omega t of the half swings between neighbours, without losses: K + K', or pi."""
    if restoring == "linear":
        return np.full(len(amplitude) - 1, math.pi)
    quarter = elliptic(np.sin(0.5 * np.clip(amplitude, 0.0, TOP)) ** 2)[0]
    return np.asarray(quarter[1:] + quarter[:-1])


def period_excess(
    amplitude: FloatArray | float,
    angular_frequency: float,
    a: float,
    b: float,
    c: float,
    share: FloatArray | float,
) -> FloatArray:
    """Relative lengthening of a half period by the losses of Eq. 8, to second order.

    ``b_v^2/(2 w^2) + (4/3) b_v (2 a y + b_h)/w^2
    + (pi^2/8) (2 a y + b_h)(a y^2 + b_h y + c)/(y w^2)``,
    which is Eq. 6 (1/(8 Q_v^2)) for viscous damping, pi^2/(32 Q_h^2) for hysteretic
    damping, and nothing for Coulomb friction alone.

    Parameters
    ----------
    amplitude
        y at the turning points, rad.
    angular_frequency, a, b, c
        omega and the rates of Eq. 13.
    share
        b_h/b, the hysteretic part; of shape (s, 1) for some of them.
    """
    y = np.maximum(amplitude, 1e-300)
    hysteretic, viscous = share * b, (1.0 - share) * b
    slope = 2.0 * a * y + hysteretic
    friction = a * y + hysteretic + c / y
    excess = 0.5 * viscous**2 + 4.0 / 3.0 * viscous * slope + math.pi**2 / 8.0 * slope * friction
    return np.asarray(np.minimum(excess / angular_frequency**2, 0.5))


def phases(
    points: TurningPoints,
    amplitude: FloatArray,
    losses: tuple[float, float, float, FloatArray | float],
    angular_frequency: float,
    restoring: Restoring,
) -> FloatArray:
    """Phase omega t of a law's turning points from the first, by a, b, c and the share."""
    excess = period_excess(amplitude, angular_frequency, *losses)
    lasts = swing_phase(amplitude, restoring) + 0.5 * math.pi * (excess[..., 1:] + excess[..., :-1])
    found = np.zeros(excess.shape)
    np.cumsum(lasts * np.diff(points.half_cycle), axis=-1, out=found[..., 1:])
    return found


def clear(points: TurningPoints) -> TurningPoints:
    """Take those below the top that stand out of the noise."""
    return points.chosen(_is_clear(points))


def _is_clear(points: TurningPoints) -> BoolArray:
    amplitude = points.amplitude_rad
    return (amplitude > SEEN * points.angle_sd_rad) & (amplitude < TOP)


def told_apart(points: TurningPoints, readings: int, noise: float) -> float:
    """Chi^2 by which the motion by x that is nearest to turning points of sin x misses them."""
    part = clear(points)
    if len(part) < LEAST_HALF_CYCLES:
        return 0.0
    amplitude, number = part.amplitude_rad, part.half_cycle - part.half_cycle[0]
    swings = (swing_phase(amplitude, "sine") - math.pi) * np.diff(number)
    late = np.concatenate([[0.0], np.cumsum(swings)])
    weight = amplitude**2 / float(amplitude @ amplitude)
    off, left = number - weight @ number, late - weight @ late
    left = amplitude * (left - (weight * off @ left) / (weight * off @ off) * off)
    in_half_cycle = readings / max(float(np.ptp(points.half_cycle)), 1.0)
    return 0.5 * in_half_cycle * float(left @ left) / noise**2


def restoring_of(points: TurningPoints, *, stated: bool = True) -> Restoring:
    """Which torque the half cycles favour.

    Where it is `stated` that the readings are angles, they are a pendulum's unless the half cycles
    exclude sin x; else the half cycles must ask for it.
    """
    if not may_be_sine(points):
        return "linear"
    found = sine_coefficient(points)
    return "sine" if found.agrees or (stated and not found.excludes_sine) else "linear"


def may_be_sine(points: TurningPoints) -> bool:
    """Whether these are angles below the top, enough of them clear of the noise."""
    inside = points.unit == "rad" and float(np.max(points.amplitude_rad)) < math.pi
    return inside and int(np.count_nonzero(_is_clear(points))) >= LEAST_HALF_CYCLES


def sine_coefficient(points: TurningPoints) -> Coefficient:
    """Fit the times with a free coefficient of sin x.

    A half swing lasts [pi (1 + losses) + eta (K + K' - pi)]/omega: the times are linear in
    1/omega and in eta/omega. The level's error makes them alternate.

    By what the coefficient changes if the frequency may drift in time, it is uncertain too.
    """
    part = clear(points)
    if len(part) < _FEWEST or points.unit != "rad":
        return Coefficient(0.0, math.inf, 0.0)
    amplitude, omega = part.amplitude_rad, 2.0 * math.pi * part.apparent_frequency_hz
    losses = (*loss_rates(part.time_s, amplitude, part.angle_sd_rad).tolist(), 0.5)
    plain, phase = (phases(part, amplitude, losses, omega, torque) for torque in TORQUES)
    drift = np.cumsum(np.linspace(-1.0, 1.0, len(part)) * np.diff(plain, prepend=0.0))
    sides = np.ones_like(plain), part.side
    return sine_share(
        part.time_s - part.time_s[0], plain, phase, drift, *sides, weight=1.0 / part.time_sd_s
    )
