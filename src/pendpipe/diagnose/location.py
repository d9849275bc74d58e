"""Where a mismatch lies: time, amplitude, phase of the cycle, frequency, harmonic, code."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.remainder import by_cycle
from pendpipe.diagnose.result import Location
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.oscillations import PlaneCoupling

_MOST: Final = 0.9
"""Part of what an effect explains that its interval holds."""
_SLIP: Final = 0.3
"""Phase in rad between two models from which their plain difference misleads."""
_HARMONICS: Final = 6
_LOUD: Final = 0.1


def locate(before: Fit, after: Fit, data: Data, effect: Effect) -> Location:
    """Say where the readings prefer the model with an effect to the one without.

    Each reading's share of Delta chi^2 is expected to be the squared difference of the two
    models (both at their best) over the noise; intervals hold nine tenths of it.
    """
    difference = _difference(before, after) * data.weight
    power = difference**2
    sampled = after.at.sampled
    time = _interval(data.time_s, power)
    amplitude = _interval(sampled.amplitude, power)
    turned = math.pi if sampled.motion.upwards < 0.0 else 0.0
    of_cycle = powers_of_cycle(sampled.phase + turned, power)
    phase = one_arc(of_cycle, _MOST)
    harmonics = _harmonics(sampled.phase, difference)
    frequency = sampled.motion.angular_frequency / (2.0 * math.pi)
    lines: tuple[float, ...] = tuple(round(h * frequency, 9) for h in harmonics if h > 0)
    instant = instant_of(after, effect)
    if instant is not None:
        time = instant
    tone = tone_of(after, effect)
    if tone is not None:
        lines, harmonics = (tone,), ()
    found = Location(time, amplitude, phase, lines, harmonics)
    summary = _summary(found, data, sampled.amplitude, facing_arcs(of_cycle))
    beat = beat_of(after, effect)
    if beat is not None:
        summary += f", beating with the motion every {beat:.3g} s"
    return replace(found, summary=summary)


def _difference(before: Fit, after: Fit) -> FloatArray:
    """Readings of the two models, one less the other; along the motion where a phase slips.

    Far out of phase the plain difference is as large as the motion and says no longer where
    they drift apart. Then it is taken as if readings were linear in ln amplitude and phase,
    x (change of ln A) + (dx/d phase) (change of phase), as the fit itself does it.
    """
    one, other = before.at.sampled, after.at.sampled
    turn = other.phase - one.phase
    # Whole turns may be counted differently; the phase of the release belongs to either model.
    turn = turn - np.average(turn, weights=other.amplitude**2)
    if np.max(np.abs(turn)) < _SLIP:
        return after.at.reading - before.at.reading
    grown = np.log(np.maximum(other.amplitude, 1e-300) / np.maximum(one.amplitude, 1e-300))
    moved = other.angle * grown + other.velocity / other.motion.angular_frequency * turn
    # What the sensor adds to the motion: its level, its curve, a tone.
    sensor = (after.at.reading - other.angle) - (before.at.reading - one.angle)
    return np.asarray(moved + sensor)


def _interval(argument: FloatArray, power: FloatArray) -> tuple[float, float] | None:
    """The shortest interval of an argument that holds nine tenths of the power."""
    total = float(power.sum())
    if not total > 0.0:
        return None
    order = np.argsort(argument, kind="stable")
    grown = np.cumsum(power[order]) / total
    sorted_argument = argument[order]
    starts = np.concatenate([[0.0], grown[:-1]])
    ends = np.searchsorted(grown, starts + _MOST, side="left")
    inside = ends < len(grown)
    if not inside.any():
        return float(sorted_argument[0]), float(sorted_argument[-1])
    lengths = sorted_argument[ends[inside]] - sorted_argument[: len(ends)][inside]
    best = int(np.argmin(lengths))
    first = int(np.flatnonzero(inside)[best])
    return float(sorted_argument[first]), float(sorted_argument[ends[first]])


def _harmonics(phase: FloatArray, difference: FloatArray) -> tuple[int, ...]:
    """Multiples of the motion's frequency that hold a tenth of the difference or more.

    The envelope is a slow function: harmonics are compared cycle by cycle.
    """
    total = float(np.sum(difference**2))
    if not total > 0.0:
        return ()
    series, _ = by_cycle(difference, phase, _HARMONICS)
    held = np.sum(series**2, axis=0)
    # A cosine and a sine each; the level has but one.
    powers = [held[0], *(held[1::2] + held[2::2])]
    return tuple(order for order, power in enumerate(powers) if power > _LOUD * total)


def instant_of(fit: Fit, effect: Effect) -> tuple[float, float] | None:
    """The 95 % interval of the instant at which a local effect happens.

    What fades after the release has a time constant and no instant.
    """
    sudden = any(parameter.name == "time" for parameter in effect.parameters)
    return _interval_of(fit, effect, "s") if sudden else None


def tone_of(fit: Fit, effect: Effect) -> float | None:
    """The frequency of a tone, Hz."""
    interval = _interval_of(fit, effect, "Hz") if effect.spectral else None
    return None if interval is None else 0.5 * (interval[0] + interval[1])


def beat_of(fit: Fit, effect: Effect) -> float | None:
    """The period in s of a tone's beats with the motion; None where it is no neighbour.

    A tone of frequency f beats |f - f_0| times a second with a motion of frequency f_0; farther
    off than half of f_0 the eye sees no beat.
    """
    phase, time = fit.at.sampled.phase, fit.at.sampled.time_s
    own = float(phase[-1] - phase[0]) / float(time[-1] - time[0]) / (2.0 * math.pi)
    tone = tone_of(fit, effect)
    if tone is not None:
        off = abs(tone - own)
    elif isinstance(effect, PlaneCoupling):
        detuning = _interval_of(fit, effect, "Hz")
        off = 0.0 if detuning is None else 0.5 * abs(detuning[0] + detuning[1])
    else:
        return None
    return 1.0 / off if 0.0 < off < 0.5 * own else None


def _interval_of(fit: Fit, effect: Effect, unit: str) -> tuple[float, float] | None:
    """The 95 % interval of an effect's parameter of that unit."""
    from pendpipe.diagnose.values import effect_parameters

    # The instant and the frequency stand behind the sizes.
    for found in reversed(effect_parameters(fit, effect).values()):
        if found.unit == unit:
            return found.value - 1.96 * found.sd, found.value + 1.96 * found.sd
    return None


def _summary(found: Location, data: Data, amplitude: FloatArray, facing: str) -> str:
    """One clause; `facing` names two arcs of the cycle where no single one will do."""
    said = []
    span = float(data.time_s[-1] - data.time_s[0])
    if found.time_s is not None:
        width = found.time_s[1] - found.time_s[0]
        if width < 0.02 * span:
            said.append(f"at {0.5 * (found.time_s[0] + found.time_s[1]):.6g} s")
        elif width < 0.8 * span:
            said.append(f"between {found.time_s[0]:.5g} and {found.time_s[1]:.5g} s")
        else:
            said.append("throughout the record")
    if found.amplitude_rad is not None:
        low, high = found.amplitude_rad
        if high - low < 0.8 * float(np.ptp(amplitude)):
            said.append(f"at amplitudes from {low:.3g} to {high:.3g} {data.unit}")
    if found.phase_rad is not None:
        low, high = found.phase_rad
        said.append(f"at phases from {low:.2f} to {high:.2f} rad of the cycle")
    elif facing:
        said.append(facing)
    if found.harmonics:
        names = {0: "the level", 1: "the fundamental"}
        parts = [names.get(h, f"harmonic {h}") for h in found.harmonics]
        said.append("in " + " and ".join(parts))
    elif found.frequency_hz:
        said.append("at " + ", ".join(f"{line:.5g} Hz" for line in found.frequency_hz))
    return ", ".join(said)


_BINS: Final = 24
_HALF: Final = _BINS // 2
_STEP: Final = 2.0 * math.pi / _BINS
_OPPOSITE: Final = 0.75
"""Part that two facing quarters of the cycle must hold to be named: a misfit of the phase
leaves there 1/2 + 1/pi = 0.82, a power that is the same everywhere 0.5."""


def powers_of_cycle(phase: FloatArray, power: FloatArray) -> FloatArray:
    """Add up a power over the cycle, in equal steps of the phase from 0 to 2 pi."""
    number = (np.mod(phase, 2.0 * math.pi) / _STEP).astype(int) % _BINS
    return np.asarray(np.bincount(number, weights=power, minlength=_BINS), dtype=np.float64)


def one_arc(powers: FloatArray, most: float) -> tuple[float, float] | None:
    """The shortest arc that holds the part `most`, where it is clearly shorter than the circle."""
    total = float(powers.sum())
    if not total > 0.0:
        return None
    for width in range(1, _HALF):
        sums = _arc_sums(powers, width)
        start = int(np.argmax(sums))
        if sums[start] > most * total:
            return start * _STEP, (start + width) * _STEP
    return None


def facing_arcs(powers: FloatArray) -> str:
    """Name two facing quarters of the cycle that hold three quarters of it; "" if none do.

    What shifts the phase shows at the crossings, what changes the amplitude at the turning
    points: twice a cycle, so that no single arc says it.
    """
    halves = powers[:_HALF] + powers[_HALF:]
    sums = _arc_sums(halves, _HALF // 2)
    start = int(np.argmax(sums))
    if not sums[start] > _OPPOSITE * float(halves.sum()):
        return ""
    # The middle of the arc to the nearest of eight phases: a bin to either side is no matter.
    centre = (start + _HALF // 4) % _HALF
    if abs(centre - _HALF // 2) <= 1:
        return "mostly at both crossings"
    if min(centre, _HALF - centre) <= 1:
        return "mostly at the turning points of both sides"
    first, last = start * _STEP, (start + _HALF // 2) * _STEP
    return f"mostly at phases from {first:.2f} to {last:.2f} rad of the cycle and half a cycle on"


def _arc_sums(powers: FloatArray, width: int) -> FloatArray:
    """Sum over `width` neighbours from each step on, around the circle."""
    return np.array([np.roll(powers, -start)[:width].sum() for start in range(len(powers))])
