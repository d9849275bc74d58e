"""What dry contacts do: friction that fades with speed, gives way before it slides, or has play."""

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
    example = (1e-3, 0.1)
    discriminating_test = (
        "lubricate or clean the pivot: the loss at small amplitude must change alone"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -f_s exp(-(v/v_s)^2) sgn(v)."""
        fading = np.exp(-((motion.velocity / values[1]) ** 2))
        return np.asarray(-values[0] * motion.direction * fading)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Fractions of the peak velocities within the record."""
        omega = span.pendulum.angular_frequency
        slow, fast = 0.3 * omega * span.last_amplitude, 0.5 * omega * span.first_amplitude
        return [(float(speed),) for speed in np.geomspace(slow, max(fast, 2.0 * slow), 6)]


class PreslidingFriction(Effect):
    """Dahl's friction: z' = v - |v| z/z_c, torque omega^2 k_d z.

    Coulomb friction omega^2 k_d z_c at amplitudes far above z_c; a spring and a loss of the
    second power below. The contact is taken to have swung with the first amplitude before.
    """

    identifier = "presliding-friction"
    name = "presliding friction (Dahl)"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= -\omega^2 k_d z, \quad \dot z = \dot x - |\dot x|\, z/z_c"
    parameters = (
        Parameter("k_d", "1", 0.0, 10.0),
        Parameter("z_c", "rad", 1e-7, 10.0),
    )
    example = (1e-3, 0.02)
    discriminating_test = (
        "swing it at ever smaller amplitudes: the frequency must rise, and the damping fall, "
        "below z_c"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -omega^2 k_d z, z in closed form since the last reversal."""
        breakaway = values[1]
        moved = np.abs(motion.angle - motion.turning_angle) / breakaway
        left = np.exp(-moved)
        # In the direction of motion z/z_c = 1 - (1 - s) e^(-moved), s at the reversal.
        start = _at_reversals(left[:, -1])[:, None]
        deflection = breakaway * (1.0 - (1.0 - start) * left)
        size = values[0] * pendulum.angular_frequency**2
        return np.asarray(-size * motion.direction * deflection)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Breakaway angles from far below the smallest amplitude to the largest."""
        small = 0.2 * span.last_amplitude
        return [(float(angle),) for angle in np.geomspace(small, span.first_amplitude, 4)]


def _at_reversals(left: FloatArray) -> FloatArray:
    """z/z_c at the start of each half cycle, in the direction that follows."""
    found = []
    deflection = (left[0] - 1.0) / (left[0] + 1.0)
    for part in left.tolist():
        found.append(deflection)
        deflection = (1.0 - deflection) * part - 1.0
    return np.array(found)


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
    example = (1e-3,)
    discriminating_test = (
        "swing it at ever smaller amplitudes: the frequency must fall as 1/amplitude"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return omega^2 x within the gap, omega^2 b/2 beyond it."""
        half = 0.5 * values[0]
        if half == 0.0:
            return np.zeros_like(motion.angle)
        within = half * np.clip(motion.angle / abs(half), -1.0, 1.0)
        return np.asarray(pendulum.angular_frequency**2 * within)
