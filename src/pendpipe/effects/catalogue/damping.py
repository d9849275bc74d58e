"""Losses that depend on amplitude and velocity: powers, and the two frictions of Eq. 8."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.effects.effect import Parameter, Pendulum, Span, enters
from pendpipe.effects.scan import rows

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


@enters(
    "acceleration",
    identifier="coulomb-friction",
    name="Coulomb friction",
    equation=r"\ddot x \mathrel{+}= -\tfrac{\pi}{2}\, \omega c\, \operatorname{sgn}\dot x",
    parameters=(Parameter("c", "rad/s", 0.0, 10.0),),
    inside=("eq8",),
    expected=True,
    prior=6.0,
    example=(1e-4,),
    discriminating_test=(
        "let it swing to the end: it must stop, off the equilibrium, and not fade away"
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
    parameters=(Parameter("a", "1/(rad s)", 0.0, 100.0),),
    inside=("eq8",),
    expected=True,
    prior=6.0,
    example=(0.01,),
    discriminating_test="change the fluid's density (a vacuum, or another gas): a must follow it",
)
def quadratic_drag(motion: Motion, pendulum: Pendulum, a: float) -> FloatArray:
    """Fluid drag in Eq. 8's energy form: 1/amplitude grows by a a second (a of Eq. 13)."""
    size = 0.5 * math.pi * pendulum.angular_frequency * a
    return np.asarray(-size * motion.direction * motion.amplitude**2)


@enters(
    "acceleration",
    identifier="drag-form",
    name="drag that follows the square of the velocity",
    equation=(
        r"f_q (\omega^2 x^2 + \dot x^2) \operatorname{sgn}\dot x"
        r" \to \tfrac{3}{2} f_q\, \dot x |\dot x|"
    ),
    parameter_free=True,
    needs=("a",),
    example=(1.0,),
    discriminating_test=(
        "release it with several times the amplitude: the third harmonic in quadrature must "
        "grow with its square, with the sign of v|v|"
    ),
)
def drag_form(motion: Motion, pendulum: Pendulum, size: float) -> FloatArray:
    """v|v| with the same envelope as Eq. 8's fluid term; the third harmonic changes its sign.

    Both fall as dr/dt = -a r^2 if v|v| is 1.5 times as strong; the friction's third harmonic
    is 1/5 of its first for v|v|, and -1/3 for the energy form.
    """
    speed = pendulum.angular_frequency * motion.amplitude
    swapped = speed**2 - 1.5 * motion.velocity**2
    return np.asarray(size * pendulum.fluid_acceleration * motion.direction * swapped)


SPEED: Final = 0.1
"""rad/s at which the size is the friction's acceleration."""


def envelope_factor(exponent: float) -> float:
    """g_n = <|sin|^(n+1)>: c|v|^n lowers the amplitude by c (omega y)^n g_n/omega a second."""
    gamma = math.gamma
    return gamma(0.5 * exponent + 1.0) / (math.sqrt(math.pi) * gamma(0.5 * exponent + 1.5))


def _other_exponents(_: Span) -> list[tuple[float, ...]]:
    """Off those of Eq. 8 (0, 1, 2) and of the cubic law."""
    return rows((0.5, 1.5, 2.5, 4.0), (0.0,))


@enters(
    "acceleration",
    identifier="power-law-damping",
    name="friction with another exponent",
    equation=(
        r"\ddot x \mathrel{+}= -f\, |\dot x/v_1|^{n} \operatorname{sgn}\dot x,"
        r"\quad v_1 = 0.1\ \mathrm{rad/s}"
    ),
    parameters=(
        Parameter("f", "rad/s^2", 0.0, 100.0),
        Parameter("exponent", "1", 0.1, 6.0),
        Parameter("energy_form", "1", 0.0, 1.0, 0.0),
    ),
    example=(1e-3, 1.5, 0.3),
    discriminating_test=(
        "release it with other amplitudes at once after another: time and amplitude part"
    ),
    shapes=_other_exponents,
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
        alike = 0.5 * math.pi * envelope_factor(exponent)
        speed = pendulum.angular_frequency * motion.amplitude
        law = law + energy * alike * (speed / SPEED) ** exponent
    return np.asarray(-size * motion.direction * law)


def _both_forms(_: Span) -> list[tuple[float, ...]]:
    return rows((0.0, 1.0))


@enters(
    "acceleration",
    identifier="cubic-damping",
    name="cubic damping",
    equation=(
        r"\ddot x \mathrel{+}= -d \left[(1 - p)\, \frac{\dot x^3}{3 \omega^2}"
        r" + p\, x^2 \dot x\right]"
    ),
    parameters=(
        Parameter("d", "1/(rad^2 s)", -1e3, 1e3),
        Parameter("position_form", "1", 0.0, 1.0, 0.0),
    ),
    example=(0.5, 0.4),
    discriminating_test=(
        "release it with twice the amplitude: the sign of the third harmonic in quadrature "
        "distinguishes v^3 from x^2 v"
    ),
    shapes=_both_forms,
)
def cubic_damping(motion: Motion, pendulum: Pendulum, size: float, position: float) -> FloatArray:
    """dr/dt = -d r^3/8 by v^3 (`position_form` 0) or by x^2 v (1): van der Pol, Rayleigh.

    The friction's third harmonic is 1/3 of its first for v^3 and -1 for x^2 v.
    """
    third = (1.0 - position) / (3.0 * pendulum.angular_frequency**2)
    square = third * motion.velocity**2 + position * motion.angle**2
    return np.asarray(-size * square * motion.velocity)
