"""What a fluid does beyond drag: it remembers, and it sheds vortices."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Parameter, Pendulum, Span, enters
from pendpipe.effects.scan import (
    half_cycle_of_release,
    phase_since_reversal,
    rows,
    since_release,
)

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


@enters(
    "acceleration",
    identifier="history-force",
    name="history force (Basset)",
    equation=(
        r"\ddot x \mathrel{+}= -\frac{h}{\sqrt\pi}"
        r" \int_0^t \frac{\ddot x(s)}{\sqrt{t - s}}\, \mathrm{d}s"
    ),
    parameters=(Parameter("h", "1/sqrt(s)", 0.0, 100.0),),
    example=(0.01,),
    discriminating_test="record the first swings after a release from rest, with a lighter bob",
)
def history_force(motion: Motion, pendulum: Pendulum, size: float) -> FloatArray:
    """h times the half derivative of the velocity, from rest at the release.

    The fluid is at rest until the turning point at which the pendulum is let go. For a motion
    V(t) = V(0) e^(st) from there, the half derivative of v is
    sqrt(s) [V(t) - V(0) erfcx(sqrt(st))], erfcx(z) = e^(z^2) erfc(z); s, the local rate of decay
    and phase, changes too slowly in a free decay to matter. What remains long after the release
    is a viscous friction and an added mass.
    """
    root = np.sqrt(_local_rate(motion))
    from scipy.special import erfcx

    faded = erfcx(root * np.sqrt(since_release(motion, pendulum)))
    # x = Re(X), X = upwards r e^(i psi), and V = i omega X.
    swinging = motion.upwards * motion.amplitude * (motion.clock.cosine + 1j * motion.clock.sine)
    first = half_cycle_of_release(motion, pendulum)
    let_go = motion.angle[first, 0]
    half_derivative = np.real(1j * pendulum.angular_frequency * root * (swinging - let_go * faded))
    half_derivative[:first] = 0.0
    return np.asarray(-size * half_derivative)


def _local_rate(motion: Motion) -> np.ndarray[tuple[int, ...], np.dtype[np.complex128]]:
    """-decay + i times the angular frequency of each half cycle, 1/s; shape (count, 1)."""
    lasts = motion.time_s[:, -1] - motion.time_s[:, 0]
    falls = motion.log_amplitude[:, -1] - motion.log_amplitude[:, 0]
    return np.asarray((falls + 1j * math.pi) / lasts)[:, None]


def _onsets(span: Span) -> list[tuple[float, ...]]:
    """Amplitudes within the record, and a short and a long burst."""
    return rows(span.amplitudes(12), (0.4, 1.2))


@enters(
    "acceleration",
    identifier="vortex-shedding",
    name="vortex shedding above an amplitude",
    equation=(
        r"\ddot x \mathrel{+}= -\frac{\pi \omega k\, (1 + \phi^2)}{\phi^2 (1 + e^{-\pi/\phi})}"
        r" \max(0, |x_\mathrm{turn}| - y_c)\, e^{-\psi/\phi}\, \mathrm{sgn}\, \dot x"
    ),
    parameters=(
        Parameter("k", "1/s", 0.0, 100.0),
        Parameter("y_c", "rad", 1e-6, 10.0),
        Parameter("phi", "1", 0.2, 2.0, 0.6),
    ),
    example=(0.01, 0.1, 0.6),
    discriminating_test=(
        "change the fluid's viscosity: the kink in the damping must move, in amplitude"
    ),
    shapes=_onsets,
)
def vortex_shedding(
    motion: Motion, pendulum: Pendulum, loss: float, critical: float, lasts: float
) -> FloatArray:
    """A burst of drag after each reversal, which takes dy/dt = -k (y - y_c) above y_c.

    The ring is shed at the reversal, so it is the turning point before a half cycle that
    decides how much the half cycle loses, and most of it is lost while the phase psi since
    then goes through phi. Since it pulls back towards the turning point, the frequency
    falls as well: d omega = -k (1 - y_c/y)/phi.
    """
    above = np.maximum(0.0, np.abs(motion.turning_angle) - critical)
    # The integral of e^(-psi/phi) sin(psi) over half a cycle.
    work = lasts**2 * (1.0 + math.exp(-math.pi / lasts)) / (1.0 + lasts**2)
    burst = np.exp(-phase_since_reversal(motion) / lasts)
    size = math.pi * pendulum.angular_frequency * loss / work
    return np.asarray(-size * motion.direction * above * burst)
