"""Where an effect shows: time, amplitude, phase of the cycle, frequency, harmonic."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.demodulation import by_cycle
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.found import Location
from pendpipe.diagnosis.refine import LARGE_PHASE_ERROR, Fit
from pendpipe.diagnosis.values import last_in
from pendpipe.effects import Effect
from pendpipe.effects.catalogue.in_time import PlaneCoupling
from pendpipe.effects.catalogue.reading import hum_near_the_motion, mains_lines
from pendpipe.estimate import Estimate
from pendpipe.quantities import after_number, listed, with_error

_INTERVAL_SHARE: Final = 0.9
"""Part of what an effect explains that its intervals hold."""
_HARMONICS: Final = 6
"""Of the motion that are told apart: what lies higher is told as sharp in phase."""
_HARMONIC_SHARE: Final = 0.1
"""Part of what an effect explains from which a harmonic is named."""


def locate(before: Fit, after: Fit, data: Data, effect: Effect) -> Location:
    """Find where the readings favour the model with an effect over the one without.

    The expected contribution of a reading to Delta chi^2 is the squared difference of the two
    fitted models over the noise; the intervals hold nine tenths of the sum.

    Parameters
    ----------
    before, after
        Fits without and with the effect.
    data
        The readings.
    effect
        The effect.
    """
    difference = between_models(before, after) * data.weight
    power = difference**2
    sampled = after.at.sampled
    time = instant_of(after, effect) or _interval(data.time_s, power)
    amplitude = _interval(sampled.amplitude, power)
    turned = math.pi if sampled.motion.upwards < 0.0 else 0.0
    of_cycle = powers_of_cycle(sampled.phase + turned, power)
    phase = one_arc(of_cycle, _INTERVAL_SHARE)
    harmonics = _harmonics(sampled.phase, difference)
    frequency = sampled.motion.angular_frequency / (2.0 * math.pi)
    lines: tuple[float, ...] = tuple(round(h * frequency, 9) for h in harmonics if h > 0)
    tone = _line(after, effect)
    if tone is not None and effect.spectral:  # near the motion the fit without it has a part
        lines, harmonics = (tone.value,), ()
    mains = mains_of(tone, data) if tone is not None else ""
    found = Location(time, amplitude, phase, lines, harmonics, mains=mains)
    summary = _summary(found, data, sampled.amplitude, opposite_arcs(of_cycle))
    beat = beat_of(after, effect)
    if beat is not None:
        summary += f", beating with the motion every {beat:.3g} s"
    return replace(found, summary=summary)


def _line(fit: Fit, effect: Effect) -> Estimate | None:
    """Return the frequency of what is a tone, by its scan or near the motion; None for others."""
    tone = effect.spectral or effect is hum_near_the_motion
    return last_in(fit, effect, "Hz") if tone else None


def mains_of(line: Estimate, data: Data) -> str:
    """Return which harmonic of 50 or 60 Hz is seen at a line's frequency; "" for none.

    >>> even = Data(np.arange(900) / 46.61, np.zeros(900), 1 / 46.61, True, np.ones(900))
    >>> mains_of(Estimate(3.3854, 4e-5, "Hz"), even)
    '50 Hz folded at 46.61 readings a second'
    """
    if not data.uniform:
        return ""
    rate = (len(data) - 1) / float(data.time_s[-1] - data.time_s[0])
    for mains, seen, within in mains_lines(rate, line.sd):
        if abs(seen - line.value) < within:
            recorded = rate * data.fold * data.every  # the means of some are analysed
            folded = f" folded at {recorded:.4g} readings a second"
            return f"{mains:g} Hz{folded if mains > 0.5 * recorded else ' of the mains'}"
    return ""


def between_models(before: Fit, after: Fit) -> FloatArray:
    """Difference of the two models' readings, linearised along the motion where phases differ.

    Far out of phase the difference of readings is as large as the motion and no longer shows where
    the models diverge. Then it is linearised in ln amplitude and phase,
    x (change of ln A) + (dx/d phase) (change of phase), as in the fit.
    """
    one, other = before.at.sampled, after.at.sampled
    turn = other.phase - one.phase
    # Whole turns may be counted differently, and each model has its own phase at release.
    turn = turn - np.average(turn, weights=other.amplitude**2)
    if np.max(np.abs(turn)) < LARGE_PHASE_ERROR:
        return after.at.reading - before.at.reading
    log_ratio = np.log(np.maximum(other.amplitude, 1e-300) / np.maximum(one.amplitude, 1e-300))
    moved = other.angle * log_ratio + other.velocity / other.motion.angular_frequency * turn
    # What the sensor adds to the motion: offset, nonlinearity, a tone.
    sensor = (after.at.reading - other.angle) - (before.at.reading - one.angle)
    return np.asarray(moved + sensor)


def _interval(argument: FloatArray, power: FloatArray) -> tuple[float, float] | None:
    """Return the shortest interval of an argument that holds nine tenths of the power."""
    total = float(power.sum())
    if not total > 0.0:
        return None
    order = np.argsort(argument, kind="stable")
    cumulative, rising = np.cumsum(power[order]) / total, argument[order]
    starts = np.concatenate([[0.0], cumulative[:-1]])
    ends = np.searchsorted(cumulative, starts + _INTERVAL_SHARE, side="left")
    firsts = np.flatnonzero(ends < len(cumulative))
    first = firsts[np.argmin(rising[ends[firsts]] - rising[firsts])]
    return float(rising[first]), float(rising[ends[first]])


def _harmonics(phase: FloatArray, difference: FloatArray) -> tuple[int, ...]:
    """Return the multiples of the motion's frequency that hold a tenth of the difference or more.

    Harmonics are fitted cycle by cycle, since the envelope varies slowly.
    """
    total = float(np.sum(difference**2))
    series, _ = by_cycle(difference, phase, _HARMONICS)
    held = np.sum(series**2, axis=0)
    # A cosine and a sine for each harmonic; the offset has one coefficient.
    powers = [held[0], *(held[1::2] + held[2::2])]
    return tuple(order for order, power in enumerate(powers) if power > _HARMONIC_SHARE * total)


def instant_of(fit: Fit, effect: Effect) -> tuple[float, float] | None:
    """Return the 95 % interval of the instant at which a sudden effect happens; else None."""
    sudden = any(parameter.name == "time" for parameter in effect.parameters)
    found = last_in(fit, effect, "s") if sudden else None
    return None if found is None else (found.value - 1.96 * found.sd, found.value + 1.96 * found.sd)


def beat_of(fit: Fit, effect: Effect) -> float | None:
    """Return the period in s of a tone's beats with the motion; None for a distant frequency.

    A tone of frequency f beats |f - f_0| times a second with a motion of frequency f_0; beyond
    half of f_0 no beats are seen.
    """
    phase, time = fit.at.sampled.phase, fit.at.sampled.time_s
    own = float(phase[-1] - phase[0]) / float(time[-1] - time[0]) / (2.0 * math.pi)
    beside = isinstance(effect, PlaneCoupling)
    found = last_in(fit, effect, "Hz") if beside else _line(fit, effect)
    if found is None:
        return None
    off = abs(found.value if beside else found.value - own)
    return 1.0 / off if 0.0 < off < 0.5 * own else None


def _summary(found: Location, data: Data, amplitude: FloatArray, opposite: str) -> str:
    """Write one clause; `opposite` names two opposite arcs of the cycle if none holds alone."""
    clauses = []
    span = float(data.time_s[-1] - data.time_s[0])
    if found.time_s is not None:
        width = found.time_s[1] - found.time_s[0]
        if width < 0.02 * span:
            clauses.append(f"at {with_error(0.5 * sum(found.time_s), 0.5 * width / 1.96, 's')}")
        elif width < 0.8 * span:
            # A thousandth of the record is as near as a reader is told it.
            ends = (round(t, 3 - math.floor(math.log10(span))) + 0.0 for t in found.time_s)
            clauses.append("between {:g} and {:g} s".format(*ends))
        else:
            clauses.append("throughout the record")
    low, high = found.amplitude_rad or (-math.inf, math.inf)
    if high - low < 0.8 * float(np.ptp(amplitude)):
        clauses.append(f"at amplitudes from {low:.3g} to {high:.3g}{after_number(data.unit)}")
    if found.phase_rad is not None:
        low, high = found.phase_rad
        clauses.append(f"at phases from {low:.2f} to {high:.2f} rad of the cycle")
    elif opposite:
        clauses.append(opposite)
    if found.harmonics:
        names = {0: "the offset", 1: "the fundamental"}
        parts = [names.get(h, f"harmonic {h}") for h in found.harmonics]
        clauses.append(f"in {listed(parts)}")
    elif found.frequency_hz:
        clauses.append("at " + ", ".join(f"{line:.5g} Hz" for line in found.frequency_hz))
    if found.mains:
        clauses.append(found.mains)
    return ", ".join(clauses)


_CYCLE_BINS: Final = 24
"""Of the phase: 15 degrees, as exactly as a reader is told it."""
_HALF_CYCLE_BINS: Final = _CYCLE_BINS // 2
"""What shows twice a cycle is folded into them."""
_BIN_RAD: Final = 2.0 * math.pi / _CYCLE_BINS
"""Width of one."""
_OPPOSITE_SHARE: Final = 0.75
"""Part that two opposite quarters of the cycle must hold to be named: a misfit of the phase
has 1/2 + 1/pi = 0.82 there, a uniform one 0.5."""


def powers_of_cycle(phase: FloatArray, power: FloatArray) -> FloatArray:
    """Sum a power over the cycle, in equal steps of the phase from 0 to 2 pi."""
    number = (np.mod(phase, 2.0 * math.pi) / _BIN_RAD).astype(int) % _CYCLE_BINS
    return np.asarray(np.bincount(number, weights=power, minlength=_CYCLE_BINS), dtype=np.float64)


def one_arc(powers: FloatArray, most: float) -> tuple[float, float] | None:
    """Return the shortest arc that holds the part `most`, if it is less than half the circle."""
    total = float(powers.sum())
    for width in range(1, _HALF_CYCLE_BINS):
        sums = _arc_sums(powers, width)
        start = int(np.argmax(sums))
        if sums[start] > most * total:
            return start * _BIN_RAD, (start + width) * _BIN_RAD
    return None


def opposite_arcs(powers: FloatArray) -> str:
    """Name two opposite quarters of the cycle that hold three quarters of it; "" if none do.

    A change of phase shows at the zero crossings, a change of amplitude at the turning points:
    twice in each cycle, so that no single arc describes it.
    """
    halves = powers[:_HALF_CYCLE_BINS] + powers[_HALF_CYCLE_BINS:]
    sums = _arc_sums(halves, _HALF_CYCLE_BINS // 2)
    start = int(np.argmax(sums))
    if not sums[start] > _OPPOSITE_SHARE * float(halves.sum()):
        return ""
    # The middle of the arc, to the nearest of eight phases.
    centre = (start + _HALF_CYCLE_BINS // 4) % _HALF_CYCLE_BINS
    if abs(centre - _HALF_CYCLE_BINS // 2) <= 1:
        return "mostly at the zero crossings"
    if min(centre, _HALF_CYCLE_BINS - centre) <= 1:
        return "mostly at the turning points"
    first, last = start * _BIN_RAD, (start + _HALF_CYCLE_BINS // 2) * _BIN_RAD
    return f"mostly at phases from {first:.2f} to {last:.2f} rad of the cycle and half a cycle on"


def _arc_sums(powers: FloatArray, width: int) -> FloatArray:
    """Sum `width` neighbours from each step on, around the circle."""
    return np.array([np.roll(powers, -start)[:width].sum() for start in range(len(powers))])
