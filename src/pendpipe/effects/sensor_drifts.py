"""Offset and gain that drift, and a coupling capacitor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import rows

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.sampling import Sampled


class OffsetDrift(Effect):
    """The reading of the equilibrium drifts, time counted from the first reading."""

    identifier = "offset-drift"
    name = "drifting offset"
    kind = "measurement"
    equation = r"y = x + \rho t"
    parameters = (Parameter("rate", "rad/s", -10.0, 10.0),)
    deciding = "a second sensor, or the sensor turned round: creep of the equilibrium turns too"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return rho t."""
        return np.asarray(values[0] * (sampled.time_s - sampled.time_s[0]))


class GainDrift(Effect):
    """The sensor's constant drifts, time counted from the first reading."""

    identifier = "gain-drift"
    name = "drifting gain"
    kind = "measurement"
    equation = r"y = x\, (1 + g t)"
    parameters = (Parameter("rate", "1/s", -10.0, 10.0),)
    deciding = "read a known tilt before and after the record"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return g t x."""
        late = sampled.time_s - sampled.time_s[0]
        return np.asarray(values[0] * late * sampled.angle)


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

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """From a period to half the record."""
        return rows(np.geomspace(span.period_s, max(0.5 * span.duration_s, 2 * span.period_s), 4))
