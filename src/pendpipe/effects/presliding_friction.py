"""Dry contacts that give way elastically before they slide (Dahl)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


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
    deciding = (
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
