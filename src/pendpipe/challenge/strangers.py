"""Effects that the catalogue does not have."""

from __future__ import annotations

from typing import Any

import numpy as np

from pendpipe.challenge.hidden import OUTSIDE, Hidden
from pendpipe.challenge.item import Item, about, effect_truth, judge, oracle_truth, truth_of
from pendpipe.challenge.registry import hide
from pendpipe.challenge.scenario import draw_scenario
from pendpipe.challenge.singles import TRIES, easier
from pendpipe.challenge.sizing import Sized, size


def make_outside(
    random: np.random.Generator, name: str, delta_chi2: float, *, oracle: bool = True,
    **scenario_options: Any,
) -> Item:  # fmt: skip
    """Hide what the catalogue does not have, sized by what its best entry leaves of it.

    Parameters
    ----------
    name
        A key of `hidden.OUTSIDE` (``magnet-near-centre``, ``rough-spot``, ...).
    delta_chi2
        Delta chi^2 that no single entry of the catalogue can take up
        (``left_by_catalogue``); ``delta_chi2`` of the truth is the whole effect's.
    """
    for _ in range(TRIES):
        hidden = hide(random, name, draw_scenario(random, **easier(scenario_options)))
        found = _size_by_rest(hidden, delta_chi2)
        if found is None:
            continue
        sized, rest, mimic = found
        codes = sized.scenario.record(random)
        entry = effect_truth(sized) | {"left_by_catalogue": rest, "best_mimic": mimic}
        truth = truth_of("outside", sized.without, [entry], sized.bench)
        if oracle:
            verdict = judge(sized.bench, sized.point, sized.scenario, codes)
            truth["oracle"] = oracle_truth(verdict, hidden.effect)
        return Item(sized.scenario, codes, truth)
    raise ValueError(f"{name} can't be made at {delta_chi2}")


def outside_names() -> tuple[str, ...]:
    """What `make_outside` can hide."""
    return tuple(OUTSIDE)


def _size_by_rest(hidden: Hidden, wanted: float) -> tuple[Sized, float, str] | None:
    """Size by what the best catalogue entry leaves of a noise-free reading."""
    whole = 2.0 * wanted
    for _ in range(5):
        sized = size(hidden, whole)
        if sized is None:
            return None
        scores = about(sized.bench, sized.point).clean_scores(sized.residual)
        mimic = max(scores, key=lambda name: scores[name])
        rest = sized.delta_chi2 - scores[mimic]
        if abs(rest / wanted - 1.0) < 0.15:
            return sized, rest, mimic
        whole *= float(np.clip(wanted / max(rest, 1e-3), 0.02, 30.0))
        if whole > 1e6:
            return None
    return None
