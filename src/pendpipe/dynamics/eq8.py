"""Eq. 8's turning points, samples, derivatives by every parameter, and comparison with readings."""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from pendpipe.dynamics.compiled import engine
from pendpipe.dynamics.layout import FIELDS, OVERDAMPED, REQUEST, STOPPED, sums_size, work_size

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.model import Eq8, Release

_NO_SAMPLES: FloatArray = np.empty(0)
_NONE: FloatArray = np.empty((0, 0))
_NO_LIMIT = 2**62
_REQUEST = ctypes.c_int64 * len(REQUEST)
_LOSSES, _DIRECTIONS = FIELDS["rate"].offset, FIELDS["directions"].offset

Method = Literal["map", "clock"]
"""``"map"`` tabulates the half-cycle map and is the fast way; ``"clock"`` solves every half cycle
by the phase clock and is the reference. They agree to 1e-10 of the amplitude, mostly to 1e-12."""


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
    method: Method = "map",
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
    method
        See `Method`.

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
    _check_method(method)
    end_s = math.inf if until_s is None else until_s
    if not end_s >= release.time_s:
        message = f"until_s is {end_s}, before the release at {release.time_s}"
        raise ValueError(message)
    room = 1024 if math.isinf(end_s) else _half_cycles(model, release, end_s) + 16
    while True:
        turning = np.empty((2, min(most, room)))
        found, stopped = _run(
            model,
            release,
            tabulate=method == "map",
            most=min(most, room),
            until_s=end_s,
            turning=turning,
        )
        if stopped or found == most or found < room:
            break
        room *= 4
    time_s, angle_rad = turning[0, :found], turning[1, :found]
    return TurningPoints(time_s, angle_rad, stopped, float(angle_rad[-1]) if stopped else math.nan)


def _check_method(method: str) -> None:
    """Refuse an unknown method."""
    if method not in ("map", "clock"):
        message = f'method must be "map" or "clock", not {method!r}'
        raise ValueError(message)


def _half_cycles(model: Eq8, release: Release, until_s: float) -> int:
    """Return about how many half cycles there are until a time; damping makes them fewer."""
    return max(0, math.ceil((until_s - release.time_s) * model.angular_frequency / math.pi))


def turning_points_with_jacobian(
    model: Eq8,
    release: Release,
    count: int,
    *,
    hysteretic_share: float | None = None,
    method: Method = "map",
) -> tuple[TurningPoints, FloatArray, FloatArray]:
    """Return turning points and the exact derivatives of their times and angles.

    Returns
    -------
    points
        At most `count`; fewer if the pendulum stops.
    time_jacobian, angle_jacobian
        (points, 8) or, with `hysteretic_share`, (points, 7); see `sample_with_jacobian`.
    """
    if count < 1:
        message = f"count must be at least 1, not {count}"
        raise ValueError(message)
    _check_method(method)
    directions, rates = _directions_of(model, hysteretic_share)
    columns = rates.size + 4
    turning = np.empty((2 + 2 * columns, count))
    found, stopped = _run(
        model,
        release,
        tabulate=method == "map",
        directions=directions,
        rates=rates,
        most=count,
        turning=turning,
    )
    turning = turning[:, :found]
    rest_rad = float(turning[1, -1]) if stopped else math.nan
    points = TurningPoints(turning[0], turning[1], stopped, rest_rad)
    return points, turning[2 : 2 + columns].T, turning[2 + columns :].T


def sample(
    model: Eq8, release: Release, time_s: FloatArray, *, method: Method = "map"
) -> FloatArray:
    """Return the readings of Eq. 8 at given times; rad, with offset.

    Parameters
    ----------
    model, release
        What moves, and from where.
    time_s
        Ascending, evenly spaced or not, none before the release. After the pendulum has stopped
        the reading is that of its rest, exactly.
    method
        See `Method`.

    Raises
    ------
    ValueError
        If the times are not as required, or `model` is overdamped.
    """
    times = _checked_times(time_s, release)
    _check_method(method)
    angle_rad = np.empty(times.size)
    if times.size:
        until_s = float(times[-1])
        _run(
            model,
            release,
            tabulate=method == "map",
            until_s=until_s,
            time_s=times,
            angle_rad=angle_rad,
        )
    return angle_rad


def sample_with_jacobian(
    model: Eq8,
    release: Release,
    time_s: FloatArray,
    *,
    hysteretic_share: float | None = None,
    method: Method = "map",
) -> tuple[FloatArray, FloatArray]:
    """Return the readings and their exact derivatives by every parameter.

    Parameters
    ----------
    model, release, time_s, method
        As in `sample`.
    hysteretic_share
        None for the columns `JACOBIAN_COLUMNS`. A number from 0 to 1 for the columns
        `JOINT_JACOBIAN_COLUMNS`, where b = b_h + b_v is one parameter with b_h = share x b;
        it must be the share that `model` has, unless its b is 0.

    Returns
    -------
    angle_rad
        (n,).
    jacobian
        (n, 8) or (n, 7), stored by columns. At c = 0 the derivative by c is that towards c > 0.
    """
    times = _checked_times(time_s, release)
    _check_method(method)
    directions, rates = _directions_of(model, hysteretic_share)
    angle_rad = np.empty(times.size)
    jacobian = np.empty((rates.size + 4, times.size))
    if times.size:
        _run(
            model,
            release,
            tabulate=method == "map",
            directions=directions,
            rates=rates,
            until_s=float(times[-1]),
            time_s=times,
            angle_rad=angle_rad,
            jacobian=jacobian,
        )
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
    times = _checked_times(time_s, release)
    readings = np.ascontiguousarray(angle_rad, dtype=np.float64)
    residual = np.empty(times.size)
    if times.size:
        _run(
            model,
            release,
            tabulate=True,
            until_s=float(times[-1]),
            time_s=times,
            angle_rad=residual,
            readings=readings,
            sums=np.zeros(sums_size(0)),
        )
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
    times = _checked_times(time_s, release)
    readings = np.ascontiguousarray(angle_rad, dtype=np.float64)
    directions, rates = _directions_of(model, None)
    columns = rates.size + 4
    sums, residual = np.zeros(sums_size(columns)), np.empty(times.size)
    if times.size:
        _run(
            model,
            release,
            tabulate=True,
            directions=directions,
            rates=rates,
            until_s=float(times[-1]),
            time_s=times,
            angle_rad=residual,
            readings=readings,
            sums=sums,
        )
    lower = sums[1 + columns :].reshape(columns, columns)
    normal = lower + lower.T
    normal.flat[:: columns + 1] *= 0.5
    return Comparison(float(sums[0]), sums[1 : 1 + columns], normal, residual)


def _run(
    model: Eq8,
    release: Release,
    *,
    tabulate: bool,
    directions: FloatArray = _NONE,
    rates: FloatArray = _NO_SAMPLES,
    most: int = _NO_LIMIT,
    until_s: float = math.inf,
    time_s: FloatArray = _NO_SAMPLES,
    angle_rad: FloatArray = _NO_SAMPLES,
    jacobian: FloatArray = _NONE,
    turning: FloatArray = _NONE,
    readings: FloatArray = _NO_SAMPLES,
    sums: FloatArray = _NO_SAMPLES,
) -> tuple[int, bool]:
    """Call the engine; return the number of turning points and whether the last is the stop."""
    if model.restoring == "sine" and not abs(release.angle_rad) < math.pi:
        message = f"with sin x the release must lie within pi, not at {release.angle_rad} rad"
        raise ValueError(message)
    count = rates.size
    side = -1.0 if release.angle_rad < 0.0 else 1.0
    workspace = np.empty(work_size(count, time_s.size))
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
    workspace[_LOSSES : _LOSSES + count] = rates
    workspace[_DIRECTIONS : _DIRECTIONS + directions.size] = directions.ravel()
    request = _REQUEST(
        _address(workspace),
        count,
        tabulate,
        most,
        _address(time_s),
        time_s.size,
        _address(angle_rad),
        _address(jacobian),
        _address(turning),
        turning.shape[1],
        _address(readings),
        readings.size,
        _address(sums),
    )
    found, state = divmod(engine()(request), OVERDAMPED + 1)
    if state == OVERDAMPED:
        message = f"{model} is overdamped: it creeps towards its equilibrium and does not turn"
        raise ValueError(message)
    return found, state == STOPPED


def _address(array: FloatArray) -> int:
    """Return where an array's numbers are (twice as fast as ``array.ctypes.data``)."""
    if array is _NO_SAMPLES or array is _NONE or array.size == 0:
        return 0
    if not array.flags.writeable:
        return array.ctypes.data
    return ctypes.addressof(ctypes.c_double.from_buffer(array))  # type: ignore[arg-type]


def _directions_of(model: Eq8, hysteretic_share: float | None) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of the model's shape by its rates, and the rates."""
    derivatives = model.shape_derivatives()
    rates = np.array([model.quadratic, model.hysteretic, model.viscous, model.coulomb])
    if hysteretic_share is None:
        return derivatives, rates
    total = model.hysteretic + model.viscous
    if not 0.0 <= hysteretic_share <= 1.0:
        message = f"hysteretic_share must lie between 0 and 1, not {hysteretic_share}"
        raise ValueError(message)
    if abs(model.hysteretic - hysteretic_share * total) > 1e-9 * total:
        message = f"hysteretic_share is {hysteretic_share}, but {model} has another"
        raise ValueError(message)
    joint = hysteretic_share * derivatives[1] + (1.0 - hysteretic_share) * derivatives[2]
    return (
        np.stack([derivatives[0], joint, derivatives[3]]),
        np.array([model.quadratic, total, model.coulomb]),
    )
