"""The measured scan rate: true whatever delays the arrivals, and honest about its error."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, t

from pendpipe.acquisition import decode
from pendpipe.acquisition.decode import find_delays, measure_rate
from pendpipe.arrays import FloatArray


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
    assert measure_rate(scans / (100.0 * (1 + 1e-5)), scans, 100.0).rate_hz == 100.0


def test_too_few_arrivals_measure_nothing() -> None:
    scans = np.arange(1.0, 36.0)
    found = measure_rate(scans / 100.0, scans, 90.0)
    assert np.isnan(found.measured_hz)
    assert found.rate_hz == 90.0


def steady(scans: FloatArray, rate_hz: float = 100.0) -> FloatArray:
    return scans / rate_hz + np.random.default_rng(3).exponential(1e-3, len(scans))


def slept(scans: FloatArray) -> FloatArray:
    """A second late, then everything at once."""
    arrival_s = steady(scans)
    arrival_s[2000:2100] = arrival_s[2100]
    return arrival_s


def wandering(scans: FloatArray) -> FloatArray:
    steps = np.random.default_rng(0).normal(0.0, 0.1, len(scans) // 20 + 1)
    return np.asarray(scans / 100.0 + np.repeat(np.cumsum(steps), 20)[: len(scans)])


@pytest.mark.parametrize(
    ("arrivals", "rise_s", "found"),
    [
        (steady, 0.3, True),
        (steady, 1.0, True),
        (lambda scans: steady(scans, 102.0), 0.3, True),  # not at the rate that it says
        (steady, 0.0, False),
        (slept, 0.0, False),  # a busy host is no loss: nothing stays late
        (wandering, 0.0, False),  # nor is what the usual steps explain
        (wandering, 6.0, True),
    ],
)
def test_scans_are_missing_where_the_arrivals_become_late_for_good(
    arrivals: Callable[[FloatArray], FloatArray], rise_s: float, found: bool
) -> None:
    scans = np.arange(1.0, 6001.0)
    arrival_s = arrivals(scans) + rise_s * (scans > 3000)
    delays, limit_s = find_delays(arrival_s, scans, 100.0)
    assert limit_s < 6.0
    assert len(delays) == found
    for delay in delays:
        assert delay.begin <= 3000 <= delay.end
        assert rise_s - 0.02 - 3.0 * (arrivals is wandering) < delay.late_s < rise_s + 0.02


@pytest.mark.parametrize(("drift_s", "chosen"), [(0.006, "nominal"), (0.025, "measured")])
def test_a_drift_of_a_busy_hosts_delays_is_no_rate(drift_s: float, chosen: str) -> None:
    """It does not scatter; below 10 ms of the host it is not believed, at any pace of the clock."""
    for clock_scale in (1.0, 20.0):
        scans = np.arange(1.0, 251.0) * 16.0
        arrival_s = scans / 100.0 * (1.0 + drift_s * clock_scale / 40.0)
        assert measure_rate(arrival_s, scans, 100.0, clock_scale).chosen == chosen


def test_chance_makes_a_rate_as_rarely_as_students_distribution_says() -> None:
    """Twelve stretches and a line leave ten degrees of freedom: 1 in 8,000 beyond six."""
    assert 2.0 * t.sf(decode._RATE_TRUST, 10) == pytest.approx(1.0 / 8000.0, rel=0.1)
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
