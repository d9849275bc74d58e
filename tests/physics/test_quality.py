"""Eqs. 12, 13, 15 and 17 at the paper's numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.physics import (
    amplitude_of_largest_quality_factor,
    amplitude_rate,
    hysteretic_quality_factor,
    largest_quality_factor,
    quality_factor,
    quality_factor_limit,
    rates_from_energy_constants,
    without_hysteresis,
)

F, A, C = 0.516, 0.45, 1.4e-6
B = np.pi * F / 136.0
positive = st.floats(-6, 3).map(lambda power: 10.0**power)


def test_fig8_q_starts_below_40_peaks_near_120_and_would_limit_at_136() -> None:
    assert abs(B - 0.01192) < 5e-6
    assert quality_factor(0.068, F, A, B, C) == pytest.approx(38.1, abs=0.1)
    assert largest_quality_factor(F, A, B, C) == pytest.approx(120.0, abs=0.2)
    assert amplitude_of_largest_quality_factor(A, C) == pytest.approx(1.8e-3, abs=5e-5)
    assert quality_factor_limit(F, B) == pytest.approx(136.0, rel=1e-14)


def test_a_above_042_meets_below_40() -> None:
    assert quality_factor(0.068, F, 0.43, B, C) < 40.0 < quality_factor(0.068, F, 0.41, B, C)


def test_product_of_a_and_c_from_the_maximum() -> None:
    root = (np.pi * F / 120.0 - B) / 2.0
    assert root**2 == pytest.approx(6.3e-7, abs=0.05e-7)


@given(a=positive, b=positive, c=positive, factor=st.floats(0.1, 10.0))
def test_q_is_largest_at_the_square_root_of_c_over_a(
    a: float, b: float, c: float, factor: float
) -> None:
    best = float(amplitude_of_largest_quality_factor(a, c))
    peak = float(largest_quality_factor(F, a, b, c))
    assert float(quality_factor(best, F, a, b, c)) == pytest.approx(peak, rel=1e-12)
    assert float(quality_factor(factor * best, F, a, b, c)) <= peak * (1.0 + 1e-12)


@given(y=positive, a=positive, b=positive, c=positive)
def test_eq15_is_two_pi_times_the_energy_over_its_loss_in_a_cycle(
    y: float, a: float, b: float, c: float
) -> None:
    relative_energy_rate = 2.0 * float(amplitude_rate(y, a, b, c)) / y
    expected = 2.0 * np.pi / (-relative_energy_rate / F)
    assert float(quality_factor(y, F, a, b, c)) == pytest.approx(expected, rel=1e-12)


def test_q_without_losses_and_at_rest() -> None:
    assert quality_factor(0.1, F, 0.0, 0.0, 0.0) == np.inf
    assert quality_factor(0.0, F, A, B, C) == 0.0
    assert quality_factor(0.0, F, A, B, 0.0) == pytest.approx(136.0)
    assert amplitude_rate(0.0, A, B, C) == 0.0


@given(c=st.tuples(positive, positive, positive), inertia=positive, y=positive)
def test_energy_of_eq12_falls_as_the_amplitude_of_eq13(
    c: tuple[float, float, float], inertia: float, y: float
) -> None:
    scale = 0.5 * inertia * (2.0 * np.pi * F) ** 2
    root = np.sqrt(scale) * y
    energy_rate = -(c[0] + c[1] * root + c[2] * root**2) * root
    abc = rates_from_energy_constants(*c, scale)
    # E = s y^2, so E' = 2 s y y'.
    assert 2.0 * scale * y * float(amplitude_rate(y, *abc)) == pytest.approx(energy_rate, rel=1e-12)


def test_hysteretic_quality_factors_of_the_paper() -> None:
    assert hysteretic_quality_factor(0.516, 3940.0) == pytest.approx(1049.0, abs=0.1)
    np.testing.assert_allclose(
        hysteretic_quality_factor([1 / 15.0, 0.5], 3940.0), [17.5, 985.0], rtol=1e-3
    )


def test_eq17_at_the_papers_record() -> None:
    viscous = without_hysteresis(136.0, hysteretic_quality_factor(F, 3940.0))
    assert viscous == pytest.approx(156.3, abs=0.05)


@given(viscous=positive, hysteretic=positive)
def test_eq17_undoes_the_sum_of_losses(viscous: float, hysteretic: float) -> None:
    measured = 1.0 / (1.0 / viscous + 1.0 / hysteretic)
    slack = 1e-12 + 1e-15 * viscous / hysteretic
    assert float(without_hysteresis(measured, hysteretic)) == pytest.approx(viscous, rel=slack)


def test_no_hysteresis_and_nothing_else() -> None:
    assert without_hysteresis(136.0, np.inf) == pytest.approx(136.0, rel=1e-14)
    assert without_hysteresis(136.0, 136.0) == np.inf
    assert without_hysteresis(136.0, 130.0) < 0.0
