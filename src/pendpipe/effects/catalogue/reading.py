"""What stands between the motion and the file: sensor, time base, noise."""

import itertools
import math
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Sampled
from pendpipe.effects.catalogue.in_time import (
    APART,
    Modulation,
    SteadyTone,
    plane_band_hz,
    tone_at,
    tried_frequencies,
)
from pendpipe.effects.effect import (
    INSTANT,
    RELAXATION,
    Effect,
    Parameter,
    Pendulum,
    Relaxing,
    Span,
    Sudden,
    between,
    elapsed,
    enters,
    reading_step,
    relaxed,
    rows,
    unusual_drift,
    without_template,
)


@enters(
    "reading",
    identifier="sensor-quadratic",
    name="quadratic sensor",
    equation=r"y = x + s_2 x^2",
    parameters=(Parameter("s2", "1/rad", -30.0, 30.0, word="quadratic term"),),
    example=(0.05,),
    discriminating_test="calibrate the sensor at many angles",
)
def sensor_quadratic(sampled: Sampled, pendulum: Pendulum, s2: float) -> FloatArray:
    """y = x + s_2 x^2: mean shift and second harmonic, both s_2 y^2/2, and no other."""
    return np.asarray(s2 * sampled.angle**2)


@enters(
    "reading",
    identifier="sensor-cubic",
    name="cubic sensor",
    equation=r"y = x + s_3 x^3",
    parameters=(Parameter("s3", "1/rad^2", -300.0, 300.0, word="cubic term"),),
    example=(0.05,),
    discriminating_test="calibrate the sensor at many angles",
)
def sensor_cubic(sampled: Sampled, pendulum: Pendulum, s3: float) -> FloatArray:
    """y = x + s_3 x^3: third harmonic s_3 y^3/4 in phase, and no change of the frequency."""
    return np.asarray(s3 * sampled.angle**2 * sampled.angle)


_MISPLACED: Final = (
    Parameter("e_1", "rad", -1.0, 1.0, word="cos x term"),
    Parameter("e_2", "rad", -0.5, 0.5, word="sin 2x term"),
)


def _camera(**more: Any) -> Callable[[Callable[..., Any]], Effect]:
    """Declare a form of the camera's geometry; `more` is what distinguishes it."""
    return enters(
        "reading",
        identifier="camera-geometry",
        discriminating_test="move the camera, or turn the encoder on its shaft by a quarter turn",
        **more,
    )


_ANGLES: Final = {
    "name": "geometry of the camera (pivot, obliquity), or an encoder's eccentricity",
    "rare": True,
    "angular": True,
}


@_camera(
    **_ANGLES,
    equation=r"y = x + e_1 (\cos x - 1) + e_2 \sin 2x",
    parameters=_MISPLACED,
    sizes=2,
    example=(0.03, 0.01),
)
def camera_geometry(sampled: Sampled, pendulum: Pendulum, e_1: float, e_2: float) -> FloatArray:
    """The angle on an image whose pivot is misplaced, or that is seen obliquely.

    A pivot misplaced across by e_1 pendulum lengths adds e_1 cos x; a camera that looks at the
    plane of swing from an angle beta, turned about the vertical, e_2 = -beta^2/4. The constant
    is the offset's. What sin x and cos 2x would add is a scale and e_1 up to a radian.
    """
    return _misplaced(sampled.angle, e_1, e_2)


def _misplaced(angle: FloatArray, e_1: float, e_2: float) -> FloatArray:
    return np.asarray(e_1 * (np.cos(angle) - 1.0) + e_2 * np.sin(2.0 * angle))


WIDE_RAD: Final = 1.0
"""Amplitude beyond which cos 2x is told from cos x: it is 4 cos x - 3 + x^4/2, the last a quarter
of 2 x^2 there."""


@_camera(
    **_ANGLES,
    key="camera-geometry:wide",
    equation=r"y = x + e_1 (\cos x - 1) + e_2 \sin 2x + e_3 (\cos 2x - 1)",
    parameters=(*_MISPLACED, Parameter("e_3", "rad", -0.5, 0.5, word="cos 2x term")),
    sizes=3,
)
def camera_seen_wide(
    sampled: Sampled, pendulum: Pendulum, e_1: float, e_2: float, e_3: float
) -> FloatArray:
    """The form beyond `WIDE_RAD`, where cos 2x is told from cos x.

    A camera turned by beta about an axis at 45 degrees to the vertical makes e_3 = beta^2/4 of the
    ellipse that it sees.
    """
    return _misplaced(sampled.angle, e_1, e_2) + e_3 * (np.cos(2.0 * sampled.angle) - 1.0)


_PERSPECTIVE: Final = Parameter("p", "1/rad", -0.5, 0.5, word="perspective")


_BY_CAMERA: Final = 3.2
"""2 ln 5: of twelve collections of others' positions ten are by video, one each by echo and laser,
so that a curved scale of positions is rather a camera's than another sensor's."""


def _on_an_image(key: str, **more: Any) -> Effect:
    """Declare a form of the camera's geometry in positions; `more` is what distinguishes it."""
    name = "perspective of the camera, or its lens"
    return _camera(key=f"camera-geometry:{key}", name=name, prior=_BY_CAMERA, **more)(
        _seen_obliquely
    )


def _seen_obliquely(sampled: Sampled, pendulum: Pendulum, p: float, k: float = 0.0) -> FloatArray:
    """The position on an image: what comes nearer is larger, and a lens bends what is far out.

    A camera at a distance D that looks at the plane of swing from an angle beta has
    p = sin(beta)/D; a lens adds the cube of the distance from its centre.
    """
    x = sampled.angle
    return np.asarray(-p * x * x / (1.0 + p * x) + k * (x * x * x))


PERSPECTIVE: Final = (
    _on_an_image("position", equation=r"y = \frac{x}{1 + p x}", parameters=(_PERSPECTIVE,)),
    _on_an_image(
        "lens",
        equation=r"y = \frac{x}{1 + p x} + k x^3",
        parameters=(
            _PERSPECTIVE,
            Parameter("k", "1/rad^2", -0.5, 0.5, word="distortion of the lens"),
        ),
        sizes=2,
    ),
)
"""The forms that are looked for in positions."""


@enters(
    "reading",
    identifier="sensor-backlash",
    name="play in the sensor's coupling",
    equation=(
        r"y = x - \operatorname{sgn}(\dot x)"
        r" \left[\tfrac b2 - \max(0, b - |x - x_\mathrm{turn}|)\right]"
    ),
    parameters=(Parameter("b", "rad", 0.0, 1.0, word="play"),),
    example=(1e-3,),
    discriminating_test=(
        "move the pendulum slowly by hand both ways against a scale: the readings differ"
    ),
)
def sensor_backlash(sampled: Sampled, pendulum: Pendulum, play: float) -> FloatArray:
    """The reading stays behind by b/2, and rests after a reversal until the play is used up."""
    motion, half = sampled.motion, sampled.half_cycle
    turn, direction = motion.turning_angle[half, 0], motion.direction[half, 0]
    rests = np.maximum(0.0, play - np.abs(sampled.angle - turn))
    return np.asarray(direction * (rests - 0.5 * play))


@enters(
    "reading",
    Relaxing,
    identifier="offset-drift",
    name="drifting offset",
    equation=r"y = x + \rho\, \tau (1 - e^{-t/\tau})",
    parameters=(Parameter("rate", "rad/s", -10.0, 10.0, word="rate"), RELAXATION),
    example=(1e-5, 25.0),
    discriminating_test=(
        "use a second sensor, or turn the sensor round: creep of the equilibrium turns too"
    ),
)
def offset_drift(sampled: Sampled, pendulum: Pendulum, rate: float, tau: float) -> FloatArray:
    """The reading of the equilibrium drifts, from the first reading on, as an amplifier warms up.

    It is straight where tau is long.
    """
    return np.asarray(rate * relaxed(elapsed(sampled.time_s), tau))


@enters(
    "reading",
    Relaxing,
    identifier="gain-drift",
    name="drifting gain",
    equation=r"y = x \left[1 + g\, \tau (1 - e^{-t/\tau})\right]",
    parameters=(Parameter("rate", "1/s", -10.0, 10.0, word="rate"), RELAXATION),
    example=(1e-4, 20.0),
    discriminating_test="read a known tilt before and after the record",
)
def gain_drift(sampled: Sampled, pendulum: Pendulum, rate: float, tau: float) -> FloatArray:
    """The sensor's constant drifts, from the first reading on; straight where tau is long."""
    return np.asarray(rate * relaxed(elapsed(sampled.time_s), tau) * sampled.angle)


@enters(
    "reading",
    Modulation,
    identifier="gain-drift",
    key="gain-drift:periodic",
    name="gain that changes periodically",
    equation=r"y = x (1 + g_c \cos 2\pi f_g t + g_s \sin 2\pi f_g t)",
    parameters=(
        Parameter("g_cosine", "1", -1.0, 1.0, word="relative amplitude"),
        Parameter("g_sine", "1", -1.0, 1.0, 0.0, word="relative amplitude"),
        Parameter("f_g", "Hz", 0.0, 1e6, word="frequency"),
    ),
    # Any smooth curve of six numbers has three.
    fewest=3.0,
    discriminating_test=type(gain_drift).discriminating_test,
)
def gain_modulation(
    sampled: Sampled, pendulum: Pendulum, cosine: float, sine: float, f_g: float
) -> FloatArray:
    """The sensor's constant goes up and down: side bands that are in phase with the motion.

    Those of a stiffness that does are in quadrature, and the farther apart the smaller.
    """
    phase = 2.0 * math.pi * f_g * elapsed(sampled.time_s)
    return np.asarray(tone_at(cosine, sine, phase) * sampled.angle)


@enters(
    "reading",
    identifier="ac-coupling",
    name="AC coupling",
    equation=r"y = x + u\, e^{-t/\tau}",
    parameters=(
        Parameter("u", "rad", -10.0, 10.0, word="level at the start"),
        Parameter("tau", "s", 1e-2, 1e6, word="time constant"),
    ),
    example=(1e-3, 5.0),
    discriminating_test="tilt the sensor and hold it: with AC coupling the reading returns",
    displacement=lambda values, duration_s: float(
        abs(values[0] * math.expm1(-duration_s / values[1]))
    ),
    shapes=lambda span: rows(between(span.period_s, 0.5 * span.duration_s, 4)),
)
def ac_coupling(sampled: Sampled, pendulum: Pendulum, level: float, tau: float) -> FloatArray:
    """A first-order high-pass: the level that its capacitor holds at the start decays.

    Its constant lead (1/(omega tau) rad) and gain are a shift of the time and of the scale,
    which no free decay shows; they are left out.
    """
    return np.asarray(level * np.exp(-elapsed(sampled.time_s) / tau))


_AMPLITUDES: Final = (
    Parameter("a_cosine", "rad", -10.0, 10.0, word="amplitude"),
    Parameter("a_sine", "rad", -10.0, 10.0, 0.0, word="amplitude"),
)
_FREQUENCY: Final = Parameter("f_a", "Hz", 0.0, 1e6, word="frequency")
_HARMONICS: Final = 3
"""Of a hum: mains, rectified mains, and the third of a magnetising current, which is saturated."""
_MAINS_HZ: Final = (50.0, 60.0)  # of the world's grids
_MAINS_SD: Final = 4e-4
"""Relative standard deviation of a grid's frequency: 20 mHz at 50 Hz."""
_BY_CHANCE: Final = 0.05
"""Largest part of all frequencies that the lines of the mains may take: else any line is one."""


def mains_lines(rate_hz: float, sd_hz: float = 0.0) -> Iterator[tuple[float, float, float]]:
    """Yield the harmonics of 50 and 60 Hz: the frequency, where it is seen, and how far about that.

    At f readings a second what has the frequency F is seen at ``|F - n f|``, n the nearest whole
    number, within two standard deviations of the grid's and of the line's own, `sd_hz`.
    """
    taken = 0.0
    for order in itertools.count(1):
        for mains in (order * each for each in _MAINS_HZ):
            within = 2.0 * math.hypot(sd_hz, _MAINS_SD * mains)
            taken += 4.0 * within / rate_hz
            if taken > _BY_CHANCE:
                return
            yield mains, abs(mains - rate_hz * round(mains / rate_hz)), within


def _pickup(base: type[Effect], **more: Any) -> Callable[[Callable[..., Any]], Effect]:
    """Declare a form of the tone; `more` is what distinguishes it."""
    return enters(
        "reading",
        base,
        identifier="tone-pickup",
        discriminating_test=(
            "record with the pendulum held, and at another sampling rate: an alias moves"
        ),
        **more,
    )


def _tone(
    sampled: Sampled, pendulum: Pendulum, cosine: float, sine: float, f_a: float
) -> FloatArray:
    """A steady tone in the reading, the alias of the mains for instance."""
    return tone_at(cosine, sine, 2.0 * math.pi * f_a * elapsed(sampled.time_s))


tone_pickup: Final = _pickup(
    SteadyTone,
    name="tone in the reading",
    equation=r"y = x + a_c \cos 2\pi f_a t + a_s \sin 2\pi f_a t",
    parameters=(*_AMPLITUDES, _FREQUENCY),
    example=(1e-3, 5e-4, 3.3),
    shapes=lambda span: rows(tried_frequencies(span, 0.2 / span.period_s)),
)(_tone)


def _near_the_motion(span: Span) -> list[tuple[float, ...]]:
    """Where the mains fold onto the motion, whose neighbourhood the scan for tones leaves alone."""
    found = list[tuple[float, ...]]()
    for _, seen, within in mains_lines(1.0 / span.interval_s):
        tried = seen + np.arange(-within, within, APART / span.duration_s)
        found += rows(tried[np.abs(tried - 1.0 / span.period_s) < plane_band_hz(span)])
    return found


_FAMILY: Final = tuple(
    each._replace(name=f"{each.name}_{order}")
    for order in range(1, _HARMONICS + 1)
    for each in _AMPLITUDES
)


@_pickup(
    SteadyTone,
    key="tone-pickup:harmonics",
    name="tone in the reading, with its harmonics",
    equation=(r"y = x + \sum_{k=1}^3 (a_{ck} \cos 2\pi k f_a t + a_{sk} \sin 2\pi k f_a t)"),
    parameters=(*_FAMILY, _FREQUENCY),
    sizes=len(_FAMILY),
    shapes=type(tone_pickup).shapes,
)
def tone_with_harmonics(sampled: Sampled, pendulum: Pendulum, *values: float) -> FloatArray:
    """A tone with its harmonics, one cause: the sampling folds each of them to its own place.

    The harmonics of a folded tone are those of the tone, folded.
    """
    phase = 2.0 * math.pi * values[-1] * elapsed(sampled.time_s)
    pairs = zip(values[0:-1:2], values[1:-1:2], strict=True)
    parts = [tone_at(*pair, order * phase) for order, pair in enumerate(pairs, 1)]
    return np.asarray(np.sum(parts, axis=0))


hum_near_the_motion: Final = _pickup(
    Effect,
    key="tone-pickup:near",
    name="mains hum that the sampling folds onto the motion",
    equation=type(tone_pickup).equation,
    parameters=type(tone_pickup).parameters,
    sizes=2,
    shapes=_near_the_motion,
)(_tone)


clipping: Final[Effect] = without_template(
    __name__,
    """Readings beyond the range are cut off: sharply, or over a width w about the level.

    With a width the upper end reads y = L - w ln(1 + e^((L - x)/w)). What is sharp is found
    by the largest reading, what is soft by its shape. The diagnosis reports a sharp level as it
    stands in the readings, and of a soft end what the largest angle loses by it.
    """,
    identifier="clipping",
    name="clipping",
    equation=r"y = \operatorname{clip}(x, y_\mathrm{low}, y_\mathrm{high})",
    parameters=(
        Parameter("lower_level", "rad", -math.inf, math.inf, -math.inf, word="lower level"),
        Parameter("upper_level", "rad", -math.inf, math.inf, math.inf, word="upper level"),
        Parameter("width", "rad", 0.0, math.inf, 0.0, word="width"),
    ),
    discriminating_test="widen the range, or release it with less amplitude",
)
missing_codes: Final[Effect] = without_template(
    __name__,
    "Codes that the converter never gives; their share falls to the neighbours.",
    identifier="missing-codes",
    name="missing codes",
    equation=r"y = q\, \operatorname{code}(x/q), \quad \operatorname{code} \notin \mathcal{M}",
    parameters=(Parameter("number", "1", 0.0, 4096.0, word="number"),),
    discriminating_test="record a slow ramp: the same codes must be missing",
)
coarse_quantisation: Final[Effect] = without_template(
    __name__,
    "Steps coarser than the noise, and than the converter's bits promise.",
    identifier="coarse-quantisation",
    name="coarse quantisation",
    equation=r"y = q\, \operatorname{round}(x/q)",
    parameters=(Parameter("step", "rad", 0.0, math.inf, word="step"),),
    discriminating_test="narrow the range, or add noise of the size of a step",
)
count_slips: Final[Effect] = without_template(
    __name__,
    "An encoder loses whole counts, or gains them: the level jumps, the motion does not.",
    identifier="count-slips",
    name="lost counts",
    equation=r"y = x + Q \sum_k n_k\, H(t - t_k), \quad n_k \in \mathbb{Z}",
    parameters=(
        Parameter("step", "rad", 0.0, math.inf, word="step"),
        Parameter("number", "1", 0.0, 1e6, word="number"),
    ),
    discriminating_test="count against the encoder's index pulse, or read it more often",
)

_WIDTHS: Final = (0.01, 0.03, 0.1)
"""Of the first amplitude: from an edge to what bends like a cubic sensor."""
_HARD: Final = 30.0
"""Widths beyond an edge where exp(-30) = 1e-13 is left of the bend: it is a corner there."""


@enters(
    "reading",
    identifier="clipping",
    key="clipping:soft",
    name="soft clipping",
    equation=r"y = x - w \ln\left[1 + (e^{d/w} - 1)\, e^{(x - x_\mathrm{top})/w}\right]",
    parameters=(
        Parameter("upper_loss", "rad", 0.0, 10.0, word="loss at the upper end"),
        Parameter("lower_loss", "rad", 0.0, 10.0, word="loss at the lower end"),
        Parameter("width", "rad", 1e-7, 10.0, word="width"),
    ),
    sizes=2,
    discriminating_test="widen the range, or release it with less amplitude",
    shapes=lambda span: rows(span.first_amplitude * np.array(_WIDTHS)),
)
def soft_clipping(
    sampled: Sampled, pendulum: Pendulum, upper: float, lower: float, width: float
) -> FloatArray:
    """The form of `clipping` that has a template: near the ends readings fall behind.

    With a level L and a width w the upper end reads y = L - w ln(1 + e^((L - x)/w)). The size
    is what the largest angle loses, d = w ln(1 + e^((x_top - L)/w)), by which

        y = x - w ln[1 + (e^(d/w) - 1) e^((x - x_top)/w)]:

    at d << w an exponential, at d >> w a flat top at x_top - d.
    """
    angle = sampled.angle
    return np.asarray(
        _lost(angle.min() - angle, lower, width) - _lost(angle - angle.max(), upper, width)
    )


SoftClipping = type(soft_clipping)


def _lost(beyond: FloatArray, depth: float, width: float) -> FloatArray:
    """Return w ln[1 + (e^(d/w) - 1) e^(beyond/w)]; no angle is `beyond` the largest."""
    near = beyond / width
    if depth > _HARD * width:
        return np.asarray(width * np.logaddexp(0.0, near + depth / width))
    return np.asarray(width * np.log1p(np.expm1(depth / width) * np.exp(near)))


@enters(
    "delay",
    Relaxing,
    identifier="clock-drift",
    name="drifting clock",
    equation=r"t \to t + \kappa \tau \left[t - \tau (1 - e^{-t/\tau})\right]",
    parameters=(Parameter("rate", "1/s", -1.0, 1.0, word="rate"), RELAXATION),
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


jitter: Final[Effect] = without_template(
    __name__,
    "Sampling instants that scatter: noise in proportion to the velocity.",
    identifier="jitter",
    name="jitter of the sampling",
    equation=r"\sigma^2 \to \sigma^2 + \dot x^2 \sigma_t^2",
    parameters=(Parameter("sigma_t", "s", 0.0, math.inf, word="jitter"),),
    discriminating_test="record a fast clean tone: the noise must grow with its slope",
)


clock_slips: Final[Effect] = without_template(
    __name__,
    "The clock misses whole samples, or repeats them, again and again.",
    identifier="clock-slips",
    name="clock slips by whole samples",
    equation=r"t \to t + \mathrm{d}t \sum_k m_k\, H(t - t_k), \quad m_k \in \mathbb{Z}",
    parameters=(
        Parameter("dt", "s", 0.0, math.inf, word="step of time"),
        Parameter("number", "1", 0.0, 1e6, word="number"),
    ),
    discriminating_test="log the computer's own clock with every sample",
)


_TICK_S: Final = 1.0 / 64.0
"""Of a computer's timer at its slowest: a clock that is set anew may jump by any part of it."""


def _part_of_a_sample(values: FloatArray, span: Span) -> float:
    """Return what a part of a sample costs.

    Samples are lost whole. Less than one, or than a tick of the clock that stamps them, is lost
    where the instrument itself reads n times as fast, which is the less likely the larger n: by
    1/n.
    """
    part = abs(float(values[0])) / min(span.interval_s / span.fold, _TICK_S)
    return -2.0 * math.log(min(max(part, 1e-6), 1.0))


@enters(
    "reading",
    Sudden,
    identifier="offset-step",
    name="jump of the reading",
    equation=r"y = x + J\, H(t - t_k)",
    parameters=(Parameter("J", "rad", -10.0, 10.0, word="jump"), INSTANT),
    tried=64,
    example=(1e-3, 21.03),
    discriminating_test=(
        "look at amplitude and phase about the jump: they stay if the sensor or the camera moved"
    ),
)
def offset_step(sampled: Sampled, pendulum: Pendulum, jump: float, instant_s: float) -> FloatArray:
    """The zero of the reading jumps by J, since the sensor or the camera was moved."""
    return np.asarray(jump * reading_step(sampled.time_s, instant_s))


@enters(
    "delay",
    Sudden,
    identifier="dropped-samples",
    name="lost samples, or a jump of the clock",
    equation=r"t \to t + d\, H(t - t_k)",
    parameters=(Parameter("d", "s", -1e5, 1e5, word="lost time"), INSTANT),
    tried=64,
    example=(1e-2, 21.03),
    discriminating_test="compare the number of samples with the time that a second clock shows",
    prior_penalty=_part_of_a_sample,
)
def dropped_samples(time_s: FloatArray, late_s: float, instant_s: float) -> FloatArray:
    """Samples were lost (or doubled): later readings come later (earlier) by a time."""
    return np.asarray(late_s * reading_step(time_s, instant_s))


_ROWS: Final = 4
"""Times that a row is read where the mark was found: an error of (omega kappa x)^5 is left."""


@enters(
    "reading",
    identifier="rolling-shutter",
    name="rolling shutter",
    equation=r"y(t) = x(t + \kappa y)",
    parameters=(Parameter("kappa", "s/rad", -1.0, 1.0, word="delay"),),
    rare=True,
    example=(0.005,),
    discriminating_test="turn the camera by 180 degrees: the sign of kappa must turn with it",
)
def rolling_shutter(sampled: Sampled, pendulum: Pendulum, kappa: float) -> FloatArray:
    """A camera reads its rows one after another: the later, the farther the bob is to one side.

    The phase is shifted by omega kappa x, which makes a second harmonic in quadrature,
    -omega kappa y^2/2 sin 2 psi.
    """
    omega = pendulum.angular_frequency
    moved = np.zeros_like(sampled.angle)
    for _ in range(_ROWS):
        turned = omega * kappa * (sampled.angle + moved)
        moved = sampled.angle * (np.cos(turned) - 1.0) + sampled.velocity / omega * np.sin(turned)
    return np.asarray(moved)


DroppedSamples = type(dropped_samples)
OffsetStep = type(offset_step)


glitches: Final[Effect] = without_template(
    __name__,
    "Single readings far off.",
    identifier="glitches",
    name="glitches",
    equation=r"y_k = x_k + g_k, \quad k \in \mathcal{G}",
    parameters=(
        Parameter("number", "1", 0.0, 1e6, word="number"),
        Parameter("rms", "rad", 0.0, math.inf, word="rms"),
    ),
    discriminating_test="change cable and supply, and record at rest",
)
tracking_noise: Final[Effect] = without_template(
    __name__,
    """The tracked mark wanders on the bob, or the tracker on the mark.

    Where the recording holds both coordinates, the distance r from the pivot shows it: a string
    keeps that, so that w, what r is more than a smooth function of the angle, is the wander
    along the string, over its length. What goes across it, in the angle, is taken in proportion.
    """,
    identifier="tracking-noise",
    name="wander of the tracked mark",
    equation=r"y = x + \kappa\, w(t), \quad w = r/\bar r - P(x)",
    parameters=(
        Parameter("kappa", "rad", -100.0, 100.0, 1.0, word="gain"),
        Parameter("rms", "1", 0.0, 1.0, word="rms"),
    ),
    discriminating_test="track another mark on the bob, or the same mark again",
)
coloured_noise: Final[Effect] = without_template(
    __name__,
    """Noise that grows to low frequencies.

    The diagnosis reports how steeply it falls about the pendulum's own frequency: the slope
    -d ln S/d ln f, which is alpha far below the corner and less about it.
    """,
    identifier="coloured-noise",
    name="coloured noise",
    equation=r"S(f) = S_0 \left[1 + (f_0/f)^{\alpha}\right]",
    parameters=(
        Parameter("corner", "Hz", 0.0, math.inf, word="corner frequency"),
        Parameter("exponent", "1", 0.0, 4.0, word="exponent"),
    ),
    discriminating_test="record with the pendulum held",
)
