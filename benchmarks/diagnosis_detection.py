"""Detection of single effects in the table of `benchmarks.diagnosis`: by size, and by effect."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks import diagnosis_outcome as outcome
from benchmarks.diagnosis_outcome import Outcome


def detection(done: Sequence[Outcome]) -> str:
    """How many single effects are found and named at each size, and the sizes of each effect."""
    singles = outcome.of(done, "single")
    if not singles:
        return ""
    return "\n\n".join(
        ["**Single effects**", _by_size(singles), _reached(singles), _by_effect(singles)]
    )


def _by_size(singles: Sequence[Outcome]) -> str:
    rows = ["| Delta chi^2 | detected | oracle | class right | oracle | first | oracle |",
            "|---|---|---|---|---|---|---|"]  # fmt: skip
    for size in sorted({entry["size"] for entry in singles}):
        part = [entry for entry in singles if entry["size"] == size]
        tests = (
            outcome.found, outcome.oracle_found, outcome.in_class, outcome.oracle_in_class,
            outcome.first, outcome.oracle_first,
        )  # fmt: skip
        counts = [sum(test(entry) for entry in part) for test in tests]
        cells = " | ".join(f"{100 * count / len(part):.0f} %" for count in counts)
        rows.append(f"| {size:g} ({len(part)}) | {cells} |")
    return "\n".join(rows)


def _power(singles: Sequence[Outcome]) -> dict[str, Any]:
    from pendpipe_challenge.intervals import power_ratio

    sizes = np.array([entry["size"] for entry in singles])
    ours, best = (
        np.array([float(test(entry)) for entry in singles])
        for test in (outcome.found, outcome.oracle_found)
    )
    return power_ratio(sizes, ours, best)


def _reached(singles: Sequence[Outcome]) -> str:
    """Delta chi^2 at which half and nine tenths of the effects are detected, and the oracle's."""
    power = _power(singles)
    if "half" not in power:
        return "Too few to say where half and nine tenths are detected."
    said = []
    for key, words in (("half", "Half"), ("nine_tenths", "Nine tenths")):
        one = power[key]
        said.append(
            f"{words} are detected at {one['found']:.3g}, by the oracle at {one['oracle']:.3g}:"
            f" {_ratio(one)}."
        )
    return " ".join(said)


def _by_effect(singles: Sequence[Outcome]) -> str:
    """The same for each effect."""
    rows = ["| effect | half at | oracle | times | nine tenths at | oracle | times |",
            "|---|---|---|---|---|---|---|"]  # fmt: skip
    for name in sorted({entry["names"][0] for entry in singles}):
        power = _power([entry for entry in singles if entry["names"][0] == name])
        if "half" not in power:
            continue
        cells = (
            f"{one['found']:.3g} | {one['oracle']:.3g} | {_ratio(one)}"
            for one in (power["half"], power["nine_tenths"])
        )
        rows.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(rows)


def _ratio(one: dict[str, Any]) -> str:
    low, high = one["interval95"]
    return f"{one['ratio']:.2f} ({low:.2f} to {high:.2f})"
