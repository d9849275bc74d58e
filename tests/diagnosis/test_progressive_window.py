"""A progressive window finds the motion where a start over the whole record is turns away."""

import math

import numpy as np
import pytest

from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import fit_in_growing_window
from pendpipe.effects.baseline import OMEGA
from pendpipe.effects.catalogue.restoring import circular_error
from pendpipe.effects.model import Model

from .records import swung

RATE_HZ, NOISE_RAD, LINEAR = 20.0, 1e-3, 0.012
OMEGA_TRUE = 6.1
TIME_S = np.arange(2400) / RATE_HZ


def test_circular_error_at_1_4_rad_is_found_from_a_frequency_that_is_12_percent_off() -> None:
    """The first cycles' own frequency is omega (1 - A^2/16): over 120 s that is 11 turns off."""
    angle = swung(TIME_S, 1.4, OMEGA_TRUE, LINEAR)[0]
    values = angle + NOISE_RAD * np.random.default_rng(4).standard_normal(len(TIME_S))
    data = Data(TIME_S, values, 1.0 / RATE_HZ, True, np.ones(len(TIME_S)))
    model = Model(TIME_S, 1.0 / RATE_HZ, (circular_error,), order=20)
    slow = OMEGA_TRUE * (1.0 - 1.4**2 / 16.0)
    start = np.array([0.0, LINEAR, 0.0, 0.5, slow, 1.4, 0.0, 0.0, 1.0])
    fit = fit_in_growing_window(model, data, white_noise(data, NOISE_RAD), start)
    assert fit.chi2 / len(TIME_S) == pytest.approx(1.0, abs=0.1)
    sd = math.sqrt(fit.covariance()[OMEGA, OMEGA])
    assert abs(fit.value[OMEGA] - OMEGA_TRUE) < 5.0 * sd
