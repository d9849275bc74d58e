"""Rounded readings: where the noise is too small to hide the steps."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from pendpipe.diagnosis.data import Data, gather, rounding_bias, with_lattice
from pendpipe.diagnosis.forensics.codes import noise_before_rounding
from pendpipe.diagnosis.forensics.local import Local

from .decays import rounded
from .records import INTERVAL_S, TIME_S, TRUTH, other_engine, white


def mean_code(angle: float, step: float, noise_rms: float) -> float:
    """The mean of round((angle + noise)/step) step, code by code."""
    codes = np.arange(-30, 31) + round(angle / step)
    edges = (np.append(codes - 0.5, codes[-1] + 0.5) * step - angle) / noise_rms
    return float(step * np.sum(codes * np.diff(ndtr(edges))))


@given(st.floats(-4.0, 4.0), st.floats(0.1, 1.5), st.floats(1e-6, 1e2))
def test_rounding_shifts_the_mean_of_noisy_readings(
    angle: float, noise: float, step: float
) -> None:
    """All in steps; Widrow's series against the sum over the codes."""
    found = rounding_bias(np.array([angle * step]), step, noise * step)[0]
    assert found / step == pytest.approx(mean_code(angle, 1.0, noise) - angle, abs=1e-4)


@pytest.mark.parametrize("share", [0.12, 0.25])
@pytest.mark.parametrize("shift", [0.0, 0.3])
def test_the_noise_before_the_rounding_is_found(share: float, shift: float) -> None:
    """And the origin of the converter's steps; with it the residual has no bias."""
    step = 1e-3
    plain = other_engine(TRUTH)
    readings = shift * step + rounded(plain - shift * step + white(4, rms=share * step), step)
    data = Data(TIME_S, readings, INTERVAL_S, True, np.ones(len(TIME_S)), step)
    found = with_lattice(data, plain)
    assert found.lattice is not None
    origin, noise = found.lattice
    assert np.mod(origin / step - shift + 0.5, 1.0) == pytest.approx(0.5, abs=1e-3)
    assert noise / step == pytest.approx(share, abs=0.045)
    assert np.std(found.residual(plain)) < np.std(data.residual(plain))


@pytest.mark.parametrize("share", [0.12, 0.25, 0.4])
def test_the_noise_before_the_rounding_is_found_where_the_model_is_the_truth(share: float) -> None:
    step, plain = 1e-3, other_engine(TRUTH)
    left = rounded(plain + white(4, rms=share * step), step) - plain
    every = np.ones(len(left), dtype=bool)
    local = Local(left, float(np.std(left)), np.zeros(len(left)), every)
    assert noise_before_rounding(local, step) / step == pytest.approx(share, rel=0.1)


@pytest.mark.parametrize(("share", "step"), [(1.0, 1e-3), (0.3, 0.0)])
def test_noise_of_a_step_or_no_step_leaves_nothing_to_find(share: float, step: float) -> None:
    plain = other_engine(TRUTH)
    readings = plain + white(4, rms=share * 1e-3)
    readings = rounded(readings, step) if step else readings
    data = Data(TIME_S, readings, INTERVAL_S, True, np.ones(len(TIME_S)), step)
    assert with_lattice(data, plain).lattice is None


@given(st.integers(24, 4000))
def test_a_quick_length_has_small_factors_and_loses_little(count: int) -> None:
    time = np.arange(count) * INTERVAL_S
    told = {"step": None, "unit": "rad", "counts": False, "period_s": 1.0, "noise_rms": 1.0}
    found = len(gather(time, np.zeros(count), **told))  # type: ignore[arg-type]
    left = found
    for prime in (2, 3, 5, 7, 11):
        while left % prime == 0:
            left //= prime
    assert left == 1
    assert 0.9 * count < found <= count


@pytest.mark.parametrize("rate_hz", [24.0, 29.97, 30.0, 60.0])
def test_stamps_rounded_to_milliseconds_are_evenly_spaced(rate_hz: float) -> None:
    """Their intervals, of 33 and 34 ms at 30 Hz, differ by up to six per cent."""
    exact = np.arange(900) / rate_hz
    data = gather(
        np.round(exact, 3),
        np.zeros(900),
        step=None,
        unit="rad",
        counts=False,
        period_s=1.0,
        noise_rms=1.0,
    )
    assert data.uniform
    assert data.interval_s == pytest.approx(1.0 / rate_hz, rel=1e-4)


@pytest.mark.parametrize("period_s", [0.2, 0.4, 1.1, 5.0])
def test_readings_are_averaged_only_where_many_are_left_in_a_cycle(period_s: float) -> None:
    """Of 20000 at 200 Hz; the noise of a mean falls with the root of their number."""
    time_s = np.arange(20_000) / 200.0
    data = gather(
        time_s, time_s**2, step=1e-3, unit="rad", counts=False, period_s=period_s, noise_rms=1e-4
    )
    assert data.interval_s == pytest.approx(data.fold / 200.0)
    assert data.fold == 1 or period_s / data.interval_s >= 24.0
    assert data.noise_rms == pytest.approx(1e-4 / data.fold**0.5)
    assert data.step == (1e-3 if data.fold == 1 else 0.0)
    assert data.values[0] == pytest.approx(np.mean(time_s[: data.fold] ** 2))
    assert data.time_s[0] == pytest.approx(np.mean(time_s[: data.fold]))
