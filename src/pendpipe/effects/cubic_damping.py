"""Friction of the third power: v^3, or a viscous friction that depends on the angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import rows

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class CubicDamping(Effect):
    """dr/dt = -d r^3/8 by v^3 (`position_form` 0) or by x^2 v (1): van der Pol, Rayleigh.

    The friction's third harmonic is 1/3 of its first for v^3 and -1 for x^2 v.
    """

    identifier = "cubic-damping"
    name = "cubic damping"
    kind = "dynamics"
    equation = (
        r"\ddot x \mathrel{+}= -d \left[(1 - p)\, \frac{\dot x^3}{3 \omega^2}"
        r" + p\, x^2 \dot x\right]"
    )
    parameters = (
        Parameter("d", "1/(rad^2 s)", -1e3, 1e3),
        Parameter("position_form", "1", 0.0, 1.0, 0.0),
    )
    deciding = (
        "release it with twice the amplitude: the sign of the third harmonic in quadrature "
        "tells v^3 from x^2 v"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -d ((1 - p) v^3/(3 omega^2) + p x^2 v)."""
        size, position = values
        third = (1.0 - position) / (3.0 * pendulum.angular_frequency**2)
        square = third * motion.velocity**2 + position * motion.angle**2
        return np.asarray(-size * square * motion.velocity)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Both forms."""
        return rows((0.0, 1.0))
