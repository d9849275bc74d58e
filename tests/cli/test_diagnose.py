"""`pendpipe diagnose`: the contract's file, key by key, and how the command ends."""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pendpipe import cli
from pendpipe.files import write_json
from pendpipe.recording import Recording, write_plain

from ..effects.integration import swung
from ..recordings import white

FREQUENCY_HZ, LINEAR = 0.9, 0.012
NOISE_RAD = 1e-4
TIME_S = np.arange(1500) / 15.0


def pendulum(folder: Path, *, sine: bool, amplitude: float = 0.25) -> Path:
    """Write a decay of x'' = -omega^2 x - 2 b x' (or with sin x), with white noise."""
    torque = math.sin if sine else float
    angle = swung(TIME_S, amplitude, 2.0 * math.pi * FREQUENCY_HZ, LINEAR, torque=torque)[0]
    path = folder / f"{'sine' if sine else 'linear'}.csv"
    write_plain(
        path, Recording(TIME_S, 0.01 + angle + white(5, len(TIME_S), NOISE_RAD), "angle_rad")
    )
    return path


@pytest.fixture(scope="module")
def linear(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording that Eq. 8 describes."""
    return pendulum(tmp_path_factory.mktemp("linear"), sine=False)


@pytest.fixture(scope="module")
def sine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One with circular error."""
    return pendulum(tmp_path_factory.mktemp("sine"), sine=True)


def diagnosis(folder: Path) -> dict[str, Any]:
    """Read the result as strict JSON: no NaN, no infinity."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    text = (folder / "diagnosis.json").read_text(encoding="utf-8")
    content: dict[str, Any] = json.loads(text, parse_constant=refuse)
    return content


TOP = {
    "schema_version",
    "baseline",
    "restoring",
    "drag_form",
    "noise_rms_rad",
    "verdict",
    "p_value",
    "effects",
    "improved",
    "held_out",
    "unexplained",
    "statement",
    "figures",
    "provenance",
}
MODEL = {"parameters", "residual_rms_rad", "chi2_per_dof", "noise_rms_rad", "fit_p_value"}
MODEL |= {"period_span_s", "quality_factors"}
EFFECT = {
    "id",
    "presumed",
    "name",
    "kind",
    "equation",
    "parameters",
    "delta_chi2",
    "p_value_global",
    "probability",
    "indistinguishable_from",
    "deciding_measurement",
    "location",
}
LOCATION = {
    "summary",
    "time_s",
    "amplitude_rad",
    "phase_rad",
    "frequency_hz",
    "harmonics",
    "adc_codes",
    "mains",
}
ESTIMATE = {"value", "sd", "interval95", "unit"}


def check_contract(content: dict[str, Any]) -> None:
    """Every key of the contract, with the kind of value that it promises."""
    assert set(content) >= TOP
    assert content["schema_version"] == 1
    assert (set(content["baseline"]), set(content["improved"])) == (MODEL | {"name"}, MODEL)
    assert set(content["held_out"]) == {
        "log_density_before",
        "log_density_after",
        "gain",
        "gain_sd",
    }
    assert set(content["unexplained"]) == {"residual_rms_rad", "p_value"}
    assert isinstance(content["statement"], str)
    for model in (content["baseline"], content["improved"]):
        assert all(set(each) == ESTIMATE | {"at_bound"} for each in model["parameters"].values())
    for effect in content["effects"]:
        assert set(effect) == EFFECT | {"curve", "confirmed"}
        assert effect["kind"] in {"dynamics", "measurement", "parameter", "unnamed"}
        assert set(effect["location"]) == LOCATION
        assert all(set(each) >= ESTIMATE for each in effect["parameters"].values())
        rest = [other["probability"] for other in effect["indistinguishable_from"]]
        assert 0.0 <= effect["probability"] + sum(rest) <= 1.0 + 1e-9


def test_a_recording_that_equation_8_describes_is_consistent(
    linear: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = cli.main(["diagnose", str(linear), "--out", str(tmp_path), "--no-figures"])
    said = capsys.readouterr()
    content = diagnosis(tmp_path)
    check_contract(content)
    assert status == 0
    assert content["verdict"] == "consistent"
    assert content["effects"] == content["figures"] == []
    assert content["p_value"] > 0.01
    assert content["noise_rms_rad"] == pytest.approx(NOISE_RAD, rel=0.06)
    found = content["baseline"]["parameters"]
    assert abs(found["frequency"]["value"] - FREQUENCY_HZ) < 5 * found["frequency"]["sd"]
    assert set(found) == {"a", "b", "c", "frequency", "amplitude", "phase", "offset"}
    assert said.out.strip() == f"{linear.name}: {content['statement']}"
    assert "fitting" in said.err
    assert "scanning" in said.err


def test_a_pendulum_lacks_nothing_and_its_sin_x_is_presumed(sine: Path, tmp_path: Path) -> None:
    words = ["--out", str(tmp_path), "--no-figures", "--fail-on", "missing-physics"]
    assert cli.main(["diagnose", str(sine), *words]) == 0
    content = diagnosis(tmp_path)
    check_contract(content)
    assert content["verdict"] == "consistent"
    assert content["restoring"] == "sine"
    assert [(each["id"], each["presumed"]) for each in content["effects"]] == [
        ("circular-error", True)
    ]


@pytest.mark.slow
def test_what_is_missing_is_named_and_the_fit_improves_to_the_noise(
    sine: Path, tmp_path: Path
) -> None:
    """As of a spring, sin x is a torque that softens: cubic, or without a name."""
    words = ["--out", str(tmp_path), "--restoring", "linear", "--fail-on", "missing-physics"]
    status = cli.main(["diagnose", str(sine), *words])
    content = diagnosis(tmp_path)
    check_contract(content)
    assert status == 3
    assert content["verdict"] == "missing-physics"
    first = content["effects"][0]
    assert (first["id"], first["presumed"]) == ("cubic-stiffness", False)
    rivals = {rival["id"] for e in content["effects"] for rival in e["indistinguishable_from"]}
    assert "circular-error" not in rivals | {effect["id"] for effect in content["effects"]}
    assert content["improved"]["residual_rms_rad"] == pytest.approx(NOISE_RAD, rel=0.06)
    assert content["figures"] == [
        "decay.svg",
        "residual_map.svg",
        "residual_spectrum.svg",
        "damping.svg",
        "frequency.svg",
        "curve.svg",
    ]
    assert {path.name for path in tmp_path.glob("*.svg")} == set(content["figures"])


@pytest.mark.slow
def test_a_wrong_parameter_is_told_from_missing_physics(linear: Path, tmp_path: Path) -> None:
    """A frequency given 0.03 % too high is not physics that was left out."""
    held = ["--no-figures", "--fix", f"frequency={1.0003 * FREQUENCY_HZ}"]
    assert cli.main(["diagnose", str(linear), "--out", str(tmp_path), *held]) == 0
    content = diagnosis(tmp_path)
    check_contract(content)
    first = content["effects"][0]
    assert (first["id"], first["kind"]) == ("parameter-frequency", "parameter")
    frequency = content["improved"]["parameters"]["frequency"]
    assert abs(frequency["value"] - FREQUENCY_HZ) < 5 * frequency["sd"]
    assert content["provenance"]["fixed"] == [held[-1]]


def test_what_holds_no_decay_is_not_analysable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dead = tmp_path / "dead.csv"
    write_plain(dead, Recording(TIME_S, np.full(len(TIME_S), 0.25), "angle_rad"))
    status = cli.main(["diagnose", str(dead), "--out", str(tmp_path / "out")])
    content = diagnosis(tmp_path / "out")
    check_contract(content)
    last = capsys.readouterr().err.splitlines()[-1]
    assert status == 2
    assert content["verdict"] == "not-analysable"
    assert content["reason"] in last
    assert "\n" not in content["reason"]


def test_a_file_that_is_not_there_leaves_nothing(tmp_path: Path, refusal_of: Any) -> None:
    refusal_of(["diagnose", str(tmp_path / "none.csv"), "--out", str(tmp_path / "out")])
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "words",
    [
        ["--fix", "mass=1"],
        ["--fix", "a=-1"],
        ["--fix", "a=0.01", "--fix", "a=0.02"],
        ["--baseline", "viscous", "--fix", "c=1e-4"],
    ],
)
def test_a_parameter_that_cannot_be_held_is_a_usage_fault(
    linear: Path, tmp_path: Path, words: list[str], refusal_of: Any
) -> None:
    out = tmp_path / "out"
    assert "--fix" in refusal_of(["diagnose", str(linear), "--out", str(out), *words])
    assert not out.exists()


def test_a_refused_record_of_a_campaign_is_not_analysable(tmp_path: Path) -> None:
    refused, out = tmp_path / "refused.json", tmp_path / "diagnosis"
    write_json(refused, {"record": "r", "stage": "acquire", "reason": "no decay"})
    words = ["--out", str(out), "--record", "r", "--refused", str(refused)]
    assert cli.main(["diagnose", str(tmp_path / "none.csv"), *words]) == 0
    content = diagnosis(out)
    check_contract(content)
    assert (content["verdict"], content["reason"]) == ("not-analysable", "no decay")


@pytest.mark.slow
def test_the_python_call_gives_the_same_answer(
    linear: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from pendpipe.diagnosis.run import diagnose_recording
    from pendpipe.recording import read_plain

    assert cli.main(["diagnose", str(linear), "--json", "--seed", "3"]) == 0
    outcome = diagnose_recording(read_plain(linear), seed=3)
    own, filed = outcome.to_dict(), json.loads(capsys.readouterr().out)
    check_contract(filed)
    for key in TOP - {"provenance"}:
        assert json.loads(json.dumps(own[key])) == filed[key]


def test_importing_the_diagnosis_costs_nothing() -> None:
    code = "import sys, pendpipe.diagnosis; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not {"numpy", "scipy", "matplotlib", "numba"} & set(loaded.stdout.split())
