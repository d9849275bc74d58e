"""The backbone: what turning points show of period and decrement where no law describes them."""

import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import pendpipe as pp
from pendpipe.analysis.fit.backbone import Backbone
from pendpipe.analysis.fit.result import FitResult
from pendpipe.files import plain
from pendpipe_challenge.motion import Motion
from pendpipe_challenge.torques import of_rates

from ..recordings import white

INPUTS = Path(__file__).parents[3] / "shared" / "inputs4"
SHARED = pytest.mark.skipif(not INPUTS.exists(), reason="../shared is not here")

OMEGA, FIRST = 6.0, 0.4
BASE = of_rates(OMEGA, 0.02, 0.012, 0.0, 0.0) | {"step_phase": 0.05}
LAWS: dict[str, dict[str, float]] = {
    "x − 0.5 x³ + 0.6 x⁵": {"cubic": -1.0, "stiffening": 0.5, "stiffening_scale": 0.2},
    "x + 0.1 x|x|": {"sided": 0.1},
    "x − 0.1 x|x|": {"sided": -0.1},
    "loss with v³": {"rayleigh": 0.01},
    "loss with x² v": {"van_der_pol": 0.4},
    "Stribeck": {"coulomb": 0.004, "stribeck": 0.006, "stribeck_speed": 0.3},
}


@cache
def decay(name: str, seed: int = 1, lasts_s: float = 90.0) -> FitResult:
    """The fit of a decay by Eq. 8, which the law's torque or loss leaves."""
    time = np.arange(0.1, lasts_s, 0.02)
    angle = Motion(BASE | LAWS[name], FIRST).run(np.r_[0.0, time]).angle_rad[1:]
    return pp.fit(pp.Recording(time, displacement_m=angle + white(seed, len(time), 2e-4)))


@cache
def true_quality(name: str) -> Any:
    """Q by ln y, from the turning points of the motion itself."""
    step = 0.002
    track = Motion(BASE | LAWS[name], FIRST).run(np.arange(0.0, 250.0, step))
    angle, rate = track.angle_rad, track.rate_rad_s
    before = np.flatnonzero(rate[:-1] * rate[1:] < 0.0)
    late = step * rate[before] / (rate[before] - rate[before + 1])
    logs = np.log(np.abs(angle[before] + 0.5 * rate[before] * late))
    quality = math.pi / (logs[:-2] - logs[2:])
    return make_interp_spline(logs[1:-1][::-1], quality[::-1])


@pytest.mark.parametrize("name", LAWS)
def test_the_period_of_small_swings_and_q_are_right_where_the_law_is_not(name: str) -> None:
    fit = decay(name)
    assert fit.refuted
    assert {"period", "Q"} <= set(fit.quotable)
    assert not {"a", "b", "c"} & set(fit.quotable)
    assert abs(fit["period"].value - 2.0 * math.pi / OMEGA) < 3.0 * fit["period"].sd
    for each in fit.quality_factors:
        true = float(true_quality(name)(math.log(each.amplitude_rad)))
        found = each.quality_factor
        assert abs(found.value - true) < 3.5 * found.sd
        assert found.sd < 0.05 * true
    assert "from the turning points" in str(fit)
    assert "error ×" not in str(fit)


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("relaxed", [0.0, 3.0])
def test_a_period_that_drifts_with_time_is_its_mean(relaxed: float, seed: int) -> None:
    """A clock that is off by up to 0.3 %, straight or as what warms up; damping falls as fast."""
    time = np.arange(0.1, 90.0, 0.02)
    passed = np.linspace(0.0, 1.0, len(time))
    late = 0.003 * (np.expm1(-relaxed * passed) / math.expm1(-relaxed) if relaxed else passed)
    clock = time + np.cumsum(0.02 * late)
    angle = Motion(BASE, FIRST).run(np.r_[0.0, time]).angle_rad[1:]
    fit = pp.fit(pp.Recording(clock, displacement_m=angle + white(seed, len(time), 2e-4)))
    assert fit.refuted
    mean = 2.0 * math.pi / OMEGA * float(np.ptp(clock) / np.ptp(time))
    assert abs(fit["period"].value - mean) < 3.0 * fit["period"].sd < 0.005 * mean


def test_a_bent_scale_is_in_the_error_of_q() -> None:
    """A sensor that reads x (1 − 0.1 x²), of which its third harmonic is all that tells."""
    true, sds = true_quality("x + 0.1 x|x|"), []
    for bent in (0.0, -0.1):
        time = np.arange(0.1, 90.0, 0.02)
        angle = Motion(BASE | LAWS["x + 0.1 x|x|"], FIRST).run(np.r_[0.0, time]).angle_rad[1:]
        fit = pp.fit(
            pp.Recording(
                time, displacement_m=angle * (1.0 + bent * angle**2) + white(3, len(time), 2e-4)
            )
        )
        assert fit.refuted
        for each in fit.quality_factors:
            found = each.quality_factor
            off = abs(found.value - float(true(math.log(each.amplitude_rad))))
            assert off < 3.0 * found.sd
        sds.append(fit.quality_factors[0].quality_factor.sd)
    assert sds[1] > 2.0 * sds[0]


def test_what_lies_beyond_the_points_is_known_the_worse_the_farther_it_is() -> None:
    """The same decay, stopped sooner: its period of small swings, and Q below its last swing."""
    sds = [decay("x + 0.1 x|x|", lasts_s=lasts)["period"].sd for lasts in (90.0, 60.0, 40.0)]
    assert sds[0] < sds[1] < sds[2]
    shown = decay("x + 0.1 x|x|").backbone
    assert shown is not None
    inside, least = math.sqrt(math.prod(shown.seen_rad)), shown.seen_rad[1]
    relative = [shown.loss(y).sd / shown.loss(y).value for y in (inside, least, 0.5 * least)]
    assert relative[0] < relative[1] < relative[2]


def test_a_fit_and_its_file_share_one_backbone() -> None:
    fit = decay("x + 0.1 x|x|")
    content = json.loads(json.dumps(fit.to_dict()))
    again = FitResult.from_json(content)
    assert fit.backbone is not None
    assert again.backbone is not None
    assert plain(again.backbone) == plain(fit.backbone) == content["backbone"]
    assert again["period"].value == fit["period"].value == content["period"]["value"]
    assert again["Q"] == fit["Q"]
    assert [each["seen"] for each in content["period_check"]] == [
        fit.backbone.period(each.amplitude_rad).value for each in fit.decrement_check
    ]


def test_a_law_that_stands_is_quoted_itself_and_agrees_with_its_backbone() -> None:
    fit = pp.fit("examples/rod-pendulum.csv")
    assert fit.lawless is None
    shown = fit.backbone
    assert isinstance(shown, Backbone)
    small = shown.small_period
    assert abs(small.value - fit["period"].value) < 3.0 * small.sd
    for each in fit.quality_factors:
        loss = shown.loss(each.amplitude_rad)
        assert abs(loss.value - 1.0 / each.damping_time_s.value) < 3.0 * loss.sd


def test_a_decay_of_too_few_clear_swings_has_none() -> None:
    fit = pp.fit("examples/rod-pendulum.csv")
    assert fit.points is not None
    few = FitResult.from_json({**fit.to_dict(), "backbone": None})
    assert few.backbone is None


@SHARED
@pytest.mark.parametrize("name", ["n01_softening.csv", "n01_hull.csv"])
def test_a_tank_and_a_hull_have_the_period_of_their_small_swings(name: str) -> None:
    """They were 600 of their errors off."""
    fit = pp.fit(INPUTS / name)
    assert abs(fit["period"].value - 0.8) < 3.0 * fit["period"].sd
    assert fit["period"].sd < 2e-4
