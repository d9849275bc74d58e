"""Constants of the pendulum that drift, and its equilibrium."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import (
    RELAXATION,
    relaxation_times,
    relaxed,
    rows,
    since_release,
    unusual_drift,
)

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion


class FrequencyDrift(Effect):
    """omega (1 + eps tau (1 - e^(-t/tau))): the rod warms up; straight where tau is long."""

    identifier = "frequency-drift"
    name = "drifting frequency"
    kind = "dynamics"
    equation = r"\omega^2 x \to \omega^2 \left[1 + 2 \epsilon \tau (1 - e^{-t/\tau})\right] x"
    parameters = (Parameter("rate", "1/s", -1.0, 1.0), RELAXATION)
    deciding = "release it again with the same amplitude: the frequency must have moved on"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 eps tau (1 - e^(-t/tau)) omega^2 x, t from the release."""
        rate, tau = values
        change = rate * relaxed(since_release(motion, pendulum), tau)
        return np.asarray(-2.0 * change * pendulum.angular_frequency**2 * motion.angle)

    def improbable(self, values: FloatArray, span: Span) -> float:
        """Return what a change beyond the usual part costs."""
        return unusual_drift(span, *values.tolist())

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Straight, and relaxing."""
        return relaxation_times(span)


class DampingDrift(Effect):
    """A viscous damping that changes by rate tau (1 - e^(-t/tau)): what warms, or creeps.

    It is straight where tau is long. Any loss changes so to first order, since
    -dy/dt = a y^2 + b y + c has room for one that is linear in y.
    """

    identifier = "damping-drift"
    name = "drifting damping"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= -2 \dot\gamma\, \tau (1 - e^{-t/\tau})\, \dot x"
    parameters = (Parameter("rate", "1/s^2", -10.0, 10.0), RELAXATION)
    deciding = "release it again with the same amplitude: the damping must have moved on"

    def acceleration(self, motion: Motion, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return -2 gamma(t) v, t from the release."""
        rate, tau = values
        gamma = rate * relaxed(since_release(motion, pendulum), tau)
        return np.asarray(-2.0 * gamma * motion.velocity)

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Straight, and relaxing."""
        return relaxation_times(span)


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
    deciding = "a second sensor or a level on the stand: a sensor's drift leaves it still"

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
