"""The fluid remembers how the pendulum began to move (Basset's force)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.complex_erfcx import erfcx
from pendpipe.effects.effect import Effect, Parameter, Pendulum
from pendpipe.effects.scan import half_cycle_of_release, since_release

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class HistoryForce(Effect):
    """h times the half derivative of the velocity, from rest at the release.

    The fluid is at rest until the turning point at which the pendulum is let go. For a motion
    V(t) = V(0) e^(st) from there, the half derivative of v is
    sqrt(s) [V(t) - V(0) erfcx(sqrt(st))], erfcx(z) = e^(z^2) erfc(z); s, the local rate of decay
    and phase, changes too slowly in a free decay to matter. What remains long after the release
    is a viscous friction and an added mass.
    """

    identifier = "history-force"
    name = "history force (Basset)"
    kind = "dynamics"
    equation = (
        r"\ddot x \mathrel{+}= -\frac{h}{\sqrt\pi}"
        r" \int_0^t \frac{\ddot x(s)}{\sqrt{t - s}}\, \mathrm{d}s"
    )
    parameters = (Parameter("h", "1/sqrt(s)", 0.0, 100.0),)
    deciding = "record the first swings after a release from rest, with a lighter bob"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -h d^(1/2) v/dt^(1/2)."""
        rate = _local_rate(motion)
        root = np.sqrt(rate)
        faded = erfcx(root * np.sqrt(since_release(motion, pendulum)))
        # x = Re(X), X = upwards r e^(i psi), and V = i omega X.
        swinging = (
            motion.upwards * motion.amplitude * (motion.clock.cosine + 1j * motion.clock.sine)
        )
        first = half_cycle_of_release(motion, pendulum)
        let_go = motion.angle[first, 0]
        half_derivative = np.real(
            1j * pendulum.angular_frequency * root * (swinging - let_go * faded)
        )
        half_derivative[:first] = 0.0
        return np.asarray(-values[0] * half_derivative)


def _local_rate(motion: Motion) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    """-decay + i times the angular frequency of each half cycle, 1/s; shape (count, 1)."""
    lasts = motion.time_s[:, -1] - motion.time_s[:, 0]
    falls = motion.log_amplitude[:, -1] - motion.log_amplitude[:, 0]
    return np.asarray((falls + 1j * math.pi) / lasts)[:, None]
