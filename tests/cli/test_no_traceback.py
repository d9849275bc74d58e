"""What no user can have meant ends in one line and status 2, and soon."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.cli import main
from pendpipe.configuration.load import load_campaign, read_configuration
from pendpipe.errors import InputError

TIME_S = np.arange(900) / 30.0
SWING = 0.3 * np.exp(-0.02 * TIME_S) * np.cos(4.0 * TIME_S)


def written(path: Path, time_s: object = TIME_S, angle_rad: object = SWING) -> Path:
    rows = zip(np.asarray(time_s).tolist(), np.asarray(angle_rad).tolist(), strict=True)
    path.write_text("time_s,angle_rad\n" + "".join(f"{t!r},{x!r}\n" for t, x in rows))
    return path


def one_line(capsys: pytest.CaptureFixture[str]) -> str:
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


@pytest.mark.parametrize(
    ("times", "values", "problem"),
    [
        (1.0, 1e-300, "the readings move by"),
        (1.0, 1e-320, "the readings move by"),
        (1.0, 1e300, "the readings are too large"),
        (1e300, 1.0, "the times span"),
        (1e-300, 1.0, "the times span"),
    ],
)
def test_numbers_that_no_pendulum_gives_are_refused(
    times: float, values: float, problem: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(written(tmp_path / "swing.csv", TIME_S * times, SWING * values))
    for command in (["fit"], ["diagnose"], ["page"], ["turning-points", "--out", "-"]):
        assert main([command[0], file, *command[1:]]) == 2
        assert f"{problem}" in (error := one_line(capsys))
        assert error.rstrip().endswith("check their unit")
    recording = pp.Recording(time_s=TIME_S * times, angle_rad=SWING * values)
    with pytest.raises(InputError, match=problem):
        pp.fit(recording)


@pytest.mark.parametrize(("times", "values"), [(1e9, 1.0), (1e-9, 1.0), (1.0, 1e-9), (1.0, 1e9)])
def test_units_of_any_size_are_none_of_these(times: float, values: float) -> None:
    """Periods of a nanosecond and of centuries, nanoradians and millions of counts."""
    fit = pp.fit(pp.Recording(time_s=TIME_S * times, displacement_m=SWING * values))
    assert fit["period"].value / times == pytest.approx(2 * np.pi / 4.0, rel=1e-3)
    assert fit["amplitude"].value / values == pytest.approx(0.3, rel=0.05)


def test_a_seed_below_zero_or_of_words_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = str(written(tmp_path / "swing.csv"))
    for seed in ("-1", "1.5", "one", "9" * 5000):
        with pytest.raises(SystemExit, match="2"):
            main(["diagnose", file, "--seed", seed])
        assert "--seed" in one_line(capsys)
    with pytest.raises(InputError, match="seed: it must not be negative"):
        pp.diagnose(file, seed=-1)
    with pytest.raises(InputError, match="seed: it must not be negative"):
        pp.simulate({}, seed=-1)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("title: One\nseed: " + "7" * 5000, "this is no YAML"),
        ("title: One\nseed: 1\ntitle: Two\n", "line 3: the key 'title' stands twice"),
        ("diagnose: {enabled: true, seed: 1, enabled: false}\n", "'enabled' stands twice"),
    ],
)
def test_a_configuration_is_refused_in_one_line(text: str, problem: str, tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_configuration(path)
    assert problem in str(caught.value)
    assert len(str(caught.value)) < 400


def test_a_merged_key_of_yaml_does_not_stand_twice(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text("a: &a {x: 1, y: 2}\nb: {<<: *a, x: 3}\n")
    assert read_configuration(path)["b"] == {"x": 3, "y": 2}


def test_nothing_is_colder_than_absolute_zero(tmp_path: Path) -> None:
    table = tmp_path / "records.tsv"
    table.write_text("record\tsource\ttemperature_c\na\ta.csv\t-500\n")
    content = read_configuration("config/config.yaml") | {"records": table.as_posix()}
    with pytest.raises(InputError, match="line 2, temperature_c"):
        load_campaign(content, "config.yaml")


@pytest.mark.skipif(sys.platform != "linux", reason="names of any bytes are Linux's")
@pytest.mark.parametrize("words", [["page", "--no-diagnosis"], ["fit"], ["inspect"]])
def test_a_name_that_is_no_utf8_is_a_name(words: list[str], tmp_path: Path) -> None:
    name = written(tmp_path / os.fsdecode(b"caf\xe9.csv"))
    command = [sys.executable, "-m", "pendpipe", words[0], name, *words[1:]]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert all(path.read_text(encoding="utf-8") for path in tmp_path.iterdir())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
@pytest.mark.parametrize("words", [["fit"], ["inspect", "--json"], ["convert", "-"]])
def test_a_full_standard_output_is_one_line(words: list[str], tmp_path: Path) -> None:
    file = str(written(tmp_path / "swing.csv"))
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "pendpipe", words[0], file, *words[1:]]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("pendpipe: standard output: it can't be written")
    assert "Traceback" not in done.stderr
