"""What changes with time: drifts, sudden changes, and the transient of the release."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from pendpipe.effects.effect import Effect, Kick, Parameter, Pendulum, Span
from pendpipe.effects.scan import (
    RELAXATION,
    Relaxing,
    Sudden,
    relaxed,
    rows,
    since_release,
    smooth_step,
    unusual_drift,
)

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion
    from pendpipe.dynamics.sampling import Sampled


class FrequencyDrift(Relaxing):
    """omega (1 + eps tau (1 - e^(-t/tau))): the rod warms up; straight where tau is long."""

    identifier = "frequency-drift"
    name = "drifting frequency"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 \left[1 + 2 \epsilon \tau (1 - e^{-t/\tau})\right] x"
    parameters = (Parameter("rate", "1/s", -1.0, 1.0), RELAXATION)
    example = (1e-5, 30.0)
    discriminating_test = (
        "release it again with the same amplitude: the frequency must have moved on"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 eps tau (1 - e^(-t/tau)) omega^2 x, t from the release."""
        rate, tau = values
        change = rate * relaxed(since_release(motion, pendulum), tau)
        return np.asarray(-2.0 * change * pendulum.angular_frequency**2 * motion.angle)

    def prior_penalty(self, values: FloatArray, span: Span) -> float:
        """Return what a change beyond the usual part costs."""
        return unusual_drift(span, *values.tolist())


class DampingDrift(Relaxing):
    """A viscous damping that changes by rate tau (1 - e^(-t/tau)): what warms, or creeps.

    It is straight where tau is long. Any loss changes so to first order, since
    -dy/dt = a y^2 + b y + c has room for one that is linear in y.
    """

    identifier = "damping-drift"
    name = "drifting damping"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= -2 \dot\gamma\, \tau (1 - e^{-t/\tau})\, \dot x"
    parameters = (Parameter("rate", "1/s^2", -10.0, 10.0), RELAXATION)
    example = (1e-4, 25.0)
    discriminating_test = "release it again with the same amplitude: the damping must have moved on"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 gamma(t) v, t from the release."""
        rate, tau = values
        gamma = rate * relaxed(since_release(motion, pendulum), tau)
        return np.asarray(-2.0 * gamma * motion.velocity)


class EquilibriumCreep(Effect):
    """The equilibrium creeps: x_eq = s ln(1 + t/tau), or s (1 - exp(-t/tau)).

    `exponential` 0 is the logarithm (linear where tau is long), 1 the exponential.
    """

    identifier = "equilibrium-creep"
    name = "creep of the equilibrium"
    kind = "dynamics"
    equation = (
        r"\omega^2 x \to \omega^2 (x - x_\mathrm{eq}), \quad x_\mathrm{eq} ="
        r" s \left[(1 - p) \ln(1 + t/\tau) + p\, (1 - e^{-t/\tau})\right]"
    )
    parameters = (
        Parameter("s", "rad", -10.0, 10.0),
        Parameter("tau", "s", 1e-3, 1e7),
        Parameter("exponential", "1", 0.0, 1.0, 0.0),
    )
    example = (1e-3, 10.0, 0.5)
    discriminating_test = (
        "a second sensor or a level on the stand: a sensor's drift leaves it still"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return omega^2 x_eq, t from the release."""
        size, tau, exponential = values
        crept = _crept(since_release(motion, pendulum) / tau, exponential)
        return np.asarray(size * pendulum.angular_frequency**2 * crept)

    def displacement(self, values: FloatArray, duration_s: float) -> float:
        """Return how far it has crept at the end: a slow creep has hardly begun."""
        size, tau, exponential = values.tolist()
        return float(abs(size * _crept(np.asarray(duration_s / tau), exponential)))

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Short and long times, of both forms."""
        lasts = span.duration_s
        return [
            *rows(lasts * np.array([0.03, 0.3, 3.0]), (0.0,)),
            *rows(lasts * np.array([0.05, 0.2]), (1.0,)),
        ]


def _crept(late: FloatArray, exponential: float) -> FloatArray:
    """(1 - p) ln(1 + t/tau) + p (1 - e^(-t/tau))."""
    return np.asarray((1.0 - exponential) * np.log1p(late) - exponential * np.expm1(-late))


_WHEN: Final = Parameter("time", "s", -math.inf, math.inf)


class EquilibriumStep(Sudden):
    """The equilibrium jumps by J (mesoanelastic): amplitude and phase jump with it."""

    identifier = "equilibrium-step"
    name = "jump of the equilibrium"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 (x - J\, H(t - t_k))"
    parameters = (Parameter("J", "rad", -10.0, 10.0), _WHEN)
    tried = 24
    turn = 0.5 * math.pi
    example = (1e-3, 21.03)
    discriminating_test = (
        "look at amplitude and phase about the jump: they change by -J cos(psi) and "
        "J sin(psi)/y only if the pendulum itself jumped"
    )

    def kick(self, values: FloatArray) -> Kick:
        """Return the jump of the angle from the equilibrium, which the reading undoes."""
        return Kick(float(values[1]), angle=-float(values[0]))

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return the new equilibrium."""
        return np.asarray(values[0] * (sampled.time_s > values[1]))


class AmplitudeStep(Sudden):
    """The amplitude changes at once by a factor e^s, the phase unchanged."""

    identifier = "amplitude-step"
    name = "jump of the amplitude"
    kind = "dynamics"
    equation = r"r \to r\, e^{s\, H(t - t_k)}"
    parameters = (Parameter("s", "1", -5.0, 5.0), _WHEN)
    tried = 72
    example = (0.01, 21.03)
    discriminating_test = "repeat the record, watched: what touched it?"

    def kick(self, values: FloatArray) -> Kick:
        """Return the change of ln r."""
        return Kick(float(values[1]), log_amplitude=float(values[0]))


class FrequencyStep(Sudden):
    """omega changes at an instant: the flexure seats itself anew."""

    identifier = "frequency-step"
    name = "jump of the frequency"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 (1 + 2 \epsilon\, H(t - t_k))\, x"
    parameters = (Parameter("change", "1", -0.4, 0.4), _WHEN)
    tried = 24
    refined = False
    example = (1e-4, 21.03)
    discriminating_test = "record on: before and after the jump the frequency must stand still"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 eps omega^2 x behind the instant."""
        size = -2.0 * values[0] * pendulum.angular_frequency**2
        return np.asarray(size * smooth_step(motion, values[1]) * motion.angle)


class DampingStep(Sudden):
    """All losses of the baseline change by a factor 1 + eps at an instant: a rub begins."""

    identifier = "damping-step"
    name = "jump of the damping"
    kind = "dynamics"
    equation = r"F(x, \dot x) \to (1 + \epsilon\, H(t - t_k))\, F(x, \dot x)"
    parameters = (Parameter("change", "1", -1.0, 100.0), _WHEN)
    tried = 24
    refined = False
    example = (0.3, 21.03)
    discriminating_test = (
        "repeat from the same amplitude: a power of the amplitude comes back, a rub not"
    )

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return eps times the baseline's friction behind the instant."""
        return np.asarray(
            values[0] * smooth_step(motion, values[1]) * pendulum.acceleration(motion)
        )


class Impulse(Sudden):
    """A knock: the velocity jumps, the angle does not."""

    identifier = "impulse"
    name = "impulse"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= \Delta v\, \delta(t - t_k)"
    parameters = (Parameter("dv", "rad/s", -100.0, 100.0), _WHEN)
    tried = 40
    turn = 0.25 * math.pi
    example = (5e-3, 21.03)
    discriminating_test = "repeat the record: a knock does not come back at the same time"

    def kick(self, values: FloatArray) -> Kick:
        """Return the jump of the velocity."""
        return Kick(float(values[1]), velocity=float(values[0]))


class ReleaseTransient(Effect):
    """Damping gamma e^(-t/tau) on top, after the release: hand, wake, other modes."""

    identifier = "release-transient"
    name = "transient of the release"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= -2 \gamma\, e^{-t/\tau}\, \dot x"
    parameters = (
        Parameter("gamma", "1/s", -10.0, 10.0),
        Parameter("tau", "s", 1e-2, 1e5),
    )
    local = True
    lasts: ClassVar[float] = 0.12
    """Part of the record within which it has to fade."""
    example = (0.01, 5.0)
    discriminating_test = "leave the first swings out: the rest must agree without it"

    def bounds(self, duration_s: float = math.inf) -> list[tuple[float, float]]:
        """Release means the first swings: what takes longer is a drift of the damping."""
        size, (shortest, longest) = super().bounds(duration_s)
        return [size, (shortest, max(min(longest, self.lasts * duration_s), 10.0 * shortest))]

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 gamma e^(-t/tau) v."""
        fading = np.exp(-since_release(motion, pendulum) / values[1])
        return np.asarray(-2.0 * values[0] * fading * motion.velocity)

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """From two periods to an eighth of the record."""
        short = 2.0 * span.period_s
        return rows(np.geomspace(short, max(self.lasts * span.duration_s, 2.0 * short), 4))
