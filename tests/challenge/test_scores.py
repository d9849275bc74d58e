"""Scores: known answers give known numbers."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from pendpipe_challenge import intervals
from pendpipe_challenge.answers import read_items, six_cases
from pendpipe_challenge.figures import draw, draw_cases
from pendpipe_challenge.measures import abstention
from pendpipe_challenge.page import page
from pendpipe_challenge.score import score


def truth(family: str, effect: str = "", size: float = 100.0, **more: Any) -> dict[str, Any]:
    """A sealed truth with what the scores read."""
    effects = [
        {
            "effect": effect,
            "also": [],
            "law": "x",
            "kind": "dynamics",
            "own_form": True,
            "delta_chi2": size,
            "parameters": {"cubic": 1.0},
            "left_by_catalogue": size,
            "best_mimic": "",
        }
    ]
    oracle = {
        "detected": size > 20 and bool(effect),
        "detected_by_effect": size > 15 and bool(effect),
        "named": effect,
        "top3": [effect],
        "class": [effect, "backlash"],
        "found_each": [True],
        "largest_score": size,
        "threshold": 20.0,
        "scores": {"cubic-stiffness": size if effect else 1.0},
        "whiteness_p": 0.5,
    }
    nuisances = {
        "alpha": 0.0,
        "freedom": 0.0,
        "stops": False,
        "samples": 1000,
        "gain": 1.0,
        "frequency_hz": 1.0,
    }
    return {
        "family": family,
        "baseline": "eq8",
        "effects": effects if effect else [],
        "nuisances": nuisances,
        "oracle": oracle,
        "cancelling": False,
        **more,
    }


def answer(*names: str, probability: float = 0.9, rest: tuple[str, ...] = ()) -> dict[str, Any]:
    """An answer that names these effects, the first with a class."""
    effects = [
        {
            "id": name,
            "probability": probability,
            "parameters": {"k3": {"value": 1.1, "sd": 0.1}},
            "indistinguishable_from": [{"id": r, "probability": 0.01} for r in rest if not i],
            "deciding_measurement": "swing it wider",
        }
        for i, name in enumerate(names)
    ]
    verdict = "missing-physics" if names else "consistent"
    return {
        "diagnosis": {
            "verdict": verdict,
            "effects": effects,
            "noise_rms_rad": 1.0,
            "baseline": {"residual_rms_rad": 2.0},
            "statement": "It differs.",
            "improved": {"residual_rms_rad": 1.0},
            "held_out": {"gain": 3.0, "gain_sd": 1.0},
        }
    }


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
    red = truth("null")
    red["nuisances"] = {**red["nuisances"], "alpha": 1.0}
    found = score(
        opened(
            (truth("null"), answer()),
            (truth("null"), answer(K3)),
            (red, answer("coloured-noise")),
            (truth("null"), answer("coloured-noise")),
        )
    )["false_alarms"]
    assert (found["hits"], found["of"]) == (2, 4)
    assert found["rightly_called_coloured"] == 1


def test_names_are_judged_first_among_three_and_in_class() -> None:
    found = score(
        opened(
            (truth("single", K3), answer(K3)),
            (truth("single", K3), answer("backlash", rest=(K3,))),
            (truth("single", K3), answer("jitter")),
            (truth("single", K3), answer()),
        )
    )["naming"]["100"]
    assert found["top1"]["hits"] == 1
    assert found["class"]["hits"] == 2
    assert found["class"]["of"] == 3
    assert found["class_size"] == pytest.approx(4 / 3)
    assert found["oracle_class_size"] == 2
    assert found["share_of_the_oracle"]["ratio"] == pytest.approx(0.5)


def test_outside_the_catalogue_a_confident_name_is_wrong() -> None:
    made = truth("outside", "unnamed-damping")
    found = score(
        opened(
            (made, answer("unnamed-damping")),
            (made, answer("unnamed-restoring")),
            (made, answer(K3, probability=0.95)),
            (made, answer(K3, probability=0.5)),
        )
    )["outside"]
    assert found["unnamed_of_the_right_kind"]["hits"] == 1
    assert found["unnamed_of_any_kind"]["hits"] == 2
    assert found["confident_wrong_names"]["hits"] == 1


def test_a_tie_is_credited_for_its_class_only() -> None:
    found = score(
        opened(
            (truth("tie", K3), answer(K3, rest=("backlash",))),
            (truth("tie", K3), answer(K3)),
        )
    )["ties"]
    assert found["class_and_deciding_measurement"]["hits"] == 1
    assert found["lone_confident_names"]["hits"] == 1


def test_pulls_compare_estimates_with_the_truth() -> None:
    found = score(opened(*[(truth("single", K3), answer(K3))] * 2))["pulls"]
    assert found["mean"]["value"] == pytest.approx(1.0)
    assert found["coverage95"]["hits"] == 2


def test_probabilities_that_come_true_are_calibrated() -> None:
    random = np.random.default_rng(0)
    stated = random.uniform(0.3, 1.0, 4000)
    honest = intervals.calibration(stated, (random.random(4000) < stated).astype(float))
    overconfident = intervals.calibration(
        stated, (random.random(4000) < stated - 0.2).astype(float)
    )
    assert honest["expected_calibration_error"] < 0.03
    assert overconfident["expected_calibration_error"] == pytest.approx(0.2, abs=0.03)


def test_the_power_curve_is_found_again() -> None:
    random = np.random.default_rng(1)
    size = random.choice([4.0, 9.0, 16.0, 25.0, 50.0, 100.0], 3000)
    found = random.random(3000) < norm.cdf(np.sqrt(size) - 4.0)
    half, most = intervals.power_curve(size, found.astype(float))
    assert half == pytest.approx(16.0, rel=0.05)
    assert most == pytest.approx((4 + 1.2816) ** 2, rel=0.05)


def test_exact_intervals_are_clopper_and_pearsons() -> None:
    none = intervals.rate(0, 300)["interval95"]
    assert none[0] == 0.0
    assert none[1] == pytest.approx(1 - 0.025 ** (1 / 300), rel=1e-9)
    half = intervals.rate(50, 100)["interval95"]
    assert half == pytest.approx([0.3983, 0.6017], abs=1e-4)


@pytest.mark.parametrize("threshold", [0.0, 0.5, 0.9])
def test_keeping_silent_withholds_what_is_less_probable(threshold: float) -> None:
    """Of four names a half is right; of the two probable ones all are."""
    content = opened(
        *[(truth("single", K3), answer(K3, probability=0.9))] * 2,
        *[(truth("single", K3), answer("jitter", probability=0.4))] * 2,
    )
    row = next(r for r in abstention(read_items(content)) if r["threshold"] == threshold)
    expected = (4, 2) if threshold == 0.0 else (2, 2)
    assert (row["accuracy"]["of"], row["accuracy"]["hits"]) == expected
    assert (row["answered"]["hits"], row["answered"]["of"]) == (expected[0], 4)


def test_the_page_says_yes_and_no() -> None:
    content = opened(
        *[(truth("null"), answer())] * 3,
        (truth("single", K3), answer(K3)),
        (truth("single", K3, 60.0), answer()),
        (truth("outside", "unnamed-damping"), answer(K3)),
    )
    text = page(score(content), ["power.svg"], "proof")
    assert "**no**" in text
    assert "| yes |" in text
    assert "item-4 | cubic-stiffness" in text
    assert "(proof/power.svg)" in text


def test_six_cases_are_chosen_by_rule_and_all_figures_drawn(tmp_path: Path) -> None:
    content = opened(
        (truth("single", K3, 60.0), answer(K3)),
        (truth("single", "backlash"), answer("backlash")),
        (truth("single", K3), answer(K3)),
        (truth("single", "impulse"), answer(K3)),
        *[(truth("null"), answer())] * 3,
    )
    cases = six_cases(read_items(content))
    assert [item.name for item in cases] == ["item-1", "item-3"]
    for name in draw(score(content), tmp_path):
        assert (tmp_path / name).read_text(encoding="utf-8").startswith("<?xml")


DRAWER = """
import json, sys
import sys
from pathlib import Path
answer = Path(sys.argv[sys.argv.index("--out") + 1])
answer.mkdir()
(answer / "residual_map.svg").write_text("<svg/>")
(answer / "diagnosis.json").write_text(json.dumps({"statement": Path(sys.argv[1]).read_text()}))
"""


def test_a_case_s_figure_says_whether_it_is_of_the_answer_that_was_scored(tmp_path: Path) -> None:
    content = opened(*[(truth("single", name), answer(name)) for name in (K3, "impulse", "jitter")])
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "item-0.csv").write_text("It differs.")
    (tmp_path / "recordings" / "item-1.csv").write_text("It differs now.")
    cases = draw_cases(content, tmp_path, tmp_path / "to", solver=[sys.executable, "-c", DRAWER])
    assert [case["same_answer"] for case in cases] == [True, False, None]
    assert [case["figure"] for case in cases] == ["case-1.svg", "case-2.svg", None]
    assert (tmp_path / "to" / "case-2.svg").read_text() == "<svg/>"


def test_items_of_one_recording_count_as_little_as_they_tell() -> None:
    """Where each recording answers alike throughout, there are as many items as recordings."""
    sources = [f"{k}.csv" for k in range(7) for _ in range(20)]
    alike = [k < 4 for k in range(7) for _ in range(20)]
    low, high = intervals.of_clusters(alike, sources)["interval95"]
    assert low < intervals.rate(4, 7)["interval95"][0] + 0.02
    assert high > intervals.rate(4, 7)["interval95"][1] - 0.02
    all_found = intervals.of_clusters([True] * 140, sources)
    assert all_found["interval95"] == intervals.rate(7, 7)["interval95"]
    assert (all_found["hits"], all_found["of"], all_found["clusters"]) == (140, 140, 7)
    mixed = [i % 2 == 0 for i in range(140)]
    assert intervals.of_clusters(mixed, sources)["interval95"] == pytest.approx(
        intervals.rate(70, 140)["interval95"]
    )
    assert intervals.of_clusters([True] * 20, sources[:20])["interval95"] == [0.0, 1.0]


def test_intervals_by_clusters_cover_what_they_promise() -> None:
    """Of rates that differ between recordings, 95 % of the intervals hold the mean at least."""
    random = np.random.default_rng(5)
    sources = np.repeat(list("abcdefg"), 10).tolist()
    held, plain = [], []
    for _ in range(400):
        each = random.beta(2.0, 2.0, 7)
        found = (random.random((7, 10)) < each[:, None]).ravel().tolist()
        low, high = intervals.of_clusters(found, sources)["interval95"]
        held.append(low <= 0.5 <= high)
        low, high = intervals.of(found)["interval95"]
        plain.append(low <= 0.5 <= high)
    assert np.mean(held) > 0.92
    assert np.mean(plain) < 0.9


@pytest.mark.parametrize(("wrong", "kept"), [(1, True), (2, False)])
def test_confident_wrong_names_may_be_five_per_cent(wrong: int, kept: bool) -> None:
    made = truth("outside", "unnamed-damping")
    right, named = answer("unnamed-damping"), answer(K3, probability=0.95)
    found = score(opened(*[(made, named if n < wrong else right) for n in range(30)]))
    rows = {row["key"]: row for row in found["promises"]}
    assert rows["confident"]["kept"] is kept


@pytest.mark.parametrize(("error", "kept"), [(0.02, True), (0.12, False)])
def test_a_calibration_error_of_five_per_cent_is_promised(error: float, kept: bool) -> None:
    right = [(truth("single", K3), answer(K3, probability=1.0 - error))] * 30
    rows = {row["key"]: row for row in score(opened(*right))["promises"]}
    assert rows["calibration"]["kept"] is kept
