"""How a pendulum with these losses moves."""

from pendpipe.dynamics.eq8 import (
    Method,
    TurningPoints,
    sample,
    sample_with_jacobian,
    turning_points,
    turning_points_with_jacobian,
)
from pendpipe.dynamics.model import JACOBIAN_COLUMNS, JOINT_JACOBIAN_COLUMNS, Eq8, Release

__all__ = [
    "JACOBIAN_COLUMNS",
    "JOINT_JACOBIAN_COLUMNS",
    "Eq8",
    "Method",
    "Release",
    "TurningPoints",
    "sample",
    "sample_with_jacobian",
    "turning_points",
    "turning_points_with_jacobian",
]
