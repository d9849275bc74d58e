"""Scores of answers, and the oracle."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from pendpipe_challenge import items
from pendpipe_challenge.items import Recipe, make_item
from pendpipe_challenge.score import calibration_error, figure, found_at, page, ratio, score

# Scores: known answers give known numbers.


def truth(family: str, effect: str = "", size: float = 100.0, **more: Any) -> dict[str, Any]:
    """A sealed truth with what the scores read."""
    hidden = {
        "effect": effect,
        "also": [],
        "law": f"{effect}: x",
        "kind": "dynamics",
        "delta_chi2": size,
        "left_by_catalogue": size,
    }
    oracle = {
        "detected": size > 20 and bool(effect),
        "named": effect,
        "class": [effect, "backlash"],
    }
    return {"family": family, "effects": [hidden] if effect else [], "oracle": oracle} | more


def answer(*names: str, probability: float = 0.9, rest: tuple[str, ...] = ()) -> dict[str, Any]:
    """An answer that names these effects, the first with a class."""
    effects = [
        {
            "id": name,
            "probability": probability,
            "parameters": {},
            "indistinguishable_from": [{"id": r, "probability": 0.01} for r in rest if not i],
            "deciding_measurement": "swing it wider",
        }
        for i, name in enumerate(names)
    ]
    verdict = "missing-physics" if names else "consistent"
    return {"diagnosis": {"verdict": verdict, "effects": effects}}


def opened(*pairs: tuple[dict[str, Any], dict[str, Any]]) -> dict[str, Any]:
    items = {f"item-{n}": {"truth": t, "answer": a} for n, (t, a) in enumerate(pairs)}
    return {
        "items": items,
        "set": "s",
        "count": len(items),
        "sealed_at": "1",
        "opened_at": "3",
        "answered_at": "2",
        "seed": 1,
        "truth_sha256": "ab",
        "answers_sha256": "cd",
    }


K3 = "cubic-stiffness"


def test_false_alarms_are_counted_and_red_noise_called_red_is_none() -> None:
    found = score(
        opened(
            (truth("null"), answer()),
            (truth("null"), answer(K3)),
            (truth("null", allowed=["coloured-noise"]), answer("coloured-noise")),
            (truth("null"), answer("coloured-noise")),
        )
    )["false_alarms"]
    assert (found["hits"], found["of"]) == (2, 4)


def test_names_are_judged_first_and_in_class() -> None:
    found = score(
        opened(
            (truth("single", K3), answer(K3)),
            (truth("single", K3), answer("backlash", rest=(K3,))),
            (truth("single", K3), answer("jitter")),
            (truth("single", K3), answer()),
        )
    )["naming"]["100"]
    counts = {key: (found[key]["hits"], found[key]["of"]) for key in ("top1", "class")}
    assert counts == {"top1": (1, 3), "class": (2, 3)}
    assert (found["class_size"], found["oracle_class_size"]) == (pytest.approx(4 / 3), 2)
    assert found["share_of_the_oracle"]["value"] == pytest.approx(0.5)


def test_the_other_families_are_counted_by_their_own_rules() -> None:
    """Outside the catalogue a confident name is wrong; a tie is credited for its class only."""
    made = truth("outside", "unnamed-damping")
    found = score(
        opened(
            (made, answer("unnamed-damping")),
            (made, answer("unnamed-restoring")),
            (made, answer(K3, probability=0.95)),
            (made, answer(K3, probability=0.5)),
            (truth("tie", K3), answer(K3, rest=("backlash",))),
            (truth("tie", K3), answer(K3)),
        )
    )["others"]
    counts = {what: (each["hits"], each["of"]) for what, each in found.items()}
    assert counts["outside: confidently wrong"] == (1, 4)
    assert counts["outside, large: unnamed, of the right kind"] == (1, 4)
    assert counts["ties: the class and what decides"] == (1, 2)
    assert counts["ties: a lone name without doubt"] == (1, 2)


def test_intervals_hold_the_numbers_of_what_was_named_or_not() -> None:
    hidden = truth("single", K3)
    hidden["effects"][0] |= {"own_form": True, "parameters": {"cubic": 1.0}}
    pairs = []
    for interval in ([0.9, 1.3], [1.1, 1.3]):
        said = answer(K3)
        said["diagnosis"]["effects"][0]["parameters"] = {"k3": {"interval95": interval}}
        pairs.append((hidden, said))
    found = score(opened(*pairs, (hidden, answer("backlash"))))["others"]
    held = found["numbers of a named effect: the 95 % interval holds"]
    assert (held["hits"], held["of"]) == (1, 2)


def test_places_are_held_by_the_answer_s_intervals_or_not() -> None:
    """An instant by its times, to a reading; a tone by its fitted frequency."""
    knock, tone = truth("single", "impulse"), truth("single", "tone-pickup")
    knock["effects"][0] |= {"instant_s": 20.0, "tick_s": 0.1}
    tone["effects"][0]["tone_hz"] = 3.3
    pairs = []
    for low, high in ((19.5, 20.1), (20.05, 20.6), (20.6, 20.8)):
        said = answer("impulse")
        said["diagnosis"]["effects"][0]["location"] = {"time_s": [low, high]}
        pairs.append((knock, said))
    for ends in ([3.29, 3.31], [3.4, 3.5]):
        said = answer("tone-pickup")
        said["diagnosis"]["effects"][0]["parameters"] = {"f": {"unit": "Hz", "interval95": ends}}
        pairs.append((tone, said))
    found = score(opened(*pairs, (knock, answer(K3))))["others"]
    counts = [
        (found[f"place: {what}"]["hits"], found[f"place: {what}"]["of"])
        for what in ("instants", "tones")
    ]
    assert counts == [(2, 3), (1, 2)]


@pytest.mark.parametrize("too_sure", [0.0, 0.2])
def test_the_calibration_error_is_what_was_stated_too_much(too_sure: float) -> None:
    random = np.random.default_rng(0)
    stated = random.uniform(0.3, 1.0, 4000)
    true = (random.random(4000) < stated - too_sure).astype(float)
    assert calibration_error(stated, true) == pytest.approx(too_sure, abs=0.03)


def test_the_power_curve_is_found_again() -> None:
    random = np.random.default_rng(1)
    size = random.choice([4.0, 9.0, 16.0, 25.0, 50.0, 100.0], 3000)
    found = (random.random(3000) < norm.cdf(np.sqrt(size) - 4.0)).astype(float)
    assert found_at(size, found, 0.0) == pytest.approx(16.0, rel=0.05)
    assert found_at(size, found, 1.2816) == pytest.approx((4 + 1.2816) ** 2, rel=0.05)


def test_a_ratio_whose_second_mean_may_vanish_has_an_interval_all_the_same() -> None:
    found = figure(ratio, [1.0, 0.0, 1.0], [0.0, 0.0, 1.0], paired=True)
    assert found["value"] == pytest.approx(2.0)
    assert found["interval95"] == pytest.approx([1.0, 3.0], abs=0.5)
    assert figure(ratio, [1.0, 1.0], [0.0, 0.0], paired=True)["value"] is None


def test_the_page_says_yes_and_no() -> None:
    content = opened(
        *[(truth("null"), answer())] * 3,
        (truth("single", K3), answer(K3)),
        (truth("single", K3, 60.0), answer()),
        (truth("outside", "unnamed-damping"), answer(K3)),
    )
    text = page(score(content))
    assert "**no**" in text
    assert "| yes |" in text
    assert "item-4 | cubic-stiffness" in text


# The oracle finds what is there, by its name, and nothing in noise.


def truth_of(
    seed: int, *effects: str, sizes: tuple[float, ...] = (), **other: Any
) -> dict[str, Any]:
    """The truth of an item that hides these effects."""
    recipe: Recipe = {"family": "single", "effects": effects, "delta_chi2": sizes} | other
    return make_item(recipe, np.random.default_rng(seed)).truth


@pytest.mark.slow
def test_the_oracle_finds_and_names_a_large_effect_and_no_null() -> None:
    """Its class ends where the likelihood has fallen by exp(-3)."""
    single = truth_of(3, "frequency-drift", sizes=(100.0,), own_form=True)
    oracle = single["oracle"]
    assert single["effects"][0]["delta_chi2"] == pytest.approx(100.0, rel=0.15)
    assert oracle["detected"]
    assert "frequency-drift" in oracle["class"]
    best = oracle["scores"][oracle["named"]]
    assert best == pytest.approx(100.0, rel=0.5)
    inside = [name for name, score in oracle["scores"].items() if best - score <= 6.0]
    assert oracle["class"][: len(inside)] == inside
    assert len(inside) > 2
    nulls = [truth_of(seed, family="null")["oracle"] for seed in range(2)]
    assert all(20.0 < null["threshold"] < 35.0 for null in nulls)
    assert sum(null["detected"] for null in nulls) <= 1


@pytest.mark.slow
def test_a_cancelling_pair_hides_itself() -> None:
    pair = truth_of(
        2,
        *("cubic-stiffness", "frequency-drift"),
        sizes=(100.0, 100.0),
        family="combination",
        cancelling=True,
    )
    assert pair["total_delta_chi2"] < sum(e["alone_delta_chi2"] for e in pair["effects"])
    assert all(e["delta_chi2"] < e["alone_delta_chi2"] for e in pair["effects"])


@pytest.mark.slow
def test_what_is_outside_leaves_something_to_every_catalogue_entry() -> None:
    (effect,) = truth_of(1, "cogging", sizes=(100.0,), family="outside")["effects"]
    assert effect["left_by_catalogue"] == pytest.approx(100.0, rel=0.5)
    assert effect["delta_chi2"] > effect["left_by_catalogue"]
    assert effect["effect"] == "unnamed-restoring"


@pytest.mark.parametrize(("wanted", "least"), [(4.0, 4.0), (100.0, 4.0), (2.0, 4.0)])
def test_what_no_scene_can_show_is_made_smaller_as_far_as_it_can_be_seen(
    monkeypatch: pytest.MonkeyPatch, wanted: float, least: float
) -> None:
    tried = list[float]()
    monkeypatch.setattr(items, "sized", lambda *given: tried.append(given[4]))
    recipe: Recipe = {"family": "single", "effects": ["impulse"], "delta_chi2": [wanted]}
    with pytest.raises(ValueError, match="no pendulum can show"):
        make_item({**recipe, "least": least}, np.random.default_rng(1))
    assert max(tried) == wanted
    assert min(tried) == min(wanted, least)
