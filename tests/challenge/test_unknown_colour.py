"""What a drift is worth to one who does not know the noise's colour."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.unknown_colour import STRENGTHS, likelihoods

from pendpipe_challenge.scenario import Noise

TIME_S = np.arange(300) * 0.5
NOISE = Noise(white_sd=2e-4, alpha=1.2)
LINES = np.column_stack([np.ones_like(TIME_S), TIME_S])


def dense(residual: np.ndarray, strength: float) -> float:
    """The same by the whole covariance matrix and its determinant."""
    slow = NOISE.slow(TIME_S)
    covariance = np.eye(len(TIME_S)) + strength / NOISE.white_sd**2 * slow @ slow.T
    inverse = np.linalg.inv(covariance) / NOISE.white_sd**2
    fitted = np.linalg.solve(LINES.T @ inverse @ LINES, LINES.T @ inverse @ residual)
    left = residual - LINES @ fitted
    return float(-np.linalg.slogdet(covariance)[1] - left @ inverse @ left)


def test_the_likelihood_is_that_of_the_whole_covariance() -> None:
    residual = NOISE.draw(TIME_S, np.random.default_rng(1))
    found = likelihoods(LINES, residual, NOISE.slow(TIME_S), NOISE.white_sd)
    assert found == pytest.approx([dense(residual, each) for each in STRENGTHS], rel=1e-9)


def test_noise_is_told_from_white_and_from_ten_times_redder() -> None:
    """Averaged over draws, the likelihood is greatest at the truth (Gibbs' inequality)."""
    random = np.random.default_rng(2)
    slow = NOISE.slow(TIME_S)
    mean = np.mean(
        [likelihoods(LINES, NOISE.draw(TIME_S, random), slow, NOISE.white_sd) for _ in range(200)],
        axis=0,
    )
    best = STRENGTHS[int(np.argmax(mean))]
    assert best == pytest.approx(1.0, rel=0.5)
