"""Friction that rises where the pivot slides slowly."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class StribeckFriction(Effect):
    """Dry friction that fades above a sliding velocity v_s: more loss at small amplitude."""

    identifier = "stribeck-friction"
    name = "Stribeck friction"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= -f_s\, e^{-(\dot x/v_s)^2} \operatorname{sgn}\dot x"
    parameters = (
        Parameter("f_s", "rad/s^2", 0.0, 100.0),
        Parameter("v_s", "rad/s", 1e-6, 100.0),
    )
    deciding = "lubricate or clean the pivot: the loss at small amplitude must change alone"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -f_s exp(-(v/v_s)^2) sgn(v)."""
        fading = np.exp(-((motion.velocity / values[1]) ** 2))
        return np.asarray(-values[0] * motion.direction * fading)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Fractions of the peak velocities within the record."""
        omega = span.pendulum.angular_frequency
        slow, fast = 0.3 * omega * span.last_amplitude, 0.5 * omega * span.first_amplitude
        return [(float(speed),) for speed in np.geomspace(slow, max(fast, 2.0 * slow), 6)]
