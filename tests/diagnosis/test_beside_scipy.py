"""Cosines and erfcx against scipy, which costs more to import."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import special
from scipy.fft import dct, idct

from pendpipe.diagnosis.numerics import cosines, from_cosines
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
