"""Which effects are refitted, and which refits are carried to the end."""

from dataclasses import replace

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.detect import Detection, Lead
from pendpipe.diagnosis.refine import pulled, refine
from pendpipe.diagnosis.rivals import (
    NEAR,
    NO_SCAN,
    Rival,
    _names_first,
    of_one_class,
    refit_leads,
    side_by_side,
    useful_chi2,
)
from pendpipe.effects.baseline import A, C
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model

from .records import INTERVAL_S, LINEAR, TIME_S, TRUTH, null_fit, prepared, stribeck_record, white


@pytest.mark.parametrize("gain", [0.0, 20.0, 100.0, 400.0, 1e4])
def test_effects_of_the_best_ones_class_are_useful(gain: float) -> None:
    fit, _, _ = null_fit()
    lead = Lead(by_identifier("cubic-stiffness"), (), gain, 0.0)
    best = Rival(lead, fit, gain, gain, gain)
    at_the_limit = gain - useful_chi2(0.0, gain, drawn=False)
    behind = replace(best, gain=at_the_limit, worth=at_the_limit, evidence=at_the_limit)
    assert not of_one_class(best, behind)


@pytest.mark.parametrize("gain", [20.0, 400.0, 1e4])
def test_a_name_may_end_farther_behind_a_curve_than_behind_a_name(gain: float) -> None:
    """It has fewer values; but what explains a third of what a curve does is of no use."""
    behind_a_curve, behind_a_name = (useful_chi2(0.0, gain, drawn=each) for each in (True, False))
    assert behind_a_name < behind_a_curve < 2.0 / 3.0 * gain + NEAR


def test_in_a_gross_misfit_every_refit_ends_at_its_minimum() -> None:
    """Otherwise only those that come near the best: here the true friction."""
    model, data, noise, truth = stribeck_record()
    base = refine(model.bare(), data, noise, truth[:-2])
    names = {"stribeck-friction": (float(truth[-1]),), "damping-drift": (100.0,)}
    leads = [Lead(by_identifier(name), shape, 0.0, 0.0) for name, shape in names.items()]
    whole = side_by_side(base, data, noise, leads, (), phase_lost=True)
    near = side_by_side(base, data, noise, leads, (), phase_lost=False)
    for lead, fit in whole:
        start = np.concatenate([base.value, [0.0], lead.shape])
        alone = refine(base.model.adding(lead.effect), data, noise, start)
        assert fit.chi2 == pytest.approx(alone.chi2, abs=0.1)
    (_, best), (_, rival) = near
    assert best.chi2 == pytest.approx(whole[0][1].chi2, abs=1.0)
    assert rival.chi2 > best.chi2 + 50.0
    assert not rival.converged


def _detection(scores: dict[str, tuple[float, tuple[float, ...]]]) -> Detection:
    """The result of a scan, with negligible p-values."""
    leads = [
        Lead(by_identifier(name), shape, score, 0.0) for name, (score, shape) in scores.items()
    ]
    return Detection(tuple(leads), 0.0, NO_SCAN)


@pytest.mark.parametrize(("others", "at_a_bound"), [(LINEAR, True), (TRUTH, False)])
def test_an_effect_whose_score_a_bound_halves_is_refitted(
    others: FloatArray, at_a_bound: bool
) -> None:
    """A loss between b and a needs a negative c, which the score keeps at zero."""
    power = by_identifier("power-law-damping")
    truth = np.concatenate([others, [5e-4, 1.4, 1.0]])
    readings = Model(TIME_S, INTERVAL_S, (power,)).reading(truth)
    data, noise = prepared(readings + white(3))
    base = refine(Model(TIME_S, INTERVAL_S), data, noise, others)
    assert ({A, C} & set(pulled(base)) != set()) == at_a_bound
    rivals = refit_leads(
        base,
        data,
        noise,
        _detection({"damping-drift": (100.0, (40.0,)), "power-law-damping": (50.0, (1.5, 0.0))}),
        held=(),
        phase_lost=False,
    )
    asked = {rival.identifier for rival in rivals}
    assert ("power-law-damping" in asked) == at_a_bound


@pytest.mark.parametrize(
    ("behind", "first"), [(1.0, "presliding-friction"), (30.0, "frequency-step")]
)
def test_in_a_misfit_a_law_that_acts_throughout_comes_before_an_event(
    behind: float, first: str
) -> None:
    """A step takes a part of any misfit; one that explains it far better leads."""
    fit, _, _ = null_fit()
    rivals = [
        Rival(Lead(by_identifier(name), (), 0.0, 0.0), fit, gain, worth, worth)
        for name, gain, worth in (
            ("frequency-step", 1000.0, 60.0),
            ("presliding-friction", 900.0, 60.0 - behind),
        )
    ]
    assert _names_first(rivals)[0].identifier == first
