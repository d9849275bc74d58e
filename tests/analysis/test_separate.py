"""k from the air benchmark and Eq. 17: injected truth, honest errors, the paper's record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pendpipe.analysis.separate import MeasuredRecord, fit_benchmark, separate
from pendpipe.errors import InputError
from pendpipe.estimate import Estimate, quality_of_rate
from pendpipe.physics import without_hysteresis

from .benchmark import known_benchmark

AIR = np.geomspace(1 / 15.0, 0.5, 12)
SDS = 1e-3 * np.geomspace(3.0, 0.3, 12)


def record(
    name: str, frequency: float, rate: float, sd: float, fluid: str = "air"
) -> MeasuredRecord:
    return MeasuredRecord(
        record=name,
        fluid=fluid,
        branch="",
        frequency=Estimate(frequency, 0.0, "Hz"),
        quadratic=Estimate(0.45, 0.01, "1/(rad s)", (0.43, 0.47)),
        linear=Estimate(rate, sd, "1/s"),
        coulomb=Estimate(1.4e-6, 1e-7, "rad/s"),
    )


def air_records(
    seed: int | None, *, k: float = 3940.0, exponent: float = 2.0, noise: float = 1.0
) -> list[MeasuredRecord]:
    """Twelve records from 15 s to 2 s; the slowest lose most, and are known worst."""
    rates = np.pi * AIR / (k * AIR**exponent)
    if seed is not None:
        rates = rates + noise * SDS * np.random.default_rng(seed).standard_normal(12)
    return [
        record(f"air-{n}", f, b, noise * s)
        for n, (f, b, s) in enumerate(zip(AIR, rates, SDS, strict=True))
    ]


@given(k=st.floats(1.0, 1e6))
@settings(deadline=None)
def test_exact_records_give_k_exactly(k: float) -> None:
    found = fit_benchmark(air_records(None, k=k))
    assert found.coefficient.value == pytest.approx(k, rel=1e-12)
    assert found.free_exponent.value == pytest.approx(2.0, abs=1e-6)
    assert found.chi2 == pytest.approx(0.0, abs=1e-12)


def test_pulls_of_k_and_of_the_exponent() -> None:
    benchmarks = [fit_benchmark(air_records(seed, noise=0.3)) for seed in range(400)]
    in_rate = [(found.inverse - 1 / 3940.0) / found.inverse_sd for found in benchmarks]
    in_k = [(found.coefficient.value - 3940.0) / found.coefficient.sd for found in benchmarks]
    exponents = [(b.free_exponent.value - 2.0) / b.free_exponent.sd for b in benchmarks]
    for pulls in (in_rate, in_k, exponents):
        # Four standard errors of a mean and of a scatter of 400 pulls.
        assert abs(np.mean(pulls)) < 4.0 / np.sqrt(400)
        assert abs(np.std(pulls) - 1.0) < 4.0 / np.sqrt(800)
    for p_values in ([b.p_value for b in benchmarks], [b.exponent_p_value for b in benchmarks]):
        assert abs(np.mean(p_values) - 0.5) < 4.0 / np.sqrt(12 * 400)


def test_a_line_through_q_against_f_squared_would_be_biased() -> None:
    # Weighting each Q by its own error favours the records whose Q came out low.
    naive = []
    for seed in range(200):
        records = air_records(seed)
        f = np.array([entry.frequency.value for entry in records])
        b = np.array([entry.linear.value for entry in records])
        s = np.array([entry.linear.sd for entry in records])
        quality, weights = np.pi * f / b, (b**2 / (np.pi * f * s)) ** 2
        naive.append(np.sum(weights * quality * f**2) / np.sum(weights * f**4) / 3940.0)
    honest = [fit_benchmark(air_records(s)).inverse * 3940.0 for s in range(200)]
    assert abs(np.mean(naive) - 1.0) > 4.0 * np.std(naive) / np.sqrt(200)
    assert abs(np.mean(honest) - 1.0) < 4.0 * np.std(honest) / np.sqrt(200)


def test_viscous_damping_in_air_is_told_from_hysteresis() -> None:
    found = fit_benchmark(air_records(1, k=985.0 / 0.5, exponent=1.0, noise=0.1))
    assert found.exponent_p_value < 1e-6
    assert found.p_value < 1e-6
    assert abs(found.free_exponent.value - 1.0) < 4.0 * found.free_exponent.sd


def test_one_frequency_gives_k_but_no_exponent() -> None:
    found = fit_benchmark([record("only", 0.2, np.pi / (3940.0 * 0.2), 1e-5)])
    assert found.coefficient.value == pytest.approx(3940.0)
    assert np.isnan(found.free_exponent.value)
    assert np.isnan(found.p_value)
    assert np.isnan(found.exponent_p_value)


def test_a_frequency_error_counts_as_an_error_of_the_rate() -> None:
    bare = record("one", 0.2, np.pi / (3940.0 * 0.2), 1e-5)
    shaky = replace(bare, frequency=Estimate(0.2, 0.002, "Hz"))
    relative = fit_benchmark([shaky]).coefficient.sd / 3940.0
    assert relative == pytest.approx(np.hypot(1e-5 / bare.linear.value, 0.01), rel=1e-12)


def test_no_benchmark_is_a_fault_of_the_input() -> None:
    with pytest.raises(InputError, match="no record in air"):
        fit_benchmark([])
    with pytest.raises(InputError, match="not positive"):
        fit_benchmark([record("odd", 0.2, -1e-3, 1e-4)])
    with pytest.raises(InputError, match="record odd: b has no usable error"):
        fit_benchmark([record("fine", 0.2, 1e-3, 1e-4), record("odd", 0.2, 1e-3, 0.0)])


def test_eq17_at_the_papers_record() -> None:
    water = record("fig7", 0.516, np.pi * 0.516 / 136.0, 2e-5, "water")
    (split,) = separate([water], known_benchmark(3940.0, 20.0))
    assert split.quality_factor_limit.value == pytest.approx(136.0)
    assert split.quality_factor_hysteretic.value == pytest.approx(1049.0, abs=0.1)
    assert split.quality_factor_viscous.value == pytest.approx(156.3, abs=0.05)
    assert split.quality_factor_viscous.value == pytest.approx(
        float(without_hysteresis(136.0, split.quality_factor_hysteretic.value)), rel=1e-13
    )


def test_errors_of_a_viscous_rate_add_up_from_its_own_and_that_of_k() -> None:
    water = record("w", 0.516, 0.0119, 2e-5, "water")
    (split,) = separate([water], known_benchmark(3940.0, 100.0))
    common = abs(split.viscous_rate_per_inverse_k) * 100.0 / 3940.0**2
    assert split.viscous_rate_sd_own == pytest.approx(2e-5)
    assert split.viscous_rate.sd == pytest.approx(np.hypot(2e-5, common), rel=1e-12)
    # The derivative, by moving k.
    (moved,) = separate([water], known_benchmark(3941.0, 0.0))
    change = moved.viscous_rate.value - split.viscous_rate.value
    assert change / (1 / 3941.0 - 1 / 3940.0) == pytest.approx(split.viscous_rate_per_inverse_k)


def test_pulls_of_the_viscous_rates_in_water_and_in_air() -> None:
    water, air = [], []
    true_rate = 0.01
    for seed in range(400):
        random = np.random.default_rng([9, seed])
        benchmark = fit_benchmark(air_records(seed, noise=0.1))
        measured = true_rate + np.pi / (3940.0 * 0.3) + 1e-5 * random.standard_normal()
        records = [record("w", 0.3, measured, 1e-5, "water"), *air_records(seed, noise=0.1)[:1]]
        split = separate(records, benchmark)
        water.append((split[0].viscous_rate.value - true_rate) / split[0].viscous_rate.sd)
        air.append(split[1].viscous_rate.value / split[1].viscous_rate.sd)
    for pulls in (water, air):
        assert abs(np.mean(pulls)) < 4.0 / np.sqrt(400)
        assert abs(np.std(pulls) - 1.0) < 4.0 / np.sqrt(800)


def test_calibration_widens_a_and_c_but_no_quality_factor() -> None:
    water = record("w", 0.516, 0.0119, 2e-5, "water")
    benchmark = known_benchmark(3940.0, 10.0)
    (bare,) = separate([water], benchmark)
    (wide,) = separate([water], benchmark, calibration_relative_sd=0.02)
    assert wide.quadratic.sd == pytest.approx(np.hypot(0.01, 0.02 * 0.45))
    assert wide.coulomb.sd == pytest.approx(np.hypot(1e-7, 0.02 * 1.4e-6))
    assert wide.quadratic.interval95 is not None
    assert wide.quadratic.interval95[0] < 0.43 < 0.47 < wide.quadratic.interval95[1]
    assert wide.quality_factor_viscous == bare.quality_factor_viscous
    assert wide.viscous_rate == bare.viscous_rate


def test_a_rate_that_may_be_zero_leaves_q_open_above() -> None:
    assert quality_of_rate(0.5, Estimate(0.01, 0.01, "1/s")).interval95 == (
        pytest.approx(np.pi * 0.5 / (0.01 * 2.959963984540054)),
        np.inf,
    )
    assert np.isnan(quality_of_rate(0.5, Estimate(-0.01, 0.01, "1/s")).value)
