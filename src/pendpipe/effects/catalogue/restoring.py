"""Restoring torques other than omega^2 x."""

import math
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Motion
from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span, enters, other_form
from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2

circular_error: Final = other_form(
    __name__,
    """omega^2 sin(x) in place of omega^2 x: the period grows by the amplitude squared/16.

    It is Eq. 8 with the energy of a pendulum: the losses that follow rho have
    rho^2 = v^2 + 2 omega^2 (1 - cos x).
    """,
    {"restoring": "sine"},
    identifier="circular-error",
    name="circular error",
    equation=r"\omega^2 x \to \omega^2 \sin x",
    expected=True,
    prior=12.0,
    angular=True,
    discriminating_test=(
        "release it again with half the amplitude: the period must follow 1 + y^2/16"
    ),
)


_LENGTH_SD: Final = 0.2
"""Of ln L about g/omega^2: physical pendulums, and marks that are not at their centre."""


def _unlike_a_pendulum(values: FloatArray, span: Span) -> float:
    length = STANDARD_GRAVITY_M_PER_S2 / span.pendulum.angular_frequency**2
    return float((0.5 * np.log(max(values[0], 1e-300) * length**2) / _LENGTH_SD) ** 2)


def _from_the_side(motion: Motion, pendulum: Pendulum, curvature: float) -> FloatArray:
    """The form of `circular-error` in the horizontal displacement x = L sin(theta).

    x'' = -x [omega^2 cos(theta) + theta'^2], with x' = L cos(theta) theta'. In metres it is
    expected, with L about g/omega^2; in other units anything may swing.
    """
    x, v = motion.angle, motion.velocity
    square = np.minimum(curvature * x * x, 0.99)
    bent = pendulum.angular_frequency**2 * (1.0 - np.sqrt(1.0 - square))
    return np.asarray(x * (bent - curvature * v * v / (1.0 - square)))


def _seen_from_the_side(unit: str, **more: Any) -> Effect:
    return enters(
        "acceleration",
        Effect,
        identifier="circular-error",
        key=f"circular-error:{unit}",
        name="circular error",
        equation=r"x = L \sin\theta, \quad \ddot\theta = -\omega^2 \sin\theta",
        parameters=(
            Parameter(
                "inverse_length_squared",
                "1/rad^2",
                0.0,
                math.inf,
                word="inverse square of the length",
            ),
        ),
        discriminating_test=circular_error.discriminating_test,
        **more,
    )(_from_the_side)


CIRCULAR_ERROR_IN: Final[dict[str, Effect]] = {
    "m": _seen_from_the_side(
        "m", expected=True, prior=circular_error.prior, prior_penalty=_unlike_a_pendulum
    ),
    "pixels": _seen_from_the_side("pixels"),
    "1": _seen_from_the_side("1"),
}
"""Its forms in readings that are no angles, by their unit."""


@enters(
    "acceleration",
    identifier="cubic-stiffness",
    powers={"x³": 3},
    name="cubic restoring torque",
    equation=r"\omega^2 x \to \omega^2 (x + k_3 x^3)",
    parameters=(Parameter("k3", "1/rad^2", -100.0, 100.0, word="cubic stiffness"),),
    example=(0.1,),
    discriminating_test=(
        "release it again with half the amplitude: the change of frequency must follow its square"
    ),
)
def cubic_stiffness(motion: Motion, pendulum: Pendulum, k3: float) -> FloatArray:
    """omega^2 (x + k_3 x^3): the frequency changes by 3 k_3 y^2/8 (Duffing)."""
    x = motion.angle
    # A power of three takes numpy thirty times as long.
    return np.asarray(-k3 * pendulum.angular_frequency**2 * (x * x * x))


@enters(
    "acceleration",
    identifier="quadratic-stiffness",
    name="quadratic restoring torque",
    equation=r"\omega^2 x \to \omega^2 (x + k_2 x^2)",
    parameters=(Parameter("k2", "1/rad", -30.0, 30.0, word="quadratic stiffness"),),
    example=(0.05,),
    discriminating_test=(
        "turn the sensor round: the second harmonic must change its sign with it, and stay "
        "-1/3 of the mean shift"
    ),
)
def quadratic_stiffness(motion: Motion, pendulum: Pendulum, k2: float) -> FloatArray:
    """omega^2 (x + k_2 x^2): mean shift -k_2 y^2/2, second harmonic k_2 y^2/6."""
    return np.asarray(-k2 * pendulum.angular_frequency**2 * motion.angle**2)


@enters(
    "acceleration",
    identifier="amplitude-linear-stiffness",
    powers={"x|x|": 2},
    name="restoring torque with x|x|",
    equation=r"\omega^2 x \to \omega^2 (x + \kappa\, x |x|)",
    parameters=(Parameter("kappa", "1/rad", -30.0, 30.0, word="stiffness with x|x|"),),
    rare=True,
    example=(0.05,),
    discriminating_test=(
        "release it again with half the amplitude: the frequency must follow the amplitude itself"
    ),
)
def amplitude_linear_stiffness(motion: Motion, pendulum: Pendulum, kappa: float) -> FloatArray:
    """omega^2 (x + kappa x|x|): the frequency changes by 4 kappa y/(3 pi), in proportion to y."""
    omega = pendulum.angular_frequency
    return np.asarray(-kappa * omega * omega * motion.angle * np.abs(motion.angle))
