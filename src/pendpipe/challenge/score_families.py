"""Scores of the families beside singles and nulls."""

from __future__ import annotations

from collections import Counter
from typing import Any, Final

from pendpipe.challenge import intervals
from pendpipe.challenge.answers import right
from pendpipe.challenge.solved import Solved

CONFIDENT: Final = 0.8


def combinations(items: list[Solved]) -> dict[str, Any]:
    """Two effects: both, one or none found, cancelling pairs apart."""

    def each(item: Solved) -> list[bool]:
        return [any(right(n, e) for n in item.answer.names) for e in item.truth["effects"]]

    plain = [item for item in items if not item.truth["cancelling"]]
    hiding = [item for item in items if item.truth["cancelling"]]
    large = [i for i in plain if all(e["delta_chi2"] > 200 for e in i.truth["effects"])]
    return {
        "both": intervals.of([all(each(item)) for item in plain]),
        "both_at_400": intervals.of([all(each(item)) for item in large]),
        "either": intervals.of([any(each(item)) for item in plain]),
        "oracle_both": intervals.of([all(i.oracle["found_each"]) for i in plain if i.oracle]),
        "cancelling_detected": intervals.of([item.answer.detected for item in hiding]),
        "cancelling_oracle": intervals.of([i.oracle["detected"] for i in hiding if i.oracle]),
        "cancelling_either": intervals.of([any(each(item)) for item in hiding]),
    }


def confident_and_wrong(item: Solved) -> bool:
    """Whether what is outside the catalogue was given a name of it without doubt."""
    named = item.answer.detected and not item.answer.lead.startswith("unnamed-")
    return named and item.answer.probability > CONFIDENT


def outside(items: list[Solved]) -> dict[str, Any]:
    """Effects outside the catalogue: unnamed, of the right kind, or confidently wrong."""
    large = [item for item in items if item.effect["left_by_catalogue"] > 70.0]

    def unnamed(item: Solved) -> bool:
        return item.effect["effect"] in item.answer.names

    return {
        "detected": intervals.of([item.answer.detected for item in items]),
        "oracle_detected": _oracle_detected(items),
        "unnamed_of_the_right_kind": intervals.of([unnamed(i) for i in large]),
        "unnamed_of_any_kind": intervals.of(
            [any(n.startswith("unnamed-") for n in i.answer.names) for i in large]
        ),
        "confident_wrong_names": intervals.of([confident_and_wrong(i) for i in items]),
        "confident_wrong_names_of_large_ones": intervals.of(
            [confident_and_wrong(i) for i in large]
        ),
        "named": dict(Counter(i.answer.lead for i in items if i.answer.detected)),
    }


def ties(items: list[Solved]) -> dict[str, Any]:
    """Rivals that one record cannot tell apart: the class and what would decide."""
    found = [item for item in items if item.answer.detected]

    def credited(item: Solved) -> bool:
        entry = item.answer.content["effects"][0]
        hit = any(right(n, item.effect) for n in item.answer.members)
        return hit and len(item.answer.members) > 1 and bool(entry.get("deciding_measurement"))

    return {
        "class_and_deciding_measurement": intervals.of([credited(item) for item in found]),
        "lone_confident_names": intervals.of(
            [len(i.answer.members) == 1 and i.answer.probability > CONFIDENT for i in found]
        ),
        "in_class": intervals.of(
            [any(right(n, i.effect) for n in i.answer.members) for i in found]
        ),
        "oracle_in_class": _oracle_in_class(items),
    }


def withheld(items: list[Solved]) -> dict[str, Any]:
    """Known physics that the baseline lacks, at full size."""
    return {
        "detected": intervals.of([item.answer.detected for item in items]),
        "oracle_detected": _oracle_detected(items),
        "in_class": intervals.of(
            [any(right(n, i.effect) for n in i.answer.members) for i in items]
        ),
        "oracle_in_class": _oracle_in_class(items),
    }


def _oracle_detected(items: list[Solved]) -> dict[str, Any]:
    return intervals.of([bool(item.oracle["detected"]) for item in items if item.oracle])


def _oracle_in_class(items: list[Solved]) -> dict[str, Any]:
    """Of those that the oracle detects: its class holds what was hidden."""
    seen = [item for item in items if item.oracle.get("detected")]
    return intervals.of([any(right(n, i.effect) for n in i.oracle["class"]) for i in seen])


def real(items: list[Solved]) -> dict[str, Any]:
    """Real recordings: the change is named, and its twin's answer does not name it."""
    changed = [any(right(n, i.effect) for n in i.answer.names) for i in items]
    before = [i.twin is not None and any(right(n, i.effect) for n in i.twin.names) for i in items]
    pairs = list(zip(changed, before, strict=True))
    return {
        "named": intervals.of(changed),
        "named_without_it": intervals.of(before),
        "newly_named": intervals.of([c and not b for c, b in pairs]),
        "by_change": {
            i.name: {"effect": i.effect["effect"], "source": i.truth["source"],
                     "named": c, "twin_named": b}
            for i, c, b in zip(items, changed, before, strict=True)
        },
    }  # fmt: skip
