"""Simpler judges of the same items: AIC, BIC and a test of whiteness."""

from __future__ import annotations

from typing import Any

import numpy as np

from pendpipe.challenge import intervals
from pendpipe.challenge.answers import right
from pendpipe.challenge.oracle import FREEDOM
from pendpipe.challenge.solved import Solved


def peers(nulls: list[Solved], singles: list[Solved]) -> dict[str, Any]:
    """AIC, BIC and a whiteness test on the same items, with the oracle's own residuals.

    They are given the true noise spectrum and the oracle's linear scores, which flatters
    them.
    """

    def chosen(item: Solved, cost: float) -> str:
        scores = item.oracle["scores"]
        worth = {n: u - cost * FREEDOM.get(n, 1) for n, u in scores.items()}
        best = max(worth, key=lambda name: worth[name])
        return best if worth[best] > 0.0 else ""

    found = {}
    for name in ("aic", "bic", "whiteness"):

        def says(item: Solved, name: str = name) -> str:
            if name == "whiteness":
                return "?" if item.oracle["whiteness_p"] < 0.01 else ""
            cost = 2.0 if name == "aic" else float(np.log(item.truth["nuisances"]["samples"]))
            return chosen(item, cost)

        seen = [item for item in singles if item.oracle and says(item)]
        found[name] = {
            "false_alarms": intervals.of([bool(says(i)) for i in nulls if i.oracle]),
            "detected": intervals.of([bool(says(i)) for i in singles if i.oracle]),
            "top1": None if name == "whiteness" else intervals.of(
                [right(says(i), i.effect) for i in seen]
            ),
        }  # fmt: skip
    return found
