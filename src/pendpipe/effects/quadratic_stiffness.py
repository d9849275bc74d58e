"""A restoring torque that differs from side to side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class QuadraticStiffness(Effect):
    """omega^2 (x + k_2 x^2): mean shift -k_2 y^2/2, second harmonic k_2 y^2/6."""

    identifier = "quadratic-stiffness"
    name = "quadratic restoring torque"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 (x + k_2 x^2)"
    parameters = (Parameter("k2", "1/rad", -30.0, 30.0),)
    deciding = (
        "turn the sensor round: the second harmonic must change its sign with it, and stay "
        "-1/3 of the mean shift"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -omega^2 k_2 x^2."""
        return np.asarray(-values[0] * pendulum.angular_frequency**2 * motion.angle**2)
