"""Fits to turning points and to amplitudes by hand, and the bounded problem beneath them."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import pendpipe as pp
from pendpipe.analysis.fit.by_points import fit_envelope, fit_period, fit_points
from pendpipe.analysis.readings import only_falls
from pendpipe.analysis.torque import period_excess
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.cli import main
from pendpipe.dynamics import Eq8, Release, sample, turning_points
from pendpipe.estimate import Estimate
from pendpipe.physics.decay import amplitude

from ..recordings import white

# The paper's route: Eq. 14 and Eq. 8's frequency from turning points.

OMEGA = 2.0 * math.pi * 0.516


def table(
    time_s: FloatArray, amplitudes: FloatArray, sd: float, seed: int | None = None
) -> TurningPoints:
    """Turning points on alternating sides, with noise where a seed is given."""
    number = np.arange(len(time_s))
    side = 1.0 - 2.0 * (number % 2)
    noise = 0.0 if seed is None else sd * np.random.default_rng(seed).standard_normal(len(time_s))
    return TurningPoints(
        half_cycle=number,
        time_s=time_s,
        time_sd_s=sd / (OMEGA * amplitudes),
        angle_rad=side * amplitudes + noise,
        angle_sd_rad=np.full(len(time_s), sd),
        level_rad=np.zeros(len(time_s)),
        level_sd_rad=0.1 * sd,
        noise_rms_rad=7.0 * sd,
        start_s=float(time_s[0]) - 0.1,
        samples=30000,
    )


def engine_table(model: Eq8, count: int, sd: float, y0: float = 0.068) -> TurningPoints:
    truth = turning_points(model, Release(0.5, y0), count=count)
    return table(truth.time_s, np.abs(truth.angle_rad), sd)


REGIMES = {
    "all": (0.45, 0.01192, 1.4e-6),
    "quadratic": (0.45, 0.0, 0.0),
    "exponential": (0.0, 0.01192, 0.0),
    "Coulomb, to the stop": (0.0, 0.0, 3e-4),
    "tangent (4 a c > b^2)": (0.45, 0.002, 1e-4),
    "b^2 = 4 a c": (0.4, 0.02, 2.5e-4),
}


@pytest.mark.parametrize("regime", REGIMES)
def test_eq_14_is_recovered_in_every_regime(regime: str) -> None:
    rates = REGIMES[regime]
    time = np.arange(260) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, *rates))
    moving = exact > 1e-5
    fit = fit_envelope(table(time[moving], exact[moving], 1e-8))
    assert fit.converged
    assert fit.value[:3] == pytest.approx(rates, rel=1e-4, abs=1e-8)
    assert fit.value[3] == pytest.approx(0.068, rel=1e-5)


@pytest.mark.slow
def test_pulls_are_standard() -> None:
    time = np.arange(309) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, *REGIMES["all"]))
    pulls = []
    for seed in range(300):
        fit = fit_envelope(table(time, exact, 1.4e-5, seed))
        sd = np.sqrt(np.diag(np.linalg.inv(fit.quadratic.normal)))
        pulls.append((fit.value - np.array([*REGIMES["all"], 0.068, 0.0]))[:4] / sd[:4])
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 3.5 / math.sqrt(300))
    assert np.all(np.abs(np.std(pulls, axis=0) - 1.0) < 3.5 / math.sqrt(600))


@pytest.mark.slow
def test_an_absent_loss_lies_at_its_bound_with_a_one_sided_interval() -> None:
    time = np.arange(200) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, 0.45, 0.0119, 0.0))
    fitted = [fit_points(table(time, exact, 1.4e-5, seed)).parameters["c"] for seed in range(60)]
    ends = [c.interval95 or (math.nan, math.nan) for c in fitted]
    assert all(low >= 0.0 and high > 0.0 for low, high in ends)
    assert sum(low == 0.0 for low, _ in ends) >= 55
    assert 15 <= sum(c.at_bound for c in fitted) <= 45
    assert all((c.value == 0.0) == c.at_bound for c in fitted)


@pytest.mark.parametrize(
    ("model", "leading"),
    [
        (Eq8(OMEGA, viscous=OMEGA / 40.0), 1.0 / (8.0 * 20.0**2)),
        (Eq8(OMEGA, hysteretic=OMEGA / 40.0), math.pi**2 / (32.0 * 20.0**2)),
        (Eq8(OMEGA, coulomb=1e-4), 0.0),
    ],
    ids=["viscous: Eq. 6", "hysteretic", "Coulomb: no shift"],
)
def test_the_period_is_lengthened_as_eq_8_says(model: Eq8, leading: float) -> None:
    truth = turning_points(model, Release(0.0, 0.068), count=2)
    b = model.viscous + model.hysteretic
    share = model.hysteretic / b if b else 0.0
    excess = truth.time_s[1] * OMEGA / math.pi - 1.0
    middle = np.array([0.5 * (0.068 + abs(truth.angle_rad[1]))])
    formula = period_excess(middle, OMEGA, model.quadratic, b, model.coulomb, share)[0]
    assert formula == pytest.approx(leading, abs=1e-15)
    assert excess == pytest.approx(formula, rel=0.01, abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    quadratic=st.floats(0.0, 1.0),
    linear=st.floats(0.005, 0.05),
    coulomb=st.floats(0.0, 1e-5),
    share=st.floats(0.0, 1.0),
)
def test_the_frequency_is_eq_8s_and_not_the_shifted_one(
    quadratic: float, linear: float, coulomb: float, share: float
) -> None:
    model = Eq8(OMEGA, quadratic, share * linear, (1.0 - share) * linear, coulomb)
    points = engine_table(model, 60, 1e-9)
    period = fit_period(points, points.amplitude_rad, (quadratic, linear, coulomb), share=share)
    shift = (linear / OMEGA) ** 2 + (quadratic * 0.068 / OMEGA) ** 2
    assert period.angular_frequency / OMEGA - 1.0 == pytest.approx(0.0, abs=0.05 * shift)


def test_the_unknown_share_widens_the_frequency() -> None:
    """At Q = 10 the shift lies between 0.125 % and 0.31 %, either part alone as likely as both."""
    for share in (0.0, 1.0):
        b = OMEGA / 20.0
        points = engine_table(Eq8(OMEGA, 0.0, share * b, (1.0 - share) * b), 12, 1e-9)
        frequency = fit_points(points).parameters["frequency"]
        low, high = frequency.interval95 or (math.nan, math.nan)
        assert low < 0.516 < high
        assert frequency.sd / frequency.value == pytest.approx(0.00117 / math.sqrt(2.0), rel=0.1)


def test_the_unknown_share_widens_the_time_of_release() -> None:
    """By where the line begins with either part of b, and b/(4 omega^2) of a half cycle's shape."""
    b = OMEGA / 20.0
    points = engine_table(Eq8(OMEGA, 0.0, 0.5 * b, 0.5 * b), 12, 1e-9)
    known, viscous, hysteretic, either = (
        fit_period(points, points.amplitude_rad, (0.0, b, 0.0), share=share)
        for share in (0.5, 0.0, 1.0, None)
    )
    ends = [viscous.time_s - known.time_s, hysteretic.time_s - known.time_s]
    shape = b / (4.0 * OMEGA**2)
    # An arcsine law's variance is half of the square of its end.
    added = 0.5 * (max(np.abs(ends)) ** 2 + shape**2)
    assert shape > 0.2 * max(np.abs(ends))
    found = either.covariance[1, 1] - known.covariance[1, 1]
    assert found == pytest.approx(added, rel=0.03)


def test_a_first_turning_point_on_the_wrong_side_has_an_answer() -> None:
    """A fit put it at zero, by which c is divided."""
    time = np.arange(9) * (math.pi / OMEGA)
    points = table(time, np.full(9, 0.01), 1e-3)
    angle, sd = points.angle_rad.copy(), points.angle_sd_rad.copy()
    angle[0], sd[0] = -angle[0], 1e-6
    fit = pp.fit(replace(points, angle_rad=angle, angle_sd_rad=sd))
    assert fit["amplitude"].value > 0.0
    assert "a" not in fit.quotable


def test_sin_x_is_refused_where_all_turn_beyond_its_top() -> None:
    time = np.arange(9) * (math.pi / OMEGA)
    with pytest.raises(pp.InputError, match="below pi rad"):
        pp.fit(table(time, 10.0 * np.exp(-0.1 * time), 1e-3), restoring="sine")


def test_the_level_error_does_not_reach_the_rates() -> None:
    """A level 5 sd off shifts the halves apart; a, b, c stay, and the offset is mended."""
    time = np.arange(309) * (math.pi / OMEGA)
    points = table(time, np.asarray(amplitude(time, 0.068, *REGIMES["all"])), 1e-5)
    error = 5e-6
    shifted = TurningPoints(
        **{
            **points.__dict__,
            "angle_rad": points.angle_rad - error * points.level_coupling,
            "level_rad": points.level_rad + error,
            "level_sd_rad": error,
        }
    )
    result = fit_points(shifted)
    for name, rate in zip("abc", REGIMES["all"], strict=True):
        estimate = result.parameters[name]
        assert abs(estimate.value - rate) < 0.05 * estimate.sd
    assert abs(result.value("offset")) < 0.05 * error


def test_held_parameters_stay() -> None:
    time = np.arange(200) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, *REGIMES["all"]))
    points = table(time, exact, 1e-5, seed=1)
    result = fit_points(points, fixed={"b": 0.0125, "frequency": 0.52, "offset": 1e-5})
    assert result.value("b") == 0.0125
    assert result.parameters["b"].sd == 0.0
    assert result.value("frequency") == pytest.approx(0.52)
    assert result.value("offset") == pytest.approx(1e-5)
    assert result.chi2_per_dof > 1.5
    viscous = fit_points(points, baseline="viscous")
    assert viscous.value("a") == viscous.value("c") == 0.0


def test_a_tail_is_called_a_tail() -> None:
    """The paper's warning: of a tail alone, a can't be told, and the fit says so."""
    time = np.arange(309) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, *REGIMES["all"]))
    tail = fit_points(table(time[250:], exact[250:], 1.4e-5, seed=3))
    whole = fit_points(table(time, exact, 1.4e-5, seed=3))
    assert any("(a tail)" in warning for warning in tail.warnings)
    assert not any("(a tail)" in warning for warning in whole.warnings)


def test_no_exponential_loss_no_quality_factor() -> None:
    time = np.arange(200) * (math.pi / OMEGA)
    exact = np.asarray(amplitude(time, 0.068, 0.45, 0.0, 1e-4))
    result = fit_points(table(time, exact, 1e-7), fixed={"b": 0.0})
    assert result.quality_factor_limit is None
    assert any("quality_factor_limit" in warning for warning in result.warnings)
    assert result.to_dict()["quality_factor_limit"]["value"] != 0.0


# Eq. 14 on amplitudes alone: by hand with a ruler, speeds at a gate, our table of turning points.
#
# A viscous decay of 200 s: half-life 138.6 s, and Q = pi 200 s/T.

TAU = 200.0
TIME = 30.0 * np.arange(12)
FALL = np.exp(-TIME / TAU)


def rows(head: str, values: FloatArray, form: str = "{:.0f},{:.2f}\n") -> str:
    return head + "".join(form.format(t, y) for t, y in zip(TIME, values, strict=True))


SIDE = np.where(np.arange(12) % 2, -1.0, 1.0)
LAYOUTS = {
    "ruler in cm": (rows("t (s),amplitude (cm)\n", 20 * FALL), 0.2, "m"),
    "no header": (rows("", 20 * FALL, "{:.0f} {:.2f}\n"), 20.0, "1"),
    "degrees": (
        rows("time\tangle [deg]\n", 20 * FALL, "{:.0f}\t{:.2f}\n"),
        math.radians(20),
        "rad",
    ),
    "decimal commas": (
        rows("t/s;A/cm\n", 20 * FALL, "{:.0f};{:.2f}\n").replace(".", ","),
        0.2,
        "m",
    ),
    "the plain form": (rows("time_s,angle_rad\n", 0.2 * FALL, "{:.0f},{:.5f}\n"), 0.2, "rad"),
    "a gate": (rows("Time (s),Speed (m/s)\n", 0.9 * FALL, "{:.3f},{:.4f}\n"), 0.9, "m/s"),
    "both sides, off the zero": (rows("t,deg\n", 20 * SIDE * FALL + 0.3), math.radians(20), "rad"),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_amplitudes_of_every_layout_tell_the_half_life(tmp_path: Path, name: str) -> None:
    content, first, unit = LAYOUTS[name]
    (tmp_path / "by-hand.csv").write_text(content)
    fit = pp.fit(tmp_path / "by-hand.csv")
    assert (fit.method, fit.light, fit["amplitude"].unit) == ("amplitudes", "green", unit)
    assert abs(fit["amplitude"].value / first - 1.0) < 0.01
    assert abs(fit.damping()["half_life_s"].value / (TAU * math.log(2.0)) - 1.0) < 0.01
    assert fit["Q"].value != fit["Q"].value
    written = fit.to_dict()
    assert any("frequency, phase and noise_rms_rad" in said for said in written["warnings"])
    assert all(math.isnan(written["parameters"][key]["value"]) for key in ("frequency", "phase"))
    assert math.isnan(written["noise_rms_rad"])
    assert "--period" in str(fit)


def test_a_period_gives_q_with_its_error(tmp_path: Path) -> None:
    time = np.linspace(0.0, 400.0, 40)
    angle = 0.2 * np.exp(-time / TAU) + 1e-4 * np.random.default_rng(1).normal(size=40)
    fit = pp.fit(time, angle, period=Estimate(1.42, 0.01, "s"))
    assert abs(fit["Q"].value / (math.pi * TAU / 1.42) - 1.0) < 0.01
    assert fit["period"].value == pytest.approx(1.42)
    assert fit["period"].sd == pytest.approx(0.01)
    assert "Q" in fit.quotable
    assert "period" not in fit.quotable
    same = pp.fit(time, angle, fixed={"frequency": 1.0 / 1.42})
    assert same["Q"].value == pytest.approx(fit["Q"].value)
    assert np.max(np.abs(fit.residual)) < 5e-4


def test_the_command_takes_period_or_frequency(tmp_path: Path, answer_of: Any) -> None:
    file = tmp_path / "ruler.csv"
    file.write_text(LAYOUTS["ruler in cm"][0])
    found = [
        json.loads(answer_of(["fit", str(file), "--json", *option]).out)
        for option in (["--period", "1.25"], ["--frequency", "0.8"], [])
    ]
    assert found[0]["quality_factors"] == found[1]["quality_factors"]
    assert found[2]["parameters"]["frequency"]["value"] is None
    assert found[2]["noise_rms_rad"] is None
    assert found[2]["quality_factors"][0]["value"] is None
    assert found[2]["damping"]["half_life_s"]["value"] == pytest.approx(138.6, rel=0.01)


LENGTH = 0.718


def by_hand(law: Eq8, first: float) -> dict[str, pp.Recording]:
    """A pendulum's turning points of one side: by a level, by a ruler, and its speeds at a gate."""
    motion = turning_points(law, Release(0.0, first), count=160)
    time, angle = motion.time_s[::2], motion.angle_rad[::2]
    fine = np.arange(0.0, float(motion.time_s[-1]), 1e-3)
    swing = sample(law, Release(0.0, first), fine)
    at = np.flatnonzero((swing[1:] < 0.0) & (swing[:-1] >= 0.0))
    speed = LENGTH * (swing[at] - swing[at + 1]) / 1e-3
    told = {"metadata": {"unit": "m/s", "holds": "amplitudes"}, "quantity": "reading"}
    return {
        "level": pp.Recording(time_s=time, angle_rad=angle),
        "ruler": pp.Recording(time_s=time, displacement_m=LENGTH * np.sin(angle)),
        "gate": pp.Recording(time_s=fine[at], values=speed, **told),
    }


@pytest.mark.parametrize("way", ["level", "ruler", "gate"])
@pytest.mark.parametrize("drag", ["energy", "speed"])
def test_amplitudes_by_hand_are_a_pendulum_s(way: str, drag: Literal["energy", "speed"]) -> None:
    """The period that is given is that of small swings: g needs no correction, Q has that at y."""
    omega = math.tau / 1.7
    law = Eq8(omega, 0.11, 0.001, 0.002, 0.0, "sine", drag)
    fit = pp.fit(by_hand(law, 0.6)[way], period=1.7, length_m=LENGTH)
    assert (fit.light, fit.restoring) == ("green", "sine")
    assert fit["g"].value == pytest.approx(omega**2 * LENGTH)
    for name, true in {"a": 0.11, "b": 0.003}.items():
        assert abs(fit[name].value - true) < 2.5 * fit[name].sd + 3e-3 * true
    cycle = turning_points(law, Release(0.0, 0.5), count=3)
    loss = math.log(0.5 / abs(float(cycle.angle_rad[2])))
    seen = math.sqrt(0.5 * abs(float(cycle.angle_rad[2])))
    assert fit.quality_factor(seen).value == pytest.approx(math.pi / loss, rel=2e-3)


@pytest.mark.parametrize(("quality", "light"), [(1.0, "amber"), (2.5, "amber"), (8.0, "green")])
def test_below_a_q_of_three_no_cycle_is_left(quality: float, light: str) -> None:
    """Amplitudes that lose most of themselves in a period give neither Q nor a, b and c."""
    time = np.arange(12.0) * 0.5
    fall = 0.2 * np.exp(-math.pi * time / quality)
    fit = pp.fit(pp.Recording(time_s=time[fall > 1e-4], angle_rad=fall[fall > 1e-4]), period=1.0)
    assert fit.light == light
    assert ("Q" in fit.quotable) == (light == "green")
    assert ("b 0" not in str(fit) and "b 3" not in str(fit)) == (light == "amber")
    assert ("Q = " in str(fit).partition("Copy")[2]) == (light == "green")


def test_a_strongly_damped_swing_is_solved_exactly_and_has_no_q() -> None:
    """All readings give T0 and the losses of Eq. 8 at a Q of 1.8: they need no cycle."""
    law, time = Eq8(5.0, 1.7, 0.0, 1.25, 0.0, "sine"), np.arange(0.0, 8.0, 0.01)
    angle = sample(law, Release(-0.05, 1.0), time) + white(1, len(time), 1e-4)
    fit = pp.fit(pp.Recording(time_s=time, angle_rad=angle))
    assert (fit.method, fit.light) == ("waveform", "amber")
    assert "Q" not in fit.quotable
    assert {"period", "a", "b"} <= set(fit.quotable)
    for name, true in {"a": 1.7, "b": 1.25, "frequency": 5.0 / math.tau}.items():
        assert abs(fit[name].value - true) < 4.0 * fit[name].sd


def test_speeds_without_a_length_keep_their_unit() -> None:
    fit = pp.fit(by_hand(Eq8(math.tau / 1.7, 0.0, 0.0, 0.01, 0.0, "sine"), 0.3)["gate"])
    assert fit["amplitude"].unit == "m/s"
    assert any("--length" in said for said in fit.warnings)


def test_fewer_than_five_amplitudes_are_refused() -> None:
    with pytest.raises(
        pp.InputError, match="4 amplitudes are too few for a, b and c; give 5 or more"
    ):
        pp.fit(TIME[:4], FALL[:4])
    assert pp.fit(TIME[:5], FALL[:5])["b"].value > 0.0


def test_a_swing_is_not_asked_for_its_period() -> None:
    with pytest.raises(pp.InputError, match="the recording itself shows the period"):
        pp.fit("examples/rod-pendulum.csv", period=1.2)


def test_amplitudes_are_no_recording_of_the_swing() -> None:
    with pytest.raises(pp.InputError, match=r"use pendpipe fit, which fits Eq\. 14 to them"):
        pp.diagnose(pp.Recording(time_s=TIME, angle_rad=FALL))


def test_a_diagnosis_is_not_advised_where_it_refuses() -> None:
    """Amplitudes that fall ever faster: no law of Eq. 13 does so."""
    time = np.linspace(0.0, 400.0, 40)
    noise = 1e-4 * np.random.default_rng(1).normal(size=40)
    fit = pp.fit(time, 0.3 * np.exp(-((time / 300.0) ** 2)) + noise)
    assert fit.light == "red"
    assert "(from the amplitudes, without a law)" in str(fit)
    assert str(fit).endswith("Next: --accept prints the law")


@pytest.mark.slow
def test_the_errors_of_a_b_and_the_half_life_cover_the_truth() -> None:
    """Fourteen amplitudes with all three losses, read to 0.5 % of the first, 120 times."""
    a, b, c = 0.01, 0.004, 1e-4
    time, rng = 20.0 * np.arange(14), np.random.default_rng(7)
    true = np.asarray(amplitude(time, 0.3, a, b, c))
    within = np.zeros(3)
    for _ in range(120):
        fit = pp.fit(time, true + 1.5e-3 * rng.normal(size=14))
        large = fit.quality_factors[0]
        loss = a * large.amplitude_rad + b + c / large.amplitude_rad
        life = large.damping_time_s
        within += [
            abs(life.value - 1.0 / loss) < 1.96 * life.sd,
            fit["a"].bounds95[0] <= a <= fit["a"].bounds95[1],
            fit["b"].bounds95[0] <= b <= fit["b"].bounds95[1],
        ]
    assert np.all(within / 120 > 0.90)


def test_a_table_of_turning_points_has_its_period(tmp_path: Path) -> None:
    table = tmp_path / "turned.csv"
    assert main(["turning-points", "examples/rod-pendulum.csv", "--out", str(table)]) == 0
    fit, whole = pp.fit(table), pp.fit("examples/rod-pendulum.csv")
    assert fit.method == "turning-points"
    assert abs(fit["period"].value - whole["period"].value) < 3.0 * whole["period"].sd
    assert abs(fit["Q"].value / whole["Q"].value - 1.0) < 0.01


REST = 1e-3 * np.random.default_rng(1).standard_normal(90000)


@pytest.mark.parametrize(
    ("values", "falls"),
    [
        (FALL, True),
        (np.repeat(FALL, 2), True),
        (FALL * SIDE, True),
        (np.linspace(1.0, 0.0, 50), True),
        (np.exp(-np.arange(200) / 120) + 0.004 * np.sin(7e3 * np.arange(200) ** 2), True),
        (np.exp(-np.arange(500) / 100) * np.cos(0.3 * np.arange(500)), False),
        (np.linspace(5.0, 1.0, 500) + 0.2 * np.cos(0.3 * np.arange(500)), False),
        (np.linspace(5.0, 1.0, 500) + 0.02 * np.cos(0.3 * np.arange(500)), False),
        (
            np.exp(-np.arange(2400) / 1000) * np.cos(0.2 * np.arange(2400))
            + 0.03 * np.sin(7e3 * np.arange(2400) ** 2)
            + 20.0 * (np.arange(2400) == 900),
            False,
        ),
        (np.exp(-np.arange(90000) / 300) * np.cos(0.06 * np.arange(90000)) + REST, False),
        (FALL[:3], False),
        (np.ones(20), False),
    ],
)
def test_only_a_fall_without_swings_is_of_amplitudes(values: FloatArray, falls: bool) -> None:
    assert only_falls(values) is falls
