"""Turning points from all the readings of their half cycles (the first step to Eq. 14)."""

from typing import TYPE_CHECKING

from pendpipe.analysis.turning_points.table import (
    TurningPoints,
    read_turning_points,
    write_turning_points,
)

if TYPE_CHECKING:
    from pendpipe.analysis.turning_points.find import find_turning_points

__all__ = ["TurningPoints", "find_turning_points", "read_turning_points", "write_turning_points"]


def __getattr__(name: str) -> object:
    """Import the finder, and with it numba, only when it is asked for."""
    if name == "find_turning_points":
        from pendpipe.analysis.turning_points.find import find_turning_points

        return find_turning_points
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
