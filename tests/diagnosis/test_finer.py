"""Between the instants of a scan: the fit must end where one from the truth does."""

import math

import numpy as np
import pytest

from pendpipe.diagnosis.data import gather
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.projection import finer_shape
from pendpipe.diagnosis.refine import refine
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model

OMEGA = 2.0 * math.pi * 0.9
BASE = np.array([7.2e-3, 9.6e-3, 1.3e-4, 0.5, OMEGA, 0.15, -0.3, 0.01])
TIME = np.arange(0.0, 200.0, 0.05)
NOISE = 1e-4


@pytest.mark.parametrize(
    ("identifier", "size"),
    [
        ("impulse", 1e-3),
        ("equilibrium-step", 5e-5),
        ("amplitude-step", 3e-3),
        ("dropped-samples", 4e-4),
    ],
)
@pytest.mark.parametrize("instant", [41.3, 120.6])
def test_an_instant_is_found_from_the_nearest_row(
    identifier: str, size: float, instant: float
) -> None:
    effect = by_identifier(identifier)
    truth = np.append(BASE, [size, instant])
    model = Model(TIME, 0.05)
    noise_values = NOISE * np.random.default_rng(4).standard_normal(len(TIME))
    readings = model.adding(effect).reading(truth) + noise_values
    data = gather(
        TIME, readings, step=None, unit="rad", counts=False, period_s=1.1, noise_rms=NOISE
    )
    noise = white_noise(data, NOISE)
    base = refine(model, data, noise, BASE)
    rows = np.unique([row[0] for row in effect.shapes(base.at.span)])
    nearest = float(rows[np.argmin(np.abs(rows - instant))])
    shape = finer_shape(base, noise, effect, (nearest,))
    start = np.concatenate([base.value, [0.0], shape])
    found = refine(model.adding(effect), data, noise, start)
    best = refine(model.adding(effect), data, noise, truth)
    assert base.chi2 - best.chi2 > 60.0
    assert found.chi2 < best.chi2 + 3.0


def test_effects_that_vary_slowly_need_no_closer_look() -> None:
    model = Model(TIME, 0.05)
    data = gather(
        TIME,
        model.reading(BASE),
        step=None,
        unit="rad",
        counts=False,
        period_s=1.1,
        noise_rms=NOISE,
    )
    noise = white_noise(data, NOISE)
    base = refine(model, data, noise, BASE)
    assert finer_shape(base, noise, by_identifier("frequency-step"), (70.0,)) == (70.0,)
