"""A fit and a diagnosis have one likelihood: of one law they print one noise, p, and errors."""

from typing import Any

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.analysis.fit.quality import small_frequency
from pendpipe.diagnosis.refine import with_errors
from pendpipe.diagnosis.values import constants_of
from pendpipe.dynamics import Eq8, Release, sample
from pendpipe.recording import Recording

from .faults import rounded

COUNT = 30
"""Each torque with each sensor and each step once: 2 · 5 · 3."""
TIME_S = np.arange(1500) / 25.0


def drawn(number: int) -> tuple[Recording, dict[str, Any]]:
    """Springs and pendulums, quiet and loud, of fine and of coarse steps, of all three losses.

    Every fifth sensor is bent, x + 0.02 x^2, or its noise has a memory: what a law leaves widens
    errors.
    """
    rng = np.random.default_rng(number)
    sine = bool(number % 2)
    omega, angle = rng.uniform(4.0, 9.0), rng.uniform(0.05, 0.5)
    rates = rng.uniform(0.0, 0.02, 3) * np.array([1.0 / angle, 1.0, 0.3 * angle])
    law = Eq8(
        omega, rates[0], 0.5 * rates[1], 0.5 * rates[1], rates[2], "sine" if sine else "linear"
    )
    values = sample(law, Release(-rng.uniform(0.0, 0.5), angle, 0.02), TIME_S)
    noise = angle * 10.0 ** rng.uniform(-4.0, -2.5)
    error = noise * rng.standard_normal(len(TIME_S))
    if number % 5 == 3:
        values = values + 0.02 * values**2
    if number % 5 == 4:
        error = error + 0.5 * np.roll(error, 1)
    values = values + error
    if number % 3 == 2:
        values = rounded(values, rng.uniform(0.5, 6.0) * noise)
    return Recording(TIME_S, values, "angle_rad"), {"restoring": law.restoring}


@pytest.mark.slow
def test_a_diagnosis_that_adds_nothing_prints_the_fits_noise_p_and_errors() -> None:
    """Of thirty recordings. Where it adds something, "as fitted" has the fit's numbers still.

    Its own likelihood, by its own engine and with its own noise, says the same where noise alone is
    left: the noise to 10 %, errors of a, b, c to 15 %. A step of a few times the noise makes most
    of it.
    """
    alike = 0
    for number in range(COUNT):
        recording, torque = drawn(number)
        fit, found = pp.fit(recording, **torque), pp.diagnose(recording, **torque)
        if fit.zero_drift is not None:
            # To a diagnosis that is no part of the law, but an effect.
            continue
        law = {**fit.parameters, "frequency": small_frequency(fit)}
        models = [found.baseline]
        if not any(each.identifier != "coloured-noise" for each in found.missing):
            models.append(found.improved)
        for model in models:
            printed = model.noise_rms_rad, model.residual_rms_rad, model.fit_p_value
            assert printed == (fit.noise_rms_rad, fit.residual_rms_rad, fit.fit_p_value), number
            assert model.parameters == law, number
        alike += len(models) - 1
        search = found.search
        if not fit.refuted and search is not None:
            noise = search.data.rms_of_reading(search.noise.rms)
            assert noise == pytest.approx(fit.noise_rms_rad, rel=0.1), number
            own = constants_of(with_errors(search.baseline, search.data, search.noise), "rad")
            for name in "abc":
                assert own[name].sd == pytest.approx(fit.parameters[name].sd, rel=0.15), number
    assert alike >= COUNT // 2
