"""Scores of an opened set, each with its interval and beside the oracle's."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from pendpipe.challenge import intervals
from pendpipe.challenge.causes import causes
from pendpipe.challenge.families import WITHOUT_STRENGTH
from pendpipe.challenge.promises import promises
from pendpipe.challenge.pulls import pulls_of
from pendpipe.challenge.score_confidence import abstention, calibration
from pendpipe.challenge.score_families import combinations, outside, real, ties, withheld
from pendpipe.challenge.score_naming import confusion, dynamics_or_measurement, naming
from pendpipe.challenge.score_nulls import false_alarms
from pendpipe.challenge.score_peers import peers
from pendpipe.challenge.score_places import places
from pendpipe.challenge.solved import Solved, read_items, six_cases

SEALS: Final = (
    "set", "count", "sealed_at", "answered_at", "opened_at", "seed", "truth_sha256",
    "answers_sha256",
)  # fmt: skip
"""What of an opened set says which it was, and when what was known."""
OBVIOUS: Final = 30.0
"""Delta chi^2 above which an effect that was not detected is listed."""


def score(opened: dict[str, Any], interval_s: Mapping[str, float] | None = None) -> dict[str, Any]:
    """All scores of an opened set.

    Parameters
    ----------
    opened
        Truth and answers.
    interval_s
        Between the samples of each recording, where known: the truth tells the places of
        lost and wild samples by their numbers.
    """
    items = read_items(opened)

    def family(*names: str) -> list[Solved]:
        return [item for item in items if item.truth["family"] in names]

    nulls, singles = family("null"), family("single")
    named = [item for item in family("single", "tie") if item.answer.detected]
    found = {
        "set": {key: opened[key] for key in SEALS},
        "items": len(items),
        "families": dict(Counter(item.truth["family"] for item in items)),
        "unsolved": [item.name for item in items if not item.answer.solved],
        "false_alarms": false_alarms(nulls),
        "detection": detection(singles),
        "naming": naming(family("single", "tie")),
        "dynamics_or_measurement": dynamics_or_measurement(family("single", "tie")),
        "combinations": combinations(family("combination")),
        "outside": outside(family("outside")),
        "ties": ties(family("tie")),
        "withheld": withheld(family("withheld")),
        "real": real(family("real")),
        "pulls": pulls_of([(item.truth, item.answer) for item in singles]),
        "held_out": held_out([item for item in singles if item.answer.detected]),
        "calibration": calibration(family("single", "tie", "outside")),
        "abstention": abstention(family("single", "tie", "outside")),
        "places": places(family("single", "tie", "combination", "real"), interval_s or {}),
        "peers": peers(nulls, singles),
        "confusion": confusion(named),
        "missed": [told(item) for item in family("single", "withheld") if missed(item)],
        "six_cases": [told(item) for item in six_cases(items)],
    }
    judged = promises(found)
    return {**found, "promises": judged, "causes": causes(items, judged)}


def missed(item: Solved) -> bool:
    """An effect that anybody would have seen, and that was not."""
    return item.size > OBVIOUS and not item.answer.detected


def told(item: Solved) -> dict[str, Any]:
    """One item in words, for pages."""
    statement = " ".join(str(item.answer.content.get("statement") or "").split())
    return {
        "item": item.name,
        "hidden": item.effect["effect"],
        "law": item.effect["law"],
        "delta_chi2": item.size,
        "oracle_detected": bool(item.oracle.get("detected")),
        "answer": item.answer.lead,
        "statement": statement or "(no statement)",
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


def held_out(items: list[Solved]) -> dict[str, Any]:
    """Prediction of blocks that were not fitted, beside what knowing the effect would gain.

    Of the two halves each is predicted from the other: an effect of Delta chi^2 lambda,
    estimated from half of the record, gains half of lambda less 1 in log density.
    """
    known = []
    for item in items:
        told = item.answer.content.get("held_out") or {}
        if told.get("gain") is not None and told.get("gain_sd") is not None:
            known.append((item, float(told["gain"]), float(told["gain_sd"])))
    shares = [gain / (0.5 * item.size - 1.0) for item, gain, _ in known if item.size >= 50.0]
    return {
        "improved": intervals.of([gain > 0.0 for _, gain, _ in known]),
        "worse_by_two_errors": intervals.of([gain < -2.0 * sd for _, gain, sd in known]),
        "median_gain": _median([gain for _, gain, _ in known]),
        "share_of_the_expected": intervals.median(shares),
    }


def _median(values: list[float]) -> float | None:
    return float(np.median(values)) if values else None
