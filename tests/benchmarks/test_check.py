"""CI's small challenge fails on what is broken, and seldom on what is as promised."""

from typing import Any

import pytest
from benchmarks.check import challenge_faults


def scores(alarms: int = 0, detected: int = 8, named: int = 8) -> dict[str, Any]:
    """Scores of 14 nulls, 8 large effects and 8 that are detected."""
    level = {"delta_chi2": 100.0, "solver": {"hits": detected, "of": 8}}
    small = {"delta_chi2": 9.0, "solver": {"hits": 0, "of": 8}}
    return {
        "items": 40,
        "unsolved": [],
        "false_alarms": {"hits": alarms, "of": 14},
        "detection": {"levels": [small, level]},
        "naming": {"all": {"class": {"hits": named, "of": 8}}},
    }


def test_a_set_as_promised_passes() -> None:
    assert challenge_faults(scores()) == []


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ({"alarms": 7}, "alarms"),
        ({"detected": 2}, "detected"),
        ({"named": 2}, "named"),
    ],
)
def test_half_the_nulls_alarmed_or_a_quarter_found_is_a_fault(
    broken: dict[str, int], said: str
) -> None:
    (fault,) = challenge_faults(scores(**broken))
    assert said in fault
