"""CI's small challenge fails on what is broken, and seldom on what is as promised."""

from math import comb
from typing import Any

import pytest

from benchmarks import check_challenge as check


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
    assert check.faults_of(scores()) == []


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
    (fault,) = check.faults_of(scores(**broken))
    assert said in fault


@pytest.mark.parametrize("of", [0, 1, 4, 14, 60])
@pytest.mark.parametrize("share", [0.01, 0.85, 0.9])
def test_chance_alone_fails_less_than_one_set_in_a_thousand(of: int, share: float) -> None:
    failed = {True: 0.0, False: 0.0}
    for hits in range(of + 1):
        probability = comb(of, hits) * share**hits * (1 - share) ** (of - hits)
        failed[True] += probability * check.is_beyond({"hits": hits, "of": of}, share, "less")
        failed[False] += probability * check.is_beyond({"hits": hits, "of": of}, share, "greater")
    assert max(failed.values()) < 0.001
