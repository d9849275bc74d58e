"""Errors of the time base."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span, enters, without_template
from pendpipe.effects.scan import (
    INSTANT,
    RELAXATION,
    Relaxing,
    Sudden,
    elapsed,
    reading_step,
    relaxed,
    unusual_drift,
)

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.sampling import Sampled


@enters(
    "delay",
    Relaxing,
    identifier="clock-drift",
    name="drifting clock",
    equation=r"t \to t + \kappa \tau \left[t - \tau (1 - e^{-t/\tau})\right]",
    parameters=(Parameter("rate", "1/s", -1.0, 1.0), RELAXATION),
    example=(1e-5, 15.0),
    discriminating_test="record a second clock (GPS, mains) on another channel",
    prior_penalty=unusual_drift,
)
def clock_drift(time_s: FloatArray, rate: float, tau: float) -> FloatArray:
    """The digitiser's clock changes its rate by kappa tau (1 - e^(-t/tau)), as it warms up.

    Where tau is long, readings come later by kappa t^2/2.
    """
    late = elapsed(time_s)
    return np.asarray(rate * tau * (late - relaxed(late, tau)))


JITTER: Final[Effect] = without_template(
    __name__,
    "Sampling instants that scatter: noise in proportion to the velocity.",
    identifier="jitter",
    name="jitter of the sampling",
    equation=r"\sigma^2 \to \sigma^2 + \dot x^2 \sigma_t^2",
    parameters=(Parameter("sigma_t", "s", 0.0, math.inf),),
    discriminating_test="record a fast clean tone: the noise must grow with its slope",
)


CLOCK_SLIPS: Final[Effect] = without_template(
    __name__,
    "The clock misses whole samples, or repeats them, again and again.",
    identifier="clock-slips",
    name="clock slips by whole samples",
    equation=r"t \to t + \mathrm{d}t \sum_k m_k\, H(t - t_k), \quad m_k \in \mathbb{Z}",
    parameters=(Parameter("dt", "s", 0.0, math.inf), Parameter("number", "1", 0.0, 1e6)),
    discriminating_test="log the computer's own clock with every sample",
)


def _part_of_a_sample(values: FloatArray, span: Span) -> float:
    """Return what a part of a sample costs.

    Samples are lost whole. Less than one is lost where the instrument itself reads n times
    as fast as it reports, which is the less likely the larger n: by 1/n.
    """
    part = abs(float(values[0])) * span.fold / span.interval_s
    return -2.0 * math.log(min(max(part, 1e-6), 1.0))


@enters(
    "delay",
    Sudden,
    identifier="dropped-samples",
    name="dropped samples",
    equation=r"t \to t + d\, H(t - t_k)",
    parameters=(Parameter("d", "s", -1e5, 1e5), INSTANT),
    tried=64,
    example=(1e-2, 21.03),
    discriminating_test="compare the number of samples with the time that a second clock shows",
    prior_penalty=_part_of_a_sample,
)
def dropped_samples(time_s: FloatArray, late_s: float, instant_s: float) -> FloatArray:
    """Samples were lost (or doubled): later readings come later (earlier) by a time."""
    return np.asarray(late_s * reading_step(time_s, instant_s))


@enters(
    "reading",
    identifier="rolling-shutter",
    name="rolling shutter",
    equation=r"y(t) = x(t + \kappa x)",
    parameters=(Parameter("kappa", "s/rad", -1.0, 1.0),),
    rare=True,
    angular=True,
    example=(0.005,),
    discriminating_test="turn the camera by 180 degrees: the sign of kappa must turn with it",
)
def rolling_shutter(sampled: Sampled, pendulum: Pendulum, kappa: float) -> FloatArray:
    """A camera reads its rows one after another: the later, the farther the bob is to one side.

    The phase is shifted by omega kappa x, which makes a second harmonic in quadrature,
    -omega kappa y^2/2 sin 2 psi.
    """
    omega = pendulum.angular_frequency
    turned = omega * kappa * sampled.angle
    moved = sampled.angle * (np.cos(turned) - 1.0) + sampled.velocity / omega * np.sin(turned)
    return np.asarray(moved)


DroppedSamples = type(dropped_samples)
