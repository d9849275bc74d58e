"""Faults of the time base."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Span
from pendpipe.effects.scan import (
    RELAXATION,
    finer_instants,
    instants,
    reading_step,
    relaxation_times,
    relaxed,
    unusual_drift,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pendpipe.arrays import FloatArray


class ClockDrift(Effect):
    """The digitiser's clock changes its rate by kappa tau (1 - e^(-t/tau)), as it warms up.

    Where tau is long, readings come later by kappa t^2/2.
    """

    identifier = "clock-drift"
    name = "drifting clock"
    kind = "measurement"
    equation = r"t \to t + \kappa \tau \left[t - \tau (1 - e^{-t/\tau})\right]"
    parameters = (Parameter("rate", "1/s", -1.0, 1.0), RELAXATION)
    deciding = "record a second clock (GPS, mains) on another channel"

    def delay(self, time_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return kappa tau [t - tau (1 - e^(-t/tau))], t from the first reading."""
        rate, tau = values
        late = time_s - time_s[0]
        return np.asarray(rate * tau * (late - relaxed(late, tau)))

    def improbable(self, values: FloatArray, span: Span) -> float:
        """Return what a change beyond the usual part costs."""
        return unusual_drift(span, *values.tolist())

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Straight, and relaxing."""
        return relaxation_times(span)


class DroppedSamples(Effect):
    """Samples were lost (or doubled): later readings come later (earlier) by a time."""

    identifier = "dropped-samples"
    name = "dropped samples"
    kind = "measurement"
    equation = r"t \to t + d\, H(t - t_k)"
    parameters = (
        Parameter("d", "s", -1e5, 1e5),
        Parameter("time", "s", -math.inf, math.inf),
    )
    local = True
    deciding = "compare the number of samples with the time that a second clock shows"

    def delay(self, time_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return d behind the instant."""
        return np.asarray(values[0] * reading_step(time_s, values[1]))

    def improbable(self, values: FloatArray, span: Span) -> float:
        """Return what a part of a sample costs.

        Samples are lost whole. Less than one is lost where the instrument itself reads n times
        as fast as it tells, which is the less likely the larger n: by 1/n.
        """
        part = abs(float(values[0])) * span.fold / span.interval_s
        return -2.0 * math.log(min(max(part, 1e-6), 1.0))

    def shapes(self, span: Span) -> list[tuple[float]]:
        """Instants."""
        return instants(span, 64)

    def finer(self, span: Span, shape: Sequence[float]) -> list[tuple[float]]:
        """Return instants between those of the scan."""
        return finer_instants(span, 64, shape[0])
