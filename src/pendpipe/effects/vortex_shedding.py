"""Vortex rings that are shed above an amplitude."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class VortexShedding(Effect):
    """An extra loss dy/dt = -k (y - y_c) above an amplitude y_c, and none below.

    The ring is shed at the reversal, so it is the turning point before a half cycle that
    decides how much the half cycle loses.
    """

    identifier = "vortex-shedding"
    name = "vortex shedding above an amplitude"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= -2 k\, \max(0, 1 - y_c/|x_\mathrm{turn}|)\, \dot x"
    parameters = (
        Parameter("k", "1/s", 0.0, 100.0),
        Parameter("y_c", "rad", 1e-6, 10.0),
    )
    deciding = "change the fluid's viscosity: the kink in the damping must move, in amplitude"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 k max(0, 1 - y_c/|turning angle|) v."""
        above = np.maximum(0.0, 1.0 - values[1] / np.abs(motion.turning_angle))
        return np.asarray(-2.0 * values[0] * above * motion.velocity)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Amplitudes within the record."""
        return [(float(angle),) for angle in span.amplitudes(12)]
