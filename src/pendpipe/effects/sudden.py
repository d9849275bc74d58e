"""What happens to the pendulum at an instant."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.effects.effect import Effect, Kick, Parameter, Pendulum, Span
from pendpipe.effects.scan import finer_instants, instants, instants_at_phases, smooth_step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion
    from pendpipe.dynamics.sampling import Sampled

_WHEN: Final = Parameter("time", "s", -math.inf, math.inf)


class EquilibriumStep(Effect):
    """The equilibrium jumps by J (mesoanelastic): amplitude and phase jump with it."""

    identifier = "equilibrium-step"
    name = "jump of the equilibrium"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 (x - J\, H(t - t_k))"
    parameters = (Parameter("J", "rad", -10.0, 10.0), _WHEN)
    local = True
    deciding = (
        "look at amplitude and phase about the jump: they change by -J cos(psi) and "
        "J sin(psi)/y only if the pendulum itself jumped"
    )

    def kick(self, values: FloatArray) -> Kick:
        """Return the jump of the angle from the equilibrium, which the reading undoes."""
        return Kick(float(values[1]), angle=-float(values[0]))

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return the new equilibrium."""
        return np.asarray(values[0] * (sampled.time_s > values[1]))

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Instants, at four phases of the cycle."""
        return instants_at_phases(span, 24, 0.5 * math.pi)

    def finer(self, span: Span, shape: Sequence[float]) -> list[tuple[float]]:
        """Return instants between those of the scan."""
        return finer_instants(span, 24, shape[0])


class AmplitudeStep(Effect):
    """The amplitude changes at once by a factor e^s, the phase unchanged."""

    identifier = "amplitude-step"
    name = "jump of the amplitude"
    kind = "dynamics"
    equation = r"r \to r\, e^{s\, H(t - t_k)}"
    parameters = (Parameter("s", "1", -5.0, 5.0), _WHEN)
    local = True
    deciding = "repeat the record, watched: what touched it?"

    def kick(self, values: FloatArray) -> Kick:
        """Return the change of ln r."""
        return Kick(float(values[1]), log_amplitude=float(values[0]))

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Instants."""
        return instants(span, 72)

    def finer(self, span: Span, shape: Sequence[float]) -> list[tuple[float]]:
        """Return instants between those of the scan."""
        return finer_instants(span, 72, shape[0])


class Impulse(Effect):
    """A knock: the velocity jumps, the angle does not."""

    identifier = "impulse"
    name = "impulse"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= \Delta v\, \delta(t - t_k)"
    parameters = (Parameter("dv", "rad/s", -100.0, 100.0), _WHEN)
    local = True
    deciding = "repeat the record: a knock does not come back at the same time"

    def kick(self, values: FloatArray) -> Kick:
        """Return the jump of the velocity."""
        return Kick(float(values[1]), velocity=float(values[0]))

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Instants, at four phases of half a cycle."""
        return instants_at_phases(span, 40, 0.25 * math.pi)

    def finer(self, span: Span, shape: Sequence[float]) -> list[tuple[float]]:
        """Return instants between those of the scan."""
        return finer_instants(span, 40, shape[0])


class FrequencyStep(Effect):
    """omega changes at an instant: the flexure seats itself anew."""

    identifier = "frequency-step"
    name = "jump of the frequency"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 (1 + 2 \epsilon\, H(t - t_k))\, x"
    parameters = (Parameter("change", "1", -0.4, 0.4), _WHEN)
    local = True
    deciding = "record on: before and after the jump the frequency must stand still"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 eps omega^2 x behind the instant."""
        size = -2.0 * values[0] * pendulum.angular_frequency**2
        return np.asarray(size * smooth_step(motion, values[1]) * motion.angle)

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Instants."""
        return instants(span, 24)


class DampingStep(Effect):
    """All losses of the baseline change by a factor 1 + eps at an instant: a rub begins."""

    identifier = "damping-step"
    name = "jump of the damping"
    kind = "dynamics"
    equation = r"F(x, \dot x) \to (1 + \epsilon\, H(t - t_k))\, F(x, \dot x)"
    parameters = (Parameter("change", "1", -1.0, 100.0), _WHEN)
    local = True
    deciding = "repeat from the same amplitude: a power of the amplitude comes back, a rub not"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return eps times the baseline's friction behind the instant."""
        return np.asarray(
            values[0] * smooth_step(motion, values[1]) * pendulum.acceleration(motion)
        )

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Instants."""
        return instants(span, 24)
