"""An item of an opened set: truth and answer side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pendpipe.challenge.answers import Answer, read_answer


@dataclass(frozen=True)
class Solved:
    """One item: its truth, its answer, and its unchanged twin's answer if it has one."""

    name: str
    truth: dict[str, Any]
    answer: Answer
    twin: Answer | None

    @property
    def effect(self) -> dict[str, Any]:
        """The first effect hidden."""
        found: dict[str, Any] = self.truth["effects"][0]
        return found

    @property
    def size(self) -> float:
        """Its Delta chi^2."""
        return float(self.effect["delta_chi2"])

    @property
    def oracle(self) -> dict[str, Any]:
        """The oracle's figures; empty where it was not asked."""
        return self.truth.get("oracle") or {}


def read_items(opened: dict[str, Any]) -> list[Solved]:
    """Items of an opened set."""
    return [
        Solved(name, entry["truth"], read_answer(entry["answer"]),
               read_answer(entry["twin"]) if "twin" in entry else None)
        for name, entry in opened["items"].items()
    ]  # fmt: skip
