"""The period from the times of the turning points: a straight line in lengthened half cycles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray

if TYPE_CHECKING:
    from pendpipe.analysis.fit.result import Restoring

_LOUD: Final = 2.0
TOP: Final = 3.13
"""Amplitude in rad beyond which a half swing says nothing of the frequency."""


class Period(NamedTuple):
    """Eq. 8's angular frequency and the time of the first turning point."""

    angular_frequency: float
    time_s: float
    covariance: FloatArray
    """Of the two, shape (2, 2); it holds what the unknown share adds."""
    chi2_per_dof: float
    late_rad: FloatArray
    """Phase by which each turning point is later than the law's, shape (k,)."""


def elliptic(m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Complete elliptic integrals K and E of the parameter m = k^2 < 1, by Gauss's means."""
    a, b = np.ones_like(m), np.sqrt(1.0 - m)
    total = 0.5 * m
    # Each step doubles the digits.
    for step in range(8):
        a, b, difference = 0.5 * (a + b), np.sqrt(a * b), 0.5 * (a - b)
        total = total + 2.0**step * difference**2
    k = 0.5 * math.pi / a
    return k, k * (1.0 - total)


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
    share: float,
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
        b_h/b, the hysteretic part.
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
    losses: tuple[float, float, float, float],
    angular_frequency: float,
    restoring: Restoring,
) -> FloatArray:
    """Phase omega t of a law's turning points from the first, by a, b, c and the share."""
    excess = period_excess(amplitude, angular_frequency, *losses)
    lasts = swing_phase(amplitude, restoring) + 0.5 * math.pi * (excess[1:] + excess[:-1])
    return np.concatenate([[0.0], np.cumsum(lasts * np.diff(points.half_cycle))])


def fit_period(
    points: TurningPoints,
    amplitude: FloatArray,
    rates: Sequence[float],
    *,
    share: float | None = None,
    held: float | None = None,
    restoring: Restoring = "linear",
) -> Period:
    """Fit a straight line to the times, in half cycles lengthened by the losses (and by sin x).

    Turning points cannot tell how b divides into hysteretic and viscous: the middle is
    taken, and what the ends would change is added to the standard deviations.

    Parameters
    ----------
    points
        The turning points.
    amplitude, rates
        What Eq. 14 made of them, and its a, b, c.
    share
        The hysteretic share of b, where it is known.
    held
        An angular frequency that is not to be fitted.
    restoring
        The restoring torque.
    """
    omega = 2.0 * math.pi * points.apparent_frequency_hz if held is None else held
    a, b, c = rates
    middle = _line(
        points, amplitude, (a, b, c, 0.5 if share is None else share), omega, held, restoring
    )
    residual = middle[2] / points.time_sd_s
    chi2 = float(residual @ residual) / max(len(points) - 2, 1)
    matrix = middle[1] * (chi2 if chi2 > _LOUD else 1.0)
    if share is None:
        ends = [
            _line(points, amplitude, (a, b, c, end), omega, held, restoring)[0]
            for end in (0.0, 1.0)
        ]
        off = max((end - middle[0] for end in ends), key=lambda change: abs(change[0]))
        matrix += np.outer(off, off) / 3.0
        # All times share what the unknown division of b does to the half cycles' shape.
        matrix[1, 1] += (b / (4.0 * float(middle[0][0]) ** 2)) ** 2 / 3.0
    found, first = (float(number) for number in middle[0])
    return Period(found, first, matrix, chi2, found * middle[2])


def _line(
    points: TurningPoints,
    amplitude: FloatArray,
    losses: tuple[float, float, float, float],
    omega: float,
    held: float | None,
    restoring: Restoring,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Angular frequency and first time for one share; their covariance; residuals in s."""
    reference = float(points.time_s[0])
    stretched = phases(points, amplitude, losses, omega, restoring) / math.pi
    columns = np.stack([stretched, np.ones_like(stretched)], axis=1)
    weighted = columns / points.time_sd_s[:, None] ** 2
    # The half period, unless it is held, and the first time.
    free = slice(0 if held is None else 1, 2)
    line, inverse = np.array([math.pi / omega, 0.0]), np.zeros((2, 2))
    inverse[free, free] = np.linalg.inv(weighted[:, free].T @ columns[:, free])
    line += inverse @ weighted.T @ (points.time_s - reference - columns @ line)
    residual = points.time_s - reference - columns @ line
    slope, first = line.tolist()
    jacobian = np.diag([-math.pi / slope**2, 1.0])
    return np.array([math.pi / slope, reference + first]), jacobian @ inverse @ jacobian, residual
