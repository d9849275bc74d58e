"""A held part of b that is released moves the readings as that part alone does."""

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.effects.baseline import HYSTERETIC, SHARE, VISCOUS, B
from pendpipe.effects.model import Model

from .records import INTERVAL_S, NOISE_RAD, TIME_S, TRUTH, other_engine, prepared, white

RATES = {HYSTERETIC: 6e-3, VISCOUS: 4e-3}
"""The parts of b, in 1/s."""
NAMES = {HYSTERETIC: "quality_factor_hysteretic", VISCOUS: "quality_factor_viscous"}


def values(rates: dict[str, float]) -> FloatArray:
    found = TRUTH.copy()
    found[B] = sum(rates.values())
    found[SHARE] = rates[HYSTERETIC] / found[B]
    return found


def held(rates: dict[str, float], parts: list[str]) -> Fit:
    """A fit that holds parts of b at what they are."""
    data, noise = prepared(other_engine(values(rates)) + white(4))
    model = Model(TIME_S, INTERVAL_S, parts={part: rates[part] for part in parts})
    return refine(model, data, noise, values(rates))


def by_part(fit: Fit, part: str) -> FloatArray:
    """By differences: what the readings do when a part alone changes, over the noise."""
    rates = {HYSTERETIC: fit.value[B] * fit.value[SHARE]}
    rates[VISCOUS] = fit.value[B] - rates[HYSTERETIC]
    model, change = Model(TIME_S, INTERVAL_S), 1e-6
    ends = []
    for sign in (-1.0, 1.0):
        moved = fit.value.copy()
        there = rates | {part: rates[part] + sign * change}
        moved[B] = sum(there.values())
        moved[SHARE] = there[HYSTERETIC] / moved[B]
        ends.append(model.reading(moved))
    return (ends[1] - ends[0]) / (2.0 * change * NOISE_RAD)


@pytest.mark.parametrize("part", [HYSTERETIC, VISCOUS])
def test_beside_a_held_other_part_it_is_that_part_s_derivative(part: str) -> None:
    fit = held(RATES, [HYSTERETIC, VISCOUS])
    expected = by_part(fit, part)
    found = ReleasedParameter(NAMES[part]).sensitivity(fit)[:-1]
    assert found == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("part", [HYSTERETIC, VISCOUS])
def test_beside_a_fitted_other_part_it_adds_what_that_one_lacks(part: str) -> None:
    """With b's own derivative it spans what both parts do."""
    fit = held(RATES, [part])
    both = np.column_stack([by_part(fit, each) for each in (HYSTERETIC, VISCOUS)])
    own = ReleasedParameter(NAMES[part]).sensitivity(fit)[:-1]
    spanned = np.column_stack([fit.jacobian[:-1, B], own])
    left = both - spanned @ np.linalg.lstsq(spanned, both, rcond=None)[0]
    assert np.abs(left).max() < 1e-4 * np.abs(both).max()


@pytest.mark.parametrize("part", [HYSTERETIC, VISCOUS])
def test_where_the_other_part_is_nothing_it_is_all_of_b(part: str) -> None:
    rates = dict.fromkeys(RATES, 0.0) | {part: 1e-2}
    data, noise = prepared(other_engine(values(rates)) + white(4))
    model = Model(TIME_S, INTERVAL_S, parts={part: rates[part]})
    fit = refine(model, data, noise, values(rates), held=[B])
    expected = by_part(fit, part)
    found = ReleasedParameter(NAMES[part]).sensitivity(fit)[:-1]
    assert found == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())
