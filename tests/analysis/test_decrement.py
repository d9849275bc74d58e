"""No law is printed that loses other than the decay loses, unless it is called red."""

import json
import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pendpipe import cli
from pendpipe.analysis.fit import fit_recording
from pendpipe.analysis.fit.decrement import check_decrement, loss_of, seen_loss
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, sample, turning_points
from pendpipe.errors import InputError
from pendpipe.recording import Recording, write_plain

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
    noise = rms * np.random.default_rng(seed).standard_normal(len(values))
    return Recording(time_s, values + noise, "angle_rad")


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


def test_the_decrement_that_is_seen_is_as_sure_as_it_says() -> None:
    law = Eq8(OMEGA, 0.1, 0.0, 0.02, 0.002)
    motion = turning_points(law, Release(0.0, 0.5), count=40)
    random, pulls = np.random.default_rng(3), []
    sd = np.full(40, 2e-3)
    for _ in range(300):
        noisy = motion.angle_rad + sd * random.standard_normal(40)
        points = TurningPoints(
            np.arange(40), motion.time_s, 1e-4 * np.ones(40), noisy, sd, np.zeros(40)
        )
        for check in check_decrement(points, law):
            pulls.append((check.seen - check.fitted) / check.seen_sd)
            assert not check.contradicts or abs(pulls[-1]) > 2.0
    assert abs(np.mean(pulls)) < 0.25
    assert 0.75 < np.std(pulls) < 1.15


def test_an_error_of_the_level_is_no_loss() -> None:
    motion = turning_points(Eq8(OMEGA, viscous=0.05), Release(0.0, 0.5), count=10)
    angle = motion.angle_rad + 0.02
    points = TurningPoints(
        np.arange(10), motion.time_s, 1e-4 * np.ones(10), angle, 1e-4 * np.ones(10), np.zeros(10)
    )
    amplitude, loss, *_ = seen_loss(points)
    assert loss == pytest.approx(0.05, rel=0.02)
    assert amplitude == pytest.approx(0.5 * math.exp(-0.05 * np.mean(motion.time_s)), rel=0.01)


def test_the_level_is_not_sought_in_turning_points_of_one_side() -> None:
    """Where the others hardly stand out: there any level would do, and any amplitude."""
    motion = turning_points(Eq8(OMEGA, viscous=0.02), Release(0.0, 0.5), count=10)
    sd = np.full(10, 0.05)
    angle = motion.angle_rad + 0.05 * np.random.default_rng(3).standard_normal(10)
    points = TurningPoints(
        np.arange(10), motion.time_s, 1e-4 * np.ones(10), angle, sd, np.zeros(10)
    )
    amplitude, _, loss_sd, *_ = seen_loss(points.chosen(points.side > 0))
    assert amplitude == pytest.approx(0.5 * math.exp(-0.02 * np.mean(motion.time_s)), rel=0.15)
    assert loss_sd > 0.02


def test_a_plain_record_is_green() -> None:
    time = np.arange(0.0, 200.0, 0.05)
    law = Eq8(OMEGA, 0.1, 0.0, 0.01, 1e-4)
    result = fit_recording(recorded(sample(law, Release(-0.3, 0.1), time), time, 1e-4))
    assert (result.light, result.method, result.restoring) == ("green", "waveform", "linear")
    assert [check.amplitude_rad for check in result.decrement_check] == sorted(
        (check.amplitude_rad for check in result.decrement_check), reverse=True
    )


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


def test_a_law_that_contradicts_the_decay_is_not_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time = np.arange(0.0, 200.0, 0.05)
    write_plain(
        tmp_path / "decay.csv",
        recorded(sample(Eq8(OMEGA, viscous=0.02), Release(-0.3, 0.1), time), time, 1e-4),
    )
    asked = ["fit", str(tmp_path / "decay.csv"), "--out", str(tmp_path / "fit.json")]
    asked += ["--fix", "b=0.04"]
    assert cli.main(asked) == 2
    printed = capsys.readouterr()
    assert printed.out.splitlines()[0].endswith("RED")
    assert printed.out.splitlines()[1].startswith("  the fitted law contradicts the decay: at ")
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
    assert cli.main([*asked, "--accept"]) == 0
    assert "−dy/dt" in capsys.readouterr().out
    assert cli.main([*asked, "--refused", str(tmp_path / "refused.json")]) == 0
    assert not (tmp_path / "refused.json").exists()


def test_a_fit_that_did_not_settle_is_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    from pendpipe.analysis.fit import by_waveform

    def hasty(*arguments: object, **options: object) -> object:
        return minimise(*arguments, **options | never)  # type: ignore[arg-type]

    minimise, never = by_waveform.minimise, {"most": 1, "chi2": None, "tolerance": 0.0}
    monkeypatch.setattr(by_waveform, "minimise", hasty)
    time = np.arange(0.0, 200.0, 0.05)
    decay = recorded(sample(Eq8(OMEGA, 0.1, 0.0, 0.01), Release(-0.3, 0.1), time), time, 1e-5)
    with pytest.raises(InputError, match="the waveform fit did not settle"):
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
        (slowing_spring, 1e-4, "turning-points"),
    ],
)
def test_fit_and_diagnosis_print_the_same_baseline(
    decay: Callable[[FloatArray], FloatArray], noise: float, method: str
) -> None:
    from pendpipe.analysis.free_decay import measure_recording
    from pendpipe.diagnosis.run import diagnose_recording

    time = np.arange(0.0, 60.0, 0.05)
    recording = recorded(decay(time), time, noise)
    points, part = measure_recording(recording, "recording")
    fitted = fit_recording(part, points=points)
    assert fitted.method == method
    diagnosed = diagnose_recording(recording).baseline
    for name, estimate in fitted.parameters.items():
        found = diagnosed.parameters[name]
        assert abs(found.value - estimate.value) < 0.1 * estimate.sd
        assert found.sd == pytest.approx(estimate.sd, rel=0.1)


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
