"""What a solver said of one item, read from its diagnosis.json."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pendpipe.challenge.registry import kind_of


@dataclass(frozen=True)
class Answer:
    """One answer in the terms of the scores.

    Parameters
    ----------
    solved
        Whether there is a diagnosis at all; a recording called not analysable has none.
    detected
        Verdict ``missing-physics``.
    groups
        For each effect found, in order: its name and the rest of its class.
    probability
        Of the first name; NaN where it is not told.
    """

    solved: bool
    detected: bool
    groups: tuple[tuple[str, ...], ...]
    probability: float
    content: dict[str, Any]

    @property
    def lead(self) -> str:
        """The first name, or nothing."""
        return self.groups[0][0] if self.groups else ""

    @property
    def members(self) -> tuple[str, ...]:
        """The first name's class, itself included."""
        return self.groups[0] if self.groups else ()

    @property
    def names(self) -> tuple[str, ...]:
        """All names of all classes."""
        return tuple(name for group in self.groups for name in group)

    @property
    def kind(self) -> str:
        """``dynamics``, ``measurement`` or ``unnamed``; the reading's unnamed is measurement."""
        if self.lead == "unnamed-measurement":
            return "measurement"
        if self.lead.startswith("unnamed-"):
            return "dynamics"
        return kind_of(self.lead) if self.lead else ""


def read_answer(entry: dict[str, Any]) -> Answer:
    """Read one kept answer; a diagnosis that lacks what contract.md asks counts as none."""
    diagnosis = entry.get("diagnosis")
    if not isinstance(diagnosis, dict) or diagnosis.get("verdict") == "not-analysable":
        return Answer(False, False, (), float("nan"), diagnosis or {})
    groups, probability = [], float("nan")
    for number, effect in enumerate(diagnosis.get("effects") or []):
        rest = sorted(
            effect.get("indistinguishable_from") or [], key=lambda e: -(e.get("probability") or 0)
        )
        groups.append((effect["id"], *(other["id"] for other in rest)))
        if number == 0 and effect.get("probability") is not None:
            probability = float(effect["probability"])
    detected = diagnosis.get("verdict") == "missing-physics"
    return Answer(True, detected, tuple(groups), probability, diagnosis)


def right(name: str, effect: dict[str, Any]) -> bool:
    """Whether a name is true of an effect."""
    return name == effect["effect"] or name in effect.get("also", [])
