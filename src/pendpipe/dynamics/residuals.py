"""Readings compared with Eq. 8: what a Gauss-Newton step needs, at the cost of the samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pendpipe.dynamics.engine import directions_of, run
from pendpipe.dynamics.eq8 import checked_times
from pendpipe.dynamics.layout import sums_size

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.model import Eq8, Release


class Comparison(NamedTuple):
    """Readings against Eq. 8; J is the Jacobian of `sample_with_jacobian`, r the residual."""

    square: float
    """r' r."""
    gradient: FloatArray
    """J' r, shape (8,)."""
    normal: FloatArray
    """J' J, shape (8, 8), for readings spread evenly within each half cycle."""
    residual: FloatArray
    """r, shape (n,)."""


def residuals(
    model: Eq8, release: Release, time_s: FloatArray, angle_rad: FloatArray
) -> FloatArray:
    """Return readings less model, shape (n,)."""
    times = checked_times(time_s, release)
    readings = np.ascontiguousarray(angle_rad, dtype=np.float64)
    residual = np.empty(times.size)
    if times.size:
        run(
            model, release, tabulate=True, until_s=float(times[-1]), time_s=times,
            angle_rad=residual, readings=readings, sums=np.zeros(sums_size(0)),
        )  # fmt: skip
    return residual


def compare(model: Eq8, release: Release, time_s: FloatArray, angle_rad: FloatArray) -> Comparison:
    """Compare readings with Eq. 8, with the columns `JACOBIAN_COLUMNS`.

    The Jacobian is never written: the products that a fit needs are summed half cycle by
    half cycle. The gradient is exact; the normal matrix takes the readings as spread evenly
    within each half cycle (or its panels), and is exact but for that.

    Parameters
    ----------
    model, release, time_s
        As in `sample`.
    angle_rad
        The readings, shape (n,).
    """
    times = checked_times(time_s, release)
    readings = np.ascontiguousarray(angle_rad, dtype=np.float64)
    directions, rates = directions_of(model, None)
    columns = rates.size + 4
    sums, residual = np.zeros(sums_size(columns)), np.empty(times.size)
    if times.size:
        run(
            model, release, tabulate=True, directions=directions, rates=rates,
            until_s=float(times[-1]), time_s=times, angle_rad=residual, readings=readings,
            sums=sums,
        )  # fmt: skip
    lower = sums[1 + columns :].reshape(columns, columns)
    normal = lower + lower.T
    normal.flat[:: columns + 1] *= 0.5
    return Comparison(float(sums[0]), sums[1 : 1 + columns], normal, residual)
