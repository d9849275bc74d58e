"""Long records: followed in one pass where they are plain, with the answer of the whole."""

import math
from dataclasses import replace

import numpy as np
import pytest

from pendpipe.analysis.turning_points.find import turning_points_of
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.arrays import FloatArray

HALF_PERIOD = 1.0
NOISE = 1e-4


def long_record(quality: float, seconds: float = 3000.0) -> tuple[Samples, float]:
    """A decay of Eq. 3, at 106 readings a half cycle, and its rate."""
    rate = math.pi / (2.0 * quality)
    time = np.arange(int(seconds * 106)) / 106.0
    motion = 0.068 * np.exp(-rate * time) * np.cos(math.pi * time + 0.3)
    noise = NOISE * np.random.default_rng(1).standard_normal(len(time))
    return Samples(time, motion + noise + 2e-3, "rad", None, NOISE), rate


def errors(points: TurningPoints, rate: float) -> tuple[FloatArray, FloatArray]:
    lag = math.atan(rate / math.pi)
    turning = np.round(points.time_s + (0.3 + lag) / math.pi) - (0.3 + lag) / math.pi
    angle = np.cos(lag) * 0.068 * np.exp(-rate * turning) * points.side
    return points.angle_rad - angle, points.time_s - turning


@pytest.mark.parametrize(
    ("quality", "half_cycles"),
    [(5000.0, 3000), (1000.0, 2600)],
    ids=["one pass", "half cycle by half cycle"],
)
def test_long_records_have_the_errors_of_short_ones(quality: float, half_cycles: int) -> None:
    samples, rate = long_record(quality, float(half_cycles))
    points = turning_points_of(samples, long=1 << 18)
    assert ("a long record" in str(points.notes)) == (quality > 1700.0)
    # One pass leaves out what stands at the ends.
    assert half_cycles - 2 <= len(points) <= half_cycles
    assert np.array_equal(points.half_cycle, np.arange(len(points)))
    angle, late = errors(points, rate)
    pull = angle / points.angle_sd_rad
    assert abs(pull.mean()) < 4.0 / math.sqrt(half_cycles)
    assert pull.std() == pytest.approx(1.0, abs=0.06)
    assert (late / points.time_sd_s).std() == pytest.approx(1.0, abs=0.06)
    assert abs(np.mean(angle * points.side)) < 0.015 * NOISE


def test_one_pass_and_whole_agree() -> None:
    samples, _ = long_record(5000.0)
    whole = turning_points_of(samples)
    passed = turning_points_of(samples, long=1 << 18)
    assert "a long record" in str(passed.notes)
    difference = (passed.angle_rad - whole.angle_rad[1:-1]) / whole.angle_sd_rad[1:-1]
    assert np.sqrt(np.mean(difference**2)) < 0.3
    assert passed.noise_rms_rad == pytest.approx(whole.noise_rms_rad, rel=0.01)


def test_a_pause_in_a_long_record_is_counted_over() -> None:
    samples, rate = long_record(5000.0)
    keep = (samples.time_s < 1400.0) | (samples.time_s > 1417.5)
    cut = Samples(samples.time_s[keep], samples.values[keep], "rad", None, NOISE)
    points = turning_points_of(cut, long=1 << 18)
    turning = points.half_cycle + 1.0 - (0.3 + math.atan(rate / math.pi)) / math.pi
    assert np.max(np.abs(points.time_s - turning)) < 0.01


@pytest.mark.parametrize("noise", [3e-5, 1e-4])
def test_the_noise_of_a_long_record_is_found_wherever_its_readings_lie(noise: float) -> None:
    """The half cycles hold no whole number of readings: none turns on a reading."""
    time = np.arange(300_000) / 100.0
    motion = 0.1 * np.exp(-1e-5 * time) * np.cos(6.0 * time + 0.3)
    readings = motion + noise * np.random.default_rng(2).standard_normal(len(time))
    samples = Samples(time, readings, "rad", None, noise)
    points = turning_points_of(samples, long=1 << 18)
    assert points.noise_rms_rad == pytest.approx(noise, rel=0.02)
    assert np.isfinite(points.angle_sd_rad).all()


def test_a_sensor_that_bends_is_not_followed_with_bare_cosines() -> None:
    """Its third harmonic takes 2 % off the fundamental that a cosine has at the turning point."""
    samples, rate = long_record(5000.0)
    bent = samples.values - 20.0 * (samples.values - 2e-3) ** 3
    points = turning_points_of(replace(samples, values=bent), long=1 << 18)
    y = 0.068 * np.exp(-rate * points.time_s)
    off = (points.amplitude_rad - (y - 20.0 * y**3)) / points.angle_sd_rad
    assert abs(float(np.mean(off))) < 1.0
