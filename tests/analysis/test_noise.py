"""Noise and step of a recording, from what no slow motion can touch."""

import math

import numpy as np
import pytest

from pendpipe.analysis.noise import noise_rms, quantisation_rms, white_rms

SWING = np.cos(np.arange(20000) * 0.06)


def test_white_noise_is_measured_through_a_motion() -> None:
    noise = 3e-4 * np.random.default_rng(1).standard_normal(20000)
    assert white_rms(SWING + noise) == pytest.approx(3e-4, rel=0.03)
    assert noise_rms(SWING + noise) == pytest.approx(3e-4, rel=0.05)


def test_a_motion_alone_leaves_next_to_nothing() -> None:
    """52 readings in a half cycle leak by (pi/52)^4/sqrt(70) of the amplitude."""
    assert white_rms(SWING) < (math.pi / 52) ** 4 / math.sqrt(70.0)


def test_glitches_are_no_noise() -> None:
    values = 3e-4 * np.random.default_rng(1).standard_normal(20000)
    values[::997] += 5.0
    assert noise_rms(values) == pytest.approx(3e-4, rel=0.1)


def test_noise_is_never_below_the_rounding() -> None:
    assert noise_rms(np.zeros(1000), 0.1) == quantisation_rms(0.1) == 0.1 / math.sqrt(12.0)
    assert quantisation_rms(None) == 0.0


def test_the_quietest_tenth_hears_no_drum_that_beats_for_most_of_the_time() -> None:
    noise = 3e-4 * np.random.default_rng(1).standard_normal(20000)
    drum = np.where(np.arange(20000) < 15000, 100.0, 1.0)
    assert noise_rms(drum * noise, quieter=0.1) == pytest.approx(3e-4, rel=0.2)
    assert noise_rms(drum * noise) > 1e-2


def test_wild_first_rows_of_a_short_recording_are_no_noise() -> None:
    values = 1e-3 * np.random.default_rng(2).standard_normal(130)
    values[:12] += np.linspace(-1.0, 1.0, 12) ** 3
    values[3:5] = 1.0
    assert noise_rms(values, quieter=0.1) == pytest.approx(1e-3, rel=0.4)
