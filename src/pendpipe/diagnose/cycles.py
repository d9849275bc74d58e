"""Amplitude and phase of each cycle, of readings and of models alike, for the figures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.model import Evaluated

_FEWEST: Final = 5
_WHOLE: Final = 0.85
"""Part of a cycle's readings that must be there."""
_CERTAIN: Final = 0.03
"""Relative error of a loss at which a span is long enough."""
_FALL: Final = 0.8
"""Part to which the amplitude may fall within a span."""
_SPANS: Final = 40


@dataclass(frozen=True)
class Cycles:
    """One number a cycle; all of shape (k,).

    Parameters
    ----------
    time_s
        The middle of each.
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
        """Return the same at other times: amplitude and frequency change slowly."""
        known = self.time_s
        pace = (self.phase[-1] - self.phase[0]) / (known[-1] - known[0])
        slow = self.phase - pace * known
        return Cycles(
            time_s, np.exp(np.interp(time_s, known, np.log(self.amplitude))),
            pace * time_s + np.interp(time_s, known, slow), np.interp(time_s, known, self.sd),
        )  # fmt: skip


@dataclass(frozen=True)
class Spans:
    """Loss and frequency between cycles; all of shape (k,).

    Parameters
    ----------
    amplitude
        In the middle (geometric mean).
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

    In each cycle ``level + r (p cos psi + q sin psi)`` is fitted, r and psi the model's
    amplitude and phase. On that clock ``x = r cos psi`` is exact, so that a restoring
    torque that is not linear makes no harmonics here.

    Parameters
    ----------
    reading, weight
        Readings (or a model's readings) and whether each counts, shape (n,).
    clock
        The model whose phase tells the cycles apart.
    noise_rms
        Standard deviation of one reading; 0 for a model's.
    """
    sampled = clock.sampled
    motion = sampled.motion
    number = np.floor(sampled.phase / (2.0 * math.pi)).astype(np.int64)
    origin = int(number.min())
    number -= origin
    carrier = motion.upwards * sampled.amplitude
    parts = [np.ones_like(reading), carrier * sampled.cosine, carrier * sampled.sine]
    count = int(number.max()) + 1

    def total(values: FloatArray) -> FloatArray:
        return np.bincount(number, weights=weight * values, minlength=count).astype(np.float64)

    size = total(parts[0])
    # The middle of a cycle is a turning point of the model, where all about it is known.
    middle = 2 * (np.arange(count) + origin) + 1
    whole = size >= max(_FEWEST, _WHOLE * float(np.median(size[size > 0.0])))
    good = whole & (middle >= 0) & (middle < len(motion.time_s))
    normal = np.array([[total(one * other) for one in parts] for other in parts])[..., good]
    right = np.array([total(one * reading) for one in parts])[..., good]
    solved = np.linalg.solve(normal.transpose(2, 0, 1), right.T[..., None])[..., 0]
    _, p, q = solved.T
    turning = middle[good]
    amplitude = motion.amplitude[turning, 0] * np.maximum(np.hypot(p, q), 1e-12)
    sd = noise_rms * np.sqrt(2.0 / size[good]) / amplitude
    phase = math.pi * turning + np.unwrap(np.arctan2(-q, p))
    return Cycles(motion.time_s[turning, 0], amplitude, phase, sd)


def span_ends(found: Cycles) -> list[int]:
    """Choose cycles between which loss and frequency are read, by their certainty."""
    least = max(1, math.ceil((len(found.time_s) - 1) / _SPANS))
    ends, log = [0], np.log(found.amplitude)
    for last in range(1, len(found.time_s)):
        first = ends[-1]
        if last - first < least or found.sd[last] > 0.3:
            continue
        drop = abs(log[first] - log[last])
        certain = math.hypot(found.sd[first], found.sd[last]) < _CERTAIN * drop
        if certain or drop > -math.log(_FALL):
            ends.append(last)
    return ends


def between(found: Cycles, ends: list[int]) -> Spans:
    """Read loss and frequency between given cycles."""
    first, last = np.array(ends[:-1], dtype=np.intp), np.array(ends[1:], dtype=np.intp)
    lasts = found.time_s[last] - found.time_s[first]
    log = np.log(found.amplitude)
    spread = np.hypot(found.sd[first], found.sd[last]) / lasts
    turns = (found.phase[last] - found.phase[first]) / (2.0 * math.pi)
    return Spans(
        np.exp(0.5 * (log[first] + log[last])), (log[first] - log[last]) / lasts, spread,
        turns / lasts, spread / (2.0 * math.pi),
    )  # fmt: skip
