"""One law, one fit, one test of it: the numbers of clean recordings at any rate, noise and loss."""

import math
from typing import Any

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.analysis.fit.goodness import LEVEL, judge
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, sample

OMEGA = 2.0 * math.pi


def clean(law: Eq8, amplitude: float, time_s: FloatArray, noise: float, seed: int = 1) -> Any:
    """A recording of the law with white noise."""
    white = np.random.default_rng(seed).standard_normal(len(time_s))
    values = sample(law, Release(-0.2, amplitude, 0.002), time_s) + noise * white
    return pp.Recording(time_s, angle_rad=values)


def pull(result: Any, name: str, truth: float) -> float:
    """Standard deviations by which a number is off."""
    return float((result[name].value - truth) / result[name].sd)


def test_few_readings_in_a_cycle_tell_the_noise() -> None:
    """Differences of 7 readings in a half cycle see the motion, and not the noise."""
    time = np.arange(0.0, 40.0, 1.0 / 14.7)
    result = pp.fit(clean(Eq8(OMEGA, viscous=0.02, restoring="sine"), 0.3, time, 5e-6))
    assert result.light == "green"
    assert result.noise_rms_rad == pytest.approx(5e-6, rel=0.1)
    assert 0.8 < result.chi2_per_dof < 1.2


@pytest.mark.parametrize("per_cycle", [4.2, 5.3, 7.5, 11.0])
@pytest.mark.parametrize("amplitude", [0.3, 1.5])
def test_four_readings_in_a_cycle_are_enough(per_cycle: float, amplitude: float) -> None:
    law = Eq8(OMEGA, viscous=0.02, restoring="sine")
    result = pp.fit(clean(law, amplitude, np.arange(0.0, 40.0, 1.0 / per_cycle), 5e-6))
    assert result.light != "red"
    assert result.noise_rms_rad == pytest.approx(5e-6, rel=0.15)
    assert abs(pull(result, "frequency", 1.0)) < 4.0
    low, high = result["b"].bounds95
    assert low - result["b"].sd <= 0.02 <= high + result["b"].sd


def test_the_minimum_is_that_of_the_noise_that_was_found() -> None:
    """Hysteretic loss from 2 rad: the half cycles' first noise is 27 times too large."""
    law = Eq8(OMEGA, hysteretic=OMEGA / 200.0, restoring="sine")
    result = pp.fit(clean(law, 2.0, np.arange(0.0, 60.0, 0.02), 1e-4))
    assert result.light == "green"
    for name, truth in {"a": 0.0, "b": OMEGA / 200.0, "c": 0.0}.items():
        low, high = result[name].bounds95
        assert low <= truth <= high
    assert abs(pull(result, "frequency", 1.0)) < 4.0


def test_rounded_stamps_of_even_times_are_even() -> None:
    """Sixty readings a second, stamped with two decimals."""
    true = np.arange(3600) / 60.0
    recording = clean(Eq8(5.0, viscous=0.02, restoring="sine"), 0.2, true, 2e-4)
    result = pp.fit(pp.Recording(np.round(true, 2), angle_rad=recording.values))
    assert result.noise_rms_rad == pytest.approx(2e-4, rel=0.05)
    assert result["b"].sd == pytest.approx(pp.fit(recording)["b"].sd, rel=0.05)


def test_uneven_times_stay_as_they_are() -> None:
    time = np.sort(np.random.default_rng(3).uniform(0.0, 60.0, 3000))
    result = pp.fit(clean(Eq8(5.0, viscous=0.02, restoring="sine"), 0.2, time, 2e-4))
    assert result.noise_rms_rad == pytest.approx(2e-4, rel=0.05)


@pytest.mark.parametrize("drag", ["energy", "speed"])
@pytest.mark.parametrize("amplitude", [1.0, 2.2])
def test_the_form_of_the_drag_is_fitted(drag: Any, amplitude: float) -> None:
    """A ball on a string loses by v|v|, and a, b, c are what they are."""
    law = Eq8(OMEGA, quadratic=0.03, viscous=0.01, coulomb=1e-4, restoring="sine", drag=drag)
    result = pp.fit(clean(law, amplitude, np.arange(0.0, 100.0, 0.01), 1e-3))
    assert (result.light, result.drag_form) == ("green", drag)
    assert result.to_dict()["drag_form"] == drag
    for name, truth in {"a": 0.03, "b": 0.01, "c": 1e-4, "frequency": 1.0}.items():
        assert abs(pull(result, name, truth)) < 4.0


def test_where_the_form_cannot_be_told_the_error_covers_both() -> None:
    """A tenth of a radian in six cycles."""
    law = Eq8(OMEGA, quadratic=0.6, restoring="sine", drag="speed")
    result = pp.fit(clean(law, 0.1, np.arange(0.0, 6.0, 0.01), 1e-3))
    assert result.drag_form == "undecided"
    low, high = result["a"].bounds95
    assert low <= 0.6 <= high


def test_a_perfect_recording_is_refuted_at_the_level_of_all_questions_together() -> None:
    """Of 60 recordings of the law of fig. 8 four were red."""
    law = Eq8(OMEGA * 0.516, 0.45, 0.00596, 0.00596, 1.4e-6, "sine")
    time = np.arange(4096) * (280.0 / 4096)
    motion = sample(law, Release(-0.3, 0.068), time)
    p_values, lights = [], []
    for seed in range(60):
        noise = 1e-4 * np.random.default_rng(seed).standard_normal(len(time))
        result = pp.fit(pp.Recording(time, angle_rad=motion + noise))
        p_values.append(result.fit_p_value)
        lights.append(result.light)
    assert "red" not in lights
    assert min(p_values) > LEVEL
    # A question's own level would refute each third.
    assert np.mean(np.array(p_values) < 0.5) < 0.75


@pytest.mark.parametrize(
    ("name", "frequency", "size"),
    [
        ("level", 0.01, 0.2),
        ("motion", 1.0, 0.2),
        ("harmonic 2", 2.0, 0.2),
        ("harmonic 3", 3.0, 0.2),
    ],
)
def test_what_noise_does_not_explain_is_seen(name: str, frequency: float, size: float) -> None:
    """A fifth of the noise, in any harmonic of the motion or below it."""
    time = np.arange(6000) * 0.02
    residual = np.random.default_rng(5).standard_normal(len(time))
    residual += size * np.cos(2.0 * math.pi * frequency * time + 1.0)
    turns = np.arange(0.25, 119.0, 0.5)
    found = judge(
        time,
        residual,
        turns,
        np.arange(len(turns), dtype=np.float64),
        fitted=6,
        lines=1,
        amplitude=np.ones(len(turns)),
        step=None,
        floor=0.0,
    )
    assert found.p_value < LEVEL, name
    assert found.noise_rms == pytest.approx(1.0, rel=0.03)


def test_a_rate_that_is_known_to_sixty_deviations_is_told() -> None:
    """No warning that a can't be told from b."""
    law = Eq8(OMEGA, quadratic=0.2, viscous=0.01, restoring="sine")
    result = pp.fit(clean(law, 0.3, np.arange(0.0, 100.0, 0.02), 1e-4))
    assert result["a"].value > 60.0 * result["a"].sd
    assert not any("can't be told" in warning for warning in result.warnings)


@pytest.mark.parametrize("count", [5000, 50_000])
def test_a_zero_that_drifts_by_a_line_is_followed(count: int) -> None:
    """1 V on -0.03 V/s: the zero moves by three swings."""
    time = np.arange(count) * (100.0 / count)
    motion = sample(Eq8(OMEGA, viscous=OMEGA / 386.0), Release(-0.1, 1.0), time)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(count)
    result = pp.fit(pp.Recording(time, volts=motion - 0.03 * time + noise))
    assert result.light == "green"
    assert result.zero_drift.unit == "V/s"
    assert abs(result.zero_drift.value + 0.03) < 4.0 * result.zero_drift.sd
    assert abs(pull(result, "b", OMEGA / 386.0)) < 4.0


def test_bursts_are_a_refusal_in_words() -> None:
    """Wild readings two and three together, a twentieth of them as large as the swing."""
    random, time = np.random.default_rng(3), np.arange(6000) / 60.0
    values = 0.5 * np.exp(-0.03 * time) * np.cos(8.44 * time)
    for start in np.flatnonzero(random.random(len(time)) < 0.02).tolist():
        values[start : start + 3] += 0.6 * random.standard_normal() * abs(values[start])
    with pytest.raises(pp.InputError, match=r"no law follows it|no free decay|did not settle"):
        pp.fit(pp.Recording(time, displacement_m=values))


@pytest.mark.parametrize("seed", range(4))
def test_torques_are_compared_by_the_readings_that_both_explain(seed: int) -> None:
    """A pendulum that friction stops: with x and with sin x it is followed to other times."""
    omega = 2.0 * math.pi * 0.05987
    law = Eq8(omega, 0.0514, 0.0134, 0.0038, 1.19e-5, "sine")
    result = pp.fit(clean(law, 0.0572, np.arange(0.0, 251.0, 1.0 / 65.0), 8e-5, seed))
    assert result.restoring == "sine"
    assert abs(pull(result, "frequency", 0.05987)) < 4.0
