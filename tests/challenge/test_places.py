"""Whether local effects are where the answer puts them."""

import math
from typing import Any

import numpy as np

from pendpipe_challenge import score
from pendpipe_challenge.hidden_instrument import glitches
from pendpipe_challenge.items import make_null
from pendpipe_challenge.score import Place, read_items, true_place

from .test_scores import answer, opened, truth

INTERVAL_S = 0.1


def placed(
    effect: str,
    known: dict[str, float],
    *,
    time_s: list[float] | None = None,
    hertz: list[float] | None = None,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """An item and its right answer, that puts the effect somewhere."""
    made, said = truth("single", effect), answer(effect)
    made["effects"][0]["parameters"] = known
    told = said["diagnosis"]["effects"][0]
    told["location"] = {"time_s": time_s}
    told["parameters"] = {"f": {"value": 1.0, "sd": 0.1, "unit": "Hz", "interval95": hertz}}
    return made, said


def places(*pairs: tuple[dict[str, Any], dict[str, Any]]) -> dict[str, Any]:
    content = opened(*pairs)
    return score.places(read_items(content), dict.fromkeys(content["items"], INTERVAL_S))


def test_an_instant_is_held_by_its_interval_or_not() -> None:
    known = {"impulse": 1e-3, "impulse_at": 20.0, "impulse_width": 0.5}
    found = places(
        placed("impulse", known, time_s=[19.5, 20.1]),
        placed("impulse", known, time_s=[20.4, 20.6]),
        placed("impulse", known, time_s=[20.6, 20.8]),
    )["impulses"]
    assert (found["hits"], found["of"]) == (2, 3)


def test_lost_samples_are_placed_to_a_sample_and_wild_ones_all() -> None:
    lost, wild = {"sample": 700.0, "lost": 2.0}, {"sample_1": 100.0, "sample_2": 300.0}
    found = places(
        placed("dropped-samples", lost, time_s=[70.05, 70.05]),
        placed("dropped-samples", lost, time_s=[71.0, 71.0]),
        placed("glitches", wild, time_s=[10.0, 30.0]),
        placed("glitches", wild, time_s=[30.0, 30.0]),
    )
    assert (found["lost samples"]["hits"], found["lost samples"]["of"]) == (1, 2)
    assert (found["glitches"]["hits"], found["glitches"]["of"]) == (1, 2)


def test_a_tone_is_held_by_its_fitted_frequency_s_interval() -> None:
    found = places(
        placed("tone-pickup", {"tone_hz": 3.3}, hertz=[3.29, 3.31]),
        placed("periodic-drive", {"drive_omega": 4.0 * math.pi}, hertz=[1.99, 2.005]),
        placed("second-mode", {"frequency_hz": 9.0}, hertz=[9.1, 9.2]),
    )["tones"]
    assert (found["hits"], found["of"]) == (2, 3)


def test_what_is_not_named_or_has_no_known_place_is_not_asked() -> None:
    made, _ = placed("impulse", {"impulse_at": 20.0}, time_s=[19.0, 21.0])
    assert places((made, answer("jitter"))) == {}
    assert places(placed("glitches", {"number": 2.0}, time_s=[1.0, 2.0])) == {}
    assert places(placed("cubic-stiffness", {"cubic": 1.0}, time_s=[1.0, 2.0])) == {}


def test_the_truth_of_glitches_tells_their_samples() -> None:
    random = np.random.default_rng(2)
    scenario = make_null(random).scenario
    hidden = glitches(random, scenario)
    wild = hidden.at(1.0).chain.glitches
    place = true_place({"effect": "glitches", "parameters": hidden.truth(1.0)}, INTERVAL_S)
    assert place == Place(wild[0][0] * INTERVAL_S, wild[-1][0] * INTERVAL_S)
