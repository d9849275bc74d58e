"""Effects without a template in the readings; each is found by a test of its own."""

from __future__ import annotations

import math

from pendpipe.effects.effect import Effect, Parameter


class BroadbandDrive(Effect):
    """Random torque (seismic, air): amplitude and phase walk, and never come to rest."""

    identifier = "broadband-drive"
    name = "broadband drive"
    kind = "dynamics"
    equation = r"\ddot x \mathrel{+}= \xi(t), \quad S_\xi(f) = S_a"
    parameters = (Parameter("acceleration_density", "(rad/s^2)^2/Hz", 0.0, 1e6),)
    template = False
    deciding = "record it at rest, and two pendulums at once: the walk does not repeat"


class Clipping(Effect):
    """Readings beyond the range are cut off: sharply, or over a width w about the level.

    With a width the upper end reads y = L - w ln(1 + e^((L - x)/w)). What is sharp is found
    by the largest reading, what is soft by its shape. The diagnosis tells a sharp level as it
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
    template = False
    deciding = "widen the range, or release it with less amplitude"


class MissingCodes(Effect):
    """Codes that the converter never gives; their share falls to the neighbours."""

    identifier = "missing-codes"
    name = "missing codes"
    kind = "measurement"
    equation = r"y = q\, \operatorname{code}(x/q), \quad \operatorname{code} \notin \mathcal{M}"
    parameters = (Parameter("number", "1", 0.0, 4096.0),)
    template = False
    deciding = "record a slow ramp: the same codes must be missing"


class CoarseQuantisation(Effect):
    """Steps coarser than the noise, and than the converter's bits promise."""

    identifier = "coarse-quantisation"
    name = "coarse quantisation"
    kind = "measurement"
    equation = r"y = q\, \operatorname{round}(x/q)"
    parameters = (Parameter("step", "rad", 0.0, math.inf),)
    template = False
    deciding = "narrow the range, or add noise of a step's size"


class Jitter(Effect):
    """Sampling instants that scatter: noise in proportion to the velocity."""

    identifier = "jitter"
    name = "jitter of the sampling"
    kind = "measurement"
    equation = r"\sigma^2 \to \sigma^2 + \dot x^2 \sigma_t^2"
    parameters = (Parameter("sigma_t", "s", 0.0, math.inf),)
    template = False
    deciding = "record a fast clean tone: the noise must grow with its slope"


class Glitches(Effect):
    """Single readings far off."""

    identifier = "glitches"
    name = "glitches"
    kind = "measurement"
    equation = r"y_k = x_k + g_k, \quad k \in \mathcal{G}"
    parameters = (
        Parameter("number", "1", 0.0, 1e6),
        Parameter("rms", "rad", 0.0, math.inf),
    )
    template = False
    deciding = "change cable and supply, and record at rest"


class ColouredNoise(Effect):
    """Noise that grows to low frequencies.

    The diagnosis tells how steeply it falls about the pendulum's own frequency: the slope
    -d ln S/d ln f, which is alpha far below the corner and less about it.
    """

    identifier = "coloured-noise"
    name = "coloured noise"
    kind = "measurement"
    equation = r"S(f) = S_0 \left[1 + (f_0/f)^{\alpha}\right]"
    parameters = (
        Parameter("corner", "Hz", 0.0, math.inf),
        Parameter("exponent", "1", 0.0, 4.0),
    )
    template = False
    deciding = "record with the pendulum held"
