"""Prediction of blocks that a model was not fitted to."""

import math

import numpy as np
import pytest

from pendpipe.diagnosis.held_out import completed, held_out, predicted_worse
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import refine
from pendpipe.effects.catalogue import by_identifier

from .records import NOISE_RAD, VALUES, diagnosed, null_fit


@pytest.mark.parametrize("name", tuple(VALUES))
def test_the_right_effect_predicts_better(name: str) -> None:
    found = diagnosed(name).held_out
    assert found.gain > 0.0
    assert found.gain > found.gain_sd > 0.0
    assert found.gain == found.after - found.before


def test_a_model_gains_nothing_over_itself() -> None:
    fit, data, noise = null_fit()
    found = held_out(fit, fit, data, noise, (), ())
    assert abs(found.gain) < 1e-6
    assert found.gain_sd < 1e-6


def test_the_density_of_noise_is_that_of_its_distribution() -> None:
    """-n/2 (1 + ln 2 pi s^2), with the scatter of a sum of n squares and of the fit."""
    fit, data, noise = null_fit()
    found = held_out(fit, fit, data, noise, (), ())
    count = len(data)
    expected = -0.5 * count * (1.0 + math.log(2.0 * math.pi * NOISE_RAD**2))
    assert abs(found.before - expected) < 4.0 * math.sqrt(0.5 * count) + 2.0 * len(fit.free)


@pytest.mark.parametrize("name", ["sensor-cubic", "frequency-drift", "offset-drift"])
def test_an_effect_that_is_not_there_predicts_no_better(name: str) -> None:
    """One free value more loses half a unit of ln p, give or take a few."""
    fit, data, noise = null_fit()
    effect = by_identifier(name)
    model = fit.model.adding(effect)
    shape = [parameter.default for parameter in effect.parameters[effect.sizes :]]
    more = refine(model, data, noise, np.concatenate([fit.value, [0.0], shape]))
    found = held_out(fit, more, data, noise, (), ())
    assert found.gain < 6.0
    assert found.gain < 3.0 * found.gain_sd + 1.0


def test_a_law_that_only_noise_asked_for_predicted_worse_and_a_right_one_does_not() -> None:
    """A line fitted to noise loses about a unit of ln p for its two sizes."""
    fit, data, noise = null_fit()
    model = fit.model.adding(by_identifier("tone-pickup"))
    more = refine(model, data, noise, np.concatenate([fit.value, [1e-4, 1e-4, 3.3]]))
    assert predicted_worse(fit, more, data, noise, (), (), drawn=False) > 0.0
    found = diagnosed("sensor-cubic").search
    fits = (found.baseline, found.fit, found.data, found.noise)
    assert predicted_worse(*fits, (), found.held, drawn=False) == 0.0


def test_coloured_noise_is_predicted_from_what_is_known() -> None:
    """Noise with a memory: the error of the first missing reading is smaller than the noise."""
    count = 400
    walk = np.cumsum(np.random.default_rng(1).standard_normal(count))
    walk -= walk.mean()
    order = np.maximum(np.arange(count), 0.5)
    spectrum = 1.0 / (2.0 - 2.0 * np.cos(np.pi * order / count))
    noise = Noise(spectrum, np.ones(count))
    out = np.zeros(count, dtype=bool)
    out[150:160] = True
    filled = completed(walk, noise, out)
    straight = np.interp(np.arange(count)[out], np.arange(count)[~out], walk[~out])
    # The mean of a random walk between known readings is a straight line.
    np.testing.assert_allclose(filled[out], straight, atol=0.05 * np.std(walk))
    np.testing.assert_allclose(filled[~out], walk[~out])
