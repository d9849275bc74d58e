"""How a pendulum with these losses moves.

Eq. 8 goes through the compiled engine (`eq8`); any other law through `any_law`.
"""

from pendpipe.dynamics.eq8 import (
    JACOBIAN_COLUMNS,
    Eq8,
    Release,
    TurningPoints,
    sample,
    sample_with_jacobian,
    turning_points,
    turning_points_with_jacobian,
)

__all__ = [
    "JACOBIAN_COLUMNS",
    "Eq8",
    "Release",
    "TurningPoints",
    "sample",
    "sample_with_jacobian",
    "turning_points",
    "turning_points_with_jacobian",
]
