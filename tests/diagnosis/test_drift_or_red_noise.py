"""Red noise or a slow effect: apparent red noise may be a drift."""

from __future__ import annotations

import numpy as np
from scipy.fft import idct
from scipy.stats import binom

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis import diagnose_recording
from pendpipe.recording import Recording

from .records import INTERVAL_S, NOISE_RAD, TIME_S, TRUTH, other_engine, recording

CLEAN = other_engine(TRUTH)
SLOW = {"offset-drift", "equilibrium-creep", "ac-coupling", "equilibrium-step"}


def named(readings: FloatArray, seed: int) -> set[str]:
    found = diagnose_recording(recording(readings, seed)).diagnosis.effects
    return {
        name
        for effect in found
        for name in (effect.identifier, *(mate for mate, _ in effect.indistinguishable))
    }


def test_weak_drifts_of_the_offset_in_white_noise_are_distinguished_from_red_noise() -> None:
    """Delta chi^2 = (slope/sigma)^2 sum (t - mean t)^2 = 196; found in most of twelve."""
    centred = TIME_S - TIME_S.mean()
    slope = 14.0 * NOISE_RAD / np.sqrt(centred @ centred)
    found = [bool(named(CLEAN + slope * centred, seed) & SLOW) for seed in range(12)]
    assert np.mean(found) > 0.5


def test_red_noise_is_not_reported_as_a_drift() -> None:
    """Twice the white density at 0.05 Hz, as 1/f below; four of 24 would be one in ten thousand."""
    frequency = np.arange(len(TIME_S)) / (2.0 * len(TIME_S) * INTERVAL_S)
    spectrum = 1.0 + np.where(frequency < 0.05, 0.05 / np.maximum(frequency, frequency[1]), 0.0)
    reported = 0
    for seed in range(24):
        cosines = np.sqrt(spectrum) * np.random.default_rng(seed).standard_normal(len(TIME_S))
        noise = NOISE_RAD * idct(cosines, norm="ortho")
        found = diagnose_recording(Recording(TIME_S, CLEAN + noise, "angle_rad")).diagnosis
        reported += any(effect.identifier in SLOW for effect in found.effects)
    assert binom.sf(reported - 1, 24, 0.01) > 1e-3
