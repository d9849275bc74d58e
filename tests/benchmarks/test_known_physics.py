"""The table of known physics is judged by the sensor's floor and by names, never by the fit."""

from __future__ import annotations

import csv
from typing import Any

import numpy as np
import pytest
from benchmarks.apparatus.scores import catalogue

from benchmarks import known_physics as known

RNG = np.random.default_rng(5)


def answers(effects: list[dict[str, Any]], **parameters: dict[str, Any]) -> known.Answers:
    """A diagnosis with these effects and parameters."""
    content = {"effects": effects, "improved": {"parameters": parameters}}
    return known.Answers({"content": {}}, {"content": content, "status": 0})


def effect(name: str, *others: str, **coefficient: float) -> dict[str, Any]:
    """A named effect with the rest of its class."""
    return {
        "id": name,
        "probability": 0.8,
        "indistinguishable_from": [{"id": each, "probability": 0.1} for each in others],
        "parameters": {key: {"value": value} for key, value in coefficient.items()},
    }


@pytest.mark.parametrize("uniform", [True, False])
def test_the_floor_is_the_noise_of_one_reading_whatever_the_motion(uniform: bool) -> None:
    time_s = np.arange(4000) / 30.0
    if not uniform:
        time_s = np.sort(RNG.uniform(0, time_s[-1], time_s.size))
    angle = 1.2 * np.exp(-0.01 * time_s) * np.cos(3.0 * time_s)
    noisy = angle + RNG.normal(0, 1e-3, time_s.size)
    noisy[::500] += 0.3  # lost marks are no noise
    # The median of 2000 sums of three squares that overlap is good to 1.8 %, by four of these.
    assert known.floor_of(time_s, noisy) == pytest.approx(1e-3, rel=0.072)


def test_an_item_is_found_by_a_name_or_by_its_class_and_by_no_other() -> None:
    found = answers([effect("circular-error", "cubic-stiffness", k3=-0.2)])
    assert known.is_found("circular-error", found)
    assert known.is_found("clipping/cubic-stiffness", found)
    assert not known.is_found("second-mode", found)
    assert not known.is_found("hardening", found)
    assert known.is_found("hardening", answers([effect("cubic-stiffness", k3=0.7)]))
    assert not known.is_found("hardening", answers([effect("cubic-stiffness", k3=-0.7)]))


def test_a_loss_is_found_where_its_interval_excludes_none() -> None:
    there, unsure = ({"value": 0.1, "interval95": [low, 0.2]} for low in (0.05, 0.0))
    assert known.is_found("a>0", answers([], a=there))
    assert not known.is_found("a>0", answers([], a=unsure))


def test_what_a_curve_explains_is_not_the_names() -> None:
    # Two thirds of the variance that the names leave are the curve's.
    rest = {"residual_rms_rad": 1.0, "chi2_per_dof": 4.0}
    curve = effect("unnamed-restoring") | {"kind": "unnamed", "delta_chi2": 800.0}
    content = {"baseline": {"residual_rms_rad": 9.0}, "improved": rest, "effects": [curve]}
    left = known.residuals(content, "fitting Eq. 8 to 100 readings")
    assert left == {"before": 9.0, "names": pytest.approx(3**0.5), "curve": 1.0}


def test_every_item_of_the_table_can_be_judged() -> None:
    with known.TABLE.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream, delimiter="\t", quoting=csv.QUOTE_NONE))
    words = {"quality", "period", "from", "until", "says", "gap", *known.TESTS}
    new = {"count-slips", "clock-slips", "rolling-shutter", "camera-geometry", "tracking-noise"}
    new |= {"amplitude-linear-stiffness", "keulegan-carpenter-drag"}
    new |= catalogue()
    new |= {"unnamed-restoring", "unnamed-measurement", "unnamed-drive", "unnamed-damping"}
    for row in rows:
        listed = known.items(row["known"]) + known.items(row["by_hand"])
        for each in [*"/".join(listed).split("/"), *row["wrong"].split("/")]:
            assert each.partition(":")[0] in words | new | {""}
