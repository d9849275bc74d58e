"""What sensor and converter do to the reading."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.effects.catalogue.oscillations import SteadyTone, tone_at, tried_frequencies
from pendpipe.effects.effect import Effect, Parameter, Pendulum, Span
from pendpipe.effects.scan import (
    RELAXATION,
    Relaxing,
    relaxed,
    rows,
)

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.sampling import Sampled


class SensorQuadratic(Effect):
    """y = x + s_2 x^2: mean shift and second harmonic, both s_2 y^2/2, and no other."""

    identifier = "sensor-quadratic"
    name = "quadratic sensor"
    kind = "measurement"
    equation = r"y = x + s_2 x^2"
    parameters = (Parameter("s2", "1/rad", -30.0, 30.0),)
    example = (0.05,)
    discriminating_test = "calibrate the sensor at many angles"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return s_2 x^2."""
        return np.asarray(values[0] * sampled.angle**2)


class SensorCubic(Effect):
    """y = x + s_3 x^3: third harmonic s_3 y^3/4 in phase, and no change of the frequency."""

    identifier = "sensor-cubic"
    name = "cubic sensor"
    kind = "measurement"
    equation = r"y = x + s_3 x^3"
    parameters = (Parameter("s3", "1/rad^2", -300.0, 300.0),)
    example = (0.05,)
    discriminating_test = "calibrate the sensor at many angles"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return s_3 x^3."""
        return np.asarray(values[0] * sampled.angle**3)


class SensorBacklash(Effect):
    """The reading stays behind by b/2, and rests after a reversal until the play is used up."""

    identifier = "sensor-backlash"
    name = "play in the sensor's coupling"
    kind = "measurement"
    equation = (
        r"y = x - \operatorname{sgn}(\dot x)"
        r" \left[\tfrac b2 - \max(0, b - |x - x_\mathrm{turn}|)\right]"
    )
    parameters = (Parameter("b", "rad", 0.0, 1.0),)
    example = (1e-3,)
    discriminating_test = (
        "move the pendulum slowly by hand both ways against a scale: the readings differ"
    )

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return the play operator less the angle."""
        motion = sampled.motion
        half = np.floor(sampled.phase / math.pi).astype(np.intp)
        half = np.clip(half, 0, motion.clock.count - 1)
        turn, direction = motion.turning_angle[half, 0], motion.direction[half, 0]
        rests = np.maximum(0.0, values[0] - np.abs(sampled.angle - turn))
        return np.asarray(direction * (rests - 0.5 * values[0]))


class OffsetDrift(Relaxing):
    """The reading of the equilibrium drifts, from the first reading on, as an amplifier warms up.

    It is straight where tau is long.
    """

    identifier = "offset-drift"
    name = "drifting offset"
    kind = "measurement"
    equation = r"y = x + \rho\, \tau (1 - e^{-t/\tau})"
    parameters = (Parameter("rate", "rad/s", -10.0, 10.0), RELAXATION)
    example = (1e-5, 25.0)
    discriminating_test = (
        "a second sensor, or the sensor turned round: creep of the equilibrium turns too"
    )

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return rho tau (1 - e^(-t/tau))."""
        rate, tau = values
        return np.asarray(rate * relaxed(sampled.time_s - sampled.time_s[0], tau))


class GainDrift(Relaxing):
    """The sensor's constant drifts, from the first reading on; straight where tau is long."""

    identifier = "gain-drift"
    name = "drifting gain"
    kind = "measurement"
    equation = r"y = x \left[1 + g\, \tau (1 - e^{-t/\tau})\right]"
    parameters = (Parameter("rate", "1/s", -10.0, 10.0), RELAXATION)
    example = (1e-4, 20.0)
    discriminating_test = "read a known tilt before and after the record"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return g tau (1 - e^(-t/tau)) x."""
        rate, tau = values
        return np.asarray(rate * relaxed(sampled.time_s - sampled.time_s[0], tau) * sampled.angle)


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
    example = (1e-3, 5.0)
    discriminating_test = "tilt the sensor and hold it: behind a capacitor the reading goes back"

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


class TonePickup(SteadyTone):
    """A steady tone in the reading, the alias of the mains for instance."""

    identifier = "tone-pickup"
    name = "tone in the reading"
    kind = "measurement"
    equation = r"y = x + a_c \cos 2\pi f_a t + a_s \sin 2\pi f_a t"
    parameters = (
        Parameter("a_cosine", "rad", -10.0, 10.0),
        Parameter("a_sine", "rad", -10.0, 10.0, 0.0),
        Parameter("f_a", "Hz", 0.0, 1e6),
    )
    example = (1e-3, 5e-4, 3.3)
    discriminating_test = (
        "record with the pendulum held, and at another sampling rate: an alias moves"
    )

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return the tone, its time counted from the first reading."""
        return tone_at(values, 2.0 * math.pi * values[2] * (sampled.time_s - sampled.time_s[0]))

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """A rough grid of frequencies."""
        return rows(tried_frequencies(span, 0.2 / span.period_s))


class Clipping(Effect):
    """Readings beyond the range are cut off: sharply, or over a width w about the level.

    With a width the upper end reads y = L - w ln(1 + e^((L - x)/w)). What is sharp is found
    by the largest reading, what is soft by its shape. The diagnosis reports a sharp level as it
    stands in the readings, and of a soft end what the largest angle loses by it.
    """

    identifier = "clipping"
    name = "clipping"
    kind = "measurement"
    equation = r"y = \operatorname{clip}(x, y_\mathrm{low}, y_\mathrm{high})"
    parameters = (
        Parameter("lower_level", "rad", -math.inf, math.inf, -math.inf),
        Parameter("upper_level", "rad", -math.inf, math.inf, math.inf),
        Parameter("width", "rad", 0.0, math.inf, 0.0),
    )
    has_signature = False
    discriminating_test = "widen the range, or release it with less amplitude"


class MissingCodes(Effect):
    """Codes that the converter never gives; their share falls to the neighbours."""

    identifier = "missing-codes"
    name = "missing codes"
    kind = "measurement"
    equation = r"y = q\, \operatorname{code}(x/q), \quad \operatorname{code} \notin \mathcal{M}"
    parameters = (Parameter("number", "1", 0.0, 4096.0),)
    has_signature = False
    discriminating_test = "record a slow ramp: the same codes must be missing"


class CoarseQuantisation(Effect):
    """Steps coarser than the noise, and than the converter's bits promise."""

    identifier = "coarse-quantisation"
    name = "coarse quantisation"
    kind = "measurement"
    equation = r"y = q\, \operatorname{round}(x/q)"
    parameters = (Parameter("step", "rad", 0.0, math.inf),)
    has_signature = False
    discriminating_test = "narrow the range, or add noise of a step's size"


_WIDTHS: Final = (0.01, 0.03, 0.1)
"""Of the first amplitude: from an edge to what bends like a cubic sensor."""
_HARD: Final = 30.0


class SoftClipping(Effect):
    """The form of `clipping` that has a template: near the ends readings fall behind.

    With a level L and a width w the upper end reads y = L - w ln(1 + e^((L - x)/w)). The size
    is what the largest angle loses, d = w ln(1 + e^((x_top - L)/w)), by which

        y = x - w ln[1 + (e^(d/w) - 1) e^((x - x_top)/w)]:

    at d << w an exponential, at d >> w a flat top at x_top - d.
    """

    identifier = "clipping"
    name = "soft clipping"
    kind = "measurement"
    equation = r"y = x - w \ln\left[1 + (e^{d/w} - 1)\, e^{(x - x_\mathrm{top})/w}\right]"
    parameters = (
        Parameter("upper_loss", "rad", 0.0, 10.0),
        Parameter("lower_loss", "rad", 0.0, 10.0),
        Parameter("width", "rad", 1e-7, 10.0),
    )
    sizes = 2
    discriminating_test = "widen the range, or release it with less amplitude"

    @property
    def key(self) -> str:
        """Beside the hard clipping, which a test of its own finds."""
        return "clipping:soft"

    def reading(self, sampled: Sampled, pendulum: Pendulum, values: FloatArray) -> FloatArray:
        """Return what both ends take off."""
        upper, lower, width = values
        angle = sampled.angle
        return np.asarray(
            _lost(angle.min() - angle, lower, width) - _lost(angle - angle.max(), upper, width)
        )

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Widths."""
        return rows(span.first_amplitude * np.array(_WIDTHS))


def _lost(beyond: FloatArray, depth: float, width: float) -> FloatArray:
    """Return w ln[1 + (e^(d/w) - 1) e^(beyond/w)]; no angle is `beyond` the largest."""
    near = beyond / width
    if depth > _HARD * width:
        return np.asarray(width * np.logaddexp(0.0, near + depth / width))
    return np.asarray(width * np.log1p(np.expm1(depth / width) * np.exp(near)))
