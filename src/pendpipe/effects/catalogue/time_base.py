"""Errors of the time base."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Span
from pendpipe.effects.scan import (
    RELAXATION,
    Relaxing,
    Sudden,
    reading_step,
    relaxed,
    unusual_drift,
)

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray


class ClockDrift(Relaxing):
    """The digitiser's clock changes its rate by kappa tau (1 - e^(-t/tau)), as it warms up.

    Where tau is long, readings come later by kappa t^2/2.
    """

    identifier = "clock-drift"
    name = "drifting clock"
    kind = "measurement"
    equation = r"t \to t + \kappa \tau \left[t - \tau (1 - e^{-t/\tau})\right]"
    parameters = (Parameter("rate", "1/s", -1.0, 1.0), RELAXATION)
    example = (1e-5, 15.0)
    discriminating_test = "record a second clock (GPS, mains) on another channel"

    def delay(self, time_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return kappa tau [t - tau (1 - e^(-t/tau))], t from the first reading."""
        rate, tau = values
        late = time_s - time_s[0]
        return np.asarray(rate * tau * (late - relaxed(late, tau)))

    def prior_penalty(self, values: FloatArray, span: Span) -> float:
        """Return what a change beyond the usual part costs."""
        return unusual_drift(span, *values.tolist())


class Jitter(Effect):
    """Sampling instants that scatter: noise in proportion to the velocity."""

    identifier = "jitter"
    name = "jitter of the sampling"
    kind = "measurement"
    equation = r"\sigma^2 \to \sigma^2 + \dot x^2 \sigma_t^2"
    parameters = (Parameter("sigma_t", "s", 0.0, math.inf),)
    has_signature = False
    discriminating_test = "record a fast clean tone: the noise must grow with its slope"


class DroppedSamples(Sudden):
    """Samples were lost (or doubled): later readings come later (earlier) by a time."""

    identifier = "dropped-samples"
    name = "dropped samples"
    kind = "measurement"
    equation = r"t \to t + d\, H(t - t_k)"
    parameters = (
        Parameter("d", "s", -1e5, 1e5),
        Parameter("time", "s", -math.inf, math.inf),
    )
    tried = 64
    example = (1e-2, 21.03)
    discriminating_test = "compare the number of samples with the time that a second clock shows"

    def delay(self, time_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return d behind the instant."""
        return np.asarray(values[0] * reading_step(time_s, values[1]))

    def prior_penalty(self, values: FloatArray, span: Span) -> float:
        """Return what a part of a sample costs.

        Samples are lost whole. Less than one is lost where the instrument itself reads n times
        as fast as it reports, which is the less likely the larger n: by 1/n.
        """
        part = abs(float(values[0])) * span.fold / span.interval_s
        return -2.0 * math.log(min(max(part, 1e-6), 1.0))
