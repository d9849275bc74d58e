"""The baseline's values in the vector of parameters: their names, places and bounds.

Of b = b_h + b_v one part, or both, may be held: then the share, or b as well, is not free.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release
from pendpipe.dynamics.any_law import Clock, Motion
from pendpipe.dynamics.eq8 import (
    BASELINE,
    OFFSET,
    OMEGA,
    SHARE,
    SHARE_MEAN,
    SHARE_SD,
    START,
    TIME,
    A,
    B,
    C,
    share_of,
)
from pendpipe.effects.effect import Pendulum

__all__ = [
    "BASELINE",
    "HIGH",
    "HYSTERETIC",
    "LOW",
    "OFFSET",
    "OMEGA",
    "SHARE",
    "SHARE_MEAN",
    "SHARE_SD",
    "START",
    "TIME",
    "VISCOUS",
    "A",
    "B",
    "C",
    "closed_form",
    "held_indices",
    "pendulum_of",
    "share_by_b",
    "values_of",
    "with_parts",
]

LOW: Final = (0.0, 0.0, 0.0, 0.0, 1e-9, -math.inf, -math.inf, -math.inf)
"""Least values, in the order of `BASELINE`."""
HIGH: Final = (math.inf, math.inf, math.inf, 1.0, math.inf, math.inf, math.inf, math.inf)
"""And the largest."""


def pendulum_of(value: FloatArray) -> Pendulum:
    """The baseline's constants from its values."""
    return Pendulum(
        float(value[OMEGA]),
        float(value[A]),
        float(value[SHARE] * value[B]),
        float((1.0 - value[SHARE]) * value[B]),
        float(value[C]),
    )


def values_of(law: Eq8, release: Release, offset: float = 0.0) -> FloatArray:
    """The baseline's values of a law that moves from a turning point."""
    losses = law.quadratic, law.hysteretic + law.viscous, law.coulomb, law.share
    return np.array([*losses, law.angular_frequency, release.angle_rad, release.time_s, offset])


def closed_form(value: FloatArray, clock: Clock) -> Motion:
    """The motion by Eq. 14, without ripple."""
    from pendpipe.physics.decay import amplitude

    omega = float(value[OMEGA])
    time = value[TIME] + clock.psi / omega
    start = abs(float(value[START]))
    decayed = amplitude(clock.psi / omega, start, *(max(float(value[k]), 0.0) for k in (A, B, C)))
    # Not so small that friction would hold the guess itself.
    stop = 2.0 * math.pi * max(float(value[C]), 0.0) / omega
    kept = np.maximum(decayed, min(max(1e-3 * start, stop), start))
    return Motion(clock, omega, np.log(kept), time, math.copysign(1.0, value[START]))


HYSTERETIC, VISCOUS = "hysteretic", "viscous"


def held_indices(parts: Mapping[str, float]) -> list[int]:
    """Indices of the values that held parts leave no freedom: with one, b moves the share."""
    return ([], [SHARE], [B, SHARE])[len(parts)]


def with_parts(value: FloatArray, parts: Mapping[str, float]) -> FloatArray:
    """Values with the share (and, if both parts are held, the b) that held parts make."""
    if not parts:
        return value
    value = value.copy()
    least = sum(parts.values())
    value[B] = least if len(parts) == 2 else max(float(value[B]), least)
    share = share_of(parts, float(value[B]))
    value[SHARE] = value[SHARE] if share is None else share
    return value


def share_by_b(value: FloatArray, parts: Mapping[str, float]) -> float:
    """Derivative of the share by b where one part of b is held; else b has it for itself."""
    if len(parts) != 1 or value[B] <= 0.0:
        return 0.0
    return float(-value[SHARE] if HYSTERETIC in parts else 1.0 - value[SHARE]) / float(value[B])
