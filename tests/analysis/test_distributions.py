"""Probabilities, against scipy, which costs more to import."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from pendpipe.analysis import distributions

_CHANCES = st.floats(1e-280, 1.0, exclude_max=True)


@given(st.lists(st.floats(-37.0, 37.0), min_size=1, max_size=20))
def test_the_normal_distribution_far_into_its_tail(value: list[float]) -> None:
    assert distributions.normal_below(value) == pytest.approx(special.ndtr(value), rel=1e-12)


@given(st.lists(st.floats(-1e3, 37.0), min_size=1, max_size=20))
def test_its_logarithm_where_it_has_underflown(value: list[float]) -> None:
    expected = special.log_ndtr(value)
    assert distributions.log_normal_below(value) == pytest.approx(expected, rel=1e-6, abs=1e-300)


@given(st.floats(0.0, 1300.0), st.integers(1, 40))
def test_chi_squared_of_whole_degrees_of_freedom(score: float, freedom: int) -> None:
    expected = special.gammaincc(0.5 * freedom, 0.5 * score)
    found = distributions.chi2_beyond(score, freedom)
    assert found == pytest.approx(expected, rel=1e-11, abs=1e-285)


@given(_CHANCES)
def test_chi_squared_of_a_chance_and_back(p_value: float) -> None:
    score = distributions.chi2_of_one(p_value)
    assert distributions.chi2_beyond(score, 1) == pytest.approx(p_value, rel=1e-8)


@given(st.integers(0, 3000), st.floats(1e-3, 5000.0))
def test_poisson_counts(count: int, mean: float) -> None:
    up_to = special.gammaincc(count + 1.0, mean)
    from_there = special.gammainc(count, mean) if count else 1.0
    assert distributions.poisson_up_to(count, mean) == pytest.approx(up_to, rel=1e-9, abs=1e-15)
    assert distributions.poisson_from(count, mean) == pytest.approx(from_there, rel=1e-9, abs=1e-15)


@given(st.floats(1.0, 1e6), st.floats(1e-3, 40.0))
def test_the_tails_of_students_distribution(freedom: float, value: float) -> None:
    found = distributions.student_beyond(np.array([freedom]), np.array([value]))
    expected = 2.0 * special.stdtr(freedom, -value)
    assert found[0] == pytest.approx(expected, rel=1e-6, abs=1e-280)


@given(st.integers(1, 60), st.integers(60, 40000), st.floats(1e-9, 0.5))
def test_so_many_of_rare_events(count: int, number: int, chance: float) -> None:
    found = distributions.binomial_at_least(count, number, chance)
    assert found == pytest.approx(special.bdtrc(count - 1, number, chance), rel=1e-8, abs=1e-280)


@given(st.floats(0.0, 3.0), st.sampled_from([1, 2, 3, 26, 101, 4000]))
def test_chi_squared_of_many_degrees_of_freedom(ratio: float, freedom: int) -> None:
    found = distributions.chi_square_p_value(ratio * freedom, freedom)
    assert found == pytest.approx(special.chdtrc(freedom, ratio * freedom), rel=1e-9, abs=1e-280)


@given(st.floats(0.0, 50.0), st.integers(1, 300), st.integers(1, 300))
def test_a_ratio_of_variances(ratio: float, numerator: int, denominator: int) -> None:
    found = distributions.variance_ratio_p_value(ratio, numerator, denominator)
    assert found == pytest.approx(special.fdtrc(numerator, denominator, ratio), rel=1e-8, abs=1e-12)
