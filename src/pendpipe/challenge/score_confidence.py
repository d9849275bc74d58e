"""Whether stated probabilities come true, and what keeping silent on the small ones would gain."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from pendpipe.challenge import intervals
from pendpipe.challenge.answers import right
from pendpipe.challenge.solved import Solved

THRESHOLDS: Final = tuple(np.linspace(0.0, 0.95, 20).round(2).tolist())
"""Probabilities below which an answer might be withheld."""


def rated(items: list[Solved]) -> list[Solved]:
    """Items whose first name has a probability."""
    return [i for i in items if i.answer.detected and np.isfinite(i.answer.probability)]


def true_of_any(item: Solved) -> bool:
    """Whether the first name is that of an effect that is there: of two, either may come first."""
    return any(right(item.answer.lead, effect) for effect in item.truth["effects"])


def calibration(items: list[Solved]) -> dict[str, Any]:
    """Compare stated probabilities of the first name with how often they come true."""
    told = rated(items)
    return intervals.calibration(
        np.array([i.answer.probability for i in told]),
        np.array([true_of_any(i) for i in told], dtype=float),
    )


def abstention(items: list[Solved]) -> list[dict[str, Any]]:
    """Accuracy of the first names, if those below a probability are withheld.

    Returns
    -------
    list
        Of each threshold: ``threshold``; ``answered``, the rate of names above it among all;
        and ``accuracy``, how many of those are right.
    """
    told = rated(items)
    rows = []
    for threshold in THRESHOLDS:
        kept = [item for item in told if item.answer.probability >= threshold]
        rows.append(
            {
                "threshold": threshold,
                "answered": intervals.rate(len(kept), len(told)),
                "accuracy": intervals.of([true_of_any(item) for item in kept]),
            }
        )
    return rows
