"""Other oscillations: a second mode, a second plane, a drive, what the wiring picks up."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.effects.effect import (
    Effect,
    Parameter,
    Pendulum,
    Span,
    enters,
    subclass,
    without_template,
)
from pendpipe.effects.scan import elapsed, rows, since_release

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.any_law import Motion
    from pendpipe.dynamics.sampling import Sampled


def tone_at(cosine: float, sine: float, phase: FloatArray) -> FloatArray:
    """Return q_c cos(phase) + q_s sin(phase)."""
    total = np.zeros_like(phase)
    # A scan asks for one quadrature at a time.
    if cosine != 0.0:
        total += cosine * np.cos(phase)
    if sine != 0.0:
        total += sine * np.sin(phase)
    return total


def tried_frequencies(span: Span, low: float, count: int = 16) -> FloatArray:
    """Return frequencies in Hz for a scan, in equal ratios up to near half the sampling rate."""
    return np.geomspace(low, 0.45 / span.interval_s, count)


def plane_band_hz(span: Span) -> float:
    """Return how near the pendulum's frequency a tone is that of a second plane.

    Within some lines' widths a steady or dying tone can imitate any slow change of phase or
    amplitude; what swings there is a second plane, with the main motion's envelope.
    """
    return min(10.0 / span.duration_s, 0.3 / span.period_s)


def _dying_tone(frequency_hz: float, decay_time_s: float) -> tuple[float, float] | None:
    return None if math.isinf(decay_time_s) else (frequency_hz, decay_time_s)


def _above_the_pendulum(span: Span) -> list[tuple[float, ...]]:
    """A rough grid of frequencies above the pendulum's, and three times of decay."""
    lasts = span.duration_s * np.array([0.02, 0.1, 0.5])
    return rows(tried_frequencies(span, 1.5 / span.period_s), lasts)


@enters(
    "reading",
    identifier="second-mode",
    name="second mode",
    kind="dynamics",
    equation=r"y = x + e^{-t/\tau_2} (q_c \cos 2\pi f_2 t + q_s \sin 2\pi f_2 t)",
    parameters=(
        Parameter("q_cosine", "rad", -10.0, 10.0),
        Parameter("q_sine", "rad", -10.0, 10.0, 0.0),
        Parameter("f_2", "Hz", 0.0, 1e6),
        Parameter("tau_2", "s", 1e-3, 1e6),
    ),
    sizes=2,
    spectral=True,
    example=(1e-3, 2e-3, 4.3, 3.0),
    discriminating_test=(
        "a second sensor on the stand, or another point of the rod; another release"
    ),
    tone=_dying_tone,
    shapes=_above_the_pendulum,
)
def second_mode(
    sampled: Sampled, pendulum: Pendulum, cosine: float, sine: float, f_2: float, tau_2: float
) -> FloatArray:
    """A mode of rod, bob or stand that rings down of its own, added to the reading.

    Its reaction on the pendulum is left out; times are from the first reading.
    """
    time = elapsed(sampled.time_s)
    return np.asarray(tone_at(cosine, sine, 2.0 * math.pi * f_2 * time) * np.exp(-time / tau_2))


BEATING_MODE: Final[Effect] = subclass(
    type(second_mode),
    "beating_mode",
    "The form of `second-mode` that is expected, where the swings grow again.",
    {"key": "second-mode:beats", "expected": True, "prior": 12.0},
)()


def _detunings(span: Span) -> list[tuple[float, ...]]:
    """On both sides, half of 1/duration apart."""
    last = plane_band_hz(span)
    beats = np.arange(0.25 / span.duration_s, last, 0.5 / span.duration_s)
    return rows([*(-beats[::-1]), *beats])


@enters(
    "reading",
    identifier="plane-coupling",
    name="swing in a second plane",
    kind="dynamics",
    equation=(
        r"y = x + \frac{r}{r_1} \left[q_c \cos(\psi + 2\pi \delta t)"
        r" + q_s \sin(\psi + 2\pi \delta t)\right]"
    ),
    parameters=(
        Parameter("q_cosine", "rad", -10.0, 10.0),
        Parameter("q_sine", "rad", -10.0, 10.0, 0.0),
        Parameter("detuning", "Hz", -1e3, 1e3),
    ),
    sizes=2,
    example=(1e-3, 5e-4, 0.02),
    discriminating_test="a second sensor across the first, or a longer record: beats must repeat",
    shapes=_detunings,
)
def plane_coupling(
    sampled: Sampled, pendulum: Pendulum, cosine: float, sine: float, detuning: float
) -> FloatArray:
    """A second plane, of nearly the same frequency and loss, seen by the sensor: beats.

    The tone has the main motion's envelope, and runs ahead of it by `detuning`. A slow
    precession is a pair of such tones.
    """
    phase = sampled.phase + 2.0 * math.pi * detuning * elapsed(sampled.time_s)
    return np.asarray(sampled.amplitude / sampled.amplitude[0] * tone_at(cosine, sine, phase))


PlaneCoupling = type(plane_coupling)


class SteadyTone(Effect):
    """What a scan over frequency finds as a line that does not fade."""

    sizes = 2
    spectral = True

    def tone(self, frequency_hz: float, decay_time_s: float) -> tuple[float] | None:
        """A steady tone."""
        return (frequency_hz,) if math.isinf(decay_time_s) else None


def _about_the_pendulum(span: Span) -> list[tuple[float, ...]]:
    """A rough grid of frequencies about the pendulum's."""
    own = 1.0 / span.period_s
    return rows([*np.linspace(0.3, 0.97, 8) * own, *np.geomspace(1.03, 4.0, 8) * own])


@enters(
    "acceleration",
    SteadyTone,
    identifier="periodic-drive",
    name="periodic drive",
    equation=r"\ddot x \mathrel{+}= d_c \cos 2\pi f_d t + d_s \sin 2\pi f_d t",
    parameters=(
        Parameter("d_cosine", "rad/s^2", -100.0, 100.0),
        Parameter("d_sine", "rad/s^2", -100.0, 100.0, 0.0),
        Parameter("f_d", "Hz", 0.0, 1e6),
    ),
    example=(5e-4, 3e-4, 1.2),
    discriminating_test=(
        "record the pendulum at rest: the tone must stay, and fall off above resonance"
    ),
    shapes=_about_the_pendulum,
)
def periodic_drive(
    motion: Motion, pendulum: Pendulum, cosine: float, sine: float, f_d: float
) -> FloatArray:
    """A periodic torque: fan, building, mains. Also rings the pendulum where it sets in."""
    return tone_at(cosine, sine, 2.0 * math.pi * f_d * since_release(motion, pendulum))


BROADBAND_DRIVE: Final[Effect] = without_template(
    __name__,
    "Random torque (seismic, air): amplitude and phase walk, and never come to rest.",
    identifier="broadband-drive",
    name="broadband drive",
    kind="dynamics",
    equation=r"\ddot x \mathrel{+}= \xi(t), \quad S_\xi(f) = S_a",
    parameters=(Parameter("acceleration_density", "(rad/s^2)^2/Hz", 0.0, 1e6),),
    discriminating_test="record it at rest, and two pendulums at once: the walk does not repeat",
)
