"""The measurement chain: from the motion to the converter's codes, faults included."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe_challenge.motion import Track
from pendpipe_challenge.torques import compiled


def with_turns(
    time: FloatArray, angle: FloatArray, rate: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Put the turning angles between the samples, by the cubic through angles and rates.

    A coupling has turned round where the pendulum did, not where it was sampled last.

    Returns
    -------
    angle
        Shape (n + turns,).
    sampled
        Which of them are the samples, same shape.
    """
    step, fall = np.diff(time), angle[:-1] - angle[1:]
    before, after = step * rate[:-1], step * rate[1:]
    # The cubic's slope: square s^2 + linear s + before, for s from 0 to 1.
    square, linear = 6.0 * fall + 3.0 * (before + after), -6.0 * fall - 4.0 * before - 2.0 * after
    turns = np.flatnonzero(before * after < 0.0)
    square, linear, before, after = square[turns], linear[turns], before[turns], after[turns]
    root = np.sqrt(np.maximum(linear**2 - 4.0 * square * before, 0.0))
    # Of the two roots, the one at which the slope crosses from the first rate to the second.
    s = np.clip(2.0 * before / (-linear + np.sign(before) * root), 0.0, 1.0)
    turned = angle[turns] + s * (before + s * (0.5 * linear + s * square / 3.0))
    sampled = np.ones(len(angle) + len(turns), dtype=np.bool_)
    sampled[turns + 1 + np.arange(len(turns))] = False
    return np.insert(angle, turns + 1, turned), sampled


@compiled
def play(angle: FloatArray, width: float) -> FloatArray:
    """Backlash of a coupling: the reading follows when the play of full `width` is used up."""
    out = np.empty(len(angle))
    held = angle[0] - 0.5 * width
    for i in range(len(angle)):
        held = min(max(held, angle[i] - 0.5 * width), angle[i] + 0.5 * width)
        out[i] = held
    return out


@compiled
def bristle_coupling(angle: FloatArray, width: float) -> FloatArray:
    """Dahl's coupling: an elastic slip of full `width` instead of a sudden one.

    z' = x' - |x'| z/(width/2), reading x - z; exact for straight motion between samples.
    """
    out = np.empty(len(angle))
    reach = 0.5 * width
    slip = 0.0
    out[0] = angle[0]
    for i in range(1, len(angle)):
        moved = angle[i] - angle[i - 1]
        way = 1.0 if moved > 0.0 else -1.0
        goal = way * reach
        slip = goal + (slip - goal) * math.exp(-abs(moved) / reach)
        out[i] = angle[i] - slip
    return out


@compiled
def high_pass(time: FloatArray, volts: FloatArray, tau: float) -> FloatArray:
    """First-order AC coupling, y' + y/tau = x', cubic between samples.

    The capacitor is discharged at the first sample.
    """
    out = np.empty(len(volts))
    n = len(volts)
    held = 0.0
    out[0] = volts[0]
    for i in range(1, n):
        h = time[i] - time[i - 1]
        before = max(i - 2, 0)
        after = min(i + 1, n - 1)
        slope0 = (volts[i] - volts[before]) / (time[i] - time[before])
        slope1 = (volts[after] - volts[i - 1]) / (time[after] - time[i - 1])
        # Three-point Gauss integral of x exp(-(h - s)/tau)/tau over the interval.
        total = 0.0
        for j in range(3):
            node = 0.5 + (j - 1) * 0.3872983346207417
            weight = 0.4444444444444444 if j == 1 else 0.2777777777777778
            a, b = 1.0 - node, node
            value = volts[i - 1] * a * a * (1 + 2 * b) + volts[i] * b * b * (3 - 2 * b)
            value += h * (slope0 * b * a * a - slope1 * a * b * b)
            total += weight * value * math.exp(-h * a / tau)
        held = held * math.exp(-h / tau) + total * h / tau
        out[i] = volts[i] - held
    return out


@dataclass(frozen=True)
class Chain:
    """What stands between the angle and the file. Zeros switch a fault off.

    Angles in rad, volts as they leave the amplifier, times in s.
    """

    volts_per_radian: float = 3.85
    nominal_volts_per_radian: float = 3.85
    offset_volts: float = 0.0
    bits: int = 16
    range_volts: float = 5.0
    second_share: float = 0.0
    # The sensor's curve.
    square: float = 0.0  # 1/rad
    cubic: float = 0.0  # 1/rad^2
    plates: float = 0.0  # capacitor: gap over angle, y/(1 - (plates y)^2) and its stray part
    lean: float = 0.0  # plates that are not centred
    logistic: float = 0.0  # a curve that saturates, 1/rad^2 at first
    play_rad: float = 0.0
    elastic_play_rad: float = 0.0
    # Delay that depends on the swing; ripple of the gain.
    delay_s_rad2: float = 0.0
    ripple: float = 0.0
    ripple_count: float = 8.0
    # In time.
    drift_volts_s: float = 0.0
    warm_up_volts: float = 0.0
    warm_up_s: float = 60.0
    walk_volts: tuple[float, ...] = ()
    gain_drift: float = 0.0  # 1/s
    gain_drift_s: float = 0.0  # s; 0: straight
    ac_time_s: float = 0.0
    tone_volts: float = 0.0
    tone_hz: float = 0.0
    tone_phase: float = 0.0
    tone_second: float = 0.0  # share of its second harmonic
    # The clock.
    clock_drift: float = 0.0  # relative rate change, 1/s
    clock_drift_s: float = 0.0
    jitter_s: float = 0.0
    dropped: tuple[tuple[int, int], ...] = ()  # (sample, how many); negative: repeated
    # The converter.
    clip_high_volts: float = 0.0
    clip_low_volts: float = 0.0
    soft_clip: float = 0.0  # width over which it saturates, V
    glitches: tuple[tuple[int, float], ...] = ()
    dead_bits: int = 0
    missing_codes: tuple[int, ...] = ()

    def changed(self, **values: Any) -> Chain:
        """The same chain with other values."""
        return replace(self, **values)

    @property
    def step_volts(self) -> float:
        """One code."""
        return 2.0 * self.range_volts / 2.0**self.bits

    @property
    def step_rad(self) -> float:
        """One code in nominal angle."""
        return self.step_volts / self.nominal_volts_per_radian

    def grid(self, samples: int, interval_s: float) -> FloatArray:
        """When the samples are really taken that the file counts evenly."""
        count = samples + sum(max(0, lost) for _, lost in self.dropped)
        time: FloatArray = interval_s * np.arange(count, dtype=np.float64)
        if self.clock_drift == 0.0:
            return time
        if self.clock_drift_s <= 0.0:
            return np.asarray(time + 0.5 * self.clock_drift * time**2)
        tau = self.clock_drift_s
        return np.asarray(time + self.clock_drift * tau * (time + tau * np.expm1(-time / tau)))

    def counted(self, series: FloatArray, samples: int) -> FloatArray:
        """Lose and repeat samples, as the logger does without noticing."""
        keep = np.arange(len(series))
        for at, lost in sorted(self.dropped, reverse=True):
            if lost > 0:
                keep = np.delete(keep, np.arange(at, at + lost))
            else:
                keep = np.insert(keep, at, np.full(-lost, keep[at]))
        return np.asarray(series[keep[:samples]])

    def volts(
        self, track: Track, samples: int, random: np.random.Generator | None = None
    ) -> FloatArray:
        """Volts before noise, evenly counted; `random` is needed for jitter alone.

        Parameters
        ----------
        track
            The motion at ``grid(samples, interval)``.
        """
        time, angle, rate = track.time_s, track.angle_rad, track.rate_rad_s
        if self.delay_s_rad2 != 0.0:
            angle = angle - self.delay_s_rad2 * _swing(track) ** 2 * rate
        if self.jitter_s > 0.0 and random is not None:
            early = self.jitter_s * random.standard_normal(len(time))
            bend = np.gradient(rate, time)
            angle = angle + rate * early + 0.5 * bend * early**2
        reading = self._sensed(self._coupled(track, angle + self.second_share * track.second_rad))
        volts = self._gain(time, track) * self.volts_per_radian * reading + self.offset_volts
        volts = volts + self._drift(time)
        if self.tone_volts != 0.0:
            phase = 2.0 * np.pi * self.tone_hz * time + self.tone_phase
            volts = volts + self.tone_volts * (
                np.cos(phase) + self.tone_second * np.cos(2.0 * phase)
            )
        if self.ac_time_s > 0.0:
            volts = high_pass(time, volts, self.ac_time_s)
        volts = self.counted(volts, samples)
        for at, size in self.glitches:
            volts[at] += size
        return self._limited(volts)

    def codes(self, volts: FloatArray) -> IntArray:
        """Rounding, limits of the range, and codes that never come."""
        if not np.all(np.isfinite(volts)):
            raise ValueError("the motion has no reading at some time (a drive after the stop)")
        if self.clip_high_volts > 0.0 and self.soft_clip == 0.0:
            volts = np.minimum(volts, self.clip_high_volts)
        if self.clip_low_volts < 0.0 and self.soft_clip == 0.0:
            volts = np.maximum(volts, self.clip_low_volts)
        half = 2 ** (self.bits - 1)
        code = np.clip(np.rint(volts / self.step_volts), -half, half - 1).astype(np.int64)
        if self.dead_bits:
            coarse = 2**self.dead_bits
            code = coarse * np.rint(volts / (self.step_volts * coarse)).astype(np.int64)
        if self.missing_codes:
            code = np.where(np.isin(code, self.missing_codes), code + 1, code)
        return np.asarray(code)

    def _coupled(self, track: Track, angle: FloatArray) -> FloatArray:
        if self.play_rad <= 0.0 and self.elastic_play_rad <= 0.0:
            return angle
        angle, sampled = with_turns(track.time_s, angle, track.rate_rad_s)
        if self.play_rad > 0.0:
            angle = play(angle, self.play_rad)
        if self.elastic_play_rad > 0.0:
            angle = bristle_coupling(angle, self.elastic_play_rad)
        return np.asarray(angle[sampled])

    def _sensed(self, angle: FloatArray) -> FloatArray:
        curved = angle + self.square * angle**2 + self.cubic * angle**3
        if self.plates != 0.0 or self.lean != 0.0:
            # Differential capacitor with gaps d(1 + l) -+ angle: (C1 - C2)/(C1 + C2 + stray).
            share, lean = self.plates * angle, self.lean
            curved = (share + lean) / (1.0 - (share + lean) ** 2) - lean / (1.0 - lean**2)
            curved = curved / (self.plates * (1.0 + lean**2) / (1.0 - lean**2) ** 2)
        if self.logistic != 0.0:
            width = 1.0 / np.sqrt(3.0 * self.logistic)
            curved = width * np.tanh(curved / width)
        return np.asarray(curved)

    def _gain(self, time: FloatArray, track: Track) -> FloatArray:
        gain = np.ones(len(time))
        if self.gain_drift != 0.0:
            tau = self.gain_drift_s
            gain = gain + self.gain_drift * (time if tau <= 0 else -tau * np.expm1(-time / tau))
        if self.ripple != 0.0:
            gain = gain + self.ripple * np.cos(self.ripple_count * np.log(_swing(track)))
        return gain

    def _drift(self, time: FloatArray) -> FloatArray:
        volts = self.drift_volts_s * time
        if self.warm_up_volts != 0.0:
            volts = volts - self.warm_up_volts * np.expm1(-time / self.warm_up_s)
        if self.walk_volts:
            knots = np.linspace(0.0, time[-1], len(self.walk_volts))
            volts = volts + np.interp(time, knots, self.walk_volts)
        return np.asarray(volts)

    def _limited(self, volts: FloatArray) -> FloatArray:
        """Limits of the amplifier; noise that comes later is limited again in `codes`."""
        high, low, soft = self.clip_high_volts, self.clip_low_volts, self.soft_clip
        if soft > 0.0:
            if high > 0.0:
                volts = high - soft * np.logaddexp(0.0, (high - volts) / soft)
            return volts
        if high > 0.0:
            volts = np.minimum(volts, high)
        if low < 0.0:
            volts = np.maximum(volts, low)
        return volts


def _swing(track: Track) -> FloatArray:
    """Instantaneous amplitude over the motion, rad: smooth enough for slow laws."""
    omega = np.sqrt(np.sum(track.rate_rad_s**2) / np.sum(track.angle_rad**2))
    return np.asarray(np.sqrt(track.angle_rad**2 + (track.rate_rad_s / omega) ** 2) + 1e-9)
