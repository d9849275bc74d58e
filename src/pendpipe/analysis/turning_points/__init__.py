"""Turning points from all the readings of their half cycles (the first step to Eq. 14)."""

from pendpipe.analysis.turning_points.find import find_turning_points
from pendpipe.analysis.turning_points.table import (
    TurningPoints,
    is_turning_points,
    read_turning_points,
    write_turning_points,
)

__all__ = [
    "TurningPoints",
    "find_turning_points",
    "is_turning_points",
    "read_turning_points",
    "write_turning_points",
]
