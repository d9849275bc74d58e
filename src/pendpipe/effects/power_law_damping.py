"""Friction that follows any power of the velocity, or of the energy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import rows

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion

SPEED: Final = 0.1
"""rad/s at which the size is the friction's acceleration."""


def envelope_factor(exponent: float) -> float:
    """g_n = <|sin|^(n+1)>: c|v|^n lowers the amplitude by c (omega y)^n g_n/omega a second."""
    gamma = math.gamma
    return gamma(0.5 * exponent + 1.0) / (math.sqrt(math.pi) * gamma(0.5 * exponent + 1.5))


class PowerLawDamping(Effect):
    """f |v/v_1|^n, v_1 = 0.1 rad/s; or, with the same envelope, Eq. 9a's power of the energy.

    The amplitude falls as its n-th power. `energy_form` 0 is the velocity's law, whose third
    harmonic is (n - 1)/(n + 3) of the friction's first; 1 is Eq. 9a's with lambda = n/2,
    whose third harmonic is -1/3 whatever n; the envelope does not tell them apart.
    """

    identifier = "power-law-damping"
    name = "friction with another exponent"
    kind = "dynamics"
    equation = (
        r"\ddot x \mathrel{+}= -f\, |\dot x/v_1|^{n} \operatorname{sgn}\dot x,"
        r"\quad v_1 = 0.1\ \mathrm{rad/s}"
    )
    parameters = (
        Parameter("f", "rad/s^2", 0.0, 100.0),
        Parameter("exponent", "1", 0.1, 6.0),
        Parameter("energy_form", "1", 0.0, 1.0, 0.0),
    )
    deciding = "release it with other amplitudes at once after another: time and amplitude part"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -f |v/v_1|^n sgn(v), or the energy's law of the same envelope."""
        size, exponent, energy = values
        law = (1.0 - energy) * np.abs(motion.velocity / SPEED) ** exponent
        if energy:
            alike = 0.5 * math.pi * envelope_factor(exponent)
            speed = pendulum.angular_frequency * motion.amplitude
            law = law + energy * alike * (speed / SPEED) ** exponent
        return np.asarray(-size * motion.direction * law)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Exponents off those of Eq. 8 (0, 1, 2) and of the cubic law."""
        return rows((0.5, 1.5, 2.5, 4.0), (0.0,))
