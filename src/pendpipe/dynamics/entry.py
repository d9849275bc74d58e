"""The engine's entry for callers outside Numba: bare pointers, so that it can be kept as code."""

from __future__ import annotations

from typing import Any

from numba import cfunc, njit, types

from pendpipe.dynamics import march as marching
from pendpipe.dynamics.layout import CONSTANTS, OVERDAMPED, inputs_size, sums_size
from pendpipe.dynamics.views import matrix, vector

_march = njit(inline="always")(marching.march)
_inputs_size = njit(_nrt=False)(inputs_size)  # type: ignore[call-overload]
_sums_size = njit(_nrt=False)(sums_size)  # type: ignore[call-overload]
_POINTER: Any = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
_STATES = OVERDAMPED + 1


def _entry(
    buffer: Any, size: int, directions: int, y: float, tabulate: int, most: int, until_s: float,
    time_s: Any, times: int, angle_rad: Any, jacobian: Any, turning: Any, room: int,
    readings: Any, compared: int, sums: Any,
) -> int:  # fmt: skip
    """Run `march.march`; the buffer begins with the constants, the rates and the directions."""
    everything = vector(buffer, size)
    ways = everything[CONSTANTS + directions :]
    columns = directions + 4 if directions > 0 else 0
    count, state = _march(
        everything[:CONSTANTS], matrix(ways, directions, 4),
        everything[CONSTANTS : CONSTANTS + directions], y, tabulate != 0, most, until_s,
        vector(time_s, times), vector(angle_rad, times),
        matrix(vector(jacobian, columns * (times - compared)), columns, times - compared),
        matrix(vector(turning, (2 + 2 * columns) * room), 2 + 2 * columns, room),
        vector(readings, compared), vector(sums, _sums_size(columns) if compared > 0 else 0),
        everything[_inputs_size(directions) :],
    )  # fmt: skip
    return _STATES * count + state


def compiled_entry() -> Any:
    """Compile the engine; this takes half a minute."""
    integer, number = types.int64, types.float64
    signature = integer(
        _POINTER, integer, integer, number, integer, integer, number,
        _POINTER, integer, _POINTER, _POINTER, _POINTER, integer, _POINTER, integer, _POINTER,
    )  # fmt: skip
    return cfunc(signature, _nrt=False, error_model="numpy")(_entry)  # type: ignore[call-arg]
