"""What dry contacts do: friction that fades with speed, gives way before it slides, or has play."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Parameter, Pendulum, Span, enters
from pendpipe.effects.scan import between, rows

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


def _peak_velocities(span: Span) -> list[tuple[float, ...]]:
    """Fractions of the peak velocities within the record."""
    omega = span.pendulum.angular_frequency
    slow, fast = 0.3 * omega * span.last_amplitude, 0.5 * omega * span.first_amplitude
    return rows(between(slow, fast, 6))


@enters(
    "acceleration",
    identifier="stribeck-friction",
    name="Stribeck friction",
    equation=r"\ddot x \mathrel{+}= -f_s\, e^{-(\dot x/v_s)^2} \operatorname{sgn}\dot x",
    parameters=(
        Parameter("f_s", "rad/s^2", 0.0, 100.0),
        Parameter("v_s", "rad/s", 1e-6, 100.0),
    ),
    example=(1e-3, 0.1),
    discriminating_test=(
        "lubricate or clean the pivot: the loss at small amplitude must change alone"
    ),
    shapes=_peak_velocities,
)
def stribeck_friction(motion: Motion, pendulum: Pendulum, size: float, v_s: float) -> FloatArray:
    """Dry friction that fades above a sliding velocity v_s: more loss at small amplitude."""
    return np.asarray(-size * motion.direction * np.exp(-((motion.velocity / v_s) ** 2)))


def _breakaway_angles(span: Span) -> list[tuple[float, ...]]:
    """From far below the smallest amplitude to the largest."""
    return rows(np.geomspace(0.2 * span.last_amplitude, span.first_amplitude, 4))


@enters(
    "acceleration",
    identifier="presliding-friction",
    name="presliding friction (Dahl)",
    equation=r"\ddot x \mathrel{+}= -\omega^2 k_d z, \quad \dot z = \dot x - |\dot x|\, z/z_c",
    parameters=(Parameter("k_d", "1", 0.0, 10.0), Parameter("z_c", "rad", 1e-7, 10.0)),
    example=(1e-3, 0.02),
    discriminating_test=(
        "swing it at ever smaller amplitudes: the frequency must rise, and the damping fall, "
        "below z_c"
    ),
    shapes=_breakaway_angles,
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
    start = _at_reversals(left[:, -1])[:, None]
    deflection = breakaway * (1.0 - (1.0 - start) * left)
    size = stiffness * pendulum.angular_frequency**2
    return np.asarray(-size * motion.direction * deflection)


def _at_reversals(left: FloatArray) -> FloatArray:
    """z/z_c at the start of each half cycle, in the direction that follows."""
    found = []
    deflection = (left[0] - 1.0) / (left[0] + 1.0)
    for part in left.tolist():
        found.append(deflection)
        deflection = (1.0 - deflection) * part - 1.0
    return np.array(found)


@enters(
    "acceleration",
    identifier="backlash",
    name="play in the pivot",
    equation=(
        r"\omega^2 x \to \omega^2 \left(x -"
        r" \operatorname{clip}(x, -\tfrac b2, \tfrac b2)\right)"
    ),
    parameters=(Parameter("b", "rad", 0.0, 1.0),),
    example=(1e-3,),
    discriminating_test=(
        "swing it at ever smaller amplitudes: the frequency must fall as 1/amplitude"
    ),
)
def backlash(motion: Motion, pendulum: Pendulum, gap: float) -> FloatArray:
    """No restoring torque within a gap b: the frequency falls by 2/pi b/(2 y) of itself."""
    half = 0.5 * gap
    if half == 0.0:
        return np.zeros_like(motion.angle)
    within = half * np.clip(motion.angle / abs(half), -1.0, 1.0)
    return np.asarray(pendulum.angular_frequency**2 * within)
