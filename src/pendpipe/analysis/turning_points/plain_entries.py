"""The loops of plain records for callers outside Numba; see `entries.py`."""

from __future__ import annotations

from typing import Any

from pendpipe.analysis.turning_points import plain_loops as loops
from pendpipe.analysis.turning_points.tracking import track
from pendpipe.dynamics.views import matrix, vector


def _fourth_square(values: Any, size: int, result: Any) -> int:
    vector(result, 1)[0] = loops.fourth_square(vector(values, size))
    return 0


def _block_squares(values: Any, size: int, length: int, squares: Any, blocks: int) -> int:
    loops.block_squares(vector(values, size), length, vector(squares, blocks))
    return 0


def _extent(values: Any, size: int, result: Any) -> int:
    return loops.extent(vector(values, size), vector(result, 2))


def _stays(values: Any, size: int, extreme: float, result: Any) -> int:
    loops.stays(vector(values, size), extreme, vector(result, 2))
    return 0


def _half_cycle_scatter(
    middles: Any, count: int, time_s: Any, residual: Any, size: int, result: Any
) -> int:
    return loops.half_cycle_scatter(
        vector(middles, count), vector(time_s, size), vector(residual, size), vector(result, 1)
    )


def _track(
    values: Any, size: int, start: Any, columns: Any, stride: int, first: int, room: int,
    result: Any, work: Any, work_size: int,
) -> int:  # fmt: skip
    count: int = track(
        vector(values, size), vector(start, 10), matrix(vector(columns, 5 * stride), 5, stride),
        first, room, vector(result, 2), vector(work, work_size),
    )  # fmt: skip
    return count
