"""What a solver answered: an item of an opened set, truth and answer side by side."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Final

from pendpipe_challenge.catalogue import kind_of


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
        Of the first name; NaN where none is stated.
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


def read_answer(entry: dict[str, Any], hidden: Collection[str] = ()) -> Answer:
    """Read one kept answer; a diagnosis that lacks what contract.md asks counts as none.

    What was presumed and fitted is found where it was hidden, and elsewhere no claim.
    """
    diagnosis = entry.get("diagnosis")
    if not isinstance(diagnosis, dict) or diagnosis.get("verdict") == "not-analysable":
        return Answer(False, False, (), float("nan"), diagnosis or {})
    claimed = [
        effect
        for effect in diagnosis.get("effects") or []
        if not effect.get("presumed") or effect["id"] in hidden
    ]
    diagnosis = diagnosis | {"effects": claimed}
    groups, probability = [], float("nan")
    for number, effect in enumerate(claimed):
        rest = sorted(
            effect.get("indistinguishable_from") or [], key=lambda e: -(e.get("probability") or 0)
        )
        groups.append((effect["id"], *(other["id"] for other in rest)))
        if number == 0 and effect.get("probability") is not None:
            probability = float(effect["probability"])
    # Noise alone may be reported of a record that lacks nothing.
    detected = diagnosis.get("verdict") == "missing-physics" or bool(groups)
    return Answer(True, detected, tuple(groups), probability, diagnosis)


def right(name: str, effect: dict[str, Any]) -> bool:
    """Whether a name is true of an effect."""
    return name == effect["effect"] or name in effect.get("also", [])


GROUPS: Final = {
    "restoring torque": ("circular-error", "cubic-stiffness", "quadratic-stiffness", "backlash"),
    "losses": (
        "drag-form",
        "power-law-damping",
        "cubic-damping",
        "stribeck-friction",
        "presliding-friction",
        "coulomb-friction",
        "quadratic-drag",
        "history-force",
        "vortex-shedding",
        "release-transient",
    ),
    "changes in time": (
        "frequency-drift",
        "damping-drift",
        "equilibrium-creep",
        "equilibrium-step",
        "amplitude-step",
        "frequency-step",
        "damping-step",
        "impulse",
    ),
    "drive and other modes": ("second-mode", "plane-coupling", "periodic-drive", "broadband-drive"),
    "sensor": (
        "sensor-quadratic",
        "sensor-cubic",
        "sensor-backlash",
        "offset-drift",
        "gain-drift",
        "ac-coupling",
        "tone-pickup",
    ),
    "clock and converter": (
        "clock-drift",
        "jitter",
        "dropped-samples",
        "glitches",
        "clipping",
        "missing-codes",
        "coarse-quantisation",
    ),
}
"""Six kinds of effect; a case of each is shown."""


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
        Solved(
            name,
            entry["truth"],
            read_answer(
                entry["answer"],
                [
                    name
                    for effect in entry["truth"]["effects"]
                    for name in (effect["effect"], *effect.get("also", []))
                ],
            ),
            read_answer(entry["twin"]) if "twin" in entry else None,
        )
        for name, entry in opened["items"].items()
    ]


def six_cases(items: list[Solved]) -> list[Solved]:
    """The rule: of each of six kinds, the first single in the set's order above 70."""
    found = []
    for effects in GROUPS.values():
        for item in items:
            if (
                item.truth["family"] == "single"
                and item.effect["effect"] in effects
                and item.size > 70.0
            ):
                found.append(item)
                break
    return found
