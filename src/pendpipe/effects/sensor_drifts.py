"""Offset and gain that drift, and a coupling capacitor."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import RELAXATION, relaxation_times, relaxed, rows

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.sampling import Sampled


class OffsetDrift(Effect):
    """The reading of the equilibrium drifts, from the first reading on, as an amplifier warms up.

    It is straight where tau is long.
    """

    identifier = "offset-drift"
    name = "drifting offset"
    kind = "measurement"
    equation = r"y = x + \rho\, \tau (1 - e^{-t/\tau})"
    parameters = (Parameter("rate", "rad/s", -10.0, 10.0), RELAXATION)
    deciding = "a second sensor, or the sensor turned round: creep of the equilibrium turns too"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return rho tau (1 - e^(-t/tau))."""
        rate, tau = values
        return np.asarray(rate * relaxed(sampled.time_s - sampled.time_s[0], tau))

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Straight, and relaxing."""
        return relaxation_times(span)


class GainDrift(Effect):
    """The sensor's constant drifts, from the first reading on; straight where tau is long."""

    identifier = "gain-drift"
    name = "drifting gain"
    kind = "measurement"
    equation = r"y = x \left[1 + g\, \tau (1 - e^{-t/\tau})\right]"
    parameters = (Parameter("rate", "1/s", -10.0, 10.0), RELAXATION)
    deciding = "read a known tilt before and after the record"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return g tau (1 - e^(-t/tau)) x."""
        rate, tau = values
        return np.asarray(rate * relaxed(sampled.time_s - sampled.time_s[0], tau) * sampled.angle)

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Straight, and relaxing."""
        return relaxation_times(span)


class AcCoupling(Effect):
    """A first-order high-pass: the level that its capacitor holds at the start decays.

    Its constant lead (1/(omega tau) rad) and gain are a shift of the time and of the scale,
    which no free decay shows; they are left out.
    """

    identifier = "ac-coupling"
    name = "AC coupling"
    kind = "measurement"
    equation = r"y = x + u\, e^{-t/\tau}"
    parameters = (
        Parameter("u", "rad", -10.0, 10.0),
        Parameter("tau", "s", 1e-2, 1e6),
    )
    deciding = "tilt the sensor and hold it: behind a capacitor the reading goes back"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return u e^(-t/tau)."""
        late = sampled.time_s - sampled.time_s[0]
        return np.asarray(values[0] * np.exp(-late / values[1]))

    def displacement(self, values: FloatArray, duration_s: float) -> float:
        """Return how far the level has decayed at the end."""
        level, tau = values.tolist()
        return float(abs(level * math.expm1(-duration_s / tau)))

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """From a period to half the record."""
        return rows(np.geomspace(span.period_s, max(0.5 * span.duration_s, 2 * span.period_s), 4))
