"""Cosines, erfcx and bounded least squares, against scipy, which costs more to import."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special
from scipy.fft import dct, idct
from scipy.optimize import lsq_linear

from pendpipe.diagnosis.numerics import bounded_least_squares, cosines, from_cosines
from pendpipe.effects.catalogue.fluid import erfcx


@given(st.integers(1, 300), st.integers(0, 2**32 - 1))
def test_cosines_of_any_number_of_readings(count: int, seed: int) -> None:
    rows = np.random.default_rng(seed).normal(size=(3, count))
    np.testing.assert_allclose(cosines(rows), dct(rows, norm="ortho"), atol=1e-12)
    np.testing.assert_allclose(from_cosines(rows), idct(rows, norm="ortho"), atol=1e-12)


@given(st.floats(0.0, 0.05), st.floats(0.1, 20.0), st.floats(0.0, 300.0))
def test_the_error_function_of_a_dying_oscillation(decay: float, omega: float, time: float) -> None:
    z = np.sqrt(np.array([(-decay + 1j * omega) * time]))
    np.testing.assert_allclose(erfcx(z), special.erfcx(z), rtol=1e-10, atol=1e-10)


@given(st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_least_squares_within_bounds(count: int, seed: int) -> None:
    generator = np.random.default_rng(seed)
    matrix = generator.normal(size=(count + 2, count))
    right = 10.0 * generator.normal(size=count + 2)
    floor = np.where(generator.random(count) < 0.4, -np.inf, -generator.integers(0, 2, count))
    ceiling = np.where(generator.random(count) < 0.4, np.inf, 3.0 * generator.random(count) + 0.1)
    found = bounded_least_squares(matrix, right, floor, ceiling)
    best = lsq_linear(matrix, right, (floor - 1e-9, ceiling + 1e-9), method="bvls").x
    assert np.all((found >= floor) & (found <= ceiling))
    cost, least = (float(np.sum((matrix @ x - right) ** 2)) for x in (found, best))
    assert cost == pytest.approx(least, rel=1e-5, abs=1e-6)
