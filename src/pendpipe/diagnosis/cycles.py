"""Amplitude and phase of each cycle, of readings and of models, and loss and frequency between."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.lock_in import lock_in
from pendpipe.effects.model import Evaluated

_CYCLE_SHARE: Final = 0.85
"""Part of a cycle's readings that must be present."""
_LOSS_ERROR: Final = 0.03
"""Relative error of the loss from which a span is long enough."""
_AMPLITUDE_RATIO: Final = 0.8
"""Ratio of amplitudes from which a span is long enough anyway."""
_MOST_SPANS: Final = 40


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


def cycles(reading: FloatArray, weight: FloatArray, clock: Evaluated, noise_rms: float) -> Cycles:
    """Lock in to readings, cycle by cycle, on a model's phase clock.

    Parameters
    ----------
    reading, weight
        Readings (or a model's readings) and whether each counts, shape (n,).
    clock
        The model whose phase numbers the cycles.
    noise_rms
        Standard deviation of one reading; 0 for a model's.
    """
    motion = clock.sampled.motion
    found = lock_in(reading, weight, clock.sampled, _CYCLE_SHARE)
    # The middle of a cycle is a turning point of the model.
    turning = 2 * found.number + 1
    inside = (turning >= 0) & (turning < len(motion.time_s))
    turning = turning[inside]
    size = np.maximum(np.hypot(found.cosine, found.sine)[inside], 1e-12)
    amplitude = motion.amplitude[turning, 0] * size
    sd = noise_rms * np.sqrt(2.0 / found.readings[inside]) / amplitude
    phase = math.pi * turning + found.phase[inside]
    return Cycles(motion.time_s[turning, 0], amplitude, phase, sd)


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
