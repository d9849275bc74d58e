"""A restoring torque that hardens or softens with the cube of the angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class CubicStiffness(Effect):
    """omega^2 (x + k_3 x^3): the frequency changes by 3 k_3 y^2/8 (Duffing)."""

    identifier = "cubic-stiffness"
    name = "cubic restoring torque"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 (x + k_3 x^3)"
    parameters = (Parameter("k3", "1/rad^2", -100.0, 100.0),)
    deciding = "release it again with half the amplitude: the frequency must follow its square"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -omega^2 k_3 x^3."""
        return np.asarray(-values[0] * pendulum.angular_frequency**2 * motion.angle**3)
