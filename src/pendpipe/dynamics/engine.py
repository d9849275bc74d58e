"""The call of the compiled engine."""

from __future__ import annotations

import ctypes
import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.dynamics.compiled import engine
from pendpipe.dynamics.layout import FIELDS, OVERDAMPED, REQUEST, STOPPED, work_size

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.model import Eq8, Release

NO_SAMPLES: FloatArray = np.empty(0)
NONE: FloatArray = np.empty((0, 0))
NO_LIMIT = 2**62
_REQUEST = ctypes.c_int64 * len(REQUEST)
_LOSSES, _DIRECTIONS = FIELDS["rate"].offset, FIELDS["directions"].offset


def run(
    model: Eq8,
    release: Release,
    *,
    tabulate: bool,
    directions: FloatArray = NONE,
    rates: FloatArray = NO_SAMPLES,
    most: int = NO_LIMIT,
    until_s: float = math.inf,
    time_s: FloatArray = NO_SAMPLES,
    angle_rad: FloatArray = NO_SAMPLES,
    jacobian: FloatArray = NONE,
    turning: FloatArray = NONE,
    readings: FloatArray = NO_SAMPLES,
    sums: FloatArray = NO_SAMPLES,
) -> tuple[int, bool]:
    """Call the engine; return the number of turning points and whether the last is the stop."""
    if model.restoring == "sine" and not abs(release.angle_rad) < math.pi:
        message = f"with sin x the release must lie within pi, not at {release.angle_rad} rad"
        raise ValueError(message)
    count = rates.size
    side = -1.0 if release.angle_rad < 0.0 else 1.0
    workspace = np.empty(work_size(count, time_s.size))
    workspace[:_LOSSES] = (
        *model.shape(), model.angular_frequency, release.time_s, release.offset_rad, side, side,
        abs(release.angle_rad), until_s,
    )  # fmt: skip
    workspace[_LOSSES : _LOSSES + count] = rates
    workspace[_DIRECTIONS : _DIRECTIONS + directions.size] = directions.ravel()
    request = _REQUEST(
        _address(workspace), count, tabulate, most, _address(time_s), time_s.size,
        _address(angle_rad), _address(jacobian), _address(turning), turning.shape[1],
        _address(readings), readings.size, _address(sums),
    )  # fmt: skip
    found, state = divmod(engine()(request), OVERDAMPED + 1)
    if state == OVERDAMPED:
        message = f"{model} is overdamped: it creeps towards its equilibrium and does not turn"
        raise ValueError(message)
    return found, state == STOPPED


def _address(array: FloatArray) -> int:
    """Return where an array's numbers are (twice as fast as ``array.ctypes.data``)."""
    if array is NO_SAMPLES or array is NONE or array.size == 0:
        return 0
    if not array.flags.writeable:
        return array.ctypes.data
    return ctypes.addressof(ctypes.c_double.from_buffer(array))  # type: ignore[arg-type]


def directions_of(model: Eq8, hysteretic_share: float | None) -> tuple[FloatArray, FloatArray]:
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
