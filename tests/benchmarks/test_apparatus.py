"""The judge of apparatus: items by set and number, and what an answer about one is worth."""

import numpy as np
import pytest
from benchmarks.apparatus import draw, solved

from pendpipe_challenge.score import CONFIDENT, Solved, questions


def test_an_item_is_a_function_of_its_set_and_its_number() -> None:
    one, same, other = draw("a", 5), draw("a", 5), draw("b", 5)
    assert one.text == same.text
    assert one.truth == same.truth
    assert one.text != other.text


def test_parts_stand_evenly_over_the_numbers() -> None:
    families = [draw("a", number).truth["family"] for number in range(5)]
    assert {"null", "single", "outside"} <= set(families)
    assert np.isfinite(
        [e["delta_chi2"] for n in range(3) for e in draw("a", n).truth["effects"]]
    ).all()


def item(lead: str, chance: float, *rivals: str, **truth: object) -> Solved:
    """An answer beside its truth: jitter is hidden."""
    hidden = [{"effect": "jitter", "also": [], "kind": "measurement", "delta_chi2": 200.0}]
    plain = {"family": "single", "effects": hidden, "present": [], "allowed": [], **truth}
    effect = {"id": lead, "probability": chance, "parameters": {}}
    effect["indistinguishable_from"] = [{"id": each, "probability": 0.1} for each in rivals]
    diagnosis = {"verdict": "missing-physics", "effects": [effect]}
    return solved({"number": 1, "truth": plain, "diagnosis": diagnosis})


def test_a_class_that_holds_the_truth_is_right_whichever_of_its_names_leads() -> None:
    asked = questions([item("glitches", 0.6, "jitter"), item("glitches", 0.6, "clipping")])
    assert asked["class holds the hidden one"] == [True, False]
    assert asked["first name is there"] == [False, False]
    assert asked["the same, with 50 % or more"] == [False, True]


@pytest.mark.parametrize(("chance", "wrong"), [(CONFIDENT, False), (CONFIDENT + 1e-9, True)])
def test_a_name_is_confident_above_its_limit(chance: float, wrong: bool) -> None:
    assert questions([item("glitches", chance)])["the same, confident"] == [wrong]


def test_what_was_presumed_is_fitted_and_no_detection() -> None:
    sine = item("circular-error", 1.0, present=["circular-error"])
    presumed = {**sine.content["effects"][0], "presumed": True}
    content = {"verdict": "consistent", "effects": [presumed]}
    asked = questions([solved({"number": 1, "truth": sine.truth, "diagnosis": content})])
    assert asked["circular error named or in a class, where there is sin x"] == [True]
    assert asked["detected"] == asked["first name is there"] == [False]


def test_on_a_null_every_name_is_false_and_near_names_are_no_error_outside() -> None:
    null = item("second-mode", 0.3, family="null", effects=[])
    assert questions([null])["nulls with a false name"] == [True]
    wind = {"effect": "unnamed-damping", "also": ["drag-form"], "left_by_catalogue": 0.0}
    near = item("drag-form", 0.9, family="outside", effects=[wind])
    assert questions([near])["outside: confidently wrong"] == [False]
