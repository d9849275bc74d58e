"""The period from the times of the turning points: a straight line in lengthened half cycles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.torque import Restoring, phases
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray

_LOUD: Final = 2.0


class Period(NamedTuple):
    """Eq. 8's angular frequency and the time of the first turning point."""

    angular_frequency: float
    time_s: float
    covariance: FloatArray
    """Of the two, shape (2, 2); it holds what the unknown share adds."""
    chi2_per_dof: float
    late_rad: FloatArray
    """Phase by which each turning point is later than the law's, shape (k,)."""


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
