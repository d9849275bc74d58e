"""False alarms: how often nothing was called something."""

from __future__ import annotations

from collections import Counter
from typing import Any

from pendpipe.challenge import intervals
from pendpipe.challenge.solved import Solved


def alarmed(item: Solved) -> bool:
    """A null called missing physics; the colour of noise that is red is no false alarm."""
    if not item.answer.detected:
        return False
    red = item.truth["nuisances"]["alpha"] > 0.0
    return not (red and set(item.answer.names) <= {"coloured-noise"})


def false_alarms(nulls: list[Solved]) -> dict[str, Any]:
    """How often nothing was called something, at the nominal 1 %."""
    solved = [item for item in nulls if item.answer.solved]
    hard = [item for item in solved if item.truth["nuisances"]["freedom"] > 0.0]
    return {
        **intervals.of([alarmed(item) for item in solved]),
        "nominal": 0.01,
        "at_five_percent": intervals.of([_doubted(i) for i in solved if not _coloured(i)]),
        "named": dict(Counter(item.answer.lead for item in solved if alarmed(item))),
        "rightly_called_coloured": sum(map(_coloured, solved)),
        "heavy_tailed": intervals.of([alarmed(item) for item in hard]),
        "stopped": intervals.of([alarmed(i) for i in solved if i.truth["nuisances"]["stops"]]),
        "oracle": intervals.of([bool(item.oracle["detected"]) for item in nulls if item.oracle]),
    }


def _coloured(item: Solved) -> bool:
    """Red noise rightly called coloured."""
    return item.answer.detected and not alarmed(item)


def _doubted(item: Solved) -> bool:
    """Whether the answer's own p-value lies below 5 %."""
    p_value = item.answer.content.get("p_value")
    return p_value is not None and float(p_value) < 0.05


def noise_of(item: Solved) -> str:
    """A null's noise in words."""
    known = item.truth["nuisances"]
    if known["freedom"] > 0.0:
        return "heavy-tailed noise"
    return "red noise" if known["alpha"] > 0.0 else "white noise"
