"""One law, one fit, one test of it: clean recordings, real apparatus, and laws that are wrong."""

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendpipe
import pendpipe as pp
from pendpipe import cli
from pendpipe.analysis.fit import fit_recording
from pendpipe.analysis.fit.decrement import check_decrement, loss_of, seen_loss
from pendpipe.analysis.fit.goodness import judge
from pendpipe.analysis.fit.quality import seen_qualities
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, sample, turning_points
from pendpipe.errors import InputError
from pendpipe.levels import REFUTED
from pendpipe.recording import Recording, write_plain
from pendpipe.report.class_table import Fitted, record

from ..effects.integration import swung
from ..recordings import white

# One law, one fit, one test of it: the numbers of clean recordings at any rate, noise and loss.

ONE_HERTZ = 2.0 * math.pi


def clean(law: Eq8, amplitude: float, time_s: FloatArray, noise: float, seed: int = 1) -> Any:
    """A recording of the law with white noise."""
    return recorded(sample(law, Release(-0.2, amplitude, 0.002), time_s), time_s, noise, seed)


def pull(result: Any, name: str, truth: float) -> float:
    """Standard deviations by which a number is off."""
    return float((result[name].value - truth) / result[name].sd)


def test_a_short_quiet_decay_by_dry_friction_tells_sin_x_from_x() -> None:
    """Five cycles from 6 degrees: the times lie between the two torques', the readings do not."""
    law = Eq8(8.46, 0.0, 0.0, 0.0, 0.0241, "sine")
    time_s = np.arange(0.0, 5.62, 1.0 / 19.7) * 2.0 * math.pi / 8.46
    result = pp.fit(clean(law, 0.1, time_s, 1.2e-6))
    assert result.restoring == "sine"
    assert abs(pull(result, "frequency", 8.46 / (2.0 * math.pi))) < 4.0


def test_few_readings_in_a_cycle_tell_the_noise() -> None:
    """Differences of 7 readings in a half cycle see the motion, and not the noise."""
    time = np.arange(0.0, 40.0, 1.0 / 14.7)
    result = pp.fit(clean(Eq8(ONE_HERTZ, viscous=0.02, restoring="sine"), 0.3, time, 5e-6))
    assert result.light == "green"
    assert result.noise_rms_rad == pytest.approx(5e-6, rel=0.1)
    assert 0.8 < result.chi2_per_dof < 1.2


@pytest.mark.parametrize("per_cycle", [4.2, 5.3, 7.5, 11.0])
@pytest.mark.parametrize("amplitude", [0.3, 1.5])
def test_four_readings_in_a_cycle_are_enough(per_cycle: float, amplitude: float) -> None:
    law = Eq8(ONE_HERTZ, viscous=0.02, restoring="sine")
    result = pp.fit(clean(law, amplitude, np.arange(0.0, 40.0, 1.0 / per_cycle), 5e-6))
    assert result.light != "red"
    assert result.noise_rms_rad == pytest.approx(5e-6, rel=0.15)
    assert abs(pull(result, "frequency", 1.0)) < 4.0
    low, high = result["b"].bounds95
    assert low - result["b"].sd <= 0.02 <= high + result["b"].sd


def test_the_minimum_is_that_of_the_noise_that_was_found() -> None:
    """Hysteretic loss from 2 rad: the half cycles' first noise is 27 times too large."""
    law = Eq8(ONE_HERTZ, hysteretic=ONE_HERTZ / 200.0, restoring="sine")
    result = pp.fit(clean(law, 2.0, np.arange(0.0, 60.0, 0.02), 1e-4))
    assert result.light == "green"
    for name, truth in {"a": 0.0, "b": ONE_HERTZ / 200.0, "c": 0.0}.items():
        low, high = result[name].bounds95
        assert low <= truth <= high
    assert abs(pull(result, "frequency", 1.0)) < 4.0


@pytest.mark.parametrize(("size", "period_s", "quality"), [(0.05, 0.8, 60), (0.3, 2.1, 400)])
def test_numbers_without_noise_are_fitted_as_exactly_as_motions_are_computed(
    size: float, period_s: float, quality: float
) -> None:
    """In columns of one array, which do not stand one beside the other."""
    time_s, omega = np.arange(4000) * 0.01, 2.0 * np.pi / period_s
    rate = 0.5 * omega / quality
    angle = size * np.exp(-rate * time_s) * np.cos(math.sqrt(omega**2 - rate**2) * time_s + 0.7)
    columns = np.column_stack([time_s, angle])
    fitted = pp.fit(pp.Recording(time_s=columns[:, 0], displacement_m=columns[:, 1]))
    assert fitted.light == "green"
    assert fitted.parameters["b"].value == pytest.approx(rate, rel=1e-9)
    assert 1.0 / fitted.parameters["frequency"].value == pytest.approx(period_s, rel=1e-12)
    assert fitted.parameters["frequency"].sd > 1e-16 / period_s


def test_rounded_stamps_of_even_times_are_even() -> None:
    """Sixty readings a second, stamped with two decimals."""
    true = np.arange(3600) / 60.0
    recording = clean(Eq8(5.0, viscous=0.02, restoring="sine"), 0.2, true, 2e-4)
    result = pp.fit(pp.Recording(np.round(true, 2), angle_rad=recording.values))
    assert result.noise_rms_rad == pytest.approx(2e-4, rel=0.05)
    assert result["b"].sd == pytest.approx(pp.fit(recording)["b"].sd, rel=0.05)


@pytest.mark.parametrize(("rate", "digits"), [(30.0, 3), (1e4, 9)])
def test_a_fit_names_the_rate_that_inspect_names(rate: float, digits: int) -> None:
    """Of stamps in milliseconds the median interval is 33 ms, or 30.3 Hz."""
    true = np.arange(0.0, 12.0, 1.0 / rate)
    swing = clean(Eq8(5.0, viscous=0.02, restoring="sine"), 0.2, true, 2e-4)
    recording = pp.Recording(np.round(true, digits), angle_rad=swing.values)
    assert recording.interval_s == pytest.approx(1.0 / rate, rel=1e-4)
    assert f", {rate:.0f} Hz, " in str(pp.fit(recording))


def test_a_loss_within_its_error_shows_no_q() -> None:
    fit = pp.fit(clean(Eq8(5.0, viscous=0.02), 0.2, np.arange(0.0, 60.0, 0.02), 2e-4))
    first, *_, last = fit.decrement_check
    sd = np.where(fit.backbone.amplitude_rad > last.amplitude_rad, 1e-3, 1.0)
    shown = replace(fit.backbone, decrement_sd=sd)
    (seen,) = seen_qualities(
        replace(fit, shown=shown, agreement=replace(fit.agreement, decrement_check=(first, last)))
    )
    assert seen.quality_factor.value == pytest.approx(5.0 / (2.0 * 0.02), rel=0.02)


def test_uneven_times_stay_as_they_are() -> None:
    time = np.sort(np.random.default_rng(3).uniform(0.0, 60.0, 3000))
    result = pp.fit(clean(Eq8(5.0, viscous=0.02, restoring="sine"), 0.2, time, 2e-4))
    assert result.noise_rms_rad == pytest.approx(2e-4, rel=0.05)


@pytest.mark.parametrize("drag", ["energy", "speed"])
@pytest.mark.parametrize("amplitude", [1.0, 2.2])
def test_the_form_of_the_drag_is_fitted(drag: Any, amplitude: float) -> None:
    """A ball on a string loses by v|v|, and a, b, c are what they are."""
    law = Eq8(ONE_HERTZ, quadratic=0.03, viscous=0.01, coulomb=1e-4, restoring="sine", drag=drag)
    result = pp.fit(clean(law, amplitude, np.arange(0.0, 100.0, 0.01), 1e-3))
    assert (result.light, result.drag_form) == ("green", drag)
    assert result.to_dict()["drag_form"] == drag
    for name, truth in {"a": 0.03, "b": 0.01, "c": 1e-4, "frequency": 1.0}.items():
        assert abs(pull(result, name, truth)) < 4.0


def test_where_the_form_cannot_be_told_the_error_covers_both() -> None:
    """A tenth of a radian in six cycles."""
    law = Eq8(ONE_HERTZ, quadratic=0.6, restoring="sine", drag="speed")
    result = pp.fit(clean(law, 0.1, np.arange(0.0, 6.0, 0.01), 1e-3))
    assert result.drag_form == "undecided"
    low, high = result["a"].bounds95
    assert low <= 0.6 <= high


@pytest.mark.slow
def test_a_perfect_recording_is_refuted_at_the_level_of_all_questions_together() -> None:
    """Of 60 recordings of the law of fig. 8 four were red."""
    law = Eq8(ONE_HERTZ * 0.516, 0.45, 0.00596, 0.00596, 1.4e-6, "sine")
    time = np.arange(4096) * (280.0 / 4096)
    motion = sample(law, Release(-0.3, 0.068), time)
    p_values, lights = [], []
    for seed in range(60):
        result = pp.fit(pp.Recording(time, angle_rad=motion + white(seed, len(time), 1e-4)))
        p_values.append(result.fit_p_value)
        lights.append(result.light)
    assert "red" not in lights
    assert min(p_values) > REFUTED
    # A question's own level would refute each third.
    assert np.mean(np.array(p_values) < 0.5) < 0.75


@pytest.mark.parametrize(
    ("name", "frequency", "size"),
    [
        ("level", 0.01, 0.2),
        ("motion", 1.0, 0.2),
        ("harmonic 2", 2.0, 0.2),
        ("harmonic 3", 3.0, 0.2),
    ],
)
def test_what_noise_does_not_explain_is_seen(name: str, frequency: float, size: float) -> None:
    """A fifth of the noise, in any harmonic of the motion or below it."""
    time = np.arange(6000) * 0.02
    residual = np.random.default_rng(5).standard_normal(len(time))
    residual += size * np.cos(2.0 * math.pi * frequency * time + 1.0)
    turns = np.arange(0.25, 119.0, 0.5)
    found = judge(
        time,
        residual,
        turns,
        np.arange(len(turns), dtype=np.float64),
        fitted=6,
        lines=1,
        amplitude=np.ones(len(turns)),
        step=None,
        floor=0.0,
    )
    assert found.p_value < REFUTED, name
    assert found.noise_rms == pytest.approx(1.0, rel=0.03)


def test_a_rate_that_is_known_to_sixty_deviations_is_told() -> None:
    """No warning that a can't be separated from b."""
    law = Eq8(ONE_HERTZ, quadratic=0.2, viscous=0.01, restoring="sine")
    result = pp.fit(clean(law, 0.3, np.arange(0.0, 100.0, 0.02), 1e-4))
    assert result["a"].value > 60.0 * result["a"].sd
    assert not any("can't be separated" in warning for warning in result.warnings)


@pytest.mark.parametrize("count", [5000, 50_000])
def test_a_zero_that_drifts_by_a_line_is_followed(count: int) -> None:
    """1 V on -0.03 V/s: the zero moves by three swings."""
    time = np.arange(count) * (100.0 / count)
    motion = sample(Eq8(ONE_HERTZ, viscous=ONE_HERTZ / 386.0), Release(-0.1, 1.0), time)
    result = pp.fit(pp.Recording(time, volts=motion - 0.03 * time + white(0, count, 1e-3)))
    assert result.light == "green"
    assert result.zero_drift.unit == "V/s"
    assert abs(result.zero_drift.value + 0.03) < 4.0 * result.zero_drift.sd
    assert abs(pull(result, "b", ONE_HERTZ / 386.0)) < 4.0


def test_bursts_are_a_refusal_in_words() -> None:
    """Wild readings two and three together, a twentieth of them as large as the swing."""
    random, time = np.random.default_rng(3), np.arange(6000) / 60.0
    values = 0.5 * np.exp(-0.03 * time) * np.cos(8.44 * time)
    for start in np.flatnonzero(random.random(len(time)) < 0.02).tolist():
        values[start : start + 3] += 0.6 * random.standard_normal() * abs(values[start])
    with pytest.raises(pp.InputError, match=r"no law describes it|no free decay|did not converge"):
        pp.fit(pp.Recording(time, displacement_m=values))


@pytest.mark.parametrize("seed", range(4))
def test_torques_are_compared_by_the_readings_that_both_explain(seed: int) -> None:
    """A pendulum that friction stops: with x and with sin x it is followed to other times."""
    omega = 2.0 * math.pi * 0.05987
    law = Eq8(omega, 0.0514, 0.0134, 0.0038, 1.19e-5, "sine")
    result = pp.fit(clean(law, 0.0572, np.arange(0.0, 251.0, 1.0 / 65.0), 8e-5, seed))
    assert result.restoring == "sine"
    assert abs(pull(result, "frequency", 0.05987)) < 4.0


# No law is printed that loses other than the decay loses, unless it is called red.

OMEGA = 5.0
SHARED = Path(__file__).resolve().parents[3] / "shared" / "recordings"
STEADY_LOSSES = {"viscous": 0.02, "quadratic": 0.03, "coulomb": 0.001}


def pendulum(
    release: float,
    time_s: FloatArray,
    *,
    quadratic: float,
    viscous: float,
    coulomb: float,
    restoring: str = "sine",
) -> FloatArray:
    """A pendulum with v|v|, v and sgn(v), by scipy from turning point to turning point.

    The losses are the first-order rates of Eq. 13: for small swings v|v| q loses
    (4/(3 pi)) q omega y^2, and sgn(v) f loses (2/pi) f/omega.
    """
    q, f = 0.75 * math.pi * quadratic / OMEGA, 0.5 * math.pi * OMEGA * coulomb
    pull = math.sin if restoring == "sine" else float
    values = np.full(len(time_s), math.nan)
    begin, angle = float(time_s[0]), release
    while begin < time_s[-1]:
        way = -math.copysign(1.0, angle)
        if OMEGA**2 * abs(pull(angle)) <= f:
            break

        def motion(_: float, state: FloatArray, way: float = way) -> list[float]:
            x, v = state
            return [v, -(OMEGA**2) * pull(x) - 2.0 * viscous * v - way * (q * v * v + f)]

        def turns(t: float, state: FloatArray, begin: float = begin, way: float = way) -> float:
            return way if t < begin + 0.2 / OMEGA else state[1]

        turns.terminal = True  # type: ignore[attr-defined]
        found = solve_ivp(
            motion,
            (begin, begin + 60.0 / OMEGA),
            [angle, 0.0],
            "DOP853",
            events=turns,
            rtol=1e-11,
            atol=1e-13,
            dense_output=True,
        )
        inside = (time_s >= begin) & (time_s < found.t[-1])
        values[inside] = found.sol(time_s[inside])[0]
        begin, angle = float(found.t[-1]), float(found.y[0, -1])
    values[np.isnan(values)] = angle
    return values


def recorded(values: FloatArray, time_s: FloatArray, rms: float, seed: int = 1) -> Recording:
    return Recording(time_s, values + white(seed, len(values), rms), "angle_rad")


def true_loss(amplitude: float, **losses: float) -> float:
    """Relative loss of the pendulum above over the cycle about an amplitude, 1/s."""
    start, loss = amplitude, 0.0
    for _ in range(2):
        time = np.arange(0.0, 6.0 * math.pi / OMEGA, 1e-3)
        values = pendulum(start, time, **losses)
        back = int(np.argmin(values)) + int(np.argmax(values[int(np.argmin(values)) :]))
        fall = math.log(start / values[back])
        start, loss = amplitude * math.exp(0.5 * fall), fall / time[back]
    return loss


FALL = math.pi * 1e-3 / OMEGA
"""What dry friction of c = 1e-3 rad/s takes from each half swing."""


def by_dry_friction(over: float) -> tuple[Eq8, float, float]:
    """From y + d to y - d in a cycle about y = `over` d."""
    loss = math.log((over + 1.0) / (over - 1.0)) / (2.0 * math.pi / OMEGA)
    return Eq8(OMEGA, coulomb=1e-3), over * FALL, loss


@pytest.mark.parametrize(
    ("law", "amplitude", "loss"),
    [
        (Eq8(OMEGA, viscous=0.3), 0.2, 0.3),
        *(by_dry_friction(over) for over in (2.2, 3.0, 30.0)),
        # Overdamped, or stopped within the cycle: Eq. 13's a y + b + c/y.
        (Eq8(OMEGA, coulomb=1e-3), 0.75 * FALL, 1e-3 / (0.75 * FALL)),
        (Eq8(OMEGA, 2.0, 30.0, 12.0, 0.5), 3.0, 2.0 * 3.0 + 42.0 + 0.5 / 3.0),
        (Eq8(OMEGA, quadratic=0.25, coulomb=60.0), 3.0, 0.25 * 3.0 + 60.0 / 3.0),
    ],
)
def test_the_loss_of_a_law_is_that_of_the_cycle_about_the_amplitude(
    law: Eq8, amplitude: float, loss: float
) -> None:
    assert loss_of(law, amplitude) == pytest.approx(loss, rel=1e-6)


def seen_points(law: Eq8, angle_sd: float, count: int, off: FloatArray | float) -> TurningPoints:
    """Turning points of a law, whose angles are off, and claim an error."""
    motion, ones = turning_points(law, Release(0.0, 0.5), count=count), np.ones(count)
    angle = motion.angle_rad + off
    return TurningPoints(
        np.arange(count), motion.time_s, 1e-4 * ones, angle, angle_sd * ones, 0.0 * ones
    )


def test_the_decrement_that_is_seen_is_as_sure_as_it_says() -> None:
    law = Eq8(OMEGA, 0.1, 0.0, 0.02, 0.002)
    random, pulls = np.random.default_rng(3), []
    for _ in range(300):
        points = seen_points(law, 2e-3, 40, 2e-3 * random.standard_normal(40))
        for check in check_decrement(points, law):
            pulls.append((check.seen - check.fitted) / check.seen_sd)
            assert not check.contradicts or abs(pulls[-1]) > 2.0
    assert abs(np.mean(pulls)) < 0.25
    assert 0.75 < np.std(pulls) < 1.15


def test_an_error_of_the_level_is_no_loss() -> None:
    points = seen_points(Eq8(OMEGA, viscous=0.05), 1e-4, 10, 0.02)
    amplitude, loss, *_ = seen_loss(points)
    assert loss == pytest.approx(0.05, rel=0.02)
    assert amplitude == pytest.approx(0.5 * math.exp(-0.05 * np.mean(points.time_s)), rel=0.01)


def test_the_level_is_not_sought_in_turning_points_of_one_side() -> None:
    """Where the others hardly stand out: there any level would do, and any amplitude."""
    points = seen_points(Eq8(OMEGA, viscous=0.02), 0.05, 10, white(3, 10, 0.05))
    amplitude, _, loss_sd, *_ = seen_loss(points.chosen(points.side > 0))
    assert amplitude == pytest.approx(0.5 * math.exp(-0.02 * np.mean(points.time_s)), rel=0.15)
    assert loss_sd > 0.02


def test_a_plain_record_is_green() -> None:
    time = np.arange(0.0, 200.0, 0.05)
    law = Eq8(OMEGA, 0.1, 0.0, 0.01, 1e-4)
    result = fit_recording(recorded(sample(law, Release(-0.3, 0.1), time), time, 1e-4))
    assert (result.light, result.method, result.restoring) == ("green", "waveform", "linear")
    assert [check.amplitude_rad for check in result.decrement_check] == sorted(
        (check.amplitude_rad for check in result.decrement_check), reverse=True
    )


@pytest.mark.slow
@pytest.mark.parametrize("release", [0.4, 1.2, 2.0, 2.5])
@pytest.mark.parametrize("rms", [1e-4, 3e-3])
def test_no_law_of_a_pendulum_that_swings_far_is_green_and_wrong(
    release: float, rms: float
) -> None:
    time = np.arange(0.0, 120.0, 0.02)
    values = pendulum(release, time, **STEADY_LOSSES)
    for restoring in ("linear", "sine"):
        result = fit_recording(recorded(values, time, rms), restoring=restoring)  # type: ignore[arg-type]
        assert result.decrement_check
        for check in result.decrement_check:
            truth = true_loss(check.amplitude_rad, **STEADY_LOSSES)
            # What is seen is the truth, whatever was fitted.
            assert abs(check.seen - truth) < 0.03 * truth + 3.0 * check.seen_sd
            unseen = 2.0 * check.seen_sd if result.light == "amber" else 0.0
            if result.light != "red":
                assert abs(check.fitted - truth) < 0.1 * truth + unseen
    assert result.light != "red"


@pytest.mark.slow
def test_a_law_that_contradicts_the_decay_is_not_printed(tmp_path: Path, answer_of: Any) -> None:
    time = np.arange(0.0, 100.0, 0.05)
    write_plain(
        tmp_path / "decay.csv",
        recorded(sample(Eq8(OMEGA, viscous=0.02), Release(-0.3, 0.1), time), time, 1e-4),
    )
    asked = ["fit", str(tmp_path / "decay.csv"), "--out", str(tmp_path / "fit.json")]
    asked += ["--fix", "b=0.04"]
    printed = answer_of(asked, 2)
    assert printed.out.splitlines()[0].endswith("RED")
    assert printed.out.splitlines()[1].startswith("  the law contradicts the decay; at ")
    assert "−dy/dt" not in printed.out
    assert printed.err.splitlines()[0].startswith(f"pendpipe: {tmp_path / 'decay.csv'}: ")
    content = json.loads((tmp_path / "fit.json").read_text())
    assert content["light"] == "red"
    # Q = omega/(2 b) is seen without a law.
    line = next(row for row in printed.out.splitlines() if row.startswith("  Q "))
    seen = re.findall(r"([0-9.]+\([0-9.]+\)) at", line)
    for q, check in zip(seen, content["decrement_check"], strict=True):
        assert abs(check["seen"] - 0.02) < 3.0 * check["seen_sd"]
        assert float(q.partition("(")[0]) == pytest.approx(0.5 * OMEGA / check["seen"], rel=1e-2)
    assert content["light_reason"] in printed.out
    # Accepted, or in a campaign, it is printed, and still called red.
    assert "−dy/dt" in answer_of([*asked, "--accept"]).out
    assert cli.main([*asked, "--refused", str(tmp_path / "refused.json")]) == 0
    assert not (tmp_path / "refused.json").exists()


def test_a_fit_that_did_not_settle_is_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    from pendpipe.analysis.fit import by_waveform

    def hasty(*arguments: object, **options: object) -> object:
        return minimise(*arguments, **options | never)  # type: ignore[arg-type]

    minimise, never = by_waveform.minimise, {"rounds": 1, "trust": -1.0, "tolerance": 0.0}
    monkeypatch.setattr(by_waveform, "minimise", hasty)
    time = np.arange(0.0, 200.0, 0.05)
    decay = recorded(sample(Eq8(OMEGA, 0.1, 0.0, 0.01), Release(-0.3, 0.1), time), time, 1e-5)
    with pytest.raises(InputError, match="the waveform fit did not converge"):
        fit_recording(decay, method="waveform")
    # Left to itself it takes what did settle.
    assert fit_recording(decay).method == "turning-points"


def eq8_decay(time_s: FloatArray) -> FloatArray:
    return sample(Eq8(OMEGA, 0.05, 0.0, 0.02, 1e-4), Release(-0.3, 0.1), time_s)


def slowing_spring(time_s: FloatArray) -> FloatArray:
    """A spring whose frequency falls by 6 % while it decays."""
    phase = OMEGA * time_s * (1.0 - 0.03 * time_s / time_s[-1])
    return np.asarray(0.15 * np.exp(-0.03 * time_s) * np.cos(phase))


@pytest.mark.parametrize(
    ("decay", "noise", "method"),
    [
        (eq8_decay, 1e-4, "waveform"),
        (eq8_decay, 2e-3, "waveform"),
        # All readings have lost the phase; the turning points, which are counted, have not.
        pytest.param(slowing_spring, 1e-4, "turning-points", marks=pytest.mark.slow),
    ],
)
def test_fit_and_diagnosis_print_the_same_baseline(
    decay: Callable[[FloatArray], FloatArray], noise: float, method: str
) -> None:
    from pendpipe.analysis.fit.quality import small_frequency
    from pendpipe.analysis.free_decay import measure_recording
    from pendpipe.diagnosis.run import diagnose_recording

    time = np.arange(0.0, 60.0, 0.05)
    recording = recorded(decay(time), time, noise)
    points, part = measure_recording(recording, "recording")
    fitted = fit_recording(part, points=points)
    assert fitted.method == method
    diagnosed = diagnose_recording(recording).baseline
    # Of a refuted law the frequency is that of the period that `fit` prints.
    printed = {**fitted.parameters, "frequency": small_frequency(fitted)}
    for name, estimate in printed.items():
        found = diagnosed.parameters[name]
        assert abs(found.value - estimate.value) < 0.1 * estimate.sd
        assert found.sd == pytest.approx(estimate.sd, rel=0.1)


@pytest.mark.slow
def test_laws_that_are_right_are_green() -> None:
    random, lights = np.random.default_rng(8), []
    for _ in range(40):
        omega = 2.0 * math.pi * float(np.exp(random.uniform(math.log(0.2), math.log(1.1))))
        b = 0.5 * omega / float(np.exp(random.uniform(math.log(10.0), math.log(500.0))))
        law = Eq8(omega, random.choice([0.0, 0.2]), 0.5 * b, 0.5 * b, random.choice([0.0, 1e-4]))
        time = np.arange(0.0, 300.0, 0.04)
        release = Release(-0.3, float(random.uniform(0.05, 0.3)), 0.003)
        result = fit_recording(recorded(sample(law, release, time), time, 1e-4), restoring="linear")
        lights.append(result.light)
    assert "red" not in lights
    # The check is at two standard deviations, three times.
    assert lights.count("green") > 30


# Motions that real apparatus makes, from the recording to the fit, by another integrator.

TIME = np.arange(0.0, 80.0, 0.01)
LOSSES = {"quadratic": 0.02, "viscous": 0.02, "coulomb": 0.004}


def fitted(values: FloatArray, rms: float = 1e-3, time: FloatArray = TIME) -> "pendpipe.FitResult":
    return pendpipe.fit(recorded(values, time, rms))


def viscous(angle: float, speed: float, loss: float, linear: bool = False) -> FloatArray:
    """A viscous pendulum, x'' = -omega^2 sin x - 2 loss x', or a wheel with x for sin x."""
    return swung(TIME, angle, OMEGA, loss, torque=float if linear else math.sin, speed=speed)[0]


def holds(result: "pendpipe.FitResult", name: str, value: float) -> bool:
    return abs(result[name].value - value) < 4.0 * result[name].sd


def test_a_pendulum_thrown_over_the_top_is_fitted_where_it_swings() -> None:
    values = viscous(0.1, 13.0, 0.04)
    assert values[-1] > 2.0 * math.pi - 0.5
    result = fitted(values)
    assert result.cuts[0]["reason"] == "it went over the top before it settled"
    assert (result.restoring, result.light) == ("sine", "green")
    assert holds(result, "b", 0.04)
    assert holds(result, "frequency", 0.5 * OMEGA / math.pi)


@pytest.mark.parametrize("wound", [1.0, 2.5, 4.0, 40.0])
def test_a_torsion_wheel_has_no_sine_however_far_it_turns(wound: float) -> None:
    result = fitted(viscous(wound, 0.0, 0.03, linear=True), rms=2e-3)
    assert (result.restoring, result.light) == ("linear", "green")
    assert holds(result, "b", 0.03)


@pytest.mark.parametrize("quality", [1.8, 2.2, 3.0, 4.0])
@pytest.mark.parametrize("torque", ["linear", "sine"])
def test_a_brake_leaves_few_half_cycles_and_they_tell_law_and_loss(
    quality: float, torque: str
) -> None:
    """The wheel of every teaching laboratory, and a vane in oil: some six half cycles."""
    loss = 0.5 * OMEGA / quality
    result = fitted(viscous(1.5, 0.0, loss, linear=torque == "linear"), rms=2e-3)
    # Too few turning points may be left to check the numbers by: amber, with right numbers.
    assert result.restoring == torque
    assert result.light != "red"
    assert holds(result, "b", loss)
    assert holds(result, "frequency", 0.5 * OMEGA / math.pi)


def test_sin_x_is_refused_beyond_pi() -> None:
    wheel = recorded(viscous(4.0, 0.0, 0.03, linear=True), TIME, 2e-3)
    for method in ("waveform", "turning-points"):
        with pytest.raises(pendpipe.InputError, match="below pi rad"):
            pendpipe.fit(wheel, restoring="sine", method=method)  # type: ignore[arg-type]


@pytest.mark.parametrize("stop", [11.0, 14.3])
def test_a_gap_in_a_decay_loses_nothing_but_its_readings(stop: float) -> None:
    values = pendulum(1.2, TIME, **LOSSES)
    keep = np.abs(TIME - 0.5 * (10.0 + stop)) > 0.5 * (stop - 10.0)
    result = fitted(values[keep], time=TIME[keep])
    assert (result.restoring, result.light) == ("sine", "green")
    assert result["amplitude"].value == pytest.approx(1.2, abs=2e-3)
    assert result["frequency"].value == pytest.approx(0.5 * OMEGA / math.pi, rel=1e-4)


def test_sides_that_differ_are_analysed_and_not_refused() -> None:
    """It swings against a cushion: stiffer by 1.8 on one side, half periods of 0.63 and 0.47 s."""
    values = swung(TIME, 0.3, OMEGA, 0.03, torque=lambda x: x * (1.0 if x > 0.0 else 1.8))[0]
    result = fitted(values)
    # No law here swings so, and yet period and loss are right.
    assert result.light != "red"
    assert result.fit_p_value < 1e-3
    assert result["b"].value == pytest.approx(0.03, rel=0.1)
    period = math.pi / OMEGA * (1.0 + math.sqrt(1.0 / 1.8))
    assert result["frequency"].value == pytest.approx(1.0 / period, rel=1e-3)


def test_two_coupled_pendulums_are_named_with_their_modes() -> None:
    one, other = (viscous(0.05, 0.0, loss, linear=True) for loss in (0.02, 0.02))
    time = TIME * 1.07  # the second is 7 % slower
    other = np.interp(TIME, time, other)
    result = fitted(one - other)
    assert result.light == "red"
    assert result.light_reason.startswith("two modes beat: ")
    found = sorted(map(float, re.findall(r"([0-9.]+) Hz", result.light_reason)))
    truth = 0.5 * OMEGA / math.pi
    assert found == pytest.approx([truth / 1.07, truth], rel=1e-4)
    row = record(Fitted("beat.csv", result))
    assert (row["T_s"], row["T0_s"], row["light"]) == (None, None, "red"), "nor in a class"


def test_a_decay_that_is_slow_and_loud_is_measured() -> None:
    # 8 % in 64 cycles, the amplitude 7.8 times the noise of a reading.
    loss = -math.log(0.92) / TIME[-1]
    result = fitted(0.1 * np.exp(-loss * TIME) * np.cos(OMEGA * TIME), rms=0.1 / 7.8)
    assert result.light == "amber"
    y = result["amplitude"].value
    rates = [result[name].value for name in "abc"] @ np.array([y, 1.0, 1.0 / y])
    assert rates == pytest.approx(loss, rel=0.25)


def test_readings_of_noise_and_of_a_motor_are_refused_each_for_its_reason() -> None:
    steady = 0.1 * np.cos(OMEGA * TIME)
    beats = steady + viscous(0.1, 0.0, 0.05, linear=True) * np.cos(0.3 * TIME)
    for values, said in ((steady, "too slow to be resolved"), (beats, "a drive holds")):
        with pytest.raises(pendpipe.InputError, match=said):
            pendpipe.fit(Recording(TIME, values + 1e-3 * np.sin(1e4 * TIME**2), "angle_rad"))
