"""True form drag in place of Eq. 8's energy form."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Pendulum

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class DragForm(Effect):
    """v|v| with the same envelope as Eq. 8's fluid term; the third harmonic changes its sign.

    Both fall as dr/dt = -a r^2 if v|v| is 1.5 times as strong; the friction's third harmonic
    is 1/5 of its first for v|v|, and -1/3 for the energy form.
    """

    identifier = "drag-form"
    name = "drag that follows the square of the velocity"
    kind = "dynamics"
    equation = (
        r"f_q (\omega^2 x^2 + \dot x^2) \operatorname{sgn}\dot x"
        r" \to \tfrac{3}{2} f_q\, \dot x |\dot x|"
    )
    parameters = ()
    switch = True
    needs = ("a",)
    deciding = (
        "release it with several times the amplitude: the third harmonic in quadrature must "
        "grow with its square, with the sign of v|v|"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return f_q (omega^2 r^2 - 1.5 v^2) sgn(v)."""
        speed = pendulum.angular_frequency * motion.amplitude
        swapped = speed**2 - 1.5 * motion.velocity**2
        return np.asarray(values[0] * pendulum.fluid_acceleration * motion.direction * swapped)
