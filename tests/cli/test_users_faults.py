"""Whatever is wrong with a call is said in one line, about what the user has named."""

import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from pendpipe import cli
from pendpipe.errors import InputError, NotAnalysableError
from pendpipe.recording import Recording, write_plain

TIME_S = np.arange(300) / 15.0
DECAY_RAD = 0.2 * np.exp(-0.05 * TIME_S) * np.cos(2.0 * math.pi * 0.8 * TIME_S)
SOURCE = "another_name.toml"
ANALYSES = {
    "diagnose": ["--no-figures", "--out"],
    "fit": ["--out"],
    "turning-points": ["--out"],
}


def called(words: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """The exit status, and the lines on standard error that report no progress."""
    try:
        status = cli.main(words)
    except SystemExit as ended:
        status = int(str(ended.code))
    lines = capsys.readouterr().err.splitlines()
    return status, "\n".join(line for line in lines if not line.startswith("  "))


def recorded(
    path: Path, values: np.ndarray = DECAY_RAD, quantity: str = "angle_rad", **metadata: str
) -> str:
    """A recording whose head names another source, as one that was simulated does."""
    time_s = TIME_S[: len(values)]
    write_plain(path, Recording(time_s, values, quantity, metadata={"source": SOURCE, **metadata}))  # type: ignore[arg-type]
    return str(path)


@pytest.mark.parametrize("command", ANALYSES)
@pytest.mark.parametrize("why", ["two samples", "no oscillation", "constant"])
def test_a_recording_that_cannot_be_used_is_named_by_its_file(
    command: str, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.csv"
    file = {
        "two samples": lambda: recorded(path, DECAY_RAD[:2]),
        "no oscillation": lambda: recorded(path, np.linspace(0.0, 0.3, 300)),
        "constant": lambda: recorded(path, quantity="volts", volts_per_radian="some"),
    }[why]()
    words = [command, file, *ANALYSES[command], str(tmp_path / "out")]
    status, said = called(words, capsys)
    assert status == 2
    assert said.startswith(f"pendpipe: {path}")
    assert SOURCE not in said
    assert "\n" not in said


@pytest.mark.parametrize("command", [*ANALYSES, "convert", "simulate"])
@pytest.mark.parametrize("taken", [True, False])
def test_a_place_that_cannot_be_written_is_the_users_fault(
    command: str, taken: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder where a file is to go or a file where a folder is; and a place below a file."""
    file = tmp_path / "file"
    file.write_text("kept")
    folder = tmp_path / "folder"
    folder.mkdir()
    out = (file if command == "diagnose" else folder) if taken else file / "below"
    if command == "simulate":
        source = str(Path(__file__).parents[2] / "config" / "model.toml")
    else:
        source = recorded(tmp_path / "mine.csv")
    status, said = called([command, source, *ANALYSES.get(command, []), str(out)], capsys)
    assert status == 2
    assert said.startswith(f"pendpipe: {file if command == 'diagnose' and taken else tmp_path}")
    assert "\n" not in said
    assert file.read_text() == "kept"


@pytest.mark.parametrize(
    ("words", "about"),
    [
        (["turning-points", "f.csv"], "--out"),
        (["diagnose", "f.csv", "--out", "d", "--level", "x"], "'x' is no number"),
        (["diagnose", "f.csv", "--out", "d", "--level", "2"], "between 0 and 1"),
        (["fit", "f.csv", "--out", "o", "--start", "x"], "--start"),
    ],
)
def test_a_call_that_cannot_be_understood_is_one_line(
    words: list[str], about: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, said = called(words, capsys)
    assert status == 2
    assert about in said
    assert "\n" not in said
    assert "--help" in said
    assert "_probability" not in said


@pytest.mark.parametrize("kind", [InputError, NotAnalysableError])
def test_a_fault_in_a_worker_process_arrives_as_it_was(kind: type[InputError]) -> None:
    fault = kind("a.csv, line 7", "time_s falls", "sort the rows")
    there = pickle.loads(pickle.dumps(fault))
    assert (type(there), str(there)) == (kind, str(fault))
