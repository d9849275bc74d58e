"""A driven pendulum, and its next decay, from free decays; closed forms and integrations judge."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import pendpipe as pp
from pendpipe.commands.main import main
from pendpipe.dynamics import Eq8, Release, sample, turning_points
from pendpipe.errors import InputError
from pendpipe.prediction import curves_of, decay_from, phase_of

from ..recordings import white

TIME = np.arange(0.0, 60.0, 0.02)


def recorded(law: Eq8, release: float, seed: int = 0) -> pp.Recording:
    """A decay of a law with noise of a thousandth of the release."""
    return pp.Recording(
        time_s=TIME,
        angle_rad=sample(law, Release(0.0, release), TIME) + white(seed, TIME.size, 1e-3 * release),
    )


SPRING = Eq8(5.0, viscous=0.05)
PENDULUM = Eq8(5.0, viscous=0.05, restoring="sine")


@pytest.fixture(scope="module")
def spring() -> Any:
    return pp.fit(recorded(SPRING, 0.3), restoring="linear")


@pytest.fixture(scope="module")
def pendulum() -> Any:
    return pp.fit(recorded(PENDULUM, 1.0), restoring="sine")


@pytest.mark.slow
def test_a_spring_is_driven_as_its_transfer_function_says(spring: Any) -> None:
    hertz = np.linspace(0.75, 0.84, 19)
    found = pp.predict(spring, drive=hertz, drive_force=0.1).response
    states = found[found.branch == "upper"]
    drive = math.tau * hertz
    exact = 0.1 / (5.0**2 - drive**2 + 2j * 0.05 * drive)
    assert states.amplitude.to_numpy() == pytest.approx(np.abs(exact), rel=5e-3)
    assert ((states.amplitude_low < np.abs(exact)) & (np.abs(exact) < states.amplitude_high)).all()
    lag = np.degrees(np.angle(exact))
    assert ((states.phase_deg_low < lag) & (lag < states.phase_deg_high)).all()


def settled(law: Eq8, hertz: float, force: float, start: float) -> tuple[float, float]:
    """Amplitude and phase to which a driven motion settles, by integration."""
    drive = math.tau * hertz

    def rate(t: float, state: Any) -> Any:
        x, v = state
        return v, -law.torque(x) - 2.0 * law.viscous * v + force * math.cos(drive * t)

    last = math.ceil(200.0 * hertz) / hertz
    when = last + np.arange(200) / 200.0 / hertz
    x = solve_ivp(rate, (0.0, when[-1]), (start, 0.0), t_eval=when, rtol=1e-8, atol=1e-10).y[0]
    return float(np.abs(x).max()), float(
        np.angle(np.mean(x * np.exp(-1j * drive * when)), deg=True)
    )


@pytest.mark.slow
def test_a_bent_resonance_has_two_states_which_an_integration_finds(pendulum: Any) -> None:
    """With one drive a pendulum swings far if it was let go far, and little if at rest."""
    hertz = 0.97 * 5.0 / math.tau
    rows = pp.predict(pendulum, drive=[hertz], drive_force=0.35).response.set_index("branch")
    assert rows.loc["unstable", "amplitude"] < rows.loc["upper", "amplitude"]
    for branch, start in (("lower", 0.0), ("upper", -0.9)):
        amplitude, phase = settled(PENDULUM, hertz, 0.35, start)
        row = rows.loc[branch]
        assert row.amplitude_low <= amplitude <= row.amplitude_high
        assert row.phase_deg_low <= phase <= row.phase_deg_high


@pytest.mark.parametrize("law", [SPRING, PENDULUM], ids=["spring", "pendulum"])
def test_a_decay_from_another_amplitude_is_the_law_s(law: Eq8, request: Any) -> None:
    fit = request.getfixturevalue("spring" if law is SPRING else "pendulum")
    found = decay_from(curves_of([fit]), 0.2)
    exact = turning_points(law, Release(0.0, 0.2), count=len(found))
    for name, values in (("time_s", exact.time_s), ("amplitude", np.abs(exact.angle_rad))):
        assert found[name].to_numpy() == pytest.approx(values, rel=3e-3, abs=1e-6)
        beyond = (values < found[f"{name}_low"] - 1e-5) | (values > found[f"{name}_high"] + 1e-5)
        assert beyond.mean() < 0.05


def test_a_phase_needs_no_force_and_passes_a_right_angle_on_the_backbone(pendulum: Any) -> None:
    curves = curves_of([pendulum])
    for y in (0.1, 0.5, 0.9):
        free = turning_points(Eq8(5.0, restoring="sine"), Release(0.0, y), count=3)
        hertz = np.array([1.0 / free.time_s[2]])
        phases = np.percentile(phase_of(curves, hertz, np.array([y])), (2.5, 97.5))
        assert phases[0] < -90.0 < phases[1]


def test_several_decays_that_differ_widen_the_bands() -> None:
    """By what they differ, and no more where they agree."""
    alike = [pp.fit(recorded(SPRING, 0.3, seed), restoring="linear") for seed in range(3)]
    apart = [
        pp.fit(recorded(Eq8(5.0, viscous=loss), 0.3, 7), restoring="linear")
        for loss in (0.045, 0.05, 0.055)
    ]
    widths = []
    for fits in (alike, apart):
        quality = decay_from(curves_of(fits), 0.2).iloc[0]
        widths.append((quality.quality_factor_high - quality.quality_factor_low) / 50.0)
    assert widths[0] < 0.02
    # A tenth between them, with two degrees of freedom.
    assert 0.5 < widths[1] < 1.5


def test_beyond_what_was_seen_it_says_so_and_not_far(pendulum: Any) -> None:
    found = pp.predict(pendulum, amplitude=1.5)
    assert "it extrapolates" in str(found)
    assert found.decay.extrapolated[0]
    assert not found.decay.extrapolated[30]
    with pytest.raises(InputError, match="is not between"):
        pp.predict(pendulum, amplitude=2.5)


def test_decays_without_a_common_amplitude_make_one_curve(spring: Any) -> None:
    small = pp.fit(recorded(SPRING, 0.01), restoring="linear")
    points = spring.points.amplitude_rad.min(), small.points.amplitude_rad.max()
    assert points[0] > points[1]
    found = pp.predict([spring, small], amplitude=0.25).decay
    assert np.isfinite(found.to_numpy(dtype=float)).all()
    with pytest.raises(InputError, match="in m and rad"):
        pp.predict([spring, metres()], amplitude=0.25)


def metres() -> Any:
    """A decay of a spring, in metres."""
    angle = recorded(SPRING, 0.3).values
    return pp.fit(pp.Recording(time_s=TIME, displacement_m=angle))


@pytest.mark.parametrize("asked", [{}, {"drive": [0.8]}, {"drive_force": 0.1}])
def test_half_a_question_is_asked_back(spring: Any, asked: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="not said what to predict"):
        pp.predict(spring, **asked)


def table_of(path: Path, law: Eq8, constant: float) -> Path:
    """A table of driven states of a spring, by its transfer function."""
    hertz = np.linspace(0.76, 0.83, 12)
    drive = math.tau * hertz
    x = constant * 0.02 / (law.angular_frequency**2 - drive**2 + 2j * law.viscous * drive)
    rows = np.column_stack([hertz, np.abs(x), np.degrees(np.angle(x)), np.full(12, 0.02)])
    head = "frequency_hz,amplitude,phase_deg,drive"
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    return path


def test_one_measured_point_tells_the_force_of_all(spring: Any, tmp_path: Path) -> None:
    found = pp.predict(spring, points=table_of(tmp_path / "a.csv", SPRING, 2.0))
    assert found.force is not None
    assert found.force.value == pytest.approx(2.0, rel=0.02)
    assert found.compared.held.mean() > 0.85
    assert len(found.compared) == 12 + 11


def test_a_measured_decay_lies_in_its_band_and_another_pendulum_s_does_not(spring: Any) -> None:
    for law, inside in ((SPRING, True), (Eq8(5.0, viscous=0.06), False)):
        points = pp.turning_points(recorded(law, 0.15, 3))
        held = pp.predict(spring, points=points).compared.groupby("quantity").held.mean()
        assert (held["amplitude"] > 0.9) == inside


def test_a_force_that_moves_nothing_is_said_to(spring: Any) -> None:
    found = pp.predict(spring, drive=[0.5, 0.8], drive_force=1e-9)
    assert found.response.empty
    assert "no state" in str(found)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("frequency_hz,amplitude\n1,2\n", "no column phase_deg"),
        ("frequency_hz,amplitude,phase_deg\n-1,2,x\n", "no row has positive numbers"),
        ("", "no table can be read"),
    ],
)
def test_a_table_that_tells_nothing_is_refused(
    spring: Any, tmp_path: Path, text: str, said: str
) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        pp.predict(spring, points=tmp_path / "a.csv")


@pytest.mark.slow
def test_the_command_prints_draws_and_writes(tmp_path: Path, capsys: Any) -> None:
    points = table_of(tmp_path / "points.csv", SPRING, 2.0)
    words = [
        "predict",
        "examples/rod-pendulum.csv",
        "--drive",
        "0.86:0.885",
        "--drive-force",
        "0.01",
    ]
    out = ["--figure", str(tmp_path / "a.svg"), "--out", str(tmp_path / "a.json"), "--from", "0.08"]
    assert main([*words, *out, "--points", str(points)]) == 0
    assert "largest state" in capsys.readouterr().out
    content = json.loads((tmp_path / "a.json").read_text())
    assert len(content["decay"]["time_s"]) == len(content["decay"]["amplitude_low"]) == 96
    assert (tmp_path / "a.svg").stat().st_size > 10_000
    page = tmp_path / "a.html"
    assert main(["page", *words[1:], "--no-diagnosis", "--out", str(page)]) == 0
    shown = page.read_text()
    assert "<h2>Predicted from one decay" in shown
    assert "What another experiment would show" in shown
    assert "<dt>largest state</dt>" in shown
    with pytest.raises(SystemExit, match="2"):
        main([*words[:3], "0.9"])
