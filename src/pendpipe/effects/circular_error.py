"""The restoring torque of a pendulum is sin(x)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Pendulum

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class CircularError(Effect):
    """omega^2 sin(x) in place of omega^2 x: the period grows by the amplitude squared/16."""

    identifier = "circular-error"
    name = "circular error"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 \sin x"
    parameters = ()
    switch = True
    prior = 6.0
    angular = True
    deciding = "release it again with half the amplitude: the period must follow 1 + y^2/16"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return omega^2 (x - sin x)."""
        omega = pendulum.angular_frequency
        return np.asarray(values[0] * omega * omega * (motion.angle - np.sin(motion.angle)))
