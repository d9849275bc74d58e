"""The baseline's places in the vector of parameters, and what effects need of its values."""

import math

import numpy as np

from pendpipe.arrays import FloatArray
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
)
from pendpipe.dynamics.eq8_model import HYSTERETIC, VISCOUS, values_of
from pendpipe.effects.effect import Pendulum

__all__ = [
    "BASELINE",
    "HYSTERETIC",
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
    "pendulum_of",
    "values_of",
]


def pendulum_of(value: FloatArray) -> Pendulum:
    """The baseline's constants from its values."""
    return Pendulum(
        float(value[OMEGA]),
        float(value[A]),
        float(value[SHARE] * value[B]),
        float((1.0 - value[SHARE]) * value[B]),
        float(value[C]),
    )


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
