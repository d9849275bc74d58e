"""Whether local effects are found at their places: instants, samples and frequencies.

Only what was rightly named is asked where it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe.challenge import intervals
from pendpipe.challenge.solved import Solved

GROUPS: Final = {
    "impulse": "impulses", "equilibrium-step": "steps", "amplitude-step": "steps",
    "frequency-step": "steps", "damping-step": "steps", "dropped-samples": "lost samples",
    "glitches": "glitches", "tone-pickup": "tones", "periodic-drive": "tones",
    "second-mode": "tones",
}  # fmt: skip
"""What is local in time or frequency, and how the page sums it up."""
_INSTANTS: Final = ("impulse", "rest_jump", "omega_jump", "gamma_jump", "scaling", "rub")
_HERTZ: Final = {"tone_hz": 1.0, "hertz": 1.0, "frequency_hz": 1.0, "drive_omega": 0.5 / math.pi}


class Place(NamedTuple):
    """An interval of time (s) or frequency (Hz); of no width where it is a point."""

    low: float
    high: float


def places(items: list[Solved], interval_s: Mapping[str, float]) -> dict[str, Any]:
    """Ask of each kind of local effect that was named whether it is where the answer puts it.

    Parameters
    ----------
    items
        Items with one effect or two.
    interval_s
        Between the samples of each recording, where known.

    Returns
    -------
    dict
        By group: the rate, ``unit``, the median ``width`` of the places reported, and the
        median ``error`` of their middles.
    """
    found: dict[str, list[tuple[bool, float, float]]] = {}
    for item in items:
        for effect in item.truth["effects"]:
            group = GROUPS.get(effect["effect"])
            true = true_place(effect, interval_s.get(item.name))
            told = _reported(item, effect["effect"]) if group and true else None
            if group is None or true is None or told is None:
                continue
            # A sample's place is known to a sample.
            slack = interval_s[item.name] if group in ("lost samples", "glitches") else 0.0
            if group == "glitches":
                held = told.low - slack <= true.low and true.high <= told.high + slack
            else:
                held = told.low - slack <= true.high and true.low <= told.high + slack
            middle = 0.5 * (told.low + told.high)
            error = max(true.low - middle, middle - true.high, 0.0)
            found.setdefault(group, []).append((held, told.high - told.low, error))
    return {
        group: {
            **intervals.of([held for held, _, _ in found[group]]),
            "unit": "Hz" if group == "tones" else "s",
            "width": float(np.median([width for _, width, _ in found[group]])),
            "error": float(np.median([error for _, _, error in found[group]])),
        }
        for group in dict.fromkeys(GROUPS.values())
        if group in found
    }


def true_place(effect: dict[str, Any], interval_s: float | None) -> Place | None:
    """Where an effect is; None where the truth does not tell."""
    known = effect["parameters"]
    for name in _INSTANTS:
        if f"{name}_at" in known:
            begin = float(known[f"{name}_at"])
            return Place(begin, begin + float(known.get(f"{name}_width", 0.0)))
    for name, factor in _HERTZ.items():
        if name in known:
            return Place(factor * float(known[name]), factor * float(known[name]))
    samples = [float(value) for name, value in known.items() if name.startswith("sample")]
    if not samples or interval_s is None:
        return None
    return Place(min(samples) * interval_s, max(samples) * interval_s)


def _reported(item: Solved, name: str) -> Place | None:
    """Where the answer puts an effect that it names: its fitted frequency, or its times."""
    for told in item.answer.content.get("effects") or []:
        if told["id"] != name:
            continue
        if GROUPS[name] == "tones":
            fitted = (told.get("parameters") or {}).values()
            hertz = [each for each in fitted if each.get("unit") == "Hz"]
            ends = hertz[-1].get("interval95") if hertz else None
        else:
            ends = (told.get("location") or {}).get("time_s")
        return Place(*map(float, ends)) if ends else None
    return None
