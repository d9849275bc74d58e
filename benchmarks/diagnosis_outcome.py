"""One recording of `benchmarks.diagnosis`, and what of its answer is right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

Outcome = dict[str, Any]


def share(hits: int, count: int) -> str:
    """A rate with its 95 % interval (Clopper and Pearson)."""
    if count == 0:
        return "-"
    from scipy.stats import binomtest

    low, high = binomtest(hits, count).proportion_ci(0.95, "exact")
    return f"{hits}/{count} = {100 * hits / count:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def of(done: Sequence[Outcome], family: str) -> list[Outcome]:
    """The recordings of a family."""
    return [entry for entry in done if entry["family"] == family]


def classes(entry: Outcome) -> list[list[str]]:
    """The class of each effect that was reported, the leader first."""
    return [[name, *rest] for name, _, rest in entry["effects"]]


def found(entry: Outcome) -> bool:
    """Whether anything was detected."""
    return bool(entry["effects"])


def oracle_found(entry: Outcome) -> bool:
    """The same of the oracle."""
    return bool(entry["oracle"]["detected"])


def in_class(entry: Outcome) -> bool:
    """Whether the first effect's class holds the truth."""
    right = set(entry["right"][0])
    return any(right & set(names) for names in classes(entry)[:1])


def in_a_class(entry: Outcome) -> bool:
    """Whether the class of any effect that was reported holds the truth."""
    right = set(entry["right"][0])
    return any(right & set(names) for names in classes(entry))


def first(entry: Outcome) -> bool:
    """Whether the first name is the truth."""
    return bool(entry["effects"]) and entry["effects"][0][0] in entry["right"][0]


def oracle_in_class(entry: Outcome) -> bool:
    """Whether the oracle's class holds the truth."""
    right = set(entry["right"][0])
    return oracle_found(entry) and bool(right & set(entry["oracle"]["class"] or []))


def oracle_first(entry: Outcome) -> bool:
    """Whether the oracle's first name is the truth."""
    return oracle_found(entry) and entry["oracle"]["named"] in entry["right"][0]


def oracle_tells_apart(entry: Outcome) -> bool:
    """Whether nothing but the truth is in the oracle's class."""
    return oracle_first(entry) and len(entry["oracle"]["class"]) == 1
