"""Which effects are refitted."""

from __future__ import annotations

import numpy as np
import pytest

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.detect import Detection, Lead
from pendpipe.diagnosis.evidence import NO_SCAN
from pendpipe.diagnosis.refine import pulled, refine
from pendpipe.diagnosis.refits import refit_leads
from pendpipe.effects.baseline import A, C
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model

from .records import INTERVAL_S, LINEAR, TIME_S, TRUTH, prepared, white


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
        gross=False,
        origin=base.value,
    )
    asked = {rival.identifier for rival in rivals}
    assert ("power-law-damping" in asked) == at_a_bound
