"""What is wrong with a call is said in one line, about what the user has named; status 2."""

import math
import pickle
import subprocess
import sys
from collections.abc import Callable
from inspect import signature
from pathlib import Path

import numpy as np
import pytest

import pendpipe as pp
from pendpipe import cli
from pendpipe.commands.main import command_of
from pendpipe.errors import InputError, NotAnalysableError
from pendpipe.recording import Recording, write_plain


@pytest.mark.parametrize("name", cli.COMMANDS | cli.STAGES)
def test_every_command_says_what_it_does(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([name, "--help"])
    assert ended.value.code == 0
    assert command_of(name).description.splitlines()[0] in capsys.readouterr().out


@pytest.mark.parametrize("name", ["inspect", "acquire", "fit", "diagnose", "simulate"])
def test_a_keyword_and_its_option_have_the_same_words(name: str) -> None:
    verb, arguments = getattr(pp, name), command_of(name).arguments
    said = " ".join(verb.__doc__.split()).lower()
    declared = {options["dest"]: options for options in arguments.values() if "dest" in options}
    shared = signature(verb).parameters.keys() & declared.keys()
    assert shared
    for keyword in shared:
        words = declared[keyword]["help"].removesuffix("; repeatable")
        assert f"{keyword} {words}.".lower() in said


@pytest.mark.parametrize("verb", [pp.read, pp.inspect, pp.acquire, pp.fit, pp.diagnose])
def test_a_keyword_that_there_is_not_is_no_keyword(verb: Callable[..., object]) -> None:
    with pytest.raises(TypeError, match="unexpected keyword argument 'sampel_rate'"):
        verb("examples/rod-pendulum.csv", sampel_rate=10.0)


def test_a_mistyped_command_gets_the_nearest_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["inspekt"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "did you mean 'pendpipe inspect'?" in err


def test_no_arguments_show_where_to_begin(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 0
    assert "pendpipe fit FILE" in capsys.readouterr().out


def test_a_users_fault_is_one_line_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = cli.main(["simulate", str(tmp_path / "none.toml"), str(tmp_path / "out.csv")])
    message = capsys.readouterr().err
    assert status == 2
    assert message.count("\n") == 1
    assert "none.toml" in message
    assert list(tmp_path.iterdir()) == []


def test_the_entry_point_imports_no_heavy_library() -> None:
    """A job's cost is its imports: the command line alone brings none of these."""
    heavy = {"numpy", "scipy", "pandas", "matplotlib", "numba", "pydantic", "serial"}
    code = "import sys, pendpipe.cli; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not heavy & set(loaded.stdout.split())


def test_the_package_itself_can_be_run() -> None:
    command = [sys.executable, "-m", "pendpipe", "inspekt"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "did you mean 'pendpipe inspect'?" in done.stderr


def test_bash_completes_commands_and_their_options() -> None:
    complete = (
        f'source <("{sys.executable}" -m pendpipe completion bash);'
        " COMP_WORDS=({}); COMP_CWORD={};"
        ' _shtab_pendpipe; echo "${{COMPREPLY[@]}}"'
    )
    for words, position, expected in (
        ("pendpipe diagn", 1, "diagnose diagnose-campaign"),
        ("pendpipe fit --restor", 2, "--restoring"),
        ("pendpipe completion z", 2, "zsh"),
    ):
        done = subprocess.run(
            ["bash", "-c", complete.format(words, position)],
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.split() == expected.split()


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
