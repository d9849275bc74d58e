"""Readings against Eq. 8: what a Gauss-Newton step needs, against the Jacobian written out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pendpipe.dynamics import Eq8, Release, compare, residuals, sample, sample_with_jacobian

W = 2.0 * math.pi * 0.516
RELEASE = Release(-0.3, -0.068, 0.003)
MODELS = {
    "a long decay": Eq8(W, 0.45, 0.006, 0.006, 1.4e-6),
    "to the stop, and at rest": Eq8(W, 0.45, 0.006, 0.006, 2e-3),
    "by Coulomb friction alone": Eq8(W, coulomb=1e-4),
    "strongly damped": Eq8(W, 1.0, 0.1, 0.3, 0.0),
}


def readings(model: Eq8, time_s: np.ndarray) -> np.ndarray:
    noise = 1e-4 * np.random.default_rng(1).standard_normal(len(time_s))
    return sample(model, RELEASE, time_s) + noise


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("count", [1, 7, 300, 5000])
def test_gradient_and_residual_are_those_of_the_jacobian(name: str, count: int) -> None:
    model = MODELS[name]
    # Uneven times, and none in the middle of the record.
    time_s = np.sort(np.random.default_rng(2).uniform(0.0, 100.0, count))
    time_s = time_s[(time_s < 30.0) | (time_s > 47.0)]
    values = readings(model, time_s)
    angle, jacobian = sample_with_jacobian(model, RELEASE, time_s)
    found = compare(model, RELEASE, time_s, values)
    residual = residuals(model, RELEASE, time_s, values)
    np.testing.assert_allclose(residual, values - angle, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.residual, residual, rtol=0, atol=1e-14)
    assert found.square == pytest.approx(residual @ residual, rel=1e-12)
    size = np.linalg.norm(jacobian, axis=0) * np.linalg.norm(values - angle) + 1e-300
    np.testing.assert_allclose(
        found.gradient / size, jacobian.T @ (values - angle) / size, rtol=0, atol=1e-12
    )


@given(
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.05),
    st.floats(0.0, 0.05),
    st.floats(0.0, 1e-3),
    st.floats(12.0, 300.0),
    st.integers(20, 60),
)
@settings(max_examples=40, deadline=None)
def test_the_normal_matrix_gives_the_precision_of_even_readings(
    a: float, b_h: float, b_v: float, c: float, in_half_cycle: float, half_cycles: int
) -> None:
    model = Eq8(W, a, b_h, b_v, c)
    time_s = np.arange(int(in_half_cycle * half_cycles)) * (math.pi / W / in_half_cycle)
    _, jacobian = sample_with_jacobian(model, RELEASE, time_s)
    normal = compare(model, RELEASE, time_s, np.zeros(len(time_s))).normal
    exact = jacobian.T @ jacobian
    size = np.sqrt(np.diag(exact))
    np.testing.assert_allclose(
        normal / np.outer(size, size), exact / np.outer(size, size), rtol=0, atol=2e-3
    )
    np.testing.assert_array_equal(normal, normal.T)
    # In every direction, above all those that are hard to tell apart.
    values, vectors = np.linalg.eigh(exact / np.outer(size, size))
    for value, vector in zip(values, vectors.T, strict=True):
        if value > 1e-9:
            seen = vector @ (normal / np.outer(size, size)) @ vector
            assert seen == pytest.approx(value, rel=0.03)
