"""Fits to every reading, and the compiled sums and solutions that they take."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pendpipe import cli
from pendpipe.analysis.fit import FitResult, fit_recording
from pendpipe.analysis.fit.by_waveform import Waveform
from pendpipe.analysis.fit.fixed import Held, parse_fixed
from pendpipe.analysis.fit.rounding import rounded
from pendpipe.analysis.fit.start import start_values
from pendpipe.analysis.half_cycles import find_extremes
from pendpipe.analysis.turning_points.find import count_half_cycles, smooth_times, turning_points_of
from pendpipe.analysis.turning_points.measure import (
    BLOCK,
    HARMONICS,
    ROWS,
    half_cycle_sums,
    prepare,
    solve_half_cycles,
)
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian, turning_points
from pendpipe.errors import InputError
from pendpipe.files import finite
from pendpipe.recording import Recording, write_plain
from pendpipe.solve import Problem, minimise

# Eq. 8 on all readings: as precise as the readings allow, and honest about it.

OMEGA = 2.0 * math.pi * 0.516
FIG_8 = Eq8(OMEGA, quadratic=0.45, hysteretic=0.00596, viscous=0.00596, coulomb=1.4e-6)
START = Release(-0.3, 0.068, 0.003)
TIME = np.arange(8192) * (300.0 / 8192)
TRUTH = {"a": 0.45, "b": 0.01192, "c": 1.4e-6, "frequency": 0.516, "offset": 0.003}


def noisy(values: FloatArray, rms: float = 1e-4, seed: int = 1) -> FloatArray:
    return np.asarray(values + rms * np.random.default_rng(seed).standard_normal(len(values)))


def fitted(model: Eq8 = FIG_8, seed: int = 1, rms: float = 1e-4, **options: object) -> FitResult:
    recording = Recording(TIME, noisy(sample(model, START, TIME), rms, seed), "angle_rad")
    return fit_recording(recording, **options)  # type: ignore[arg-type]


def pulls(result: FitResult, truth: dict[str, float]) -> dict[str, float]:
    return {
        name: (result.value(name) - value) / result.parameters[name].sd
        for name, value in truth.items()
    }


@pytest.mark.slow
def test_pulls_are_standard_and_intervals_cover() -> None:
    found = [fitted(seed=seed) for seed in range(60)]
    pull = np.array([list(pulls(result, TRUTH).values()) for result in found])
    assert np.all(np.abs(pull.mean(axis=0)) < 3.5 / math.sqrt(60))
    # The share of b is told only in part, so that the frequency's sd errs upwards.
    assert np.all(np.abs(pull.std(axis=0)[[0, 1, 2, 4]] - 1.0) < 3.5 / math.sqrt(120))
    assert pull.std(axis=0)[3] < 1.3
    for name in "abc":
        ends = [result.parameters[name].interval95 or (0.0, 0.0) for result in found]
        assert sum(low <= TRUTH[name] <= high for low, high in ends) >= 51


def test_the_stated_precision_is_the_cramer_rao_bound() -> None:
    """Fisher's information of the readings, with b's share known and with it free."""
    result = fitted()
    jacobian = sample_with_jacobian(FIG_8, START, TIME)[1]
    joint = 0.5 * (jacobian[:, 1] + jacobian[:, 2])  # half of b is hysteretic
    known = np.column_stack([jacobian[:, 0], joint, jacobian[:, 3:]])
    rms = result.noise_rms_rad
    free = rms * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    bound = rms * np.sqrt(np.diag(np.linalg.inv(known.T @ known)))
    assert result.parameters["a"].sd == pytest.approx(bound[0], rel=0.02)
    assert result.parameters["b"].sd == pytest.approx(bound[1], rel=0.02)
    assert result.parameters["c"].sd == pytest.approx(bound[2], rel=0.04)
    assert free[0] == pytest.approx(bound[0], rel=0.01)
    limit = result.quality_factor_limit
    assert limit.sd / limit.value == pytest.approx(bound[1] / 0.01192, rel=0.02)


def test_amplitude_and_phase_are_those_of_the_first_turning_point_kept() -> None:
    result = fitted(rms=1e-7)
    truth = turning_points(FIG_8, START, count=2)
    assert result.value("amplitude") == pytest.approx(abs(truth.angle_rad[1] - 0.003), rel=1e-5)
    phase = OMEGA * (0.0 - truth.time_s[1]) + math.pi
    assert math.remainder(result.value("phase") - phase, 2 * math.pi) == pytest.approx(
        0.0, abs=5.0 * result.parameters["phase"].sd + 1e-6
    )


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_the_frequency_is_eq_8s_at_low_q(share: float) -> None:
    """Viscous damping at Q = 10 slows the swing by 0.125 %, hysteretic by 0.31 %."""
    b = OMEGA / 20.0
    model = Eq8(OMEGA, hysteretic=share * b, viscous=(1.0 - share) * b)
    time = np.arange(3000) * 0.01
    values = noisy(sample(model, Release(-0.4, 0.1), time))
    result = fit_recording(Recording(time, values, "angle_rad"))
    frequency = result.parameters["frequency"]
    assert abs(frequency.value - 0.516) < 4.0 * frequency.sd
    assert frequency.sd < 5e-4 * 0.516


def test_one_recording_does_not_tell_hysteretic_from_viscous() -> None:
    """Only Eq. 8's third harmonic would, which another drag or the sensor swamps."""
    quiet = fitted(rms=1e-5)
    assert quiet.form.quality_factor_hysteretic is None
    assert quiet.form.quality_factor_viscous is None
    b = quiet.parameters["b"]
    assert abs(b.value - TRUTH["b"]) < 4.0 * b.sd


def test_a_loss_that_is_not_told_from_others_is_no_more_than_their_sum() -> None:
    """Of forty swings with noise of a hundredth the sum is known, and no part of it."""
    law = Eq8(OMEGA, hysteretic=0.001, viscous=0.001)
    time = np.arange(0.0, 40.0 / 0.516, 0.1)
    recording = Recording(time, noisy(sample(law, START, time), 7e-4), "angle_rad")
    result = fit_recording(recording, restoring="linear", method="waveform")
    y = result.value("amplitude")
    whole = result.value("a") * y + result.value("b") + result.value("c") / y
    for name, part in (("a", y), ("b", 1.0), ("c", 1.0 / y)):
        assert 0.3 * whole < part * result[name].sd < 1.01 * whole


def test_an_absent_loss_stays_at_its_bound() -> None:
    model = Eq8(OMEGA, quadratic=0.45, viscous=0.0119)
    results = [fitted(model, seed) for seed in range(12)]
    at_bound = [result.parameters["c"].at_bound for result in results]
    assert 1 <= sum(at_bound) <= 11
    for result in results:
        low, high = result.parameters["c"].interval95 or (math.nan, math.nan)
        assert low >= 0.0
        assert 0.0 < high < 6.0 * result.parameters["c"].sd


def test_rounding_of_a_converter_is_noise() -> None:
    step = 1.27e-3
    values = np.round(noisy(sample(FIG_8, START, TIME), 6e-4) / step) * step
    result = fit_recording(Recording(TIME, values, "angle_rad", resolution=step))
    assert result.noise_rms_rad == pytest.approx(math.hypot(6e-4, step / math.sqrt(12)), rel=0.05)
    assert all(abs(pull) < 4.5 for pull in pulls(result, TRUTH).values())


def test_slow_noise_widens_the_errors() -> None:
    """A wobble at the motion's own frequency hides from differences, not from half cycles."""
    steps = np.random.default_rng(7).standard_normal(150)
    slow = np.interp(TIME, np.linspace(0.0, 300.0, 150), steps)
    values = noisy(sample(FIG_8, START, TIME)) + 3e-4 * slow * np.cos(OMEGA * TIME)
    result, clean = fit_recording(Recording(TIME, values, "angle_rad")), fitted()
    assert result.parameters["a"].sd > 3.0 * clean.parameters["a"].sd
    assert any("see pendpipe diagnose" in warning for warning in result.warnings)
    assert not any("see pendpipe diagnose" in warning for warning in clean.warnings)


def test_a_prediction_is_compared_not_fitted() -> None:
    result = fitted(fixed={"a": 0.45, "b": 0.0125, "c": 1.4e-6})
    assert [result.value(name) for name in "abc"] == [0.45, 0.0125, 1.4e-6]
    assert result.parameters["b"].sd == 0.0
    assert result.residual_rms_rad > 1.5 * result.noise_rms_rad
    first = float(turning_points(FIG_8, START, count=2).angle_rad[1]) - START.offset_rad
    right = fitted(fixed={"amplitude": abs(first)})
    assert right.chi2_per_dof == pytest.approx(1.0, abs=0.1)
    assert right.parameters["amplitude"].sd == 0.0


def test_held_quality_factors_make_b() -> None:
    result = fitted(fixed={"quality_factor_hysteretic": 272.0, "quality_factor_viscous": 272.0})
    assert result.value("b") == pytest.approx(math.pi * 0.516 * 2 / 272.0, rel=1e-3)
    one = fitted(fixed={"quality_factor_hysteretic": 272.0})
    assert abs(one.value("b") - 0.01192) < 4.0 * one.parameters["b"].sd


def test_the_viscous_baseline_has_one_loss() -> None:
    result = fitted(Eq8(OMEGA, viscous=0.0119), baseline="viscous")
    assert result.baseline == "viscous"
    assert result.value("a") == result.value("c") == 0.0
    assert abs(result.value("b") - 0.0119) < 4.0 * result.parameters["b"].sd


def test_both_methods_agree() -> None:
    waveform, points = fitted(), fitted(method="turning-points")
    for name in "abc":
        sd = waveform.parameters[name].sd
        assert points.parameters[name].sd == pytest.approx(sd, rel=0.05)
        assert abs(points.value(name) - waveform.value(name)) < 0.6 * sd


def test_fit_json_is_read_as_it_was_written() -> None:
    content = json.loads(json.dumps(finite(fitted().to_dict())))
    assert finite(FitResult.from_json(content).to_dict()) == content
    assert set(content) == {
        "schema_version",
        "method",
        "baseline",
        "parameters",
        "period",
        "quality_factors",
        "gravity",
        "length",
        "quotable",
        "period_check",
        "hysteretic_share",
        "clock_ppm",
        "scale_percent",
        "backbone",
        "damping",
        "quality_factor_limit",
        "quality_factor_hysteretic",
        "quality_factor_viscous",
        "covariance",
        "noise_rms_rad",
        "residual_rms_rad",
        "chi2_per_dof",
        "samples",
        "turning_points",
        "cuts",
        "provenance",
        "warnings",
        "restoring",
        "drag_form",
        "drag",
        "fit_p_value",
        "torque_log_odds",
        "zero_drift",
        "other_frequency",
        "light",
        "light_reason",
        "hindered",
        "decrement_check",
    }
    sd = [content["parameters"][name]["sd"] for name in content["covariance"]["order"]]
    assert np.sqrt(np.diag(content["covariance"]["matrix"])) == pytest.approx(sd)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        *(([word], "--fix") for word in ("q=3", "b", "b=red", "b=-1", "frequency=0")),
        (["a=0.02", "a=0.03"], "a is held twice"),
        (["b=0.01", "quality_factor_viscous=200"], "both held"),
    ],
)
def test_a_wrong_fix_is_refused(words: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        parse_fixed(words)


@pytest.mark.parametrize("name", ["a", "c", "quality_factor_hysteretic"])
def test_what_equation_3_lacks_is_not_held_beside_it(name: str) -> None:
    """Its only loss is viscous: no drag, no Coulomb friction, no hysteresis."""
    with pytest.raises(InputError, match=r"Eq\. 3.* has no .*; .*--baseline eq8"):
        fitted(fixed={name: 0.01}, baseline="viscous")


def test_the_commands_write_what_the_contract_asks(tmp_path: Path, answer_of: Any) -> None:
    recording, points, out = (tmp_path / name for name in ("r.csv", "tp.csv", "fit.json"))
    volts = 3.85 * noisy(sample(FIG_8, START, TIME))
    write_plain(recording, Recording(TIME, volts, "volts", metadata={"volts_per_radian": "3.85"}))
    assert cli.main(["turning-points", str(recording), "--out", str(points)]) == 0
    call = ["fit", str(recording), "--turning-points", str(points), "--out", str(out)]
    assert "πf/b" in answer_of([*call, "--seed", "5", "-v"]).out
    content = json.loads(out.read_text())
    assert content["provenance"]["volts_per_radian"] == 3.85
    assert content["provenance"]["seed"] == 5
    assert len(content["provenance"]["input_sha256"]) == 64
    assert content["parameters"]["a"]["unit"] == "1/(rad s)"
    assert cli.main(["fit", str(recording), "--method", "turning-points", "--out", str(out)]) == 0
    assert json.loads(out.read_text())["method"] == "turning-points"


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.05, 0.2], ids=["hardly any noise", "noise of step/5"])
def test_rounding_that_is_not_random_is_taken_for_what_it_is(noise: float) -> None:
    """Steps of 1.27 mrad, and a tail that ends within one: chi^2 would err by 2 sd."""
    step, pull = 1.27e-3, []
    for seed in range(12):
        release = Release(-0.3, 0.060 + 0.001 * seed, 0.003 + 1.1e-4 * seed)
        values = noisy(sample(FIG_8, release, TIME), noise * step, seed)
        recording = Recording(TIME, np.round(values / step) * step, "angle_rad", resolution=step)
        result = fit_recording(recording)
        assert result.noise_rms_rad >= step / math.sqrt(12.0)
        pull.append(list(pulls(result, {name: TRUTH[name] for name in "abc"}).values()))
    assert np.all(np.abs(np.mean(pull, axis=0)) < 1.0)
    assert np.all(np.sqrt(np.mean(np.square(pull), axis=0)) < 1.6)


def test_the_likelihood_of_roundings_has_the_slope_it_says() -> None:
    residual = np.linspace(-40.0, 40.0, 401)
    score, weight, spare = np.empty(401), np.empty(401), np.empty(401)
    for k in (0, 100, 199, 200, 207, 300, 400):
        one = residual[k : k + 1]
        rounded(one, 0.5, 1.0, score[k : k + 1], weight[k : k + 1])
        step = 1e-3
        up = rounded(one - step, 0.5, 1.0, spare[:1], spare[1:2])
        down = rounded(one + step, 0.5, 1.0, spare[:1], spare[1:2])
        here = rounded(one, 0.5, 1.0, spare[:1], spare[1:2])
        assert score[k] == pytest.approx(-0.25 * (up - down) / step, rel=1e-3, abs=1e-5)
        assert weight[k] == pytest.approx(0.5 * (up + down - 2 * here) / step**2, rel=2e-2)
    wide = rounded(np.zeros(1), 50.0, 1.0, spare[:1], spare[1:2])
    assert wide == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_a_step_taken_on_trust_ends_at_the_optimum() -> None:
    """Against the search gone on with until chi^2 can't be lowered by 1e-10."""
    fine = np.arange(32768) * (300.0 / 32768)
    off = []
    for seed in range(60):
        values = noisy(sample(FIG_8, START, fine), 10.0 ** (-4.5 + 0.01 * seed), seed)
        points = turning_points_of(prepare(Recording(fine, values, "angle_rad"), "record"))
        law = Waveform(fine, values, points.noise_rms_rad)
        problem = Problem(law.at, law.bounds, moved=law.curved)
        first = start_values(points, Held({}, "eq8", 1.0)).value
        soon = minimise(problem, first, trust=0.03, rounds=2)
        if not soon.converged:
            continue
        late = minimise(problem, soon.value, tolerance=1e-10)
        sd = np.sqrt(np.diag(np.linalg.inv(late.point.quadratic.normal)))
        off.append(np.abs(soon.value - late.value) / sd)
        assert soon.chi2 == pytest.approx(late.chi2, abs=0.03)
    assert len(off) > 20
    assert np.max(np.array(off)[:, :3]) < 0.01
    assert np.max(off) < 0.1


@pytest.mark.parametrize(("omega", "time_s"), [(OMEGA, -1e8), (1e7, -0.3)])
def test_a_trial_of_more_half_cycles_than_readings_can_show_is_refused(
    omega: float, time_s: float
) -> None:
    """Without a loss the engine would follow it for ever."""
    problem = Waveform(TIME, np.zeros_like(TIME), 1e-4)
    trial = np.array([0.0, 0.0, 0.0, 0.5, omega, 0.07, time_s, 0.0])
    assert problem.at(trial) is None


@pytest.mark.parametrize("quadratic", [0.0, 0.45])
def test_a_long_step_of_the_share_of_b_keeps_the_period_that_its_derivative_promises(
    quadratic: float,
) -> None:
    """The period is a parabola in the hysteretic share; omega takes up what bends it."""
    problem = Waveform(TIME, np.zeros_like(TIME), 1e-4)
    begin = np.array([quadratic, 0.1, 0.0, 0.5, OMEGA, 0.3, -0.3, 0.0])

    def period(value: FloatArray) -> float:
        return float(turning_points(*problem.motion_of(value), count=3).time_s[2])

    tiny = np.zeros(8)
    tiny[3], tiny[4] = 1e-4, 1e-9
    slope = (period(begin + tiny) - period(begin - tiny)) / 2e-4
    for change in (-0.5, 0.5):
        step = np.zeros(8)
        step[3], step[4] = change, 1e-12
        promised = period(begin) + slope * change
        straight, curved = begin + step, problem.curved(begin, step)
        missed = [abs(period(end) - promised) for end in (straight, curved)]
        assert missed[1] < 0.1 * missed[0]
    held = np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0])
    assert problem.curved(begin, held)[4] == OMEGA


def test_a_record_whose_loss_is_all_viscous_takes_few_looks_at_its_readings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The search begins half way to hysteretic, far from the truth at so little noise."""
    looks, quadratic = [], Waveform.quadratic
    monkeypatch.setattr(
        Waveform, "quadratic", lambda self, value: looks.append(1) or quadratic(self, value)
    )
    law = Eq8(OMEGA, quadratic=0.002, viscous=OMEGA / 400.0, coulomb=1e-5)
    values = noisy(sample(law, Release(-0.3, 0.3), TIME))
    recording = Recording(TIME, values, "angle_rad")
    result = fit_recording(recording, method="waveform", restoring="linear")
    assert result.light == "green"
    # Two for the drag's form, and two for the share.
    assert len(looks) <= 5


# The loops of the turning points: kept as machine code, and right.

FIT = """
import sys
import numpy as np
from pendpipe.analysis.fit import fit_recording
from pendpipe.recording import Recording
time_s = np.arange(4000) / 100.0
angle = 0.1 * np.exp(-0.02 * time_s) * np.cos(3.0 * time_s)
noise = 1e-5 * np.random.default_rng(5).standard_normal(len(time_s))
fit = fit_recording(Recording(time_s, angle + noise, "angle_rad"))
print(abs(fit.value("b") - 0.02) < 1e-3, "numba" in sys.modules, "scipy" in sys.modules)
"""
MEASURE = """
import sys
import numpy as np
from pendpipe.analysis.turning_points import find_turning_points
from pendpipe.recording import Recording
time_s = np.arange(4000) / 100.0
angle = 0.1 * np.exp(-0.02 * time_s) * np.cos(3.0 * time_s)
noise = 1e-5 * np.random.default_rng(5).standard_normal(len(time_s))
points = find_turning_points(Recording(time_s, angle + noise, "angle_rad"))
print(len(points) > 30, "numba" in sys.modules, "scipy" in sys.modules)
"""


@pytest.mark.parametrize("code", [MEASURE, FIT], ids=["turning points", "waveform"])
def test_a_new_process_measures_and_fits_without_numba(code: str) -> None:
    exec(code, {})  # what it needs is compiled and kept
    run = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.split() == ["True", "False", "False"]


@given(
    st.integers(1, 12),
    st.integers(0, HARMONICS),
    st.booleans(),
    st.integers(1, 3),
    st.sampled_from([7, BLOCK]),
    st.integers(0, 2**32 - 1),
)
def test_sums_and_solutions_are_those_of_least_squares(
    half_cycles: int, free: int, shaped: bool, stride: int, block_size: int, seed: int
) -> None:
    """Each half cycle's amplitude and sine are those of numpy's least squares."""
    random = np.random.default_rng(seed)
    time_s = np.sort(random.uniform(-0.5, half_cycles - 0.5, 60 * half_cycles))
    centre_s, rate = np.arange(half_cycles, dtype=float), np.full(half_cycles, np.pi)
    values = random.normal(0.0, 1.0, len(time_s))
    shape = np.zeros((half_cycles, 4 + HARMONICS))
    if shaped:
        shape[:] = random.uniform(-0.05, 0.05, shape.shape)
        shape[:, 0] = np.abs(shape[:, 0])  # friction never drives
    bounds = np.searchsorted(time_s, np.arange(half_cycles + 1) - 0.5)
    edges = np.stack([bounds[:-1], bounds[1:]], axis=1)
    level = 0.2
    gram, right = np.zeros((half_cycles, 3 + free, 3 + free)), np.zeros((half_cycles, 3 + free))
    square, block = np.zeros(half_cycles), np.ones((ROWS, block_size))
    harmonics = HARMONICS if shaped else free
    half_cycle_sums(
        time_s,
        values,
        stride,
        edges,
        centre_s,
        rate,
        level,
        shape,
        harmonics,
        gram,
        right,
        square,
        block,
    )
    solution = _solved(gram, right)[[0, 1, *range(13, 13 + free)]].T
    for k in range(half_cycles):
        used = slice(edges[k, 0], edges[k, 1], stride)
        phase = rate[k] * (time_s[used] - centre_s[k])
        friction, viscous, friction2, viscous2 = shape[k, :4]
        cosine, sine = np.cos(phase), np.sin(phase)
        odd = [np.cos((2 * m + 3) * phase) for m in range(HARMONICS)]
        form = cosine + (np.sign(phase) * friction - friction2) * (1.0 - cosine)
        form += viscous * (sine - phase * cosine)
        form += viscous2 * phase * (0.5 * phase * cosine - sine)
        form += sum(share * wave for share, wave in zip(shape[k, 4:], odd, strict=True))
        basis = np.stack([np.ones_like(phase), form, sine, *odd[:free]])
        reading = values[used] - level
        np.testing.assert_allclose(gram[k], basis @ basis.T, atol=1e-6)
        np.testing.assert_allclose(right[k], basis @ reading, atol=1e-6)
        assert square[k] == pytest.approx(reading @ reading)
        if len(reading) > 3 * len(basis):
            expected, *_ = np.linalg.lstsq(basis[1:].T, reading, rcond=None)
            np.testing.assert_allclose(solution[k], expected, rtol=1e-4, atol=1e-4)


def _solved(gram: FloatArray, right: FloatArray) -> FloatArray:
    """What half cycles on the upper side tell, and their harmonics."""
    count, terms = right.shape
    nothing, side, room = np.zeros(count), np.ones(count), np.empty((count, terms - 1, terms - 1))
    harmonics, found = np.empty((count, terms - 3)), np.empty((13, count))
    solve_half_cycles(gram, right, nothing, nothing, side, room, harmonics, found)
    return np.vstack([found, harmonics.T])


def test_a_half_cycle_without_readings_has_no_solution() -> None:
    told, counted = np.split(_solved(np.zeros((1, 3, 3)), np.zeros((1, 3))), [11])
    assert np.isnan(told).all()
    assert not counted.any()


@given(st.integers(3, 40), st.booleans())
def test_extremes_of_a_cosine_are_where_it_turns(turns: int, upside: bool) -> None:
    """The first reading, where the motion begins, counts as one of them, and so does the last."""
    readings = 240
    phase = np.arange(turns * readings + 1) * np.pi / readings
    values = np.cos(phase) if upside else -np.cos(phase)
    index = find_extremes(values, 0.01)
    assert index.tolist() == (np.arange(turns + 1) * readings).tolist()


@given(st.lists(st.integers(1, 3), min_size=6, max_size=30), st.floats(0.1, 10.0))
def test_half_cycles_lost_in_gaps_are_counted(steps: list[int], period: float) -> None:
    """An interval with a gap counts as many half cycles as fit and as its sides ask for."""
    steps[:5] = [1] * 5
    number = np.concatenate([[0], np.cumsum(steps)])
    sign = 1 - 2 * (number % 2)
    gap = np.concatenate([[0], (np.array(steps) > 1).astype(int)])
    counted = np.zeros(len(number), dtype=np.int64)
    assert count_half_cycles(period * number, sign, gap, period, counted) == len(number)
    assert counted.tolist() == number.tolist()


@given(st.integers(8, 100), st.floats(0.1, 10.0), st.floats(-1e-4, 1e-4))
def test_smoothing_leaves_a_parabola_alone(count: int, period: float, drift: float) -> None:
    """Times that are a parabola of their number are their own local parabola."""
    number = np.arange(count)
    time_s = period * (number + drift * number**2)
    centre, half_period = smooth_times(number, time_s, np.ones(count), 9.0, number)
    np.testing.assert_allclose(centre, time_s, rtol=1e-9, atol=1e-9 * period)
    np.testing.assert_allclose(half_period, period * (1.0 + 2.0 * drift * number), rtol=1e-7)


@given(st.lists(st.integers(-6, 6), min_size=2, max_size=60))
def test_extremes_by_a_fixed_threshold_are_those_of_the_definition(steps: list[int]) -> None:
    """Between neighbours the readings go from one to the other, and no return exceeds it."""
    values, least = np.cumsum(np.array(steps, dtype=float)), 3.0
    index = find_extremes(values, least)
    if len(index) == 0:
        assert np.ptp(values) <= least
        return
    assert np.all(np.diff(index) > 0)
    first = np.sign(values[index[0]] - values[index[1]])
    side = first * (1.0 - 2.0 * (np.arange(len(index)) % 2))
    swing = -np.diff(values[index]) * side[:-1]
    assert np.all(swing > least)
    for start, stop, sign in zip(index[:-1], index[1:], -side[:-1], strict=True):
        path = sign * values[start : stop + 1]
        assert path.min() == path[0]
        assert path.max() == path[-1]
        assert np.max(np.maximum.accumulate(path) - path) <= least
