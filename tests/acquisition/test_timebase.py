"""The measured scan rate: true whatever delays the arrivals, and honest about its error."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, t

from pendpipe.acquisition import decode
from pendpipe.acquisition.decode import find_delays, measure_rate


@given(
    rate_hz=st.floats(1.0, 1e4),
    delay_s=st.floats(0.0, 10.0),
    origin_s=st.floats(-100.0, 100.0),
)
def test_a_constant_delay_changes_nothing(rate_hz: float, delay_s: float, origin_s: float) -> None:
    scans = np.arange(1.0, 401.0)
    found = measure_rate(origin_s + scans / rate_hz + delay_s, scans, 50.0)
    assert found.measured_hz == pytest.approx(rate_hz, rel=1e-9)


@given(scale=st.sampled_from([1.0, 1000.0]), rate_hz=st.floats(10.0, 1000.0))
def test_units_scale(scale: float, rate_hz: float) -> None:
    """A clock that runs faster measures a slower device, in proportion."""
    scans = np.arange(1.0, 401.0)
    arrival_s = scans / rate_hz + 1e-3 * np.sin(scans) ** 2
    slow = measure_rate(arrival_s, scans, rate_hz)
    fast = measure_rate(arrival_s * scale, scans, rate_hz / scale, clock_scale=scale)
    assert fast.measured_hz * scale == pytest.approx(slow.measured_hz, rel=1e-9)
    assert fast.measured_sd_hz * scale == pytest.approx(slow.measured_sd_hz, rel=1e-9)


@pytest.mark.parametrize("late_s", [1e-3, 1e-2])
def test_random_delays_leave_the_rate_within_its_error(late_s: float) -> None:
    """Exponential delays, with one in twenty a hundred times as long."""
    random = np.random.default_rng(20)
    pulls = []
    for _ in range(400):
        scans = np.arange(8.0, 8.0 * 600, 8.0)
        delay = random.exponential(late_s, len(scans))
        delay *= np.where(random.random(len(scans)) < 0.05, 100.0, 1.0)
        found = measure_rate(scans / 110.0 + delay, scans, 110.0)
        pulls.append((found.measured_hz - 110.0) / found.measured_sd_hz)
    assert abs(np.mean(pulls)) < 0.2
    assert np.std(pulls) < 1.3


def test_a_device_that_is_wrong_by_a_factor_is_believed_the_clock() -> None:
    scans = np.arange(1.0, 501.0)
    found = measure_rate(scans / 120.0, scans, 60.0)
    assert found.chosen == "measured"
    assert found.rate_hz == pytest.approx(120.0)


def test_a_quartz_is_believed_before_the_time_stamps() -> None:
    """10 parts in a million cannot be seen in five seconds."""
    scans = np.arange(1.0, 501.0)
    found = measure_rate(scans / (100.0 * (1 + 1e-5)), scans, 100.0)
    assert found.rate_hz == 100.0


def test_too_few_arrivals_measure_nothing() -> None:
    scans = np.arange(1.0, 36.0)
    found = measure_rate(scans / 100.0, scans, 90.0)
    assert np.isnan(found.measured_hz)
    assert found.rate_hz == 90.0


@pytest.mark.parametrize("step_s", [0.02, 0.1])
def test_a_clock_that_wanders_has_lost_nothing(step_s: float) -> None:
    """Only a delay that stays, and that the usual steps do not explain, is a loss."""
    scans = np.arange(10.0, 4000.0)
    for seed in range(30):
        steps = np.random.default_rng(seed).normal(0.0, step_s, len(scans) // 20 + 1)
        arrival = scans / 100.0 + np.repeat(np.cumsum(steps), 20)[: len(scans)]
        assert find_delays(arrival, scans, 100.0)[0] == []
    # A second without scans, and many times the usual step, is one.
    arrival[2000:] += 50.0 * step_s + 1.0
    (delay,) = find_delays(arrival, scans, 100.0)[0]
    assert delay.begin <= 2000 <= delay.end


@pytest.mark.parametrize(("drift_s", "chosen"), [(0.006, "nominal"), (0.025, "measured")])
def test_a_drift_of_a_busy_hosts_delays_is_no_rate(drift_s: float, chosen: str) -> None:
    """It does not scatter; below 10 ms of the host it is not believed, at any pace of the clock."""
    for clock_scale in (1.0, 20.0):
        scans = np.arange(1.0, 251.0) * 16.0
        arrival_s = scans / 100.0 * (1.0 + drift_s * clock_scale / 40.0)
        assert measure_rate(arrival_s, scans, 100.0, clock_scale).chosen == chosen


def test_chance_makes_a_rate_as_rarely_as_students_distribution_says() -> None:
    """Twelve stretches and a line leave ten degrees of freedom: 1 in 8,000 beyond six."""
    trust = decode._RATE_TRUST
    assert 2.0 * t.sf(trust, 10) == pytest.approx(1.0 / 8000.0, rel=0.1)
    generator, scans = np.random.default_rng(11), np.arange(1.0, 481.0) * 16.0
    beyond = 0
    for _ in range(1000):
        # Delays of many ms: the floor of the host's ten is far below.
        arrival_s = scans / 100.0 + generator.uniform(0.0, 3.0, len(scans))
        beyond += measure_rate(arrival_s, scans, 100.0).chosen == "measured"
    assert beyond <= binom.isf(1e-3, 1000, 1.0 / 8000.0)


@pytest.mark.parametrize(("height_s", "lost"), [(1.2, 0), (1.4, 1)])
def test_a_loss_is_a_step_of_more_than_eight_spreads_of_the_others(
    height_s: float, lost: int
) -> None:
    """Delays of 0, 0.1, 0.1 s in turn: steps spread by 0.148 s, and a step loses 0.1 s in them."""
    scans = np.arange(1.0, 2049.0)
    delay_s = np.repeat(np.resize([0.0, 0.1, 0.1], 256), 8)
    arrival_s = scans / 100.0 + delay_s + height_s * (scans > 1024)
    assert len(find_delays(arrival_s, scans, 100.0)[0]) == lost
