"""Red noise or a slow effect: apparent red noise may be a drift."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.fft import idct
from scipy.stats import binom

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.forensics.colour import note_wander
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.noise_estimate import estimate_noise
from pendpipe.diagnosis.run import diagnose_recording
from pendpipe.recording import Recording

from .records import (
    FREQUENCY_HZ,
    INTERVAL_S,
    NOISE_RAD,
    TIME_S,
    TRUTH,
    null_fit,
    other_engine,
    recording,
    white,
)

CLEAN = other_engine(TRUTH)
SLOW = {"offset-drift", "equilibrium-creep", "ac-coupling", "equilibrium-step"}


def named(readings: FloatArray, seed: int) -> set[str]:
    found = diagnose_recording(recording(readings, seed)).effects
    return {
        name
        for effect in found
        for name in (effect.identifier, *(mate for mate, _ in effect.indistinguishable))
    }


def test_weak_drifts_of_the_offset_in_white_noise_are_distinguished_from_red_noise() -> None:
    """Delta chi^2 = (slope/sigma)^2 sum (t - mean t)^2 = 196; found in most of six."""
    centred = TIME_S - TIME_S.mean()
    slope = 14.0 * NOISE_RAD / np.sqrt(centred @ centred)
    found = [bool(named(CLEAN + slope * centred, seed) & SLOW) for seed in range(6)]
    assert np.mean(found) > 0.5


def test_red_noise_is_not_reported_as_a_drift() -> None:
    """Twice the white density at 0.05 Hz, as 1/f below; three of ten are one in 10,000."""
    frequency = np.arange(len(TIME_S)) / (2.0 * len(TIME_S) * INTERVAL_S)
    spectrum = 1.0 + np.where(frequency < 0.05, 0.05 / np.maximum(frequency, frequency[1]), 0.0)
    reported = 0
    for seed in range(10):
        cosines = np.sqrt(spectrum) * np.random.default_rng(seed).standard_normal(len(TIME_S))
        noise = NOISE_RAD * idct(cosines, norm="ortho")
        found = diagnose_recording(Recording(TIME_S, CLEAN + noise, "angle_rad"))
        reported += any(effect.identifier in SLOW for effect in found.effects)
    assert binom.sf(reported - 1, 10, 0.01) > 1e-3


@pytest.mark.parametrize(
    ("name", "motion"),
    [("offset-drift", lambda t: 4e-5 * (t - 16.0)), ("offset-step", lambda t: 5e-4 * (t > 15.0))],
)
def test_in_few_readings_a_large_slow_error_of_the_zero_is_no_noise(
    name: str, motion: Callable[[FloatArray], FloatArray]
) -> None:
    """Five and more times the noise in 700 readings: a filter of some readings could make it."""
    start = TIME_S[:700]
    readings = CLEAN[:700] + motion(start - start[0])
    assert name in named(readings, 3)


@pytest.mark.parametrize("uneven", [0.0, 0.03])
def test_what_wanders_more_slowly_than_the_motion_is_told_beside_what_is_faster(
    uneven: float,
) -> None:
    """A zero that comes and goes has no name; the sentence does not call all of it noise."""
    time_s = TIME_S + np.where(np.arange(len(TIME_S)) % 2, 0.0, uneven * INTERVAL_S)
    wander = 5e-3 * np.exp(-(((time_s - 30.0) / 8.0) ** 2))
    angle_rad = other_engine(TRUTH, time_s) + wander + white(3)
    found = diagnose_recording(Recording(time_s, angle_rad, "angle_rad"))
    assert not found.effects
    assert found.details.startswith("Eq. 8 describes the motion of this recording, whose zero")
    assert "the zero wanders by 1.4" in found.details


def test_noise_about_the_motion_is_no_wander_of_the_zero() -> None:
    fit, data, _ = null_fit()
    turns = 2.0 * np.pi * FREQUENCY_HZ * TIME_S
    slow = np.random.default_rng(1).standard_normal((2, len(TIME_S))).cumsum(axis=1)
    line = 3e-5 * (slow[0] * np.cos(turns) + slow[1] * np.sin(turns))
    near = replace(data, values=data.values + line)
    noise = estimate_noise(near, near.residual(fit.at.reading), FREQUENCY_HZ, 0.0)
    coloured = replace(noise, variance=np.linspace(2.0, 1.0, len(near)))
    samples = Samples(TIME_S, near.values, "rad", None, NOISE_RAD)
    assert note_wander(Evidence(near, fit, coloured, samples)) is None
