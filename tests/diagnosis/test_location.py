"""Where an effect shows: time, frequency, harmonic."""

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.location import locate
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.diagnosis.result import Location
from pendpipe.diagnosis.rivals import near_harmonic_by_chance
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model

from .records import (
    FREQUENCY_HZ,
    INSTANT_S,
    INTERVAL_S,
    NOISE_RAD,
    TIME_S,
    TONE_HZ,
    TRUTH,
    diagnosed,
    prepared,
    white,
)

LARGE = np.where(TRUTH == 0.15, 0.4, TRUTH)
"""The same pendulum released at 0.4 rad, where sin x is far from x."""


def location_of(name: str) -> Location:
    return diagnosed(name).effects[0].location


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
    """Amplitude and losses absorb its effect on the fundamental."""
    for name, harmonic in (("sensor-quadratic", 2), ("sensor-cubic", 3)):
        found = location_of(name)
        assert harmonic in found.harmonics
        assert harmonic * FREQUENCY_HZ == pytest.approx(max(found.frequency_hz), rel=1e-3)
        assert max(found.harmonics) == harmonic


def test_a_curved_sensor_shows_at_large_amplitudes_that_is_early() -> None:
    found = location_of("sensor-cubic")
    amplitude = diagnosed("sensor-cubic").search.fit.at.sampled.amplitude
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
        assert lowest <= interval[0] < interval[1] <= highest
    assert np.all(np.isfinite(found.frequency_hz))


def located(
    identifier: str,
    values: tuple[float, ...],
    base: FloatArray = TRUTH,
    time_s: FloatArray = TIME_S,
) -> tuple[Location, float]:
    """Where an effect shows that Eq. 8 lacks; and Eq. 8's phase error, rad."""
    effect = by_identifier(identifier)
    bare, extended = Model(time_s, INTERVAL_S), Model(time_s, INTERVAL_S, (effect,))
    truth = np.append(base, values)
    readings = extended.reading(truth) + white(2, len(time_s))
    even = len(time_s) == len(TIME_S)
    data = Data(time_s, readings, INTERVAL_S, even, np.ones(len(time_s)))
    noise = white_noise(data, NOISE_RAD)
    before, after = refine(bare, data, noise, base), refine(extended, data, noise, truth)
    return locate(before, after, data, effect), before.max_phase_error_rad


SLIPPING = {
    "circular-error": ((1.0,), LARGE),
    "clock-drift": ((1e-4, 1e3), TRUTH),
    "frequency-drift": ((3e-4, 40.0), TRUTH),
}


@pytest.mark.parametrize("name", SLIPPING)
def test_a_phase_error_of_a_radian_is_a_misfit_of_the_fundamental(name: str) -> None:
    """However large: the pendulum is early or late, and its offset unchanged."""
    found, slip = located(name, *SLIPPING[name])
    assert slip > 0.5
    assert found.harmonics == (1,)
    assert found.frequency_hz == pytest.approx((FREQUENCY_HZ,), rel=1e-2)
    assert "level" not in found.summary


def test_a_phase_error_shows_at_the_same_amplitudes_whether_it_is_small_or_large() -> None:
    """Its effect is linear along the motion, if not in the readings."""
    small, slip = located("clock-drift", (2e-6, 1e3))
    large, slipped = located("clock-drift", (1e-4, 1e3))
    assert slip < 0.02
    assert slipped > 0.5
    assert large.amplitude_rad == pytest.approx(small.amplitude_rad, rel=0.01)


def test_a_phase_misfit_shows_at_the_zero_crossings_and_a_loss_at_the_turning_points() -> None:
    """Twice a cycle: no single arc of less than half a circle holds most of it."""
    early, _ = located("clock-drift", (1e-5, 1e3))
    assert early.phase_rad is None
    assert "zero crossings" in early.summary
    lossy, _ = located("damping-drift", (3e-4, 1e3))
    assert lossy.phase_rad is None
    assert "turning points" in lossy.summary


def test_a_step_of_the_offset_prefers_no_part_of_the_cycle() -> None:
    summary = located("equilibrium-step", (4e-4, INSTANT_S))[0].summary
    assert "crossings" not in summary
    assert "turning points" not in summary


def test_what_fades_after_the_release_lies_at_the_beginning_and_not_at_its_time_constant() -> None:
    found, _ = located("release-transient", (0.02, 4.8))
    assert found.time_s[0] == TIME_S[0]
    assert 4.8 < found.time_s[1] < 0.5 * TIME_S[-1]


def test_an_encoder_that_records_its_counts_makes_no_harmonics_of_a_phase_error() -> None:
    """Its readings are dense at the crossings: |sin| of the phase, which has a second harmonic."""
    finer = np.arange(0.0, 60.0, INTERVAL_S / 4.0)
    speed = np.abs(np.sin(TRUTH[4] * (finer - TRUTH[6])))
    written = finer[np.random.default_rng(4).uniform(size=len(finer)) < speed]
    found, slip = located("frequency-drift", (1e-3, 40.0), time_s=written)
    assert slip > 0.5
    assert found.harmonics == (1,)


@pytest.mark.parametrize(
    ("frequency_hz", "by_chance"),
    [
        (3.5 * FREQUENCY_HZ, 0.9),
        (3.0 * FREQUENCY_HZ, 0.05),
        (0.5 / INTERVAL_S - FREQUENCY_HZ, 0.15),
        (1.0 / INTERVAL_S - 11.0 * FREQUENCY_HZ, 0.15),
    ],
)
def test_a_line_of_every_second_reading_or_an_alias_is_seldom_there_by_chance(
    frequency_hz: float, by_chance: float
) -> None:
    """Lines at a harmonic, about half the sampling rate, and the alias of the eleventh harmonic."""
    tone = by_identifier("tone-pickup")
    model = Model(TIME_S, INTERVAL_S, (tone,))
    truth = np.append(TRUTH, [3e-4, 2e-4, frequency_hz])
    data, noise = prepared(model.reading(truth) + white(3))
    found = near_harmonic_by_chance(refine(model, data, noise, truth), tone)
    assert found > by_chance if by_chance == 0.9 else found < by_chance
