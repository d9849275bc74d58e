"""A sensor that follows the pendulum with play."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.sampling import Sampled


class SensorBacklash(Effect):
    """The reading stays behind by b/2, and rests after a reversal until the play is used up."""

    identifier = "sensor-backlash"
    name = "play in the sensor's coupling"
    kind = "measurement"
    equation = (
        r"y = x - \operatorname{sgn}(\dot x)"
        r" \left[\tfrac b2 - \max(0, b - |x - x_\mathrm{turn}|)\right]"
    )
    parameters = (Parameter("b", "rad", 0.0, 1.0),)
    deciding = "move the pendulum slowly by hand both ways against a scale: the readings differ"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return the play operator less the angle."""
        motion = sampled.motion
        half = np.floor(sampled.phase / math.pi).astype(np.intp)
        half = np.clip(half, 0, motion.clock.count - 1)
        turn, direction = motion.turning_angle[half, 0], motion.direction[half, 0]
        rests = np.maximum(0.0, values[0] - np.abs(sampled.angle - turn))
        return np.asarray(direction * (rests - 0.5 * values[0]))
