"""The sensor's line: injected truth, honest errors, and the test of linearity."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pendpipe.analysis.calibrate import calibrate
from pendpipe.cli import main
from pendpipe.errors import InputError

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
        ("angle_rad,volts\n0,1\n1,two\n2,3\n", "line 3: volts 'two' is no number"),
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
    content: str | None, fault: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, out = tmp_path / "t.csv", tmp_path / "o.json"
    if content is not None:
        table.write_text(content)
    assert main(["calibrate", str(table), "--out", str(out)]) == 2
    line = capsys.readouterr().err
    assert fault in line
    assert line.count("\n") == 1
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
