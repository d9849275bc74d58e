"""The baseline's values in the vector of parameters: their names, places and bounds."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Motion
from pendpipe.dynamics.clock import Clock
from pendpipe.effects.effect import Pendulum

BASELINE: Final = ("a", "b", "c", "share", "omega", "start_rad", "start_s", "offset")
"""Eq. 13's rates; the hysteretic share of b; omega; the turning point from which the motion
starts (about the equilibrium) and when; and the reading of the equilibrium."""
A, B, C, SHARE, OMEGA, START, TIME, OFFSET = range(8)
LOW: Final = (0.0, 0.0, 0.0, 0.0, 1e-9, -math.inf, -math.inf, -math.inf)
HIGH: Final = (math.inf, math.inf, math.inf, 1.0, math.inf, math.inf, math.inf, math.inf)


def pendulum_of(value: FloatArray) -> Pendulum:
    """The baseline's constants from its values."""
    return Pendulum(
        float(value[OMEGA]), float(value[A]), float(value[SHARE] * value[B]),
        float((1.0 - value[SHARE]) * value[B]), float(value[C]),
    )  # fmt: skip


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
