"""Vortex rings that are shed above an amplitude."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import phase_since_reversal, rows

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class VortexShedding(Effect):
    """A burst of drag after each reversal, which takes dy/dt = -k (y - y_c) above y_c.

    The ring is shed at the reversal, so it is the turning point before a half cycle that
    decides how much the half cycle loses, and most of it is lost while the phase psi since
    then goes through phi. Since it pulls back towards the turning point, the frequency
    falls as well: d omega = -k (1 - y_c/y)/phi.
    """

    identifier = "vortex-shedding"
    name = "vortex shedding above an amplitude"
    kind = "dynamics"
    equation = (
        r"\ddot x \mathrel{+}= -\frac{\pi \omega k\, (1 + \phi^2)}{\phi^2 (1 + e^{-\pi/\phi})}"
        r" \max(0, |x_\mathrm{turn}| - y_c)\, e^{-\psi/\phi}\, \mathrm{sgn}\, \dot x"
    )
    parameters = (
        Parameter("k", "1/s", 0.0, 100.0),
        Parameter("y_c", "rad", 1e-6, 10.0),
        Parameter("phi", "1", 0.2, 2.0, 0.6),
    )
    deciding = "change the fluid's viscosity: the kink in the damping must move, in amplitude"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -(pi omega k/I) max(0, |turning angle| - y_c) e^(-psi/phi) sgn(v).

        I, the integral of e^(-psi/phi) sin(psi) over half a cycle, is
        phi^2 (1 + e^(-pi/phi))/(1 + phi^2).
        """
        loss, critical, lasts = values
        above = np.maximum(0.0, np.abs(motion.turning_angle) - critical)
        work = lasts**2 * (1.0 + math.exp(-math.pi / lasts)) / (1.0 + lasts**2)
        burst = np.exp(-phase_since_reversal(motion) / lasts)
        size = math.pi * pendulum.angular_frequency * loss / work
        return np.asarray(-size * motion.direction * above * burst)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Amplitudes within the record, and a short and a long burst."""
        return rows(span.amplitudes(12), (0.4, 1.2))
