"""Amplitude and phase of each cycle, of readings and of models, and loss and frequency between."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtr

from pendpipe.analysis.demodulation import lock_in
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.effects.model import Evaluated
from pendpipe.quantities import after_number, with_error

_CYCLE_SHARE: Final = 0.85
"""Part of a cycle's readings that must be present."""
_LOSS_ERROR: Final = 0.03
"""Relative error of the loss from which a span is long enough."""
_AMPLITUDE_RATIO: Final = 0.8
"""Ratio of amplitudes from which a span is long enough anyway."""
_MOST_SPANS: Final = 40
"""Spans of a record: a curve through forty points has its errors drawn beside it."""
_FEWEST_SPANS: Final = 8
"""Spans of cycles needed to estimate their scatter."""
_SIGNIFICANT: Final = 0.001
"""Probability by chance (Student's, for the scatter of the other spans) that is significant."""


@dataclass(frozen=True)
class Cycles:
    """One value for each cycle; all of shape (k,).

    Parameters
    ----------
    time_s
        Middle of each cycle.
    amplitude, phase
        Of the readings: amplitude, and phase in rad, rising by 2 pi a cycle.
    sd
        Standard deviation of ln amplitude, and of the phase in rad.
    """

    time_s: FloatArray
    amplitude: FloatArray
    phase: FloatArray
    sd: FloatArray

    def at(self, time_s: FloatArray) -> Cycles:
        """Interpolate at other times: amplitude and frequency change slowly."""
        known = self.time_s
        pace = (self.phase[-1] - self.phase[0]) / (known[-1] - known[0])
        slow = self.phase - pace * known
        return Cycles(
            time_s,
            np.exp(np.interp(time_s, known, np.log(self.amplitude))),
            pace * time_s + np.interp(time_s, known, slow),
            np.interp(time_s, known, self.sd),
        )


@dataclass(frozen=True)
class Spans:
    """Loss and frequency between cycles; all of shape (k,).

    Parameters
    ----------
    amplitude
        Geometric mean of the ends.
    loss, loss_sd
        -d ln y/dt, in 1/s.
    frequency_hz, frequency_sd_hz
        Turns over time.
    """

    amplitude: FloatArray
    loss: FloatArray
    loss_sd: FloatArray
    frequency_hz: FloatArray
    frequency_sd_hz: FloatArray


def cycles(reading: FloatArray, data: Data, clock: Evaluated, noise_rms: float) -> Cycles:
    """Lock in to readings, cycle by cycle, on a model's phase clock.

    Times are those of the recording, whose clock may drift.

    Parameters
    ----------
    reading
        Of the recording, or a model's, shape (n,).
    data
        The readings' times, and whether each counts.
    clock
        The model whose phase numbers the cycles.
    noise_rms
        Standard deviation of one reading; 0 for a model's.
    """
    sampled = clock.sampled
    found = lock_in(reading, data.weight, sampled, _CYCLE_SHARE)
    # The middle of a cycle is a turning point of the model, which a kick may have moved.
    turned = math.pi * (2.0 * found.number + 1.0)
    inside = (sampled.phase[0] <= turned) & (turned <= sampled.phase[-1])
    turned = turned[inside]
    size = np.maximum(np.hypot(found.cosine, found.sine)[inside], 1e-12)
    amplitude = np.interp(turned, sampled.phase, sampled.amplitude) * size
    sd = noise_rms * np.sqrt(2.0 / found.readings[inside]) / amplitude
    stamped_s = np.interp(turned, sampled.phase, data.time_s)
    return Cycles(stamped_s, amplitude, turned + found.phase[inside], sd)


def span_ends(found: Cycles) -> list[int]:
    """Choose cycles between which loss and frequency are precise enough."""
    least = max(1, math.ceil((len(found.time_s) - 1) / _MOST_SPANS))
    ends, log = [0], np.log(found.amplitude)
    for last in range(1, len(found.time_s)):
        first = ends[-1]
        if last - first < least or found.sd[last] > 0.3:
            continue
        drop = abs(log[first] - log[last])
        certain = math.hypot(found.sd[first], found.sd[last]) < _LOSS_ERROR * drop
        if certain or drop > -math.log(_AMPLITUDE_RATIO):
            ends.append(last)
    return ends


def between(found: Cycles, ends: list[int]) -> Spans:
    """Return loss and frequency between given cycles."""
    first, last = np.array(ends[:-1], dtype=np.intp), np.array(ends[1:], dtype=np.intp)
    lasts = found.time_s[last] - found.time_s[first]
    log = np.log(found.amplitude)
    spread = np.hypot(found.sd[first], found.sd[last]) / lasts
    turns = (found.phase[last] - found.phase[first]) / (2.0 * math.pi)
    return Spans(
        np.exp(0.5 * (log[first] + log[last])),
        (log[first] - log[last]) / lasts,
        spread,
        turns / lasts,
        spread / (2.0 * math.pi),
    )


@dataclass(frozen=True)
class SmallSwings:
    """Frequency of the readings over the model's, less 1, in the last span of cycles.

    Sticking contacts and the elastic deflection of a bearing show only there, in a few cycles that
    have little weight in chi^2. So these cycles are tested by themselves.

    Parameters
    ----------
    amplitude_rad
        In the middle of that span, rad (or m).
    frequency_excess, frequency_excess_sd
        (f - f_model)/f_model, and its error from the readings and the scatter of the others.
    others
        The number of other spans.
    """

    amplitude_rad: float
    frequency_excess: float
    frequency_excess_sd: float
    others: int

    @property
    def significant(self) -> bool:
        """Whether it exceeds the scatter."""
        by_chance = 2.0 * stdtr(self.others, -abs(self.frequency_excess) / self.frequency_excess_sd)
        return bool(by_chance < _SIGNIFICANT)

    def sentence(self, unit: str) -> str:
        """Return it as a sentence."""
        excess, sd = self.frequency_excess, self.frequency_excess_sd
        way, torque = ("above", "stiffer") if excess > 0.0 else ("below", "softer")
        return (
            f"At the smallest amplitudes ({self.amplitude_rad:.3g}{after_number(unit)}) the"
            f" frequency is {with_error(100.0 * abs(excess), 100.0 * sd, '%')} {way} the"
            f" model's: the restoring torque is {torque} there."
        )


def small_swings(fit: Fit, data: Data, noise: Noise) -> SmallSwings | None:
    """Compare the last span of cycles with a model; None where there are too few."""
    measured = cycles(data.values, data, fit.at, noise.white_rms)
    if len(measured.time_s) < _FEWEST_SPANS:
        return None
    ends = span_ends(measured)
    if len(ends) <= _FEWEST_SPANS:
        return None
    own = cycles(fit.at.reading, data, fit.at, 0.0).at(measured.time_s)
    one, other = between(measured, ends), between(own, ends)
    off: FloatArray = one.frequency_hz / other.frequency_hz - 1.0
    scatter = float(np.sqrt(np.mean(off[:-1] ** 2)))
    sd = float(np.hypot(one.frequency_sd_hz[-1] / other.frequency_hz[-1], scatter))
    return SmallSwings(float(one.amplitude[-1]), float(off[-1]), sd, len(off) - 1)
