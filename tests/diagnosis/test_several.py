"""Recordings of one pendulum together: what one alone leaves open, and who contradicts whom."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.analysis.readings import motion_of
from pendpipe.cli import main
from pendpipe.diagnosis.result import Diagnosis
from pendpipe.dynamics.eq8 import A as QUADRATIC, B as LINEAR, C as FRICTION
from pendpipe.effects.catalogue import by_identifier
from pendpipe.effects.model import Model
from pendpipe.effects.stack import Differs, Stack
from pendpipe.recording import Recording

from ..effects.integration import swung
from .records import white

AMPLITUDES = (0.05, 0.15, 0.4)
B, C = np.pi * 0.9 * (1.0 / 600.0 + 1.0 / 900.0), 7e-4


def swing(amplitude: float, seed: int, *effects: dict[str, Any], **pendulum: Any) -> Recording:
    return pp.simulate(
        {
            "pendulum": {
                "frequency_hz": 0.9,
                "quality_factor_viscous": 600.0,
                "quality_factor_hysteretic": 900.0,
                "c": C,
                "release_angle_rad": amplitude,
                **pendulum,
            },
            "sensor": {"volts_per_radian": 1.0, "noise_volts": 1e-4},
            "sampling": {"sample_rate_hz": 15.0, "duration_s": 100.0},
            "effects": list(effects),
            "seed": seed,
        }
    )


@cache
def together(kind: str) -> Diagnosis:
    effects = {
        "nothing": [],
        "cubic": [{"id": "cubic-damping", "d": 0.1, "position_form": 0.0}],
    }
    releases = {}
    for number, amplitude in enumerate(AMPLITUDES):
        odd = {"quality_factor_viscous": 500.0} if kind == "odd" and number == 1 else {}
        name = f"{1e3 * amplitude:.0f} mrad"
        releases[name] = swing(amplitude, 40 + number, *effects.get(kind, []), **odd)
    found = pp.diagnose(releases, volts_per_radian=1.0, together=True)
    assert isinstance(found, Diagnosis)
    return found


def assert_shared_values_are_true(found: dict[str, Any]) -> None:
    for name, truth in (("b", B), ("c", C), ("frequency", 0.9)):
        value = found["improved"]["parameters"][name]
        assert abs(value["value"] - truth) < 4.0 * value["sd"]


@pytest.mark.slow
def test_three_releases_share_their_values_and_lack_nothing() -> None:
    found = together("nothing").to_dict()
    assert found["verdict"] == "consistent"
    assert found["unexplained"]["p_value"] > 1e-3
    assert_shared_values_are_true(found)


@pytest.mark.slow
def test_shared_values_are_better_known_than_in_the_best_recording() -> None:
    found = together("nothing")
    best = min(each.improved.parameters["c"].sd for each in found.alone)
    assert found.to_dict()["improved"]["parameters"]["c"]["sd"] < best


@pytest.mark.slow
def test_a_torque_that_is_known_is_that_of_all() -> None:
    pair = [swing(each, 7, restoring="linear").between(0.0, 40.0) for each in (0.05, 0.4)]
    springs = pp.diagnose(pair, volts_per_radian=1.0, together=True, restoring="linear")
    assert {each.restoring for each in (springs, *springs.alone)} == {"linear"}
    assert springs.verdict == "consistent"


@pytest.mark.slow
def test_each_release_is_predicted_from_the_others_within_its_band() -> None:
    found = together("nothing")
    for each in found.to_dict()["recordings"]:
        # 1000 readings: a fraction of 0.95 has a standard deviation of 0.007.
        within = each["prediction"]["within_95"]
        assert within == pytest.approx(0.95, abs=0.03)
        assert f"{each['name']} is predicted from the others" in found.details
        assert f" {100 * within:.0f} % of the rest " in found.details


@pytest.mark.slow
def test_amplitudes_exclude_a_drift_that_one_recording_cannot_tell_from_cubic_damping() -> None:
    found = together("cubic")
    largest = found.alone[-1].missing[0]
    alone = {largest.identifier, *(name for name, _ in largest.indistinguishable)}
    assert {"cubic-damping", "damping-drift"} <= alone
    (effect,) = found.missing
    assert effect.identifier == "cubic-damping"
    assert "damping-drift" not in {name for name, _ in effect.indistinguishable}
    size = effect.parameters["d"]
    assert abs(size.value - 0.1) < 4.0 * size.sd
    assert_shared_values_are_true(found.to_dict())


def test_derivatives_of_two_recordings_are_those_of_each_by_what_it_has() -> None:
    members = [Model(np.arange(90) / 9.0 + late, 1.0 / 9.0) for late in (0.0, 0.4)]
    stack = Stack.of(members, ["b"], same_sensor=False)
    effects = stack.admitted([by_identifier("cubic-stiffness"), by_identifier("sensor-cubic")])
    for effect in (*effects, Differs("c", 1)):
        stack = stack.adding(effect)
    # Shared values, start and offset of the first; b, start, time and offset of the second;
    # k3; the sensor's s3 of each; what c has more in the second.
    value = np.array([2e-3, 5e-3, 1e-3, 0.5, 5.5, 0.2, -0.1, 0.01, 7e-3, 0.4, 0.2, -0.02])
    value = np.append(value, [0.05, 0.02, -0.03, 2e-4])
    at = stack.evaluate(value)
    found = at.jacobian
    assert len(at.reading) == 180
    assert at.parts[0].at.value[[QUADRATIC, LINEAR, FRICTION]] == pytest.approx([2e-3, 5e-3, 1e-3])
    assert at.parts[1].at.value[[QUADRATIC, LINEAR, FRICTION]] == pytest.approx(
        [2e-3, 7e-3, 1.2e-3]
    )
    for index in range(len(value)):
        step = np.zeros_like(value)
        step[index] = 1e-5 * max(abs(value[index]), 1e-2)
        quotient = stack.reading(value + step) - stack.reading(value - step)
        error = found[:, index] - quotient / (2.0 * step[index])
        # As of one recording: the columns of the baseline leave out small parts of the effects'.
        assert np.linalg.norm(error) < 0.025 * np.linalg.norm(found[:, index]), index


@pytest.mark.slow
def test_the_form_of_the_drag_is_told_by_all_where_none_tells_it_alone() -> None:
    """The search goes to the other form in each recording, and says so by its name."""
    time_s = np.arange(0.0, 60.0, 1.0 / 15.0)
    angle = swung(time_s, 0.4, 5.6, 0.006, drag=0.03)[0]
    noisy = (angle + white(seed, len(angle), 9e-4) for seed in (1, 2, 3))
    found = pp.diagnose([Recording(time_s, y, "angle_rad") for y in noisy], together=True)
    assert {each.drag_form for each in found.alone} == {"undecided"}
    assert found.drag_form == "speed"
    assert "drag-form" in {each.identifier for each in found.effects if each.presumed}


@pytest.mark.slow
def test_recording_with_another_damping_is_named_with_its_value() -> None:
    found = together("odd")
    effect = found.missing[0]
    assert effect.identifier == "parameter-b"
    assert effect.location.summary == "in 150 mrad"
    odd, usual = effect.parameters["150 mrad"], effect.parameters["50 mrad"]
    assert abs(odd.value - np.pi * 0.9 * (1.0 / 500.0 + 1.0 / 900.0)) < 4.0 * odd.sd
    assert abs(usual.value - B) < 4.0 * usual.sd
    assert "150 mrad contradicts the others in b" in str(found)


@pytest.mark.slow
def test_knock_in_one_recording_is_its_own_and_the_shared_values_stand() -> None:
    knock = {"id": "impulse", "dv": 5e-3, "time": 40.3}
    releases = {
        name: swing(amplitude, 60 + number, *([knock] if number == 1 else []))
        for number, (name, amplitude) in enumerate({"first": 0.2, "second": 0.3}.items())
    }
    found = pp.diagnose(releases, volts_per_radian=1.0, together=True)
    assert isinstance(found, Diagnosis)
    (effect,) = found.missing
    assert effect.location.summary == "in second alone"
    assert_shared_values_are_true(found.to_dict())
    assert found.to_dict()["recordings"][1]["prediction"]["within_95"] > 0.9


@pytest.mark.slow
def test_command_writes_the_keys_of_a_diagnosis_and_the_recordings(tmp_path: Path) -> None:
    files = []
    for number, amplitude in enumerate((0.1, 0.3)):
        files.append(str(tmp_path / f"{number}.csv"))
        recording = motion_of(swing(amplitude, 50 + number), 1.0, "x")
        lines = [
            f"{t!r},{x!r}"
            for t, x in zip(recording.time_s.tolist(), recording.values.tolist(), strict=True)
        ]
        Path(files[-1]).write_text("\n".join(["time_s,angle_rad", *lines]))
    assert (
        main(
            ["diagnose", "--together", *files, "--out", str(tmp_path / "out"), "--own", "frequency"]
        )
        == 0
    )
    found = json.loads((tmp_path / "out/diagnosis.json").read_text())
    one = pp.diagnose(files[0]).to_dict()
    assert one.keys() - found.keys() <= {"remainder", "small_amplitudes", "prediction"}
    assert [each["name"] for each in found["recordings"]] == ["0.csv", "1.csv"]
    assert "frequency" not in found["improved"]["parameters"]
    assert "frequency" in found["recordings"][0]["parameters"]


def test_what_is_for_one_recording_is_refused(answer_of: Any) -> None:
    assert "--fix" in answer_of(["diagnose", "a.csv", "b.csv", "--fix", "c=0"], 2).err
    with pytest.raises(pp.InputError, match="at least two"):
        pp.diagnose([swing(0.1, 1)], volts_per_radian=1.0, together=True)


def test_two_pendulums_are_not_taken_for_one(tmp_path: Path, answer_of: Any) -> None:
    """1.27 and 1.42 s: no amplitude lengthens the one to the other."""
    time_s, files = np.arange(0.0, 40.0, 0.02), []
    for period in (1.27, 1.42):
        angle = 0.2 * np.exp(-0.02 * time_s) * np.cos(2.0 * np.pi * time_s / period)
        files.append(str(tmp_path / f"{period}.csv"))
        rows = "".join(f"{t:.2f},{x:.6f}\n" for t, x in zip(time_s, angle, strict=True))
        Path(files[-1]).write_text("time_s,angle_rad\n" + rows)
    assert (
        "add --together if they are recordings of one pendulum"
        in answer_of(["diagnose", *files], 2).err
    )
    assert "1.42.csv swings at 0.70" in answer_of(["diagnose", "--together", *files], 2).err
    with pytest.raises(pp.InputError, match="say together=True"):
        pp.diagnose(files)
    with pytest.raises(pp.InputError, match="no amplitude of one pendulum"):
        pp.diagnose(files, together=True)
