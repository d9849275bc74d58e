"""Play between the pendulum and what drives it back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class Backlash(Effect):
    """No restoring torque within a gap b: the frequency falls by 2/pi b/(2 y) of itself."""

    identifier = "backlash"
    name = "play in the pivot"
    kind = "dynamics"
    equation = (
        r"\omega^2 x \to \omega^2 \left(x -"
        r" \operatorname{clip}(x, -\tfrac b2, \tfrac b2)\right)"
    )
    parameters = (Parameter("b", "rad", 0.0, 1.0),)
    deciding = "swing it at ever smaller amplitudes: the frequency must fall as 1/amplitude"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return omega^2 x within the gap, omega^2 b/2 beyond it."""
        half = 0.5 * values[0]
        if half == 0.0:
            return np.zeros_like(motion.angle)
        within = half * np.clip(motion.angle / abs(half), -1.0, 1.0)
        return np.asarray(pendulum.angular_frequency**2 * within)
