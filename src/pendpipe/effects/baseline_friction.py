"""The two frictions of Eq. 8 that the viscous baseline (Eq. 3) leaves out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class CoulombFriction(Effect):
    """Dry friction: the amplitude falls by c a second, whatever it is (c of Eq. 13)."""

    identifier = "coulomb-friction"
    name = "Coulomb friction"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= -\tfrac{\pi}{2}\, \omega c\, \operatorname{sgn}\dot x"
    parameters = (Parameter("c", "rad/s", 0.0, 10.0),)
    inside = ("eq8",)
    expected = True
    prior = 6.0
    deciding = "let it swing to the end: it must stop, off the equilibrium, and not fade away"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -(pi/2) omega c sgn(v)."""
        size = 0.5 * math.pi * pendulum.angular_frequency * values[0]
        return np.asarray(-size * motion.direction * np.ones_like(motion.angle))


class QuadraticDrag(Effect):
    """Fluid drag in Eq. 8's energy form: 1/amplitude grows by a a second (a of Eq. 13)."""

    identifier = "quadratic-drag"
    name = "quadratic drag"
    kind = "dynamics"
    equation = (
        r"\ddot x \mathrel{+}= -\tfrac{\pi}{2}\, \tfrac{a}{\omega}"
        r" (\omega^2 x^2 + \dot x^2) \operatorname{sgn}\dot x"
    )
    parameters = (Parameter("a", "1/(rad s)", 0.0, 100.0),)
    inside = ("eq8",)
    expected = True
    prior = 6.0
    deciding = "change the fluid's density (a vacuum, or another gas): a must follow it"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -(pi/2) a omega r^2 sgn(v)."""
        size = 0.5 * math.pi * pendulum.angular_frequency * values[0]
        return np.asarray(-size * motion.direction * motion.amplitude**2)
