"""Scores of an opened set, each with its interval and beside the oracle's."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from pendpipe.challenge import intervals
from pendpipe.challenge.answers import right
from pendpipe.challenge.families import WITHOUT_STRENGTH
from pendpipe.challenge.oracle import FREEDOM
from pendpipe.challenge.pulls import pulls_of
from pendpipe.challenge.score_families import combinations, outside, real, ties, withheld
from pendpipe.challenge.solved import Solved, read_items


def score(opened: dict[str, Any]) -> dict[str, Any]:
    """All scores of an opened set."""
    items = read_items(opened)

    def family(*names: str) -> list[Solved]:
        return [item for item in items if item.truth["family"] in names]

    nulls, singles = family("null"), family("single")
    named = [item for item in family("single", "tie") if item.answer.detected]
    return {
        "items": len(items),
        "families": dict(Counter(item.truth["family"] for item in items)),
        "unsolved": [item.name for item in items if not item.answer.solved],
        "false_alarms": false_alarms(nulls),
        "detection": detection(singles),
        "naming": naming(family("single", "tie")),
        "dynamics_or_measurement": intervals.of(
            [item.answer.kind == item.effect["kind"] for item in named]
        ),
        "combinations": combinations(family("combination")),
        "outside": outside(family("outside")),
        "ties": ties(family("tie")),
        "withheld": withheld(family("withheld")),
        "real": real(family("real")),
        "pulls": pulls_of([(item.truth, item.answer) for item in singles]),
        "held_out": held_out(named),
        "calibration": calibration(family("single", "tie", "outside")),
        "peers": peers(nulls, singles),
        "confusion": confusion(named),
    }


def alarmed(item: Solved) -> bool:
    """A null called missing physics; the colour of noise that is red is no false alarm."""
    if not item.answer.detected:
        return False
    red = item.truth["nuisances"]["alpha"] > 0.0
    return not (red and set(item.answer.names) <= {"coloured-noise"})


def false_alarms(nulls: list[Solved]) -> dict[str, Any]:
    """How often nothing was called something, at the nominal 1 %."""
    solved = [item for item in nulls if item.answer.solved]
    colour = [item for item in solved if item.answer.detected and not alarmed(item)]
    hard = [item for item in solved if item.truth["nuisances"]["freedom"] > 0.0]
    return {
        **intervals.of([alarmed(item) for item in solved]),
        "nominal": 0.01,
        "named": dict(Counter(item.answer.lead for item in solved if alarmed(item))),
        "rightly_called_coloured": len(colour),
        "heavy_tailed": intervals.of([alarmed(item) for item in hard]),
        "stopped": intervals.of([alarmed(i) for i in solved if i.truth["nuisances"]["stops"]]),
        "oracle": intervals.of([bool(item.oracle["detected"]) for item in nulls if item.oracle]),
    }


def detection(singles: list[Solved]) -> dict[str, Any]:
    """Power against Delta chi^2."""
    tuned = [item for item in singles if item.effect["effect"] not in WITHOUT_STRENGTH]
    sizes = np.array([item.size for item in tuned])
    found = np.array([float(item.answer.detected) for item in tuned])
    largest = np.array([float(item.oracle["detected"]) for item in tuned])
    own = np.array([float(item.oracle["detected_by_effect"]) for item in tuned])
    levels = []
    for low, high in ((0, 6), (6, 12), (12, 20), (20, 35), (35, 70), (70, 200), (200, 1e3),
                      (1e3, np.inf)):  # fmt: skip
        here = (sizes >= low) & (sizes < high)
        if here.any():
            levels.append(
                {
                    "delta_chi2": float(np.median(sizes[here])),
                    "solver": intervals.of((found[here] > 0).tolist()),
                    "oracle": intervals.of((largest[here] > 0).tolist()),
                    "oracle_by_effect": intervals.of((own[here] > 0).tolist()),
                }
            )
    return {
        "levels": levels,
        "against_largest_score": intervals.power_ratio(sizes, found, largest),
        "against_by_effect": intervals.power_ratio(sizes, found, own),
    }


def naming(items: list[Solved]) -> dict[str, Any]:
    """Top-1, top-3 and class among the detected, by size, beside the oracle's."""
    bands = {"all": (0.0, np.inf), "50": (35.0, 70.0), "100": (70.0, 200.0), "400": (200.0, 1e3)}
    found = {}
    for band, (low, high) in bands.items():
        here = [item for item in items if low <= item.size < high]
        solver = [item for item in here if item.answer.detected]
        oracle = [item for item in here if item.oracle.get("detected")]
        hit = [any(right(n, i.effect) for n in i.answer.members) for i in here]
        best = [
            bool(i.oracle.get("detected")) and any(right(n, i.effect) for n in i.oracle["class"])
            for i in here
        ]
        accuracy, ceiling = intervals.of(hit), intervals.of(best)
        found[band] = {
            "top1": intervals.of([right(i.answer.lead, i.effect) for i in solver]),
            "top3": intervals.of(
                [any(right(n, i.effect) for n in i.answer.names[:3]) for i in solver]
            ),
            "class": intervals.of(
                [any(right(n, i.effect) for n in i.answer.members) for i in solver]
            ),
            "class_size": _mean([len(i.answer.members) for i in solver]),
            "oracle_top1": intervals.of([right(i.oracle["named"], i.effect) for i in oracle]),
            "oracle_top3": intervals.of(
                [any(right(n, i.effect) for n in i.oracle["top3"]) for i in oracle]
            ),
            "oracle_class": intervals.of(
                [any(right(n, i.effect) for n in i.oracle["class"]) for i in oracle]
            ),
            "oracle_class_size": _mean([len(i.oracle["class"]) for i in oracle]),
            "class_and_detected": accuracy,
            "oracle_class_and_detected": ceiling,
            "share_of_the_oracle": (
                accuracy["rate"] / ceiling["rate"] if ceiling["rate"] else None
            ),
        }
    return found


def held_out(items: list[Solved]) -> dict[str, Any]:
    """Prediction of blocks that were not fitted."""
    gains = [i.answer.content.get("held_out") or {} for i in items]
    known = [g for g in gains if g.get("gain") is not None and g.get("gain_sd") is not None]
    return {
        "improved": intervals.of([g["gain"] > 0.0 for g in known]),
        "worse_by_two_errors": intervals.of([g["gain"] < -2.0 * g["gain_sd"] for g in known]),
        "median_gain": _median([g["gain"] for g in known]),
    }


def calibration(items: list[Solved]) -> dict[str, Any]:
    """Compare stated probabilities of the first name with how often they come true."""
    told = [i for i in items if i.answer.detected and np.isfinite(i.answer.probability)]
    correct = [right(i.answer.lead, i.effect) for i in told]
    return intervals.calibration(
        np.array([i.answer.probability for i in told]), np.array(correct, dtype=float)
    )


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


def confusion(items: list[Solved]) -> dict[str, dict[str, int]]:
    """Effect hidden against first name."""
    table: dict[str, dict[str, int]] = {}
    for item in items:
        row = table.setdefault(item.effect["effect"], {})
        row[item.answer.lead] = row.get(item.answer.lead, 0) + 1
    return table


def _mean(values: list[int]) -> float | None:
    return float(np.mean(values)) if values else None


def _median(values: list[float]) -> float | None:
    return float(np.median(values)) if values else None
