"""Eq. 8's turning points, samples, and their derivatives by every parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.dynamics.kernel import address
from pendpipe.dynamics.layout import (
    ADDRESSES,
    ENDINGS,
    FIELDS,
    OVERDAMPED,
    STOPPED,
    counts,
    work_size,
)
from pendpipe.dynamics.march import march
from pendpipe.dynamics.model import JACOBIAN_COLUMNS, RATES

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.model import Eq8, Release

_NONE: FloatArray = np.empty(0)
_COLUMNS = len(JACOBIAN_COLUMNS)
_NO_LIMIT = 2**62
_LOSSES, _DIRECTIONS = FIELDS["rate"].offset, FIELDS["directions"].offset


@dataclass(frozen=True)
class TurningPoints:
    """Where the pendulum turns.

    Parameters
    ----------
    time_s
        When, the release first.
    angle_rad
        Where: signed, offset included.
    stopped
        Whether friction holds the pendulum at the last of them.
    rest_rad
        Where it then stays, offset included; ``nan`` if it has not stopped.
    """

    time_s: FloatArray
    angle_rad: FloatArray
    stopped: bool
    rest_rad: float


def turning_points(
    model: Eq8,
    release: Release,
    *,
    count: int | None = None,
    until_s: float | None = None,
) -> TurningPoints:
    """Return the turning points of Eq. 8.

    Parameters
    ----------
    model, release
        What moves, and from where.
    count
        At most so many, the release among them.
    until_s
        None after this time. Without `count` and `until_s` there must be Coulomb friction, and
        the motion is followed to its stop.

    Raises
    ------
    ValueError
        If there is no end to the motion asked for, or `model` is overdamped.
    """
    if count is None and until_s is None and model.coulomb == 0.0:
        message = "give count or until_s: without Coulomb friction the motion has no end"
        raise ValueError(message)
    if count is not None and count < 1:
        message = f"count must be at least 1, not {count}"
        raise ValueError(message)
    most = _NO_LIMIT if count is None else count
    end_s = math.inf if until_s is None else until_s
    if not end_s >= release.time_s:
        message = f"until_s is {end_s}, before the release at {release.time_s}"
        raise ValueError(message)
    # Damping makes the half cycles fewer.
    half_cycles = (end_s - release.time_s) * model.angular_frequency / math.pi
    room = 1024 if math.isinf(end_s) else math.ceil(half_cycles) + 16
    while True:
        turning = np.empty((2, min(most, room)))
        found, stopped = _run(model, release, most=min(most, room), until_s=end_s, turning=turning)
        if stopped or found == most or found < room:
            break
        room *= 4
    time_s, angle_rad = turning[0, :found], turning[1, :found]
    return TurningPoints(time_s, angle_rad, stopped, float(angle_rad[-1]) if stopped else math.nan)


def turning_points_with_jacobian(
    model: Eq8, release: Release, count: int
) -> tuple[TurningPoints, FloatArray, FloatArray]:
    """Return turning points and the exact derivatives of their times and angles.

    Returns
    -------
    points
        At most `count`; fewer if the pendulum stops.
    time_jacobian, angle_jacobian
        (points, 8), with the columns `JACOBIAN_COLUMNS`.
    """
    if count < 1:
        message = f"count must be at least 1, not {count}"
        raise ValueError(message)
    turning = np.empty((2 + 2 * _COLUMNS, count))
    found, stopped = _run(model, release, derivatives=True, most=count, turning=turning)
    turning = turning[:, :found]
    rest_rad = float(turning[1, -1]) if stopped else math.nan
    points = TurningPoints(turning[0], turning[1], stopped, rest_rad)
    return points, turning[2 : 2 + _COLUMNS].T, turning[2 + _COLUMNS :].T


def sample(model: Eq8, release: Release, time_s: FloatArray) -> FloatArray:
    """Return the readings of Eq. 8 at given times; rad, with offset.

    Parameters
    ----------
    model, release
        What moves, and from where.
    time_s
        Ascending, evenly spaced or not, none before the release. After the pendulum has stopped
        the reading is that of its rest, exactly.

    Raises
    ------
    ValueError
        If the times are not as required, or `model` is overdamped.
    """
    times = _checked_times(time_s, release)
    angle_rad = np.empty(times.size)
    _run(model, release, time_s=times, angle_rad=angle_rad)
    return angle_rad


def sample_with_jacobian(
    model: Eq8, release: Release, time_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the readings and their exact derivatives by every parameter.

    Parameters
    ----------
    model, release, time_s
        As in `sample`.

    Returns
    -------
    angle_rad
        (n,).
    jacobian
        (n, 8), with the columns `JACOBIAN_COLUMNS`, stored by columns. At c = 0 the derivative
        by c is that towards c > 0.
    """
    times = _checked_times(time_s, release)
    angle_rad, jacobian = np.empty(times.size), np.empty((_COLUMNS, times.size))
    _run(model, release, derivatives=True, time_s=times, angle_rad=angle_rad, jacobian=jacobian)
    jacobian[-1] = 1.0
    return angle_rad, jacobian.T


def _checked_times(time_s: FloatArray, release: Release) -> FloatArray:
    """Return the times as the engine needs them."""
    times = np.ascontiguousarray(time_s, dtype=np.float64)
    if times.ndim != 1 or (times.size and not math.isfinite(times[0] + times[-1])):
        message = "time_s must be one-dimensional and finite"
        raise ValueError(message)
    # Written so that a nan in the middle is found as well.
    if not (times[1:] >= times[:-1]).all():
        message = "time_s must ascend"
        raise ValueError(message)
    if times.size and times[0] < release.time_s:
        message = f"time_s starts at {times[0]}, before the release at {release.time_s}"
        raise ValueError(message)
    return times


def _run(
    model: Eq8,
    release: Release,
    *,
    derivatives: bool = False,
    most: int = _NO_LIMIT,
    until_s: float = math.inf,
    time_s: FloatArray | None = None,
    angle_rad: FloatArray = _NONE,
    jacobian: FloatArray = _NONE,
    turning: FloatArray = _NONE,
) -> tuple[int, bool]:
    """Call the engine; return the number of turning points and whether the last is the stop."""
    if model.restoring == "sine" and not abs(release.angle_rad) < math.pi:
        message = f"with sin x the release must lie within pi, not at {release.angle_rad} rad"
        raise ValueError(message)
    if time_s is None:
        time_s = _NONE
    elif time_s.size == 0:
        return 0, False
    else:
        until_s = float(time_s[-1])
    rates = len(RATES) if derivatives else 0
    side = -1.0 if release.angle_rad < 0.0 else 1.0
    workspace = np.empty(work_size(rates, time_s.size))
    workspace[:_LOSSES] = (
        *model.shape(),
        model.angular_frequency,
        release.time_s,
        release.offset_rad,
        side,
        side,
        abs(release.angle_rad),
        until_s,
    )
    if derivatives:
        workspace[_LOSSES : _LOSSES + rates] = model.rates()
        by_rates = model.shape_derivatives()
        workspace[_DIRECTIONS : _DIRECTIONS + by_rates.size] = by_rates.ravel()
    arrays = {
        "workspace": workspace,
        "time_s": time_s,
        "angle_rad": angle_rad,
        "jacobian": jacobian,
        "turning": turning,
    }
    room = turning.shape[-1]
    request = [address(arrays[name]) for name in ADDRESSES]
    request += counts(rates, time_s.size, room, most)
    found, ending = divmod(march(np.array(request)), ENDINGS)
    if ending == OVERDAMPED:
        message = f"{model} is overdamped: it creeps towards its equilibrium and does not turn"
        raise ValueError(message)
    return found, ending == STOPPED
