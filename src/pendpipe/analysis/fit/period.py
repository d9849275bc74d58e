"""The period from the times of the turning points: a straight line in lengthened half cycles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.torque import phases
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.eq8 import SHARE_MEAN, SHARE_SD, Restoring

_LOUD: Final = 2.0
"""chi^2 per degree of freedom of the times from which the error follows their scatter."""


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
    shares = np.array([SHARE_MEAN, 0.0, 1.0] if share is None else [share])[:, None]
    half_cycles = phases(points, amplitude, (a, b, c, shares), omega, restoring) / math.pi
    weight, first_s = points.time_sd_s**-2.0, float(points.time_s[0])
    # Straight lines t = first + half period times half cycles, one a share.
    total, time = float(weight.sum()), points.time_s - first_s
    centre, middle = half_cycles @ weight / total, float(time @ weight) / total
    off = half_cycles - centre[:, None]
    square = off**2 @ weight
    if held is None:
        half = (off * weight) @ time / square
        variance = 1.0 / square[0]
    else:
        half, variance = np.full(len(shares), math.pi / omega), 0.0
    begun = middle - half * centre
    late = time - begun[0] - half[0] * half_cycles[0]
    found = math.pi / half
    by_half = np.array([-found[0] / half[0], -centre[0]])
    matrix = variance * np.outer(by_half, by_half) + np.diag([0.0, 1.0 / total])
    chi2 = float(late**2 @ weight) / max(len(points) - 2, 1)
    if chi2 > _LOUD:
        matrix *= chi2
    if share is None:
        ends = [(found[end] - found[0], begun[end] - begun[0]) for end in (1, 2)]
        off_by = max(ends, key=lambda change: abs(change[0]))
        part = (SHARE_SD / SHARE_MEAN) ** 2
        matrix += part * np.outer(off_by, off_by)
        # All times share what the unknown division of b does to the half cycles' shape.
        matrix[1, 1] += (b / (4.0 * float(found[0]) ** 2)) ** 2 * part
    omega = float(found[0])
    return Period(omega, first_s + float(begun[0]), matrix, chi2, omega * late)
