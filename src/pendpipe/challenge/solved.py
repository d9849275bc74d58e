"""An item of an opened set: truth and answer side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from pendpipe.challenge.answers import Answer, read_answer

GROUPS: Final = {
    "restoring torque": ("circular-error", "cubic-stiffness", "quadratic-stiffness", "backlash"),
    "losses": (
        "drag-form", "power-law-damping", "cubic-damping", "stribeck-friction",
        "presliding-friction", "coulomb-friction", "quadratic-drag", "history-force",
        "vortex-shedding", "release-transient",
    ),
    "changes in time": (
        "frequency-drift", "damping-drift", "equilibrium-creep", "equilibrium-step",
        "amplitude-step", "frequency-step", "damping-step", "impulse",
    ),
    "drive and other modes": ("second-mode", "plane-coupling", "periodic-drive",
                              "broadband-drive"),
    "sensor": ("sensor-quadratic", "sensor-cubic", "sensor-backlash", "offset-drift",
               "gain-drift", "ac-coupling", "tone-pickup"),
    "clock and converter": ("clock-drift", "jitter", "dropped-samples", "glitches", "clipping",
                            "missing-codes", "coarse-quantisation"),
}  # fmt: skip
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
        Solved(name, entry["truth"], read_answer(entry["answer"]),
               read_answer(entry["twin"]) if "twin" in entry else None)
        for name, entry in opened["items"].items()
    ]  # fmt: skip


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
