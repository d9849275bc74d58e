"""b = b_h + b_v: the errors of both parts follow from those of b and of the share."""

from __future__ import annotations

import numpy as np
import pytest

from pendpipe.analysis.fit.by_waveform import split_quality_factors
from pendpipe.dynamics.eq8 import OMEGA, SHARE, B

OMEGA_PER_S = 2.0 * np.pi * 0.9
RATE_PER_S, PART = 0.01, 0.4


@pytest.mark.parametrize("correlation", [-0.8, 0.0, 0.8])
def test_errors_are_the_scatter_of_what_correlated_values_give(correlation: float) -> None:
    """What raises b and lowers the share leaves b_h as it was, and moves b_v twice."""
    value = np.zeros(8)
    value[[OMEGA, SHARE, B]] = OMEGA_PER_S, PART, RATE_PER_S
    sd = np.array([2e-4, 8e-3])
    covariance = np.zeros((8, 8))
    own = np.outer(sd, sd) * np.array([[1.0, correlation], [correlation, 1.0]])
    covariance[np.ix_([B, SHARE], [B, SHARE])] = own
    hysteretic, viscous, _ = split_quality_factors(value, covariance, {})
    assert hysteretic is not None
    assert viscous is not None
    assert hysteretic.value == pytest.approx(OMEGA_PER_S / (2.0 * PART * RATE_PER_S))
    drawn = np.random.default_rng(7).multivariate_normal([RATE_PER_S, PART], own, 40_000)
    for found, parts in ((hysteretic, drawn[:, 1]), (viscous, 1.0 - drawn[:, 1])):
        # Of the rate: Q itself is 1/rate, and no longer normal.
        rates = parts * drawn[:, 0]
        assert found.sd / found.value == pytest.approx(rates.std() / rates.mean(), rel=0.02)
