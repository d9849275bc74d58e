"""Losses: friction and drag that follow amplitude, velocity or history; dry contacts; a fluid."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Motion
from pendpipe.dynamics.half_derivative import half_derivative
from pendpipe.dynamics.kernel import kernel
from pendpipe.effects.effect import (
    Parameter,
    Pendulum,
    between,
    enters,
    half_cycle_of_release,
    other_form,
    phase_since_reversal,
    rows,
)


@enters(
    "acceleration",
    identifier="coulomb-friction",
    name="Coulomb friction",
    equation=r"\ddot x \mathrel{+}= -\tfrac{\pi}{2}\, \omega c\, \operatorname{sgn}\dot x",
    parameters=(Parameter("c", "rad/s", 0.0, 10.0, word="friction"),),
    inside=("eq8",),
    expected=True,
    prior=6.0,
    example=(1e-4,),
    discriminating_test=(
        "let it swing to the end: it must stop, off the equilibrium, instead of fading away"
    ),
)
def coulomb_friction(motion: Motion, pendulum: Pendulum, c: float) -> FloatArray:
    """Dry friction: the amplitude falls by c a second, whatever it is (c of Eq. 13)."""
    size = 0.5 * math.pi * pendulum.angular_frequency * c
    return np.asarray(-size * motion.direction * np.ones_like(motion.angle))


@enters(
    "acceleration",
    identifier="quadratic-drag",
    name="quadratic drag",
    equation=(
        r"\ddot x \mathrel{+}= -\tfrac{\pi}{2}\, \tfrac{a}{\omega}"
        r" (\omega^2 x^2 + \dot x^2) \operatorname{sgn}\dot x"
    ),
    parameters=(Parameter("a", "1/(rad s)", 0.0, 100.0, word="drag"),),
    inside=("eq8",),
    expected=True,
    prior=6.0,
    example=(0.01,),
    discriminating_test="change the fluid's density (a vacuum, or another gas): a must follow it",
)
def quadratic_drag(motion: Motion, pendulum: Pendulum, a: float) -> FloatArray:
    """Fluid drag in Eq. 8's energy form: 1/amplitude grows by a a second (a of Eq. 13)."""
    size = 0.5 * math.pi * pendulum.angular_frequency * a
    square = pendulum.energy(motion.angle, motion.velocity) / pendulum.angular_frequency**2
    return np.asarray(-size * motion.direction * square)


drag_form: Final = other_form(
    __name__,
    """v|v| with the same envelope as Eq. 8's fluid term; the third harmonic changes its sign.

    Both fall as dr/dt = -a r^2 if v|v| is 1.5 times as strong; the friction's third harmonic
    is 1/5 of its first for v|v|, and -1/3 for the energy form. With sin x the envelopes part at
    large amplitudes. It has no size to scan for: the fit takes one form, and a diagnosis goes to
    the other where the readings tell it beside what was left out.
    """,
    {"drag": "speed"},
    identifier="drag-form",
    name="drag that follows the square of the velocity",
    equation=(
        r"f_q (\omega^2 x^2 + \dot x^2) \operatorname{sgn}\dot x"
        r" \to \tfrac{3}{2} f_q\, \dot x |\dot x|"
    ),
    needs=("a",),
    discriminating_test=(
        "release it with several times the amplitude: the third harmonic in quadrature must "
        "grow with its square, with the sign of v|v|"
    ),
)


SPEED: Final = 0.1
"""rad/s at which the size is the friction's acceleration."""


@enters(
    "acceleration",
    identifier="power-law-damping",
    name="friction with another exponent",
    equation=(
        r"\ddot x \mathrel{+}= -f\, |\dot x/v_1|^{n} \operatorname{sgn}\dot x,"
        r"\quad v_1 = 0.1\ \mathrm{rad/s}"
    ),
    parameters=(
        Parameter("f", "rad/s^2", 0.0, 100.0, word="friction"),
        Parameter("exponent", "1", 0.1, 6.0, word="exponent"),
        Parameter("energy_form", "1", 0.0, 1.0, 0.0, word="share by energy"),
    ),
    example=(1e-3, 1.5, 0.3),
    discriminating_test=(
        "release it with several amplitudes in quick succession: this separates time and amplitude"
    ),
    # Off those of Eq. 8 (0, 1, 2) and of the cubic law.
    shapes=lambda _: rows((0.5, 1.5, 2.5, 4.0), (0.0,)),
)
def power_law_damping(
    motion: Motion, pendulum: Pendulum, size: float, exponent: float, energy: float
) -> FloatArray:
    """f |v/v_1|^n, v_1 = 0.1 rad/s; or, with the same envelope, Eq. 9a's power of the energy.

    The amplitude falls as its n-th power. `energy_form` 0 is the velocity's law, whose third
    harmonic is (n - 1)/(n + 3) of the friction's first; 1 is Eq. 9a's with lambda = n/2,
    whose third harmonic is -1/3 whatever n; the envelope does not distinguish them.
    """
    law = (1.0 - energy) * np.abs(motion.velocity / SPEED) ** exponent
    if energy:
        # c|v|^n lowers the amplitude by c (omega y)^n <|sin|^(n+1)>/omega a second.
        gammas = math.gamma(0.5 * exponent + 1.0) / math.gamma(0.5 * exponent + 1.5)
        alike = 0.5 * math.sqrt(math.pi) * gammas
        speed = np.sqrt(pendulum.energy(motion.angle, motion.velocity))
        law = law + energy * alike * (speed / SPEED) ** exponent
    return np.asarray(-size * motion.direction * law)


@enters(
    "acceleration",
    identifier="cubic-damping",
    name="cubic damping",
    equation=(
        r"\ddot x \mathrel{+}= -d \left[(1 - p)\, \frac{\dot x^3}{3 \omega^2}"
        r" + p\, x^2 \dot x\right]"
    ),
    parameters=(
        Parameter("d", "1/(rad^2 s)", -1e3, 1e3, word="cubic loss"),
        Parameter("position_form", "1", 0.0, 1.0, 0.0, word="share with x²v"),
    ),
    example=(0.5, 0.4),
    discriminating_test=(
        "release it with twice the amplitude: the sign of the third harmonic in quadrature "
        "distinguishes v^3 from x^2 v"
    ),
    shapes=lambda _: rows((0.0, 1.0)),
)
def cubic_damping(motion: Motion, pendulum: Pendulum, size: float, position: float) -> FloatArray:
    """dr/dt = -d r^3/8 by v^3 (`position_form` 0) or by x^2 v (1): van der Pol, Rayleigh.

    The friction's third harmonic is 1/3 of its first for v^3 and -1 for x^2 v.
    """
    third = (1.0 - position) / (3.0 * pendulum.angular_frequency**2)
    square = third * motion.velocity**2 + position * motion.angle**2
    return np.asarray(-size * square * motion.velocity)


@enters(
    "acceleration",
    identifier="stribeck-friction",
    name="Stribeck friction",
    equation=r"\ddot x \mathrel{+}= -f_s\, e^{-(\dot x/v_s)^2} \operatorname{sgn}\dot x",
    parameters=(
        Parameter("f_s", "rad/s^2", 0.0, 100.0, word="friction at rest"),
        Parameter("v_s", "rad/s", 1e-6, 100.0, word="fading at a velocity of"),
    ),
    example=(1e-3, 0.1),
    discriminating_test=(
        "lubricate or clean the pivot: only the loss at small amplitude must change"
    ),
    # Fractions of the peak velocities within the record.
    shapes=lambda span: rows(
        span.pendulum.angular_frequency
        * between(0.3 * span.last_amplitude, 0.5 * span.first_amplitude, 6)
    ),
)
def stribeck_friction(motion: Motion, pendulum: Pendulum, size: float, v_s: float) -> FloatArray:
    """Dry friction that fades above a sliding velocity v_s: more loss at small amplitude."""
    return np.asarray(-size * motion.direction * np.exp(-((motion.velocity / v_s) ** 2)))


@enters(
    "acceleration",
    identifier="presliding-friction",
    name="presliding friction (Dahl)",
    contact=True,
    equation=r"\ddot x \mathrel{+}= -\omega^2 k_d z, \quad \dot z = \dot x - |\dot x|\, z/z_c",
    parameters=(
        Parameter("k_d", "1", 0.0, 10.0, word="relative stiffness"),
        Parameter("z_c", "rad", 1e-7, 10.0, word="breakaway at"),
    ),
    example=(1e-3, 0.02),
    discriminating_test=(
        "swing it at ever smaller amplitudes: far below the breakaway angle z_c the frequency "
        "rises and the damping falls"
    ),
    # From far below the smallest amplitude to the largest.
    shapes=lambda span: rows(np.geomspace(0.2 * span.last_amplitude, span.first_amplitude, 4)),
)
def presliding_friction(
    motion: Motion, pendulum: Pendulum, stiffness: float, breakaway: float
) -> FloatArray:
    """Dahl's friction: z' = v - |v| z/z_c, torque omega^2 k_d z.

    Coulomb friction omega^2 k_d z_c at amplitudes far above z_c; a spring and a loss of the
    second power below. The contact is taken to have swung with the first amplitude before.
    """
    left = np.exp(-(np.abs(motion.angle - motion.turning_angle) / breakaway))
    # z in closed form since the last reversal, in the direction of motion:
    # z/z_c = 1 - (1 - s) e^(-moved), s at the reversal.
    start = np.empty((len(left), 1))
    _at_reversals(left[:, -1].copy(), start[:, 0])
    deflection = breakaway * (1.0 - (1.0 - start) * left)
    size = stiffness * pendulum.angular_frequency**2
    return np.asarray(-size * motion.direction * deflection)


@kernel()
def _at_reversals(left: FloatArray, found: FloatArray) -> None:
    """Write z/z_c at the start of each half cycle, in the direction that follows."""
    deflection = (left[0] - 1.0) / (left[0] + 1.0)
    for k in range(left.size):
        found[k] = deflection
        deflection = (1.0 - deflection) * left[k] - 1.0


_RESOLVED: Final = 0.65
"""Harmonics over nodes of half a cycle, up to which these resolve them."""


@enters(
    "acceleration",
    identifier="backlash",
    name="play in the pivot",
    contact=True,
    nodes=48,
    equation=(
        r"\omega^2 x \to \omega^2 \left(x -"
        r" \operatorname{clip}(x, -\tfrac b2, \tfrac b2)\right)"
    ),
    parameters=(Parameter("b", "rad", 0.0, 1.0, word="play"),),
    example=(1e-3,),
    discriminating_test=(
        "swing it at ever smaller amplitudes: the frequency must fall as 1/amplitude"
    ),
)
def backlash(motion: Motion, pendulum: Pendulum, gap: float) -> FloatArray:
    """No restoring torque within a gap b: the frequency falls by 2/pi b/(2 y) of itself.

    The torque has corners, which the nodes of the clock would miss: it enters by its first
    harmonics, clip(r cos psi) = r (c_1 cos psi + c_3 cos 3 psi + ...) with b/2 = r cos(theta),
    c_m = 4/pi [int_0^theta cos(theta) cos(m psi) dpsi + int_theta^(pi/2) cos psi cos(m psi) dpsi].
    """
    half, amplitude = 0.5 * gap, motion.amplitude
    if half == 0.0:
        return np.zeros_like(motion.angle)
    psi = np.arccos(np.clip(motion.angle / amplitude, -1.0, 1.0))
    corner = np.arccos(np.clip(abs(half) / amplitude, 0.0, 1.0))
    within = np.zeros_like(motion.angle)
    for m in range(1, int(_RESOLVED * psi.shape[1]) + 1, 2):
        # sin((m - 1) theta)/(m - 1) is theta at m = 1, where the upper limit counts too.
        below = corner - 0.5 * math.pi if m == 1 else np.sin((m - 1) * corner) / (m - 1)
        beyond = -0.5 * (below + np.sin((m + 1) * corner) / (m + 1))
        share = np.cos(corner) * np.sin(m * corner) / m + beyond
        within += 4.0 / math.pi * share * np.cos(m * psi)
    size = math.copysign(pendulum.angular_frequency**2, half)
    return np.asarray(size * amplitude * within)


@enters(
    "acceleration",
    identifier="history-force",
    name="history force (Basset)",
    equation=(
        r"\ddot x \mathrel{+}= -\frac{h}{\sqrt\pi}"
        r" \int_0^t \frac{\ddot x(s)}{\sqrt{t - s}}\, \mathrm{d}s"
    ),
    parameters=(Parameter("h", "1/sqrt(s)", 0.0, 100.0, word="history coefficient"),),
    example=(0.01,),
    discriminating_test="record the first swings after a release from rest, with a lighter bob",
)
def history_force(motion: Motion, pendulum: Pendulum, size: float) -> FloatArray:
    """h times the half derivative of the velocity, from rest at the release.

    The fluid is at rest until the turning point at which the pendulum is let go. What remains
    long after it is a viscous friction and an added mass.
    """
    return -size * half_derivative(motion, half_cycle_of_release(motion, pendulum))


@enters(
    "acceleration",
    identifier="vortex-shedding",
    name="vortex shedding above an amplitude",
    equation=(
        r"\ddot x \mathrel{+}= -\frac{\pi \omega k\, (1 + \phi^2)}{\phi^2 (1 + e^{-\pi/\phi})}"
        r" \max(0, |x_\mathrm{turn}| - y_c)\, e^{-\psi/\phi}\, \mathrm{sgn}\, \dot x"
    ),
    parameters=(
        Parameter("k", "1/s", 0.0, 100.0, word="loss rate"),
        Parameter("y_c", "rad", 1e-6, 10.0, word="above an amplitude of"),
        Parameter("phi", "1", 0.2, 2.0, 0.6, word="fading over a phase of"),
    ),
    example=(0.01, 0.1, 0.6),
    discriminating_test=(
        "change the fluid's viscosity: the amplitude of the kink in the damping must change"
    ),
    # Amplitudes within the record, and a short and a long burst.
    shapes=lambda span: rows(
        np.geomspace(span.last_amplitude, span.first_amplitude, 14)[1:-1], (0.4, 1.2)
    ),
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
