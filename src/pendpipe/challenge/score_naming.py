"""Scores of the names given, beside the oracle's."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pendpipe.challenge import intervals
from pendpipe.challenge.answers import right
from pendpipe.challenge.registry import kind_of
from pendpipe.challenge.solved import Solved

BANDS: Final = {
    "all": (0.0, np.inf), "50": (35.0, 70.0), "100": (70.0, 200.0), "400": (200.0, 1e3),
}  # fmt: skip
"""Of Delta chi^2, by the size that was wanted."""


def naming(items: list[Solved]) -> dict[str, Any]:
    """Top-1, top-3 and class among the detected, by size, beside the oracle's."""
    return {
        band: _of_band([item for item in items if low <= item.size < high])
        for band, (low, high) in BANDS.items()
    }


def _of_band(items: list[Solved]) -> dict[str, Any]:
    """Names of one band; accuracies of both judges are over all items, found or not."""
    solver = [item for item in items if item.answer.detected]
    oracle = [item for item in items if item.oracle.get("detected")]
    hit = [any(right(n, i.effect) for n in i.answer.members) for i in items]
    best = [bool(i.oracle.get("detected")) and _in_oracles(i, "class") for i in items]
    sizes = [len(i.answer.members) for i in solver]
    ceilings = [len(i.oracle["class"]) for i in oracle]
    return {
        "top1": intervals.of([right(i.answer.lead, i.effect) for i in solver]),
        "top3": intervals.of([any(right(n, i.effect) for n in i.answer.names[:3]) for i in solver]),
        "class": intervals.of([any(right(n, i.effect) for n in i.answer.members) for i in solver]),
        "class_size": _mean(sizes),
        "oracle_top1": intervals.of([right(i.oracle["named"], i.effect) for i in oracle]),
        "oracle_top3": intervals.of([_in_oracles(i, "top3") for i in oracle]),
        "oracle_class": intervals.of([_in_oracles(i, "class") for i in oracle]),
        "oracle_class_size": _mean(ceilings),
        "class_size_ratio": intervals.ratio(sizes, ceilings),
        "class_and_detected": intervals.of(hit),
        "oracle_class_and_detected": intervals.of(best),
        "share_of_the_oracle": intervals.ratio(hit, best, paired=True),
    }


def _in_oracles(item: Solved, names: str) -> bool:
    return any(right(name, item.effect) for name in item.oracle[names])


def dynamics_or_measurement(items: list[Solved]) -> dict[str, Any]:
    """Whether the fault is looked for in the pendulum or in the instrument, of the detected."""
    oracle = [item for item in items if item.oracle.get("detected")]
    return {
        **intervals.of([i.answer.kind == i.effect["kind"] for i in items if i.answer.detected]),
        "oracle": intervals.of([kind_of(i.oracle["named"]) == i.effect["kind"] for i in oracle]),
    }


def confusion(items: list[Solved]) -> dict[str, dict[str, int]]:
    """Effect hidden against first name."""
    table: dict[str, dict[str, int]] = {}
    for item in items:
        row = table.setdefault(item.effect["effect"], {})
        row[item.answer.lead] = row.get(item.answer.lead, 0) + 1
    return table


def _mean(values: list[int]) -> float | None:
    return float(np.mean(values)) if values else None
