"""Which loss takes how much, as far as a fit tells it."""

import json

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.analysis.fit.quality import TOLD_APART
from pendpipe.analysis.fit.result import FitResult


def decay(lasts_s: float, noise_rad: float) -> pp.Recording:
    """Viscous: 0.3 rad, omega 6 1/s, b 0.03 1/s."""
    time_s = np.arange(0.0, lasts_s, 0.02)
    noise = noise_rad * np.random.default_rng(2).standard_normal(len(time_s))
    angle_rad = 0.3 * np.exp(-0.03 * time_s) * np.cos(6.0 * time_s) + noise
    return pp.Recording(time_s=time_s, angle_rad=angle_rad)


def test_a_long_decay_tells_which_loss_takes_it() -> None:
    """It falls to a fiftieth: drag and dry friction would have taken it otherwise."""
    fit = pp.fit(decay(130.0, 1e-4), restoring="linear")
    for each in fit.quality_factors:
        for name, share in each.losses.items():
            assert share.sd < 0.05
            assert abs(share.value - (name == "b")) < 3.0 * share.sd + 0.01
        assert each.dominant == "b"


def test_six_swings_tell_the_loss_but_not_which() -> None:
    fit = pp.fit(decay(6.0, 2e-3), restoring="linear")
    for each in fit.quality_factors:
        # pi f/b, whichever loss it is.
        assert abs(each.quality_factor.value - 100.0) < 4.0 * each.quality_factor.sd
        assert max(share.sd for share in each.losses.values()) > TOLD_APART
        assert each.dominant is None


def test_q_and_the_period_are_data() -> None:
    fit = pp.fit(decay(130.0, 1e-4), restoring="linear")
    # Q = omega/(2 b), at every amplitude; the period is that without the losses.
    assert abs(fit["Q"].value - 100.0) < 4.0 * fit["Q"].sd
    assert fit["Q"] == fit.quality_factor(fit["amplitude"].value)
    assert abs(fit.quality_factor(0.05).value - 100.0) < 4.0 * fit.quality_factor(0.05).sd
    assert abs(fit["period"].value - 2.0 * np.pi / np.hypot(6.0, 0.03)) < 4.0 * fit["period"].sd
    content = fit.to_dict()
    assert content["period"]["value"] == fit["period"].value
    for entry, of in zip(content["quality_factors"], fit.quality_factors, strict=True):
        assert entry["value"] == of.quality_factor.value
        assert sum(entry["losses"].values()) == pytest.approx(1.0)
    frame = fit.to_frame()
    assert frame.loc["Q", "value"] == fit["Q"].value
    assert frame.loc["period", "unit"] == "s"
    assert sum(name.startswith("Q(") for name in frame.index) == 3
    with pytest.raises(pp.InputError, match="no amplitude"):
        fit.quality_factor(-0.1)
    assert FitResult.from_json(json.loads(json.dumps(content)))["Q"] == fit["Q"]


def test_a_contradicted_law_leaves_the_q_of_the_turning_points() -> None:
    fit = pp.fit(decay(60.0, 1e-4), restoring="linear", fixed={"b": 0.06})
    assert fit.light == "red"
    assert abs(fit["Q"].value - 100.0) < 4.0 * fit["Q"].sd
    assert all(not each.losses for each in fit.quality_factors)
    assert fit.to_dict()["quality_factors"][0]["losses"] is None
    with pytest.raises(pp.InputError, match="turning points show Q from"):
        fit.quality_factor(1e-4)
