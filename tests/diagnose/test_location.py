"""Where a mismatch lies: time, frequency, harmonic."""

from __future__ import annotations

import numpy as np
import pytest

from pendpipe.diagnose.place import Location

from .records import FREQUENCY_HZ, INSTANT_S, TIME_S, TONE_HZ, diagnosed


def location_of(name: str) -> Location:
    return diagnosed(name).diagnosis.effects[0].location


def test_a_step_lies_at_its_instant() -> None:
    """Within two 95 % intervals, each less than the record's fiftieth."""
    found = location_of("equilibrium-step")
    assert found.time_s is not None
    low, high = found.time_s
    assert 0.0 < high - low < 0.02 * TIME_S[-1]
    assert abs(0.5 * (low + high) - INSTANT_S) < high - low
    assert "s" in found.summary


def test_a_tone_lies_at_its_frequency() -> None:
    found = location_of("tone-pickup")
    assert found.frequency_hz == pytest.approx((TONE_HZ,), abs=0.05 / TIME_S[-1])
    assert found.harmonics == ()
    assert "Hz" in found.summary


def test_a_square_in_the_sensor_lies_in_the_second_harmonic_and_a_cube_in_the_third() -> None:
    """What a curve does to the fundamental, amplitude and losses take."""
    for name, harmonic in (("sensor-quadratic", 2), ("sensor-cubic", 3)):
        found = location_of(name)
        assert harmonic in found.harmonics
        assert harmonic * FREQUENCY_HZ == pytest.approx(max(found.frequency_hz), rel=1e-3)
        assert max(found.harmonics) == harmonic


def test_a_curved_sensor_shows_at_large_amplitudes_that_is_early() -> None:
    found = location_of("sensor-cubic")
    assert found.amplitude_rad is not None
    assert found.time_s is not None
    amplitude = diagnosed("sensor-cubic").search.improved.at.sampled.amplitude
    assert found.amplitude_rad[1] > 0.97 * amplitude.max()
    assert found.amplitude_rad[0] > 1.2 * amplitude.min()
    assert found.time_s[0] < 5.0


@pytest.mark.parametrize("name", ["circular-error", "frequency-drift", "sensor-quadratic"])
def test_intervals_lie_within_the_record(name: str) -> None:
    found = location_of(name)
    for interval, lowest, highest in (
        (found.time_s, TIME_S[0], TIME_S[-1]),
        (found.amplitude_rad, 0.0, 0.16),
    ):
        assert interval is not None
        assert lowest <= interval[0] < interval[1] <= highest
    assert np.all(np.isfinite(found.frequency_hz))
