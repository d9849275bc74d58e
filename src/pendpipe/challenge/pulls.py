"""Pulls and coverage: whether an effect's parameters are right, and their errors."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pendpipe.challenge import intervals
from pendpipe.challenge.answers import Answer

SAME: Final[dict[str, tuple[tuple[str, str, float], ...]]] = {}
"""By effect: name in diagnosis.json, name in the truth, factor from truth to diagnosis."""


def pulls_of(items: list[tuple[dict[str, Any], Answer]]) -> dict[str, Any]:
    """Pulls and coverage of effects that act by the catalogue's own law and were named so."""
    pulls, covered = [], []
    for truth, answer in items:
        effect = truth["effects"][0]
        if not (answer.detected and effect["own_form"] and answer.lead == effect["effect"]):
            continue
        told = answer.content["effects"][0].get("parameters") or {}
        for theirs, ours, factor in SAME.get(effect["effect"], ()):
            estimate = told.get(theirs) or {}
            value, sd = estimate.get("value"), estimate.get("sd")
            if value is None or not sd or ours not in effect["parameters"]:
                continue
            true = factor * effect["parameters"][ours]
            pulls.append((value - true) / sd)
            low, high = estimate.get("interval95") or [value - 1.96 * sd, value + 1.96 * sd]
            covered.append(bool(low <= true <= high))
    spread = np.array(pulls)
    return {
        "parameters": len(pulls),
        "mean": float(spread.mean()) if len(pulls) else None,
        "sd": float(spread.std(ddof=1)) if len(pulls) > 1 else None,
        "robust_sd": float(1.4826 * np.median(np.abs(spread - np.median(spread))))
        if len(pulls) > 1
        else None,
        "coverage95": intervals.of(covered),
    }
