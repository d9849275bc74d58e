"""Eq. 14 on amplitudes alone: by hand with a ruler, speeds at a gate, our table of turning points.

A viscous decay of 200 s: half-life 138.6 s, and Q = pi 200 s/T.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.analysis.fit.by_points import GRAVITY
from pendpipe.arrays import FloatArray
from pendpipe.cli import main
from pendpipe.estimate import Estimate
from pendpipe.physics import amplitude
from pendpipe.recording import only_falls

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


def test_the_command_takes_period_or_frequency(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "ruler.csv"
    file.write_text(LAYOUTS["ruler in cm"][0])
    found = []
    for option in (["--period", "1.25"], ["--frequency", "0.8"], []):
        assert main(["fit", str(file), "--json", *option]) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert found[0]["quality_factors"] == found[1]["quality_factors"]
    assert found[2]["parameters"]["frequency"]["value"] is None
    assert found[2]["noise_rms_rad"] is None
    assert found[2]["quality_factors"][0]["value"] is None
    assert found[2]["damping"]["half_life_s"]["value"] == pytest.approx(138.6, rel=0.01)


def test_a_length_makes_angles_of_speeds_and_of_positions() -> None:
    """At the bottom v = 2 sqrt(g l) sin(A/2); on a ruler x = l sin A."""
    angle, length = 0.9 * FALL, 0.5
    speeds = 2.0 * math.sqrt(GRAVITY * length) * np.sin(0.5 * angle)
    told = {"metadata": {"unit": "m/s"}, "quantity": "reading"}
    gate = pp.Recording(time_s=TIME, values=speeds, **told)
    assert any("--length" in said for said in pp.fit(gate).warnings)
    for recording in (gate, pp.Recording(time_s=TIME, displacement_m=length * np.sin(angle))):
        fit = pp.fit(recording, length_m=length)
        assert fit["amplitude"].unit == "rad"
        assert abs(fit["amplitude"].value - 0.9) < 1e-6
        assert abs(fit["b"].value * TAU - 1.0) < 1e-4


def test_fewer_than_five_amplitudes_are_refused() -> None:
    with pytest.raises(pp.InputError, match="4 amplitudes tell no a, b and c; give 5 or more"):
        pp.fit(TIME[:4], FALL[:4])
    assert pp.fit(TIME[:5], FALL[:5])["b"].value > 0.0


def test_a_swing_is_not_asked_for_its_period() -> None:
    with pytest.raises(pp.InputError, match="the recording shows its own"):
        pp.fit("examples/rod-pendulum.csv", period=1.2)


def test_amplitudes_are_no_recording_of_the_swing() -> None:
    with pytest.raises(pp.InputError, match=r"pendpipe fit takes Eq\. 14 of them"):
        pp.diagnose(pp.Recording(time_s=TIME, angle_rad=FALL))


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
