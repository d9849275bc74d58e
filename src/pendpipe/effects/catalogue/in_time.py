"""What has a time of its own: added oscillations; drifts, sudden changes, the release."""

import math
from collections.abc import Callable
from typing import Any, ClassVar, Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release
from pendpipe.dynamics.any_law import Motion, Sampled
from pendpipe.effects.effect import (
    INSTANT,
    RELAXATION,
    Effect,
    Kick,
    Parameter,
    Pendulum,
    Relaxing,
    Span,
    Start,
    Sudden,
    between,
    elapsed,
    enters,
    relaxed,
    rows,
    since_release,
    smooth_step,
    subclass,
    unusual_drift,
    without_template,
)
from pendpipe.effects.kicks import between_kicks, corner, pulse, repeated_kick
from pendpipe.effects.two_modes import two_modes
from pendpipe.effects.two_planes import beside, planes, two_planes, waveform


def _beating(time_s: FloatArray, values: FloatArray, period_s: float) -> Start | None:
    """Start at Eq. 8 for the stronger of two modes that beat, and at the other beside it."""
    modes = two_modes(time_s, values, 0.5 * period_s)
    if modes is None:
        return None
    own, other = modes
    omega = 2.0 * math.pi * own.frequency.value
    turn = (-own.phase_rad % (2.0 * math.pi)) / omega
    largest = own.amplitude.value * math.exp(-own.loss.value * turn)
    law = Eq8(omega, hysteretic=0.5 * own.loss.value, viscous=0.5 * own.loss.value)
    size, phase = other.amplitude.value, other.phase_rad
    sizes = size * math.cos(phase), -size * math.sin(phase)
    found = np.array([*sizes, other.frequency.value, 1.0 / other.loss.value])
    return Start(beating_mode, law, Release(float(time_s[0] + turn), largest), found)


def tone_at(cosine: float, sine: float, phase: FloatArray) -> FloatArray:
    """Return q_c cos(phase) + q_s sin(phase)."""
    # One wave for both: a cosine of an array takes as long as forty products.
    size = math.hypot(cosine, sine)
    return size * np.cos(phase - math.atan2(sine, cosine)) if size else np.zeros_like(phase)


def tried_frequencies(span: Span, low: float) -> FloatArray:
    """Return frequencies in Hz for a scan, in equal ratios up to near half the sampling rate."""
    return np.geomspace(low, 0.45 / span.interval_s, 16)


def plane_band_hz(span: Span) -> float:
    """Return how near the pendulum's frequency a tone is that of a second plane.

    Within some lines' widths a steady or dying tone can imitate any slow change of phase or
    amplitude; what swings there is a second plane, with the main motion's envelope.
    """
    return min(10.0 / span.duration_s, 0.3 / span.period_s)


@enters(
    "reading",
    identifier="second-mode",
    name="second mode",
    kind="dynamics",
    equation=r"y = x + e^{-t/\tau_2} (q_c \cos 2\pi f_2 t + q_s \sin 2\pi f_2 t)",
    parameters=(
        Parameter("q_cosine", "rad", -10.0, 10.0, word="amplitude"),
        Parameter("q_sine", "rad", -10.0, 10.0, 0.0, word="amplitude"),
        Parameter("f_2", "Hz", 0.0, 1e6, word="frequency"),
        Parameter("tau_2", "s", 1e-3, 1e6, word="damping time"),
    ),
    sizes=2,
    spectral=True,
    example=(1e-3, 2e-3, 4.3, 3.0),
    discriminating_test=(
        "put a second sensor on the stand or on another point of the rod; release it again"
    ),
    tone=lambda frequency_hz, decay_time_s, _: (
        None if math.isinf(decay_time_s) else (frequency_hz, decay_time_s)
    ),
    shapes=lambda span: rows(
        tried_frequencies(span, 1.5 / span.period_s), span.duration_s * np.array([0.02, 0.1, 0.5])
    ),
    start=_beating,
)
def second_mode(
    sampled: Sampled, pendulum: Pendulum, cosine: float, sine: float, f_2: float, tau_2: float
) -> FloatArray:
    """A mode of rod, bob or stand that rings down of its own, added to the reading.

    Its reaction on the pendulum is left out; times are from the first reading.
    """
    time = elapsed(sampled.time_s)
    return np.asarray(tone_at(cosine, sine, 2.0 * math.pi * f_2 * time) * np.exp(-time / tau_2))


beating_mode: Final[Effect] = subclass(
    type(second_mode),
    "beating_mode",
    "The form of `second-mode` that is expected, where the swings grow again.",
    {"key": "second-mode:beats", "expected": True, "prior": 12.0},
)()


_SLOWEST: Final = 1.5
"""Beats, or cycles of a modulation, within the recording: slower ones are drifts."""


def _detunings(span: Span, slowest: float = 0.25, apart: float = 0.5) -> list[tuple[float, ...]]:
    """On both sides, a part of 1/duration apart, from so many beats within the recording on."""
    last = plane_band_hz(span)
    beats = np.arange(slowest / span.duration_s, last, apart / span.duration_s)
    return rows([*(-beats[::-1]), *beats])


def _in_two_planes(
    time_s: FloatArray, values: FloatArray, pendulum: Pendulum, about_s: float
) -> Start | None:
    """Start at the two planes that explain the slow amplitude of the readings."""
    if pendulum.restoring != "sine":
        return None
    found = two_planes(time_s, values, pendulum.angular_frequency)
    if found is None:
        return None
    own = 0.5 * found.linear
    law = Eq8(found.omega, found.quadratic, own, own, restoring="sine")
    turns = round((found.phase_rad + found.omega * (about_s - time_s[0])) / math.pi)
    late = (turns * math.pi - found.phase_rad) / found.omega
    side = -1.0 if turns % 2 else 1.0
    lost = (found.linear + found.quadratic * found.amplitude) * late
    at = Release(float(time_s[0]) + late, side * found.amplitude * math.exp(-lost))
    share = side * found.other * found.amplitude
    detuning = found.detuning / (2.0 * math.pi)
    return Start(string_planes, law, at, np.array([share.real, -share.imag, detuning]))


_SEEN: Final = "part seen at the start"


def _second_plane(**more: Any) -> Callable[[Callable[..., Any]], Effect]:
    """Declare a form of the second plane; `more` is what distinguishes it."""
    return enters(
        "reading",
        identifier="plane-coupling",
        name="swing in a second plane",
        kind="dynamics",
        parameters=(
            Parameter("q_cosine", "rad", -10.0, 10.0, word=_SEEN),
            Parameter("q_sine", "rad", -10.0, 10.0, 0.0, word=_SEEN),
            Parameter("detuning", "Hz", -1e3, 1e3, word="detuning"),
        ),
        sizes=2,
        carried=True,
        discriminating_test=(
            "add a second sensor across the first, or record longer: beats must repeat"
        ),
        **more,
    )


@_second_plane(
    equation=(
        r"y = x + \operatorname{Re}\left[r \beta\, e^{i\psi}\right], \quad"
        r" \dot\beta = 2\pi i \delta \beta - \tfrac38 \omega r^2 \operatorname{Im} \beta,"
        r" \quad r_1 \beta_1 = q_c - i q_s"
    ),
    example=(1e-3, 5e-4, 0.02),
    # Where the planes' turn takes up the detuning a small swing grows, and beats are sharper.
    shapes=lambda span: _detunings(span, _SLOWEST, 0.25),
    start=lambda time_s, values, period_s: _in_two_planes(
        time_s, values, Pendulum(2.0 * math.pi / period_s, restoring="sine"), float(time_s[0])
    ),
    restart=_in_two_planes,
)
def plane_coupling(
    sampled: Sampled, pendulum: Pendulum, cosine: float, sine: float, detuning: float
) -> FloatArray:
    """A second plane, of nearly the same frequency and loss, seen by the sensor: beats.

    A sensor askew adds a part of it: a tone with the main motion's envelope, which runs ahead of it
    by `detuning`. Of a string both planes are those of a spherical pendulum: the more they swing,
    the slower, and an ellipse turns by 3/8 of the product of its half axes. Of a spring the
    planes do not turn each other: beta has the detuning alone.
    """
    time, turned = elapsed(sampled.time_s), 2.0 * math.pi * detuning
    if pendulum.restoring == "sine":
        across = beside(time, *_amplitude_so_far(sampled), turned, pendulum.quadratic)
    else:
        across = np.exp(1j * turned * time) * np.array([[1.0], [-1j]])
    seen = (cosine * across[0] + sine * across[1]) * np.exp(1j * sampled.phase)
    return np.asarray(sampled.amplitude / sampled.amplitude[0] * seen.real)


def _amplitude_so_far(sampled: Sampled) -> tuple[FloatArray, FloatArray]:
    """Return the integral of omega r^2 since the first reading, and r^2."""
    motion = sampled.motion
    reached = sampled.at_nodes(motion.clock.integral(motion.amplitude**2))
    return reached - reached[0], sampled.amplitude**2


PlaneCoupling = type(plane_coupling)


@_second_plane(
    key="plane-coupling:string",
    # Axes at 45 degrees to the plane that is seen share its motion equally.
    displacement=lambda _own, _duration_s: 0.0,
    equation=(
        r"y = \operatorname{Re}\left[(a \cos\alpha - b \sin\alpha)\, e^{i\psi}\right], \quad"
        r" \dot a = -\tfrac{i \omega}{16} (|a|^2 + |b|^2) a - \Omega b, \quad"
        r" \dot b = -\tfrac{i \omega}{16} (|a|^2 + |b|^2) b + \Omega a + 2\pi i \delta b,"
        r" \quad \Omega = -\tfrac38 \omega \operatorname{Im}(a^* b)"
    ),
)
def string_planes(
    sampled: Sampled, pendulum: Pendulum, cosine: float, sine: float, detuning: float
) -> FloatArray:
    """A spherical pendulum's two planes: the form of `plane-coupling` at which a restart begins.

    Along the suspension's axis of frequency f_0 + `detuning` the motion seen is
    q_c cos(psi) + q_s sin(psi) at the first reading. Without detuning that is precession alone.
    The axes' angle alpha to the plane that is seen, tan^2 alpha = q/r, is that with which the other
    moves least. At size 0 it has no derivative.
    """
    motion = sampled.motion
    ratio = motion.upwards * complex(cosine, -sine) / sampled.amplitude[0]
    turned, time = 2.0 * math.pi * detuning, elapsed(sampled.time_s)
    both = planes(time, *_amplitude_so_far(sampled), ratio, turned, pendulum.quadratic)
    return motion.upwards * waveform(sampled.amplitude, sampled.phase, *both)


class SteadyTone(Effect):
    """What a scan over frequency finds as a line that does not fade."""

    sizes = 2
    spectral = True

    def tone(self, frequency_hz: float, decay_time_s: float, span: Span) -> tuple[float] | None:
        """A steady tone."""
        return (frequency_hz,) if math.isinf(decay_time_s) else None


_STRENGTH: Final = "amplitude of the acceleration"


def _drive(base: type[Effect], **more: Any) -> Effect:
    """Declare the drive; `more` is what distinguishes a form of it."""
    return enters(
        "acceleration",
        base,
        identifier="periodic-drive",
        name="periodic drive",
        equation=r"\ddot x \mathrel{+}= d_c \cos 2\pi f_d t + d_s \sin 2\pi f_d t",
        parameters=(
            Parameter("d_cosine", "rad/s^2", -100.0, 100.0, word=_STRENGTH),
            Parameter("d_sine", "rad/s^2", -100.0, 100.0, 0.0, word=_STRENGTH),
            Parameter("f_d", "Hz", 0.0, 1e6, word="frequency"),
        ),
        sizes=2,
        discriminating_test=(
            "record the pendulum at rest: the tone must stay, and fall off above resonance"
        ),
        **more,
    )(_driven)


def _driven(
    motion: Motion, pendulum: Pendulum, cosine: float, sine: float, f_d: float
) -> FloatArray:
    """A periodic torque: fan, building, mains. Also rings the pendulum where it sets in."""
    return tone_at(cosine, sine, 2.0 * math.pi * f_d * since_release(motion, pendulum))


periodic_drive: Final = _drive(
    SteadyTone,
    example=(5e-4, 3e-4, 1.2),
    shapes=lambda span: rows(
        np.array([*np.linspace(0.3, 0.97, 8), *np.geomspace(1.03, 4.0, 8)]) / span.period_s
    ),
)

APART: Final = 0.8
"""Of 1/duration between frequencies near resonance: half of it from one, two thirds of the power of
a steady tone are seen."""


def _near_resonance(span: Span) -> list[tuple[float, ...]]:
    """On both sides of the pendulum's frequency, where the scan for tones leaves it alone."""
    beats = np.arange(0.5 * APART, plane_band_hz(span) * span.duration_s, APART)
    own = 1.0 / span.period_s
    return rows(own + np.array([*(-beats[::-1]), *beats]) / span.duration_s)


def _near_by_chance(values: FloatArray, span: Span) -> float:
    """Twice the logarithm by which a drive is less likely as near resonance: it may be anywhere."""
    apart = abs(float(values[2]) * span.period_s - 1.0)
    return -2.0 * math.log(min(max(2.0 * apart, 1e-6), 1.0))


def _kicked(
    time_s: FloatArray, values: FloatArray, pendulum: Pendulum, about_s: float
) -> Start | None:
    """Start at the kicks that stand out of the readings, a period apart."""
    sine = pendulum.restoring == "sine"
    found = repeated_kick(time_s, values, pendulum.angular_frequency, sine=sine)
    if found is None:
        return None
    law = Eq8(found.omega, 0.0, 0.5 * found.loss, 0.5 * found.loss, restoring=pendulum.restoring)
    turns = round((found.phase_rad + found.omega * (about_s - time_s[0])) / math.pi)
    late = (turns * math.pi - found.phase_rad) / found.omega
    size = (-1.0) ** turns * found.amplitude * math.exp(-found.loss * late)
    at = Release(float(time_s[0]) + late, size)
    return Start(repeated_kicks, law, at, np.array([found.kick, found.period_s, found.first_s]))


def _anywhere(values: FloatArray, span: Span) -> float:
    """Twice the logarithm of the periods and instants tried, a quarter of a cycle apart."""
    instants = 4.0 * np.array([span.duration_s, float(values[1])]) / span.period_s
    return 2.0 * float(np.log(np.maximum(instants, 1.0)).sum())


@enters(
    "acceleration",
    identifier="periodic-drive",
    key="periodic-drive:kicks",
    name="kick that is repeated",
    equation=r"\ddot x \mathrel{+}= \Delta v \sum_k \delta(t - t_1 - k T_k)",
    parameters=(
        Parameter("dv", "rad/s", -100.0, 100.0, word="change of velocity"),
        Parameter("period", "s", 1e-2, 1e6, word="every"),
        Parameter("first", "s", -math.inf, math.inf, word="first at"),
    ),
    nodes=30,
    discriminating_test="record the pendulum at rest: it must begin to swing at the same instants",
    prior_penalty=_anywhere,
    reading=lambda sampled, pendulum, values: (
        values[0] * corner(between_kicks(sampled.time_s, *values[1:]), pendulum.angular_frequency)
    ),
)
def repeated_kicks(
    motion: Motion, pendulum: Pendulum, kick: float, period_s: float, first_s: float
) -> FloatArray:
    """A knock again and again: one cause of lines at all multiples of 1/T_k.

    The form of `periodic-drive` at which a restart begins. Each kick takes an eighth of a cycle in
    the motion, and the reading has the corner that a sharp one makes.
    """
    late = between_kicks(motion.time_s, period_s, first_s)
    pulses = pulse(late, pendulum.angular_frequency) * (since_release(motion, pendulum) > 0.0)
    return np.asarray(kick * pulses)


resonant_drive: Final = _drive(
    Effect,
    key="periodic-drive:near",
    shapes=_near_resonance,
    prior_penalty=_near_by_chance,
    restart=_kicked,
)
"""The form that is looked for near resonance: it beats with the motion, and does not decay."""


def _keeps_in_step(values: FloatArray, span: Span) -> float:
    """Twice the logarithm by which a drive is less likely to stay in step: that is a loss."""
    slipped = abs(float(values[2]) - 2.0 / span.period_s) * span.duration_s
    return -2.0 * math.log(min(max(4.0 * slipped, 1e-6), 1.0))


def _parametric(base: type[Effect], **more: Any) -> Effect:
    """Declare the parametric drive; `more` is what distinguishes a form of it."""
    return enters(
        "acceleration",
        base,
        identifier="parametric-drive",
        name="parametric drive",
        equation=r"\omega^2 x \to \omega^2 x (1 + h_c \cos 2\pi f_h t + h_s \sin 2\pi f_h t)",
        parameters=(
            Parameter("h_cosine", "1", -1.0, 1.0, word="relative amplitude"),
            Parameter("h_sine", "1", -1.0, 1.0, 0.0, word="relative amplitude"),
            Parameter("f_h", "Hz", 0.0, 1e6, word="frequency"),
        ),
        sizes=2,
        discriminating_test="stop what shakes the pivot, or record another length beside it",
        **more,
    )(_modulated)


def _modulated(
    motion: Motion, pendulum: Pendulum, cosine: float, sine: float, f_h: float
) -> FloatArray:
    """A pivot that is shaken up and down, or a length that changes, at about twice the frequency.

    Amplitude and phase beat with the difference to twice the pendulum's frequency. A slow change
    of the stiffness makes side bands at equal distances, which are one cause.
    """
    torque = tone_at(cosine, sine, 2.0 * math.pi * f_h * since_release(motion, pendulum))
    return np.asarray(-pendulum.torque(motion.angle) * torque)


parametric_drive: Final = _parametric(
    Effect,
    example=(2e-4, 1e-4, 1.85),
    shapes=lambda span: rows(2.0 / span.period_s - np.ravel(_detunings(span))),
    prior_penalty=_keeps_in_step,
)


class Modulation(Effect):
    """What makes two lines at equal distances from the motion's frequency.

    Within some lines' widths of it these are looked for at once, farther out a scan over frequency
    finds either of them.
    """

    sizes = 2
    fewest: ClassVar[float] = 0.0
    """Cycles within the recording at least."""

    def bounds(self, duration_s: float = math.inf) -> list[tuple[float, float]]:
        """Fewer cycles are a drift, which curves follow as well."""
        *sizes, (_, fastest) = super().bounds(duration_s)
        return [*sizes, (self.fewest / duration_s, fastest)]

    def shapes(self, span: Span) -> list[tuple[float, ...]]:
        """Frequencies whose side bands lie where no tone is looked for."""
        slowest = max(self.fewest, _SLOWEST)
        cycles = np.arange(slowest, plane_band_hz(span) * span.duration_s, APART)
        return rows(cycles / span.duration_s)

    def tone(self, frequency_hz: float, decay_time_s: float, span: Span) -> tuple[float] | None:
        """The distance of a line from the motion's frequency."""
        steady = math.isinf(decay_time_s) and frequency_hz < 2.0 / span.period_s
        return (abs(frequency_hz - 1.0 / span.period_s),) if steady else None

    def prior_penalty(self, values: FloatArray, span: Span) -> float:
        """Of less than one cycle it is a drift."""
        return -2.0 * math.log(min(max(float(values[2]) * span.duration_s, 1e-6), 1.0))


slow_modulation: Final = _parametric(Modulation, key="parametric-drive:slow")
"""The form that is looked for at changes of the stiffness that are slower than the motion."""


broadband_drive: Final[Effect] = without_template(
    __name__,
    "Random torque (seismic, air): amplitude and phase walk, and never come to rest.",
    identifier="broadband-drive",
    name="broadband drive",
    kind="dynamics",
    equation=r"\ddot x \mathrel{+}= \xi(t), \quad S_\xi(f) = S_a",
    parameters=(
        Parameter("acceleration_density", "(rad/s^2)^2/Hz", 0.0, 1e6, word="spectral density"),
    ),
    discriminating_test="record it at rest, and two at once: the random walk does not repeat",
)


@enters(
    "acceleration",
    Relaxing,
    identifier="frequency-drift",
    name="drifting frequency",
    equation=r"\omega^2 x \to \omega^2 \left[1 + 2 \epsilon \tau (1 - e^{-t/\tau})\right] x",
    parameters=(Parameter("rate", "1/s", -1.0, 1.0, word="rate"), RELAXATION),
    example=(1e-5, 30.0),
    discriminating_test=(
        "release it again with the same amplitude: the frequency must have drifted"
    ),
    prior_penalty=unusual_drift,
)
def frequency_drift(motion: Motion, pendulum: Pendulum, rate: float, tau: float) -> FloatArray:
    """omega (1 + eps tau (1 - e^(-t/tau))): the rod warms up; straight where tau is long."""
    change = rate * relaxed(since_release(motion, pendulum), tau)
    return np.asarray(-2.0 * change * pendulum.torque(motion.angle))


@enters(
    "acceleration",
    Relaxing,
    identifier="damping-drift",
    name="drifting damping",
    equation=r"\ddot x \mathrel{+}= -2 \dot\gamma\, \tau (1 - e^{-t/\tau})\, \dot x",
    parameters=(Parameter("rate", "1/s^2", -10.0, 10.0, word="rate"), RELAXATION),
    example=(1e-4, 25.0),
    discriminating_test="release it again with the same amplitude: the damping must have drifted",
)
def damping_drift(motion: Motion, pendulum: Pendulum, rate: float, tau: float) -> FloatArray:
    """A viscous damping that changes by rate tau (1 - e^(-t/tau)): what warms, or creeps.

    It is straight where tau is long. Any loss changes so to first order, since
    -dy/dt = a y^2 + b y + c has room for one that is linear in y.
    """
    gamma = rate * relaxed(since_release(motion, pendulum), tau)
    return np.asarray(-2.0 * gamma * motion.velocity)


@enters(
    "acceleration",
    Modulation,
    identifier="damping-drift",
    key="damping-drift:periodic",
    name="damping that changes periodically",
    equation=r"\ddot x \mathrel{+}= -2 (\gamma_c \cos 2\pi f_\gamma t"
    r" + \gamma_s \sin 2\pi f_\gamma t)\, \dot x",
    parameters=(
        Parameter("gamma_cosine", "1/s", -100.0, 100.0, word="amplitude"),
        Parameter("gamma_sine", "1/s", -100.0, 100.0, 0.0, word="amplitude"),
        Parameter("f_gamma", "Hz", 0.0, 1e6, word="frequency"),
    ),
    fewest=3.0,
    discriminating_test="read it with a second sensor: a gain that changes is the first one's",
)
def damping_modulation(
    motion: Motion, pendulum: Pendulum, cosine: float, sine: float, f_gamma: float
) -> FloatArray:
    """A loss that goes up and down; its side bands are those of a gain that does."""
    phase = 2.0 * math.pi * f_gamma * since_release(motion, pendulum)
    return np.asarray(-2.0 * tone_at(cosine, sine, phase) * motion.velocity)


def _crept(late: FloatArray, exponential: float) -> FloatArray:
    """(1 - p) ln(1 + t/tau) + p (1 - e^(-t/tau))."""
    return np.asarray((1.0 - exponential) * np.log1p(late) - exponential * np.expm1(-late))


def _crept_at_the_end(values: FloatArray, duration_s: float) -> float:
    """How far it has crept: a slow creep has hardly begun."""
    size, tau, exponential = values.tolist()
    return float(abs(size * _crept(np.asarray(duration_s / tau), exponential)))


@enters(
    "acceleration",
    identifier="equilibrium-creep",
    name="creep of the equilibrium",
    equation=(
        r"\tau(x) \to \tau(x - x_\mathrm{eq}), \quad x_\mathrm{eq} ="
        r" s \left[(1 - p) \ln(1 + t/\tau) + p\, (1 - e^{-t/\tau})\right]"
    ),
    parameters=(
        Parameter("s", "rad", -10.0, 10.0, word="size"),
        Parameter("tau", "s", 1e-3, 1e7, word="time constant"),
        Parameter("exponential", "1", 0.0, 1.0, 0.0, word="exponential share"),
    ),
    example=(1e-3, 10.0, 0.5),
    discriminating_test="put a second sensor on the stand: it stays still if the first drifts",
    displacement=_crept_at_the_end,
    shapes=lambda span: [
        *rows(span.duration_s * np.array([0.03, 0.3, 3.0]), (0.0,)),
        *rows(span.duration_s * np.array([0.05, 0.2]), (1.0,)),
    ],
)
def equilibrium_creep(
    motion: Motion, pendulum: Pendulum, size: float, tau: float, exponential: float
) -> FloatArray:
    """The equilibrium creeps: x_eq = s ln(1 + t/tau), or s (1 - exp(-t/tau)).

    `exponential` 0 is the logarithm (linear where tau is long), 1 the exponential. The torque turns
    with it, as that of gravity does where a support tilts.
    """
    crept = size * _crept(since_release(motion, pendulum) / tau, exponential)
    return np.asarray(pendulum.torque(motion.angle) - pendulum.torque(motion.angle - crept))


@enters(
    "kick",
    Sudden,
    identifier="equilibrium-step",
    name="jump of the equilibrium",
    equation=r"\omega^2 x \to \omega^2 (x - J\, H(t - t_k))",
    parameters=(Parameter("J", "rad", -10.0, 10.0, word="jump"), INSTANT),
    tried=24,
    turn=0.5 * math.pi,
    example=(1e-3, 21.03),
    discriminating_test=(
        "look at amplitude and phase about the jump: they change by -J cos(psi) and "
        "J sin(psi)/y only if the pendulum itself jumped"
    ),
    reading=lambda sampled, _, values: np.asarray(values[0] * (sampled.time_s > values[1])),
)
def equilibrium_step(jump: float, instant_s: float) -> Kick:
    """The equilibrium jumps by J (mesoanelastic): amplitude and phase jump with it."""
    return Kick(float(instant_s), angle=-float(jump))


@enters(
    "kick",
    Sudden,
    identifier="amplitude-step",
    name="jump of the amplitude",
    equation=r"r \to r\, e^{s\, H(t - t_k)}",
    parameters=(Parameter("s", "1", -5.0, 5.0, word="relative jump"), INSTANT),
    tried=72,
    example=(0.01, 21.03),
    discriminating_test="repeat the recording and watch: what touches it?",
)
def amplitude_step(jump: float, instant_s: float) -> Kick:
    """The amplitude changes at once by a factor e^s, the phase unchanged."""
    return Kick(float(instant_s), log_amplitude=float(jump))


@enters(
    "acceleration",
    Sudden,
    identifier="frequency-step",
    name="jump of the frequency",
    equation=r"\omega^2 x \to \omega^2 (1 + 2 \epsilon\, H(t - t_k))\, x",
    parameters=(Parameter("change", "1", -0.4, 0.4, word="relative change"), INSTANT),
    tried=24,
    refined=False,
    example=(1e-4, 21.03),
    discriminating_test="record longer: the frequency must be constant but for the jump",
)
def frequency_step(
    motion: Motion, pendulum: Pendulum, change: float, instant_s: float
) -> FloatArray:
    """omega changes at an instant: the flexure seats itself anew."""
    torque = pendulum.torque(motion.angle)
    return np.asarray(-2.0 * change * smooth_step(motion, instant_s) * torque)


@enters(
    "acceleration",
    Sudden,
    identifier="damping-step",
    name="jump of the damping",
    equation=r"F(x, \dot x) \to (1 + \epsilon\, H(t - t_k))\, F(x, \dot x)",
    parameters=(Parameter("change", "1", -1.0, 100.0, word="relative change"), INSTANT),
    tried=24,
    refined=False,
    example=(0.3, 21.03),
    discriminating_test="release it again alike: a law of the amplitude recurs, a rub does not",
)
def damping_step(motion: Motion, pendulum: Pendulum, change: float, instant_s: float) -> FloatArray:
    """All losses of the baseline change by a factor 1 + eps at an instant: a rub begins."""
    return np.asarray(change * smooth_step(motion, instant_s) * pendulum.losses(motion))


@enters(
    "acceleration",
    Sudden,
    identifier="damping-step",
    key="damping-step:viscous",
    name="jump of the damping",
    equation=r"\ddot x \mathrel{+}= -2 \gamma\, H(t - t_k)\, \dot x",
    parameters=(Parameter("gamma", "1/s", -10.0, 10.0, word="extra damping"), INSTANT),
    tried=24,
    refined=False,
    example=(1e-3, 21.03),
    discriminating_test="release it again alike: a law of the amplitude recurs, a magnet does not",
)
def viscous_step(motion: Motion, pendulum: Pendulum, gamma: float, instant_s: float) -> FloatArray:
    """The viscous damping alone changes at an instant: a magnet is moved, the air is let in."""
    return np.asarray(-2.0 * gamma * smooth_step(motion, instant_s) * motion.velocity)


def _at_a_turn(values: FloatArray, span: Span) -> float:
    """Return twice the logarithm by which a knock is less likely to leave the amplitude alone.

    At a turning point it does, as a jump of the clock does anywhere. Of an instant at a turning
    point, known to s, the phase u from it has the density (2/pi)^(1/2)/s e^(-u^2/(2 s^2)); of one
    at random, 1. What is told from a turning point has no such rival.
    """
    phase, error = span.to_a_turn(float(values[1]))
    error = max(error, np.finfo(np.float64).eps)  # no phase is known better than it is rounded
    density = math.log(2.0 / math.pi) - 2.0 * math.log(error)
    return max(density - (phase / error) ** 2, 0.0)


@enters(
    "kick",
    Sudden,
    identifier="impulse",
    name="impulse",
    equation=r"\ddot x \mathrel{+}= \Delta v\, \delta(t - t_k)",
    parameters=(Parameter("dv", "rad/s", -100.0, 100.0, word="change of velocity"), INSTANT),
    tried=40,
    turn=0.25 * math.pi,
    example=(5e-3, 21.03),
    discriminating_test="repeat the recording: a knock does not recur at the same time",
    prior_penalty=_at_a_turn,
)
def impulse(jump: float, instant_s: float) -> Kick:
    """A knock: the velocity jumps, the angle does not."""
    return Kick(float(instant_s), velocity=float(jump))


FADES: Final = 0.12
"""Part of the record within which the transient of a release has to fade."""


@enters(
    "acceleration",
    identifier="release-transient",
    name="transient of the release",
    equation=r"\ddot x \mathrel{+}= -2 \gamma\, e^{-t/\tau}\, \dot x",
    parameters=(
        Parameter("gamma", "1/s", -10.0, 10.0, word="extra damping"),
        Parameter("tau", "s", 1e-2, 1e5, word="time constant"),
    ),
    local=True,
    example=(0.01, 5.0),
    discriminating_test="leave out the first swings: the rest must need no transient",
    # What fades later is a drift.
    bounds=lambda duration_s=math.inf: [
        (-10.0, 10.0),
        (1e-2, max(min(1e5, FADES * duration_s), 0.1)),
    ],
    shapes=lambda span: rows(between(2.0 * span.period_s, FADES * span.duration_s, 4)),
)
def release_transient(motion: Motion, pendulum: Pendulum, gamma: float, tau: float) -> FloatArray:
    """Damping gamma e^(-t/tau) on top, after the release: hand, wake, other modes."""
    fading = np.exp(-since_release(motion, pendulum) / tau)
    return np.asarray(-2.0 * gamma * fading * motion.velocity)
