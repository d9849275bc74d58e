"""The oracle finds what is there, by its name, and nothing in noise."""

from typing import Any

import numpy as np
import pytest

from pendpipe_challenge.items import Recipe, make_item


def truth(seed: int, *effects: str, sizes: tuple[float, ...] = (), **other: Any) -> dict[str, Any]:
    """The truth of an item that hides these effects."""
    recipe: Recipe = {"family": "single", "effects": effects, "delta_chi2": sizes} | other
    return make_item(recipe, np.random.default_rng(seed)).truth


def test_the_oracle_finds_and_names_a_large_effect_and_no_null() -> None:
    single = truth(11, "sensor-cubic", sizes=(400.0,), own_form=True)
    oracle = single["oracle"]
    assert single["effects"][0]["delta_chi2"] == pytest.approx(400.0, rel=0.15)
    assert oracle["detected"]
    assert "sensor-cubic" in oracle["class"]
    assert oracle["scores"][oracle["named"]] == pytest.approx(400.0, rel=0.5)
    nulls = [truth(seed, family="null")["oracle"] for seed in range(5)]
    assert all(20.0 < null["threshold"] < 35.0 for null in nulls)
    assert sum(null["detected"] for null in nulls) <= 1


def test_a_class_ends_where_the_likelihood_has_fallen_by_exp_minus_3() -> None:
    oracle = truth(3, "frequency-drift", sizes=(100.0,), own_form=True)["oracle"]
    best = oracle["scores"][oracle["named"]]
    inside = [name for name, score in oracle["scores"].items() if best - score <= 6.0]
    assert oracle["class"][: len(inside)] == inside


def test_a_cancelling_pair_hides_itself() -> None:
    pair = truth(
        2,
        *("cubic-stiffness", "frequency-drift"),
        sizes=(100.0, 100.0),
        family="combination",
        cancelling=True,
    )
    assert pair["total_delta_chi2"] < sum(e["alone_delta_chi2"] for e in pair["effects"])
    assert all(e["delta_chi2"] < e["alone_delta_chi2"] for e in pair["effects"])


def test_what_is_outside_leaves_something_to_every_catalogue_entry() -> None:
    (effect,) = truth(1, "cogging", sizes=(100.0,), family="outside")["effects"]
    assert effect["left_by_catalogue"] == pytest.approx(100.0, rel=0.5)
    assert effect["delta_chi2"] > effect["left_by_catalogue"]
    assert effect["effect"] == "unnamed-restoring"
