"""sin x in the fit: where a recording asks for it, and with the right numbers."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ellipe, ellipk

import pendpipe as pp
from pendpipe import cli
from pendpipe.analysis.fit import fit_recording
from pendpipe.analysis.fit.by_points import fit_energies
from pendpipe.analysis.fit.fitted import Told
from pendpipe.analysis.fit.fixed import Held
from pendpipe.analysis.fit.printed import facts
from pendpipe.analysis.fit.quality import pendulum_of
from pendpipe.analysis.fit.start import start_values
from pendpipe.analysis.torque import restoring_of, sine_coefficient
from pendpipe.analysis.turning_points import TurningPoints, find_turning_points
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, sample, turning_points
from pendpipe.dynamics.eq8 import Restoring
from pendpipe.estimate import Estimate
from pendpipe.files import read_json
from pendpipe.physics.lengthening import elliptic
from pendpipe.recording import Recording
from pendpipe.solve import covariance

from ..recordings import white
from .test_one_fit import SHARED, pendulum, recorded

OMEGA = 5.0
TIME = np.arange(0.0, 120.0, 0.02)


def points_of(
    law: Eq8, release: float, count: int, sd: float = 1e-4, seed: int = 5
) -> TurningPoints:
    motion = turning_points(law, Release(0.3, release), count=count)
    error = sd * np.ones(count)
    random = np.random.default_rng(seed)
    return TurningPoints(
        np.arange(count),
        motion.time_s + error / OMEGA * random.standard_normal(count),
        error / OMEGA,
        motion.angle_rad + error * random.standard_normal(count),
        error,
        np.zeros(count),
        level_sd_rad=1e-4,
    )


def test_elliptic_integrals_are_scipy_s() -> None:
    m = np.array([0.0, 1e-8, 0.3, 0.9, 1.0 - 1e-6])
    k, e = elliptic(m)
    np.testing.assert_allclose(k, ellipk(m), rtol=1e-13)
    np.testing.assert_allclose(e, ellipe(m), rtol=1e-12)


@pytest.mark.parametrize("torque", ["linear", "sine"])
@pytest.mark.parametrize("release", [0.3, 1.2, 2.5, 2.9])
def test_the_energies_of_turning_points_tell_a_b_and_c(release: float, torque: str) -> None:
    law = Eq8(OMEGA, 0.02, 0.005, 0.005, 0.01, torque)  # type: ignore[arg-type]
    pulls = []
    for seed in range(8):
        points = points_of(law, release, 30, seed=seed)
        found = fit_energies(points, restoring=torque)  # type: ignore[arg-type]
        sd = np.sqrt(np.diag(covariance(found.quadratic.normal, found.held)))
        pulls.append((found.value - [0.02, 0.01, 0.01, release, 0.0]) / sd)
        held = fit_energies(points, {"b": 0.01, "amplitude": release}, restoring=torque)  # type: ignore[arg-type]
        assert held.value[[1, 3]] == pytest.approx([0.01, release], rel=1e-12)
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 1.5)
    assert np.all(np.std(pulls, axis=0) < 2.0)


@pytest.mark.parametrize("torque", ["linear", "sine"])
@pytest.mark.parametrize("release", [0.5, 2.9])
def test_a_start_is_near_each_law_before_any_motion_is_fitted(
    release: float, torque: Restoring
) -> None:
    points = points_of(Eq8(OMEGA, 0.02, 0.005, 0.005, 0.01, torque), release, 50)
    assert restoring_of(points) == torque
    start = start_values(points, Held({}, "eq8", 1.0), torque)
    a, b, c, _, omega, angle, time, _ = start.value[:8].tolist()
    assert omega == pytest.approx(OMEGA, rel=2e-3)
    loss = 0.01 * release**2 + 0.01 * release + 0.01
    assert 0.5 * a * release**2 + b * release + c == pytest.approx(loss, rel=0.1)
    law = Eq8(omega, a, 0.5 * b, 0.5 * b, c, torque)
    turns = turning_points(law, Release(time, angle), count=start.before + 50)
    assert turns.angle_rad[start.before] == pytest.approx(release, rel=0.03)
    assert turns.time_s[start.before] == pytest.approx(0.3, abs=0.3 / OMEGA)


def test_the_free_coefficient_of_sin_x_tells_pendulums_from_other_torques() -> None:
    sine = Eq8(OMEGA, 0.02, 0.005, 0.005, 0.001, "sine")
    coefficient = sine_coefficient(points_of(sine, 1.0, 60))
    assert coefficient.value == pytest.approx(1.0, abs=4.0 * coefficient.sd + 0.02)
    assert coefficient.agrees
    # A torsion wheel turns as far, with a torque that is linear.
    wheel = points_of(Eq8(OMEGA, 0.0, 0.0, 0.01, 0.005), 2.5, 60)
    assert abs(sine_coefficient(wheel).value) < 0.02
    assert sine_coefficient(wheel).excludes_sine
    assert restoring_of(wheel) == "linear"
    # Angles so small that nobody can tell are a pendulum's; torques that harden are not.
    small = points_of(Eq8(OMEGA, viscous=0.01, restoring="sine"), 0.01, 60)
    assert [restoring_of(small, stated=stated) for stated in (True, False)] == ["sine", "linear"]
    hard = shifted(points_of(Eq8(OMEGA, viscous=0.02), 0.5, 60), lambda y: -0.05 * y**2)
    assert sine_coefficient(hard).value < -0.5
    assert restoring_of(hard) == "linear"


def shifted(points: TurningPoints, longer: Callable[[FloatArray], FloatArray]) -> TurningPoints:
    """The same with half periods that are longer by a part that the amplitude tells."""
    late = np.cumsum(longer(points.amplitude_rad)) * math.pi / OMEGA
    return replace(points, time_s=points.time_s + late)


def test_a_pendulum_whose_frequency_drifts_is_still_a_pendulum() -> None:
    # It drifts against sin x, as strongly: the times alone then speak for the linear law.
    points = points_of(Eq8(OMEGA, viscous=0.015, restoring="sine"), 0.4, 100)
    drift = 0.25 * np.cumsum(np.linspace(-0.01, 0.01, 100)) * math.pi / OMEGA
    points = replace(points, time_s=points.time_s + drift)
    assert restoring_of(points) == "sine"
    assert not sine_coefficient(points).agrees
    assert restoring_of(points, stated=False) == "linear"


def test_half_periods_that_alternate_and_gaps_leave_coefficient_and_start_where_they_were() -> None:
    points = points_of(Eq8(OMEGA, 0.02, 0.0, 0.01, 0.0, "sine"), 1.0, 60)
    uneven = replace(points, time_s=points.time_s + 0.1 / OMEGA * points.side)
    left = points.chosen(np.abs(np.arange(60) - 17.5) > 7.5)
    coefficient = sine_coefficient(points).value
    assert sine_coefficient(uneven).value == pytest.approx(coefficient, abs=0.01)
    for changed in (uneven, left):
        assert restoring_of(changed) == "sine"
        omega = start_values(changed, Held({}, "eq8", 1.0), "sine").value[4]
        assert omega == pytest.approx(OMEGA, rel=3e-3)


@pytest.mark.parametrize("release", [1.5, 2.5, 2.9])
def test_turning_points_far_out_are_where_the_motion_turns(release: float) -> None:
    losses = {"quadratic": 0.03, "viscous": 0.01, "coulomb": 0.02}
    time = np.arange(0.0, 30.0, 0.01)
    values = pendulum(release, time, **losses)
    fine = np.arange(0.0, 30.0, 1e-4)
    swings = pendulum(release, fine, **losses)
    points = find_turning_points(recorded(values, time, 1e-3))
    for when, angle, sd in zip(
        points.time_s[1:8], points.angle_rad[1:8], points.angle_sd_rad[1:8], strict=True
    ):
        near = np.abs(fine - when) < 0.1
        turned = float(np.max(np.abs(swings[near])))
        assert abs(abs(angle) - turned) < 4.0 * sd + 1e-3


def far(release: float, seed: int = 1) -> Recording:
    """A pendulum that swings far, with all losses."""
    law = Eq8(OMEGA, 0.02, 0.004, 0.006, 0.003, "sine")
    return recorded(sample(law, Release(-0.2, release, 0.01), TIME), TIME, 1e-3, seed)


@pytest.mark.parametrize("release", [0.5, 1.4, 2.9])
def test_a_b_c_and_the_frequency_of_a_pendulum_that_swings_far(release: float) -> None:
    truth = {"a": 0.02, "b": 0.01, "c": 0.003, "frequency": 0.5 * OMEGA / math.pi}
    pulls = []
    for seed in range(6):
        result = fit_recording(far(release, seed))
        assert (result.restoring, result.method, result.light) == ("sine", "waveform", "green")
        pulls.append([(result.value(k) - v) / result.parameters[k].sd for k, v in truth.items()])
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 1.7)
    assert np.all(np.std(pulls, axis=0) < 2.0)


@pytest.mark.slow
@pytest.mark.parametrize("release", [0.6, 1.5, 2.5])
def test_drag_in_its_true_form_is_lost_as_the_law_says(release: float) -> None:
    # Not the energy form of the fit: the readings tell, and the losses agree all the same.
    values = pendulum(release, TIME, quadratic=0.03, viscous=0.01, coulomb=0.002)
    result = fit_recording(recorded(values, TIME, 1e-3))
    assert result.restoring == "sine"
    assert result.light != "red"
    assert all(abs(check.excess) < 0.06 for check in result.decrement_check[:2])


def test_x_that_the_readings_prefer_is_fitted_and_said() -> None:
    law = Eq8(OMEGA, 0.1, 0.005, 0.005, 1e-4)
    recording = recorded(sample(law, Release(-0.2, 0.07), TIME), TIME, 1e-4)
    auto, linear = (fit_recording(recording, restoring=each) for each in (None, "linear"))  # type: ignore[arg-type]
    assert auto.parameters == linear.parameters
    assert (auto.form.torque_odds or 0.0) > math.log(1000.0)
    assert "x fits better than sin x, 10^" in str(auto)


def test_an_angle_swings_by_sin_x_where_its_readings_cannot_tell() -> None:
    """And the answer gives the period of a wheel beside that of a pendulum."""
    time = np.arange(0.0, 60.0, 0.02)
    law = Eq8(OMEGA, viscous=0.01, restoring="sine")
    periods = []
    for seed in (1, 2):
        values = sample(law, Release(-0.2, 0.05), time)
        result = fit_recording(Recording(time, values + white(seed, len(time), 5e-4), "angle_rad"))
        assert result.restoring == "sine"
        assert abs(result.form.torque_odds or math.inf) < math.log(1000.0)
        assert result.form.other_frequency is not None
        assert any("--restoring linear" in warning for warning in result.warnings)
        off = result["frequency"].value - 0.5 * OMEGA / math.pi
        assert abs(off) < 4.0 * result["frequency"].sd
        periods.append(result["frequency"].value)
    assert np.ptp(periods) < 5.0 * result["frequency"].sd


def test_the_turning_points_alone_know_sin_x() -> None:
    result = fit_recording(far(2.0), method="turning-points")
    assert (result.method, result.restoring) == ("turning-points", "sine")
    for name, value in {"a": 0.02, "b": 0.01, "c": 0.003, "offset": 0.01}.items():
        assert abs(result.value(name) - value) < 4.0 * result.parameters[name].sd + 0.01 * value
    assert result.value("frequency") == pytest.approx(0.5 * OMEGA / math.pi, rel=1e-4)


def test_what_is_held_is_held_with_sin_x() -> None:
    for method in ("waveform", "turning-points"):
        result = fit_recording(far(1.4), method=method, fixed={"b": 0.01, "offset": 0.01})  # type: ignore[arg-type]
        assert result.restoring == "sine"
        assert result.value("b") == 0.01
        assert result.value("offset") == 0.01


@pytest.mark.parametrize("length", [Estimate(0.6, 0.0, "m"), None])
def test_a_position_swings_as_l_sin_x(length: Estimate | None) -> None:
    omega, time = math.sqrt(9.80665 / 0.6), np.arange(0.0, 40.0, 0.01)
    angle = sample(Eq8(omega, viscous=0.01, restoring="sine"), Release(-0.2, 0.5), time)
    recording = Recording(
        time, 0.6 * np.sin(angle) + 0.02 + white(3, len(time), 1e-4), "displacement_m"
    )
    result = fit_recording(recording, restoring="sine", length=length)
    assert (result.light, result["amplitude"].unit) == ("green", "rad")
    assert abs(result["frequency"].value - 0.5 * omega / math.pi) < 4.0 * result["frequency"].sd
    assert abs(result["b"].value - 0.01) < 4.0 * result["b"].sd
    assert abs(result["offset"].value - 0.02) < 4.0 * result["offset"].sd


# x in these units: 1 m is so many, and so far the period tells it.
READ_IN = {
    "m": (1.0, 1e-9),
    "cm": (100.0, 1e-9),
    "pixels": (733.0, 1e-3),
    "m/s^2": (4.9, 3e-3),
    "no unit: metres": (1.0, 1e-9),
    "no unit: centimetres": (100.0, 1e-9),
    "no unit: millimetres": (1000.0, 1e-9),
    "no unit: its own": (733.0, 1e-3),
}


@pytest.mark.parametrize("unit", READ_IN)
def test_who_gives_the_length_has_said_that_it_is_a_pendulum(unit: str) -> None:
    """G and T0 come out, whatever the position is read in: the period tells the scale."""
    size, known = READ_IN[unit]
    omega, time = math.sqrt(9.81 / 0.6), np.arange(0.0, 60.0, 0.02)
    angle = sample(Eq8(omega, viscous=0.01, restoring="sine"), Release(-0.2, 0.5), time)
    x = 0.6 * np.sin(angle) + 2e-4 * np.random.default_rng(3).standard_normal(len(time))
    told = {"m": (x, "displacement_m"), "cm": (x, "displacement_m")}
    values, quantity = told.get(unit, (size * x, "reading"))
    metadata = {} if "no unit" in unit or unit in told else {"unit": unit}
    recording = Recording(time, values, quantity, metadata=metadata)  # type: ignore[arg-type]
    fit = pp.fit(recording, length_m=0.6)
    assert (fit.restoring, fit.light, fit["amplitude"].unit) == ("sine", "green", "rad")
    assert abs(fit["period"].value - math.tau / omega) < 4.0 * fit["period"].sd
    assert abs(fit["g"].value - 9.81) < 4.0 * fit["g"].sd
    assert fit["g"].sd < 2e-4 * 9.81
    assert abs(fit["amplitude"].value / 0.5 - 1.0) < 0.01 + known


def test_swings_too_small_to_tell_their_size_say_so() -> None:
    omega, time = math.sqrt(9.81 / 0.6), np.arange(0.0, 60.0, 0.02)
    angle = sample(Eq8(omega, viscous=0.01, restoring="sine"), Release(-0.2, 0.02), time)
    recording = Recording(
        time, 4.0 * np.sin(angle) + white(3, len(time), 1e-3), "reading", metadata={"unit": "m/s^2"}
    )
    fit = pp.fit(recording, length_m=0.6)
    assert fit.restoring == "linear"
    assert "of these swings" in str(fit)
    assert fit["g"].value == pytest.approx(9.81, rel=1e-3)


@pytest.mark.slow
def test_a_length_by_another_g_is_no_cubic_torque() -> None:
    """L = g/omega^2 by standard gravity is 3e-4 off where g is 9.81: the readings tell it."""
    omega, time = math.sqrt(9.81 / 0.6), np.arange(0.0, 120.0, 0.02)
    law = Eq8(omega, 0.004, 0.002, 0.003, restoring="sine")
    position = 0.6 * np.sin(sample(law, Release(-0.2, 0.6), time))
    recording = Recording(time, position + white(1, len(time), 5e-5), "displacement_m")
    assert pp.diagnose(recording, restoring="sine").verdict == "consistent"
    assert pp.diagnose(recording, length_m=0.6).verdict == "consistent"
    # Its turning points may have been measured before: a campaign's stages do so.
    points = pp.turning_points(recording)
    assert pp.diagnose(recording, points=points, restoring="sine").verdict == "consistent"


@pytest.mark.parametrize("amplitude", [0.15, 0.35, 1.5])
def test_a_rate_is_that_of_a_pendulum(amplitude: float) -> None:
    """A gyroscope's reading: T0, a and c are those of the angle."""
    law = Eq8(OMEGA, 0.02, 0.004, 0.006, 1e-3, restoring="sine")
    time, step = np.arange(0.0, 60.0, 0.01), 1e-6
    release = Release(-0.2, amplitude)
    rate = sample(law, release, time + step) - sample(law, release, time - step)
    values = rate / (2.0 * step) + 0.01 + white(3, len(time), 1e-3)
    recording = Recording(time, values, "reading", metadata={"unit": "rad/s"})
    result = fit_recording(recording)
    assert (result.restoring, result.light, result["amplitude"].unit) == ("sine", "green", "rad")
    for name, value in {
        "frequency": 0.5 * OMEGA / math.pi,
        "b": 0.01,
        "a": 0.02,
        "c": 1e-3,
    }.items():
        low, high = result[name].bounds95
        assert low - result[name].sd <= value <= high + result[name].sd
    assert result.noise_rms_rad == pytest.approx(1e-3, rel=0.05)
    # Its length tells g as that of an angle does: within three standard deviations of the truth.
    g = pendulum_of(replace(result, told=Told(length=Estimate(0.4, 0.0, "m"))))["g"].value
    assert g == pytest.approx(0.4 * (2.0 * math.pi * result["frequency"].value) ** 2, rel=1e-12)
    assert g == pytest.approx(0.4 * OMEGA**2, rel=12.0 * result["frequency"].sd * math.pi / OMEGA)


def test_g_of_a_linear_fit_is_that_of_small_swings() -> None:
    """A swing of 0.5 rad takes 2 K(sin(y/2))/pi as long as a small one; the line says so."""
    time = np.arange(0.0, 20.0, 0.01)
    law = Eq8(OMEGA, viscous=1e-4, restoring="sine")
    values = sample(law, Release(-0.2, 0.5), time)
    result = fit_recording(recorded(values, time, 1e-3), restoring="linear")
    line = dict(facts(replace(result, told=Told(length=Estimate(0.4, 0.0, "m")))))["g"]
    assert float(line.partition("(")[0]) == pytest.approx(0.4 * OMEGA**2, rel=1e-3)
    longer = 2.0 * ellipk(math.sin(0.25) ** 2) / math.pi
    said = re.search(r"finite-amplitude correction (\S+) % included", line)
    assert said is not None
    assert float(said[1]) == pytest.approx(100.0 * (longer**2 - 1.0), rel=0.03)


@pytest.mark.slow
def test_where_only_the_smallest_swings_contradict_the_larger_are_fitted() -> None:
    values = sample(Eq8(OMEGA, 0.0, 0.0, 0.02, 1e-3), Release(-0.2, 0.5), TIME)
    # A bearing that takes far more from small swings than from large ones.
    small = np.abs(values) < 0.02
    late = int(np.flatnonzero(~small)[-1])
    values[late:] *= np.exp(-0.3 * (TIME[late:] - TIME[late]))
    result = fit_recording(recorded(values, TIME, 1e-5), restoring="linear")
    assert result.light == "amber"
    assert "does not follow the fitted law" in result.light_reason
    assert result.cuts[-1]["stop_s"] == pytest.approx(TIME[-1])
    loss = [result.value(name) for name in "abc"] @ np.array([0.3**2, 0.3, 1.0])
    assert loss == pytest.approx(0.02 * 0.3 + 1e-3, rel=0.01)
    # A reading whose unit nobody knows has a size without one.
    bare = fit_recording(replace(recorded(values, TIME, 1e-5), quantity="reading"))
    assert re.search(r"below 0\.\d+: there the decay does not follow", bare.light_reason)


@pytest.mark.slow
@pytest.mark.skipif(not SHARED.is_dir(), reason="no ../shared/recordings here")
@pytest.mark.parametrize(
    ("name", "torque"),
    [
        ("profcarter-adip/adip_pend_data.mat", "sine"),
        ("profcarter-adip/cdip_pend_data.mat", "sine"),
        ("yfysiks-encoder/data32.csv", "sine"),
        ("bychai-phy180/10cm.txt", "sine"),
        ("hasi7-string/QFactorGraph10(43cm).txt", "sine"),
        ("kosta24-torsion/0.96734.1.csv", "linear"),
        ("yfysiks-encoder/data2_14.csv", "sine"),
        ("nielsskov-cartpend/test1pend1.csv", "sine"),
        ("nielsskov-cartpend/test1pend2.csv", "sine"),
        ("kenevich-furuta-arm2/dataset4.txt", "sine"),
        ("tylertian-phy180/lab1_data.txt", "sine"),
        ("jiarui-phy180/8050.txt", "sine"),
        ("jiarui-phy180/8053.txt", "sine"),
        ("jiarui-phy180/8055.txt", "sine"),
        ("davidw99-wood-steel-bob/damping_angle.xlsx", "sine"),
        ("jlefebvre-phy180/q2_data.csv", "sine"),
        ("martin8ner-pohl-eddy/1.3_100mA.csv", "linear"),
        ("martin8ner-pohl-eddy/1.3_200mA.csv", "linear"),
        ("kvlcc2-roll-decay/model_test_21337.csv", "linear"),
        ("martinrobomaze-eulers-rod/d_4mm_l_100mm_50deg.txt", None),
    ],
)
def test_real_pendulums_swing_by_sin_x_and_no_green_law_is_off_by_a_tenth(
    name: str, torque: str | None, tmp_path: Path
) -> None:
    out = tmp_path / "fit.json"
    unit = ["--unit", "deg"] if name.startswith("bychai") else []  # its file states none
    status = cli.main(["fit", str(SHARED / name), "--out", str(out), *unit])
    content = read_json(out)
    assert (status == 2) == (content["light"] == "red")
    off = [abs(each["fitted"] / each["seen"] - 1.0) for each in content["decrement_check"]]
    assert content["light"] != "green" or max(off) < 0.1
    assert torque in (None, content["restoring"])
    if torque == "sine":
        assert content["light"] != "red"
        largest = content["decrement_check"][0]
        error = max(0.05 * largest["seen"], 2.0 * largest["seen_sd"])
        assert largest["fitted"] == pytest.approx(largest["seen"], abs=error)
