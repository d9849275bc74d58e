"""How a pendulum with these losses moves.

Eq. 8 goes through the compiled engine (`eq8`), other laws of angle and velocity through the same
half-cycle map in numpy (`laws`, `autonomous`), and laws with explicit time or states of their
own through a general integrator (`driven`).
"""

from pendpipe.dynamics.driven import Driven, DrivenMotion, follow_driven
from pendpipe.dynamics.eq8 import (
    Method,
    TurningPoints,
    sample,
    sample_with_jacobian,
    turning_points,
    turning_points_with_jacobian,
)
from pendpipe.dynamics.laws import (
    Autonomous,
    EnergyFriction,
    Eq8Friction,
    Friction,
    FrictionOf,
    Gravity,
    PolynomialTorque,
    PowerFriction,
    Restoring,
    StribeckFriction,
    linear,
)
from pendpipe.dynamics.model import JACOBIAN_COLUMNS, JOINT_JACOBIAN_COLUMNS, Eq8, Release
from pendpipe.dynamics.residuals import Comparison, compare, residuals

__all__ = [
    "JACOBIAN_COLUMNS",
    "JOINT_JACOBIAN_COLUMNS",
    "Autonomous",
    "Comparison",
    "Driven",
    "DrivenMotion",
    "EnergyFriction",
    "Eq8",
    "Eq8Friction",
    "Friction",
    "FrictionOf",
    "Gravity",
    "Method",
    "PolynomialTorque",
    "PowerFriction",
    "Release",
    "Restoring",
    "StribeckFriction",
    "TurningPoints",
    "compare",
    "follow_driven",
    "linear",
    "residuals",
    "sample",
    "sample_with_jacobian",
    "turning_points",
    "turning_points_with_jacobian",
]
