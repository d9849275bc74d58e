"""b = b_h + b_v with a part held: what is left of b, and what it does to the readings."""

import numpy as np
import pytest

from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import white_noise
from pendpipe.diagnosis.refine import refine
from pendpipe.effects.baseline import HYSTERETIC, SHARE, VISCOUS, B, pendulum_of
from pendpipe.effects.model import Model

TIME_S = np.arange(600) / 15.0
VALUE = np.array([7.2e-3, 9.6e-3, 1.3e-4, 0.4, 2.0 * np.pi * 0.9, 0.15, -0.3, 0.01])
RATE = {HYSTERETIC: 0.4 * 9.6e-3, VISCOUS: 0.6 * 9.6e-3}


def model_with(*parts: str) -> Model:
    return Model(TIME_S, 1.0 / 15.0, parts={part: RATE[part] for part in parts})


@pytest.mark.parametrize("part", [HYSTERETIC, VISCOUS])
@pytest.mark.parametrize("factor", [1.0, 1.5, 4.0])
def test_a_held_part_stays_whatever_the_whole_is(part: str, factor: float) -> None:
    value = VALUE.copy()
    value[B] *= factor
    pendulum = pendulum_of(model_with(part).settled(value))
    assert getattr(pendulum, part) == pytest.approx(RATE[part], rel=1e-12)
    assert pendulum.linear == pytest.approx(value[B], rel=1e-12)


def test_two_held_parts_make_the_whole() -> None:
    value = VALUE.copy()
    value[[B, SHARE]] = 0.1, 0.9
    pendulum = pendulum_of(model_with(HYSTERETIC, VISCOUS).settled(value))
    assert pendulum.hysteretic == pytest.approx(RATE[HYSTERETIC], rel=1e-12)
    assert pendulum.viscous == pytest.approx(RATE[VISCOUS], rel=1e-12)


@pytest.mark.parametrize("part", [HYSTERETIC, VISCOUS])
def test_b_acts_on_the_readings_as_its_other_part_does(part: str) -> None:
    """The fit's derivative by b is that of readings with the held part kept."""
    model, rms = model_with(part), 1e-4
    data = Data(TIME_S, model.reading(VALUE), 1.0 / 15.0, True, np.ones(len(TIME_S)))
    fit = refine(model, data, white_noise(data, rms), VALUE, rounds=0)
    assert SHARE not in fit.free
    step = 1e-6
    low, high = VALUE.copy(), VALUE.copy()
    low[B] -= step
    high[B] += step
    change = model.reading(model.settled(high)) - model.reading(model.settled(low))
    slope = change / (2.0 * step)
    by_other = slope - rms * fit.jacobian[:-1, B]
    assert np.linalg.norm(by_other) < 1e-4 * np.linalg.norm(slope)
    # The share's part of it is small, but seen.
    alone = (
        rms * refine(model_with(), data, white_noise(data, rms), VALUE, rounds=0).jacobian[:-1, B]
    )
    assert np.linalg.norm(slope - alone) > 3.0 * np.linalg.norm(by_other)
