"""Numbers to quote: what a misfit costs them, shares of the loss, theory and calibration."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.interpolate import make_interp_spline

import pendpipe as pp
from pendpipe.analysis.calibrate import calibrate
from pendpipe.analysis.compare import theory_curve
from pendpipe.analysis.fit import goodness, result
from pendpipe.analysis.fit.consequence import unsure
from pendpipe.analysis.fit.decrement import Check
from pendpipe.analysis.fit.quality import TOLD_APART
from pendpipe.analysis.fit.result import FitResult
from pendpipe.arrays import FloatArray
from pendpipe.cli import main
from pendpipe.dynamics import Eq8, Release, sample, turning_points
from pendpipe.errors import InputError
from pendpipe.physics import Fluid, Rod, Sphere

from ..recordings import white

# The light says what the misfit does to the numbers, and not how loud it is.

OMEGA, LOSS = 6.0, 0.03
TIME = np.arange(0.0, 80.0, 0.02)
PERIOD = 2.0 * math.pi / math.hypot(OMEGA, LOSS)


def viscous(time_s: FloatArray, phase: FloatArray | None = None) -> FloatArray:
    """0.3 rad, Q = omega/(2 b) = 100."""
    turn = OMEGA * time_s if phase is None else phase
    return np.asarray(0.3 * np.exp(-LOSS * time_s) * np.cos(turn))


def fitted(values: FloatArray, rms: float = 1e-4, **options: Any) -> FitResult:
    recording = pp.Recording(
        time_s=TIME[: len(values)], angle_rad=values + white(5, len(values), rms)
    )
    return pp.fit(recording, restoring="linear", **options)


def test_noise_alone_widens_nothing() -> None:
    fit = fitted(viscous(TIME))
    assert (fit.light, fit.refuted) == ("green", False)
    assert fit.lawless is None
    assert "from the turning points" not in str(fit)
    assert {"period", "Q"} <= set(fit.quotable)


def test_a_loud_even_harmonic_of_the_sensor_moves_neither_period_nor_q() -> None:
    """A sensor's x + 0.05 x^2: a hundred times the noise."""
    angle = viscous(TIME)
    fit = fitted(angle + 0.05 * angle**2)
    assert fit.chi2_per_dof > 20.0
    assert fit.refuted
    assert fit.light == "green"
    assert "right to 5 %" in fit.light_reason
    assert "diagnose" in fit.light_reason
    assert abs(fit["Q"].value - 100.0) < 0.5
    assert abs(fit["period"].value / PERIOD - 1.0) < 1e-5
    assert "from the turning points" in str(fit)
    assert "(error ×" not in str(fit)


def test_some_cycles_of_a_long_record_tell_the_errors_of_its_misfit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every third of 76, of a bent sensor whose gain wanders: as all of them to a tenth.

    They are counted from the first reading, half a cycle from where their phase is 0.
    """
    values = viscous(TIME)
    values = (values * (1.0 + 0.01 * np.sin(0.2 * TIME)) + 0.05 * values**2)[26:]
    every = fitted(values)
    monkeypatch.setattr(goodness, "_ROWS", len(TIME) // 2)
    some = fitted(values)
    assert every.refuted
    for name, estimate in every.parameters.items():
        assert some.parameters[name].sd == pytest.approx(estimate.sd, rel=0.1)
    assert some["frequency"].sd != every["frequency"].sd


def test_a_period_that_drifts_is_what_the_swings_of_each_amplitude_show() -> None:
    """A frequency that falls by 0.5 % along the record, as the amplitude falls to 0.09 of it."""
    drift = 0.005
    phase = OMEGA * TIME * (1.0 - 0.5 * drift * TIME / TIME[-1])
    fit = fitted(viscous(TIME, phase))
    assert fit.refuted
    assert fit["period"] == fit.backbone.small_period
    for amplitude in (0.28, 0.15, 0.05, 0.03):
        seen, since = fit.backbone.period(amplitude), math.log(0.3 / amplitude) / LOSS
        true = PERIOD / (1.0 - drift * since / TIME[-1])
        assert abs(seen.value - true) < 3.0 * seen.sd < 0.05 * drift * PERIOD
    # It drifts with time, and is then the mean; of small swings it would be above the last one's.
    mean = PERIOD / (1.0 - 0.5 * drift)
    assert abs(fit["period"].value - mean) < fit["period"].sd < 0.25 * drift * PERIOD
    assert [check.seen for check in fit.period_check] == sorted(
        check.seen for check in fit.period_check
    )
    assert abs(fit["Q"].value - 100.0) < 5.0


def test_amber_names_what_cannot_be_quoted() -> None:
    fit = fitted(viscous(TIME[:400]), rms=0.01)
    assert fit.light == "amber"
    assert fit.light_reason.startswith("don't quote ")
    assert "Q at" in fit.light_reason
    assert "Q" not in fit.quotable
    assert fit.light_reason in str(fit)


@pytest.mark.parametrize(("p_value", "doubted"), [(0.4, []), (1e-6, [0])])
def test_a_loss_is_doubted_only_where_more_than_noise_is_left(
    p_value: float, doubted: list[int]
) -> None:
    """Turning points 2.6 of their errors, and 8 %, off: chance, unless the law misses something."""
    fit = fitted(viscous(TIME))
    large = fit.decrement_check[0]
    chance = large._replace(seen=large.fitted / 1.08, seen_sd=0.08 * large.fitted / 1.08 / 2.6)
    checks = (chance, *fit.decrement_check[1:])
    agreement = replace(fit.agreement, fit_p_value=p_value, decrement_check=checks)
    off, unseen = unsure(replace(fit, agreement=agreement))
    assert [checks.index(each) for each in off] == doubted
    assert not unseen


def test_white_readings_overrule_turning_points_that_contradict_and_say_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What the turning points show stays what it was, error and all."""
    wrong = Check(0.2, LOSS, 0.8 * LOSS, 0.01 * LOSS), Check(0.1, LOSS, LOSS, 0.01 * LOSS)
    monkeypatch.setattr(result, "check_decrement", lambda *_: wrong)
    fit = fitted(viscous(TIME))
    first, second = fit.decrement_check
    assert first._replace(overruled="") == wrong[0]
    assert second == wrong[1]
    assert "leave only noise" in first.overruled
    assert first.p_value < 1e-12
    assert not any((fit.refuted, first.contradicts, first.confirms))
    assert any("overruled" in said for said in fit.warnings)
    assert fit.to_dict()["decrement_check"][0]["overruled"] == first.overruled


@pytest.mark.slow
def test_small_and_noisy_swings_of_the_law_itself_are_green() -> None:
    """Sixteen decays whose turning points show Q to 3 to 10 %: chance lights nothing."""
    lights = []
    for seed in range(16):
        recording = pp.Recording(
            time_s=TIME, angle_rad=0.1 * viscous(TIME) / 0.3 + white(seed, len(TIME), 2e-3)
        )
        lights.append(pp.fit(recording).light)
    assert lights.count("green") >= 15


@pytest.mark.slow
def test_red_keeps_the_period_and_q_of_the_turning_points() -> None:
    fit = fitted(viscous(TIME), fixed={"b": 2.0 * LOSS})
    assert fit.light == "red"
    assert abs(fit["period"].value / PERIOD - 1.0) < 1e-3
    assert fit["Q"] == fit.quality_factors[0].quality_factor
    for each in fit.quality_factors:
        assert abs(each.quality_factor.value - 100.0) < 4.0 * each.quality_factor.sd
        assert not each.losses
    assert fit.to_dict()["quality_factors"][0]["losses"] is None
    assert "from the turning points alone" in str(fit)
    assert "−dy/dt" not in str(fit)
    with pytest.raises(pp.InputError, match="turning points show Q from"):
        fit.quality_factor(1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("b", [LOSS, 2.0 * LOSS])
def test_what_stands_in_fit_json_comes_back(b: float) -> None:
    fit = fitted(viscous(TIME), fixed={"b": b})
    again = FitResult.from_json(fit.to_dict())
    assert again.to_dict() == fit.to_dict()
    assert (again.period.value, again.period.sd) == (fit.period.value, fit.period.sd)


def test_the_times_of_a_viscous_decay_are_those_of_its_loss() -> None:
    found = fitted(viscous(TIME)).damping()
    assert found["damping_time_s"].value == pytest.approx(1.0 / LOSS, rel=2e-3)
    assert found["half_life_s"].value == pytest.approx(math.log(2.0) / LOSS, rel=2e-3)
    assert found["logarithmic_decrement"].value == pytest.approx(LOSS * PERIOD, rel=2e-3)


KNOWN = {
    "drag": (Eq8(OMEGA, quadratic=0.05, restoring="sine"), 1.0),
    "drag by v|v|": (Eq8(OMEGA, quadratic=0.05, restoring="sine", drag="speed"), 2.0),
    "viscous": (Eq8(OMEGA, viscous=0.02, restoring="sine"), 1.5),
    "hysteretic, Q of 15": (Eq8(OMEGA, hysteretic=0.2), 0.3),
    "dry, Q of 20 at first": (Eq8(OMEGA, coulomb=0.045), 0.3),
    "all": (Eq8(OMEGA, 0.02, 0.005, 0.005, 0.002, "sine"), 0.6),
}


@pytest.mark.parametrize("name", KNOWN)
def test_the_amplitude_falls_to_a_half_and_to_1_e_when_the_fit_says(name: str) -> None:
    """Of six known decays the turning points themselves, without noise, tell when."""
    law, first = KNOWN[name]
    time = np.arange(0.0, 100.0, 0.02)
    fit = pp.fit(
        pp.Recording(
            time, angle_rad=sample(law, Release(-0.1, first), time) + white(3, len(time), 1e-4)
        )
    )
    found = fit.damping()
    own = turning_points(law, Release(-0.1, first), until_s=600.0)
    when = make_interp_spline(-np.log(np.abs(own.angle_rad)), own.time_s, k=3)
    start = found["amplitude_rad"].value
    for quantity, part in {"half_life_s": 0.5, "damping_time_s": math.exp(-1.0)}.items():
        lasts = float(when(-math.log(part * start)) - when(-math.log(start)))
        assert abs(found[quantity].value - lasts) < 3.0 * found[quantity].sd
        assert found[quantity].sd < 0.02 * lasts


def test_a_time_beyond_the_recording_is_called_extrapolated() -> None:
    """Halved after 23 s, and down to 1/e after 33 s."""
    for until, said in ((1000, "s, both extrapolated"), (1500, "s (extrapolated)"), (3100, "s")):
        assert re.search(rf"[0-9)] {re.escape(said)}; log", str(fitted(viscous(TIME[:until]))))


def test_what_the_clock_leaves_out_is_said_or_enters_the_error() -> None:
    fit = fitted(viscous(TIME))
    assert "an error of 50 ppm adds" in str(fit)
    known = fitted(viscous(TIME), clock_ppm=20.0)
    both = math.hypot(fit["period"].sd, 2e-5 * PERIOD)
    assert known["period"].sd == pytest.approx(both, rel=1e-3)
    assert "50 ppm" not in str(known)


def test_a_scale_that_may_be_off_enters_amplitude_a_and_c_and_the_period_by_sin_x() -> None:
    """The amplitude of the small-angle period's correction A^2/16 is known as well as the scale."""
    plain, wide = (pp.fit("examples/string-pendulum.csv", scale_percent=p) for p in (None, 2.0))
    for name in ("amplitude", "a"):
        sd = math.hypot(plain[name].sd, 0.02 * plain[name].value)
        assert wide[name].sd == pytest.approx(sd)
    assert wide["b"].sd == plain["b"].sd
    moved = math.sqrt(wide["frequency"].sd ** 2 - plain["frequency"].sd ** 2)
    assert moved / plain["frequency"].value == pytest.approx(0.02 * 0.42**2 / 8.0, rel=0.1)
    assert wide.to_dict()["scale_percent"] == 2.0
    with pytest.raises(pp.InputError, match="scale_percent"):
        pp.fit("examples/string-pendulum.csv", scale_percent=-1.0)


# Which loss takes how much, as far as a fit tells it.


def decay(lasts_s: float, noise_rad: float) -> pp.Recording:
    """Viscous: 0.3 rad, omega 6 1/s, b 0.03 1/s."""
    time_s = np.arange(0.0, lasts_s, 0.02)
    angle_rad = 0.3 * np.exp(-0.03 * time_s) * np.cos(6.0 * time_s) + white(
        2, len(time_s), noise_rad
    )
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


@pytest.mark.parametrize("part", [0.04, 0.4])
def test_a_share_has_its_error_or_its_limit(part: float) -> None:
    """Viscous loss beside dry friction: however small it is, what is seen is not called unseen."""
    law = Eq8(OMEGA, viscous=0.03 * part, coulomb=0.2 * 0.03 * (1.0 - part))
    time = np.arange(0.0, 45.0, 0.02)
    fit = pp.fit(
        pp.Recording(
            time, displacement_m=sample(law, Release(-0.1, 0.3), time) + white(3, len(time), 1e-4)
        )
    )
    large, printed = fit.quality_factors[0], str(fit)
    share = large.losses["b"]
    assert share.value > 2.0 * share.sd
    true = law.viscous / (law.viscous + law.coulomb / large.amplitude_rad)
    assert share.bounds95[0] <= true <= share.bounds95[1]
    assert re.search(r"[0-9.]+\([0-9.]+\) % viscous or internal \(b\)", printed)
    assert re.search(r"drag ~ speed² \(a\) < [0-9.]+ %", printed)
    assert large.losses["a"].bounds95[0] <= 0.0 < large.losses["a"].bounds95[1] < 0.1
    entry = fit.to_dict()["quality_factors"][0]
    assert entry["losses_interval95"]["b"] == list(share.bounds95)


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
    with pytest.raises(pp.InputError, match="not an amplitude"):
        fit.quality_factor(-0.1)
    assert FitResult.from_json(json.loads(json.dumps(content)))["Q"] == fit["Q"]


# Theory stands beside a pendulum that has a sphere in its fluid, and beside no other.

WATER = Fluid(998.0, 1.0e-3), 9.81
ROD = Rod(0.2, 0.8, 0.3)
BALL = Sphere(0.3, 0.02, 0.7, submerged=True)


def test_the_history_term_divides_q_by_one_and_a_over_delta() -> None:
    curve = theory_curve([ROD, BALL], *WATER)
    delta = np.sqrt(2.0 * 1.0e-3 / (998.0 * 2.0 * np.pi * curve["frequency_hz"]))
    assert curve["a_over_delta"] == pytest.approx(0.02 / delta)
    ratio = curve["quality_factor_viscous_steady"] / curve["quality_factor_viscous_theory"]
    assert ratio == pytest.approx(1.0 + curve["a_over_delta"])
    # Added mass and buoyancy both lengthen the period, and together more.
    parts = curve["lengthening_buoyancy"], curve["lengthening_added_mass"]
    assert 0.0 < max(parts) < curve["lengthening_both"]


def test_without_a_submerged_sphere_there_is_no_theory() -> None:
    assert theory_curve([ROD, Sphere(0.3, 0.02, 0.7)], *WATER) is None
    assert theory_curve([ROD], *WATER) is None


# The sensor's line: injected truth, honest errors, and the test of linearity.

ANGLES = np.linspace(-0.06, 0.06, 25)


def caliper_run(
    seed: int, *, volts_sd: float, angle_sd: float, cubic: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    volts = 0.012 + 3.85 * ANGLES + cubic * ANGLES**3
    noisy = volts + volts_sd * random.standard_normal(25)
    return ANGLES + angle_sd * random.standard_normal(25), noisy


@given(slope=st.floats(0.01, 1e3), offset=st.floats(-5.0, 5.0), sign=st.sampled_from([-1, 1]))
@settings(deadline=None)
def test_an_exact_line_is_found_exactly(slope: float, offset: float, sign: int) -> None:
    result = calibrate(ANGLES, offset + sign * slope * ANGLES)
    assert result.volts_per_radian.value == pytest.approx(sign * slope, rel=1e-9)
    assert result.offset.value == pytest.approx(offset, abs=1e-9 * (1 + slope))


def test_line_is_least_squares_where_the_angles_are_exact() -> None:
    angle, volts = caliper_run(1, volts_sd=1e-3, angle_sd=0.0)
    weights = np.random.default_rng(2).uniform(0.5, 2.0, 25)
    result = calibrate(angle, volts, volts_sd=1e-3 / weights)
    slope, offset = np.polyfit(angle, volts, 1, w=weights)
    _, covariance = np.polyfit(angle, volts, 1, w=weights / 1e-3, cov="unscaled")
    assert result.volts_per_radian.value == pytest.approx(slope, rel=1e-12)
    assert result.offset.value == pytest.approx(offset, rel=1e-9)
    assert result.volts_per_radian.sd == pytest.approx(np.sqrt(covariance[0, 0]), rel=1e-9)
    assert result.offset.sd == pytest.approx(np.sqrt(covariance[1, 1]), rel=1e-9)
    assert result.covariance == pytest.approx(covariance[0, 1], rel=1e-9)


def test_pearsons_data_with_yorks_weights() -> None:
    # The field's standard example: York 1966 finds -0.48053 and 5.4799 for these.
    x = np.array([0.0, 0.9, 1.8, 2.6, 3.3, 4.4, 5.2, 6.1, 6.5, 7.4])
    y = np.array([5.9, 5.4, 4.4, 4.6, 3.5, 3.7, 2.8, 2.8, 2.4, 1.5])
    x_weight = np.array([1000.0, 1000, 500, 800, 200, 80, 60, 20, 1.8, 1])
    y_weight = np.array([1.0, 1.8, 4, 8, 20, 20, 70, 70, 100, 500])
    result = calibrate(x, y, volts_sd=y_weight**-0.5, angle_sd_rad=x_weight**-0.5)
    assert result.volts_per_radian.value == pytest.approx(-0.480533407, abs=1e-8)
    assert result.offset.value == pytest.approx(5.47991022, abs=1e-7)
    # York et al. 2004: 0.058 and 0.295 (maximum likelihood).
    assert result.volts_per_radian.sd == pytest.approx(0.058, abs=5e-4)
    assert result.offset.sd == pytest.approx(0.295, abs=5e-4)


@pytest.mark.parametrize(
    ("volts_sd", "angle_sd", "known"),
    [(1e-3, 0.0, True), (3e-5, 3.3e-5, True), (0.02, 0.006, True), (1e-3, 0.0, False)],
    ids=["volts", "caliper", "coarse angles", "unknown errors"],
)
def test_pulls_are_unbiased_with_unit_scatter(
    volts_sd: float, angle_sd: float, known: bool
) -> None:
    pulls, fits, curves = [], [], []
    for seed in range(400):
        angle, volts = caliper_run(seed, volts_sd=volts_sd, angle_sd=angle_sd)
        given_sd = np.full(25, volts_sd) if known else None
        result = calibrate(angle, volts, volts_sd=given_sd, angle_sd_rad=angle_sd)
        pulls.append((result.volts_per_radian.value - 3.85) / result.volts_per_radian.sd)
        fits.append(result.chi2_p_value)
        curves.append(result.linearity.p_value)
    # Four standard errors of a mean and of a scatter of 400 pulls.
    assert abs(np.mean(pulls)) < 4.0 / np.sqrt(400)
    assert abs(np.std(pulls) - 1.0) < 4.0 / np.sqrt(800)
    for p_values in [curves, fits] if known else [curves]:
        assert abs(np.mean(p_values) - 0.5) < 4.0 / np.sqrt(12 * 400)


def test_least_squares_would_be_biased_where_york_is_not() -> None:
    pulls = []
    for seed in range(200):
        angle, volts = caliper_run(seed, volts_sd=0.02, angle_sd=0.006)
        result = calibrate(angle, volts, volts_sd=np.full(25, 0.02))
        pulls.append((result.volts_per_radian.value - 3.85) / result.volts_per_radian.sd)
    assert np.mean(pulls) < -0.3


def test_curvature_is_noticed() -> None:
    angle, straight = caliper_run(5, volts_sd=1e-4, angle_sd=0.0)
    _, curved = caliper_run(5, volts_sd=1e-4, angle_sd=0.0, cubic=-20.0)
    sd = np.full(25, 1e-4)
    flat, bent = calibrate(angle, straight, volts_sd=sd), calibrate(angle, curved, volts_sd=sd)
    assert flat.linearity.p_value > 0.01
    assert bent.linearity.p_value < 1e-6
    assert abs(bent.linearity.cubic.value + 20.0) < 4.0 * bent.linearity.cubic.sd
    assert abs(bent.linearity.quadratic.value) < 4.0 * bent.linearity.quadratic.sd
    assert bent.chi2_p_value < 1e-6
    assert calibrate(angle, curved).linearity.p_value < 1e-6


def test_the_arms_error_is_the_constants_alone() -> None:
    angle, volts = caliper_run(3, volts_sd=1e-3, angle_sd=0.0)
    sd = np.full(25, 1e-3)
    bare = calibrate(angle, volts, volts_sd=sd)
    with_arm = calibrate(angle, volts, volts_sd=sd, relative_scale_sd=0.01)
    assert with_arm.volts_per_radian.sd == pytest.approx(
        np.hypot(bare.volts_per_radian.sd, 0.01 * bare.volts_per_radian.value)
    )
    assert with_arm.offset.sd == bare.offset.sd


@given(unit=st.floats(1e-3, 1e3))
@settings(deadline=None)
def test_units_scale(unit: float) -> None:
    angle, volts = caliper_run(4, volts_sd=1e-3, angle_sd=1e-4)
    sd = np.full(25, 1e-3)
    one = calibrate(angle, volts, volts_sd=sd, angle_sd_rad=1e-4)
    other = calibrate(unit * angle, volts, volts_sd=sd, angle_sd_rad=unit * 1e-4)
    assert other.volts_per_radian.value * unit == pytest.approx(
        one.volts_per_radian.value, rel=1e-10
    )
    assert other.volts_per_radian.sd * unit == pytest.approx(one.volts_per_radian.sd, rel=1e-8)
    assert other.linearity.p_value == pytest.approx(one.linearity.p_value, rel=1e-5)


@pytest.mark.parametrize(
    ("angle", "volts", "sd", "problem"),
    [
        ([0.0, 1.0], [0.0, 1.0], None, "too few"),
        ([0.1, 0.1, 0.1], [0.0, 1.0, 2.0], None, "angles are the same"),
        ([0.1, 0.2, 0.3], [1.0, 1.0, 1.0], None, "volts are the same"),
        ([0.1, 0.2, np.nan], [1.0, 1.1, 1.2], None, "NaN"),
        ([0.1, 0.2, 0.3], [1.0, 1.1, 1.2], [0.1, 0.0, 0.1], "no error"),
        ([0.1, 0.2, 0.3], [1.0, 1.1, 1.2], [0.1, -0.1, 0.1], "negative"),
    ],
)
def test_points_without_a_line_are_refused(
    angle: list[float], volts: list[float], sd: list[float] | None, problem: str
) -> None:
    errors = None if sd is None else np.array(sd)
    with pytest.raises(InputError, match=problem):
        calibrate(np.array(angle), np.array(volts), volts_sd=errors)


def test_command_reads_displacements_and_writes_the_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    angle, volts = caliper_run(7, volts_sd=1e-4, angle_sd=0.0)
    table, out = tmp_path / "caliper.csv", tmp_path / "sensor.json"
    rows = "".join(
        f"{0.3 * a!r},{v!r}\n" for a, v in zip(angle.tolist(), volts.tolist(), strict=True)
    )
    table.write_text("# a remark\ndisplacement_m,volts\n" + rows)
    assert main(["calibrate", str(table), "--arm-m", "0.3", "--out", str(out)]) == 0
    content = json.loads(out.read_text())
    direct = calibrate(angle, volts)
    assert content["volts_per_radian"]["value"] == pytest.approx(
        direct.volts_per_radian.value, rel=1e-12
    )
    assert f"{direct.volts_per_radian.value:.7g}" in capsys.readouterr().out


def test_command_reads_degrees_and_decimal_commas(tmp_path: Path) -> None:
    table, out = tmp_path / "t.csv", tmp_path / "o.json"
    table.write_text("angle_deg;volts;who\n-3,5;-0,2\n0;0,0;me\n3,5;0,2;you\n7;0,4;you\n")
    assert main(["calibrate", str(table), "--out", str(out)]) == 0
    constant = json.loads(out.read_text())["volts_per_radian"]["value"]
    assert constant == pytest.approx(0.2 / np.deg2rad(3.5), rel=1e-12)


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("angle_rad,current\n0,1\n", "column volts is needed"),
        ("phi,volts\n0,1\n", "angle_rad or angle_deg or displacement_m"),
        ("angle_rad,angle_deg,volts\n0,0,1\n", "exactly one"),
        ("angle_rad,volts\n0,1\n1,two\n2,3\n", "line 3: volts 'two' is not a number"),
        ("angle_rad,volts\n0,1\n1\n", "line 3: volts is missing"),
        ("angle_rad,volts\n0,1\n1,2\n2,3\n1e12,4\n", "line 5: angle_rad is 1e12"),
        ("angle_rad,volts\n0,1\n1,nan\n", "line 3: volts is nan"),
        ("angle_rad,volts\n0,1\n1,2\n", "too few"),
        ("displacement_m,volts\n0,1\n1,2\n2,3\n", "--arm-m"),
        ("angle_rad,volts\n0.1,1\n0.1,2\n0.1,3\n", "angles are the same"),
        ("", "empty"),
        (None, "check the path"),
    ],
)
def test_a_bad_table_is_one_line_and_status_2(
    content: str | None, fault: str, tmp_path: Path, refusal_of: Any
) -> None:
    table, out = tmp_path / "t.csv", tmp_path / "o.json"
    if content is not None:
        table.write_text(content)
    assert fault in refusal_of(["calibrate", str(table), "--out", str(out)])
    assert not out.exists()


def test_a_constant_that_is_given_is_exact_and_comes_before_the_caliper_run(tmp_path: Path) -> None:
    recording, out, run = (tmp_path / name for name in ("r.csv", "out.json", "sensor.json"))
    recording.write_text("time_s,volts\n" + "".join(f"{k},{k % 3}\n" for k in range(9)))
    measured = {"value": 3.85, "sd": 0.01, "unit": "V/rad"}
    run.write_text(json.dumps({"volts_per_radian": measured, "points": [{"angle_rad": 9.0}]}))
    words = ["calibrate", str(recording), "--record", "one", "--out", str(out)]
    assert main([*words, "--sensor", str(run)]) == 0
    assert json.loads(out.read_text())["volts_per_radian"] == measured
    assert main([*words, "--sensor", str(run), "--volts-per-radian", "2"]) == 0
    given = json.loads(out.read_text())["volts_per_radian"]
    assert given == {"value": 2.0, "sd": 0.0, "unit": "V/rad"}


def test_a_point_far_beyond_the_others_ends_in_no_traceback() -> None:
    points = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 1e12])
    assert calibrate(points, points).volts_per_radian.value == pytest.approx(1.0)


def test_a_line_takes_two_of_the_points() -> None:
    """Without errors given the scatter is that of n - 2: neither too small nor too large."""
    angle = np.linspace(-0.2, 0.2, 5)
    random, noise = np.random.default_rng(11), 2e-3
    found = [calibrate(angle, 3.85 * angle + noise * random.standard_normal(5)) for _ in range(600)]
    variance = np.mean([each.residual_sd_volts**2 for each in found])
    # The mean of 600 chi^2 of 3 degrees of freedom is known to sqrt(2/3/600) = 3.3 %.
    assert variance == pytest.approx(noise**2, rel=0.1)
    slopes = np.array([each.volts_per_radian.value for each in found])
    given = np.mean([each.volts_per_radian.sd**2 for each in found])
    assert given == pytest.approx(slopes.var(), rel=0.2)


@pytest.mark.parametrize("count", [5, 9])
def test_digits_are_no_curvature(count: int) -> None:
    """Points on a line to all four digits that are written, but for the last one of one of them."""
    angle = np.linspace(-0.2, 0.2, count)
    volts = np.round(3.85 * angle, 4)
    volts[-1] += 1e-4
    found = calibrate(angle, volts)
    assert found.linearity is None if count == 5 else found.linearity.p_value > 0.01  # type: ignore[union-attr]
