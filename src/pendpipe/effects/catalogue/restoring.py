"""Restoring torques other than omega^2 x."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum

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
    parameter_free = True
    prior = 6.0
    angular = True
    example = (1.0,)
    discriminating_test = (
        "release it again with half the amplitude: the period must follow 1 + y^2/16"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return omega^2 (x - sin x)."""
        omega = pendulum.angular_frequency
        return np.asarray(values[0] * omega * omega * (motion.angle - np.sin(motion.angle)))


class CubicStiffness(Effect):
    """omega^2 (x + k_3 x^3): the frequency changes by 3 k_3 y^2/8 (Duffing)."""

    identifier = "cubic-stiffness"
    name = "cubic restoring torque"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 (x + k_3 x^3)"
    parameters = (Parameter("k3", "1/rad^2", -100.0, 100.0),)
    example = (0.1,)
    discriminating_test = (
        "release it again with half the amplitude: the frequency must follow its square"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -omega^2 k_3 x^3."""
        return np.asarray(-values[0] * pendulum.angular_frequency**2 * motion.angle**3)


class QuadraticStiffness(Effect):
    """omega^2 (x + k_2 x^2): mean shift -k_2 y^2/2, second harmonic k_2 y^2/6."""

    identifier = "quadratic-stiffness"
    name = "quadratic restoring torque"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 (x + k_2 x^2)"
    parameters = (Parameter("k2", "1/rad", -30.0, 30.0),)
    example = (0.05,)
    discriminating_test = (
        "turn the sensor round: the second harmonic must change its sign with it, and stay "
        "-1/3 of the mean shift"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -omega^2 k_2 x^2."""
        return np.asarray(-values[0] * pendulum.angular_frequency**2 * motion.angle**2)
