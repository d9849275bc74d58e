"""Why promises were missed is counted from the truth, and told where it happened only."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from typing import Any

import numpy as np
import pytest

from pendpipe_challenge.answers import read_items
from pendpipe_challenge.catalogue import EFFECTS, hide
from pendpipe_challenge.page import page
from pendpipe_challenge.score import EXPLAINED, causes, score

from .test_scores import K3, answer, opened, truth

REASONS = tomllib.loads(files("pendpipe_challenge").joinpath("reasons.toml").read_text("utf-8"))


def nulls(count: int = 4) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    return [(truth("null"), answer())] * count


def because(key: str, content: dict[str, Any]) -> dict[str, Any]:
    """What accounts for a promise that was not kept."""
    row = {"key": key, "promise": "much", "kept": False}
    found: dict[str, Any] = causes(read_items(content), [row])[key]
    return found


def test_what_was_not_detected_is_counted_by_hidden_effect_and_law() -> None:
    """Ten of twenty, two of them barely above the oracle's threshold of 20."""
    content = opened(
        *[(truth("single", K3, 100.0), answer(K3))] * 10,
        *[(truth("single", "clipping", 100.0), answer())] * 8,
        *[(truth("single", "offset-drift", 25.0), answer())] * 2,
        *nulls(),
    )
    found = because("half", content)
    told = [(row["hidden"], row["count"], row["of"], row["narrowly"]) for row in found["rows"]]
    assert told == [("clipping", 8, 8, 0), ("offset-drift", 2, 2, 2)]
    assert {reason["cause"] for reason in found["reasons"]} == {"clipping", "offset-drift"}


def test_a_wrong_class_is_told_with_the_name_that_was_given() -> None:
    content = opened(
        *[(truth("single", K3), answer("jitter"))] * 3, (truth("tie", K3), answer(K3)), *nulls()
    )
    (row,) = because("class at 100", content)["rows"]
    assert (row["hidden"], row["law"], row["answer"]) == (K3, "x", "jitter")
    assert (row["count"], row["of"]) == (3, 4)


def test_confident_names_outside_are_told_by_law() -> None:
    made = truth("outside", "unnamed-damping")
    made["effects"][0]["law"] = "kink of 1/Q"
    content = opened(*[(made, answer("damping-step"))] * 2, (made, answer("unnamed-damping")))
    found = because("confident", content)
    assert [(row["answer"], row["count"], row["of"]) for row in found["rows"]] == [
        ("damping-step", 2, 3)
    ]
    assert [reason["cause"] for reason in found["reasons"]] == ["kink of 1/Q"]


def test_false_alarms_are_told_by_noise() -> None:
    red = truth("null")
    red["nuisances"] = {**red["nuisances"], "alpha": 1.0}
    content = opened(*[(red, answer(K3))] * 3, (red, answer()), *nulls())
    (row,) = because("false alarms", content)["rows"]
    assert (row["hidden"], row["answer"], row["count"], row["of"]) == ("red noise", K3, 3, 4)


def test_an_overconfident_bin_names_what_fills_it() -> None:
    """Of thirty stated at 0.95 a third is right; those at 0.5 keep their word."""
    content = opened(
        *[(truth("single", K3), answer(K3, probability=0.95))] * 10,
        *[(truth("tie", K3), answer("jitter", probability=0.95))] * 20,
        *[(truth("single", K3), answer(K3, probability=0.55))] * 5,
        *[(truth("single", K3), answer("jitter", probability=0.55))] * 5,
    )
    (row,) = because("calibration", content)["bins"]
    assert row["overconfident"]
    assert row["edges"] == pytest.approx([0.9, 1.0])
    assert row["families"] == {"single": [10, 10], "tie": [0, 20]}
    assert [(each["answer"], each["count"]) for each in row["culprits"]] == [("jitter", 20)]
    assert row["error"] == pytest.approx((0.95 - 1 / 3) * 30 / 40)


def test_a_kept_promise_has_no_causes_and_the_page_no_such_part() -> None:
    content = opened(*[(truth("single", K3), answer(K3, probability=1.0))] * 9, *nulls(20))
    found = score(content)
    assert found["causes"] == {}
    assert "Why promises were missed" not in page(found, [], "proof")


def test_each_reason_is_on_the_page_once_and_only_where_its_cause_occurred() -> None:
    content = opened(
        *[(truth("single", "clipping", size), answer()) for size in (50.0, 60.0, 100.0, 110.0)],
        *[(truth("single", K3, size), answer(K3)) for size in (50.0, 100.0)] * 2,
    )
    text = page(score(content), [], "proof")
    assert text.count(REASONS["undetected"]["clipping"]) == 1
    for table in REASONS.values():
        for cause, why in table.items():
            assert (why in text) == (cause == "clipping")


def test_reasons_are_keyed_by_what_can_be_hidden() -> None:
    """By names and laws that the generator has."""
    from pendpipe_challenge.hidden import OUTSIDE
    from pendpipe_challenge.items import make_null

    random = np.random.default_rng(1)
    scenario = make_null(random).scenario
    laws = {hide(random, name, scenario).law for name in OUTSIDE}
    for table in ("undetected", "misnamed"):
        for key in REASONS[table]:
            hidden = key.split(" -> ")[0].split(" (")[0]
            assert hidden in EFFECTS, key
            said = key.split(" -> ")[1] if " -> " in key else ""
            assert not said or said in EFFECTS or said.startswith("unnamed-"), key
    assert set(REASONS["outside"]) <= laws
    assert set(REASONS) == {"undetected", "misnamed", "outside", "false-alarm"}


def test_every_promise_can_be_explained() -> None:
    promised = {row["key"] for row in score(opened(*nulls()))["promises"]}
    assert promised == set(EXPLAINED)
