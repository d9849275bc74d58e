"""Whatever is wrong is said in one line."""

import errno
import math
import os
import pickle
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pendpipe as pp
from pendpipe import cli
from pendpipe.cli import main
from pendpipe.commands.main import command_of
from pendpipe.configuration.load import load_campaign, read_configuration
from pendpipe.errors import InputError, NotAnalysableError
from pendpipe.recording import Recording, write_plain

Refusal = Callable[[list[str]], str]

# What is wrong with a call is said in one line, about what the user has named; status 2.


@pytest.mark.parametrize("name", cli.COMMANDS | cli.STAGES)
def test_every_command_says_what_it_does(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([name, "--help"])
    assert ended.value.code == 0
    assert command_of(name).description.splitlines()[0] in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "verb"),
    {
        "inspect": pp.read,
        "acquire": pp.acquire,
        "fit": pp.fit,
        "diagnose": pp.diagnose,
        "simulate": pp.simulate,
    }.items(),
)
def test_a_keyword_and_its_option_have_the_same_words(
    name: str, verb: Callable[..., object]
) -> None:
    arguments = command_of(name).arguments
    said = " ".join((verb.__doc__ or "").split()).lower()
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


def test_a_mistyped_file_in_the_place_of_a_command_gets_the_nearest_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer_of: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("rod-pendulum.csv").touch()
    assert "rod-pendulum.csv" in answer_of(["rod-pendulm.csv"], 2).err


def test_a_mistyped_command_gets_the_nearest_one(refusal_of: Refusal) -> None:
    assert "did you mean 'pendpipe inspect'?" in refusal_of(["inspekt"])


@pytest.mark.parametrize(
    ("short", "whole"),
    [
        (["help"], ["--help"]),
        (["help", "fit"], ["fit", "--help"]),
        (["examples/rod-pendulum.csv"], ["fit", "examples/rod-pendulum.csv"]),
    ],
)
def test_help_helps_and_a_file_is_fitted(
    short: list[str], whole: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    printed = []
    for words in (short, whole):
        with suppress(SystemExit):
            assert main(words) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1] != ""


def test_no_arguments_show_where_to_begin(answer_of: Any) -> None:
    assert "pendpipe fit FILE" in answer_of([]).out


def test_a_users_fault_is_one_line_and_status_2(tmp_path: Path, refusal_of: Refusal) -> None:
    words = ["simulate", str(tmp_path / "none.toml"), str(tmp_path / "out.csv")]
    assert "none.toml" in refusal_of(words)
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


def test_bash_completes_commands_and_their_options(tmp_path: Path, answer_of: Any) -> None:
    (tmp_path / "completion").write_text(answer_of(["completion", "bash"]).out)
    asked = {
        ("pendpipe diagn", 1): ["diagnose", "diagnose-campaign"],
        ("pendpipe fit --restor", 2): ["--restoring"],
        ("pendpipe completion z", 2): ["zsh"],
    }
    complete = "".join(
        f'COMP_WORDS=({words}); COMP_CWORD={position}; _shtab_pendpipe\necho "${{COMPREPLY[@]}}"\n'
        for words, position in asked
    )
    said = subprocess.run(
        ["bash", "-c", f"source ./completion\n{complete}"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert [line.split() for line in said.splitlines()] == list(asked.values())


TIME_S = np.arange(300) / 15.0
DECAY_RAD = 0.2 * np.exp(-0.05 * TIME_S) * np.cos(2.0 * math.pi * 0.8 * TIME_S)
SOURCE = "another_name.toml"
ANALYSES = {
    "diagnose": ["--no-figures", "--out"],
    "fit": ["--out"],
    "turning-points": ["--out"],
}


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
    command: str, why: str, tmp_path: Path, refusal_of: Refusal
) -> None:
    path = tmp_path / "mine.csv"
    file = {
        "two samples": lambda: recorded(path, DECAY_RAD[:2]),
        "no oscillation": lambda: recorded(path, np.linspace(0.0, 0.3, 300)),
        "constant": lambda: recorded(path, quantity="volts", volts_per_radian="some"),
    }[why]()
    said = refusal_of([command, file, *ANALYSES[command], str(tmp_path / "out")])
    assert said.startswith(f"pendpipe: {path}")
    assert SOURCE not in said


@pytest.mark.parametrize("command", [*ANALYSES, "convert", "simulate"])
@pytest.mark.parametrize("taken", [True, False])
def test_a_place_that_cannot_be_written_is_the_users_fault(
    command: str, taken: bool, tmp_path: Path, refusal_of: Refusal
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
    said = refusal_of([command, source, *ANALYSES.get(command, []), str(out)])
    assert said.startswith(f"pendpipe: {file if command == 'diagnose' and taken else tmp_path}")
    assert file.read_text() == "kept"


@pytest.mark.parametrize(
    ("words", "about"),
    [
        (["turning-points", "f.csv"], "--out"),
        (["diagnose", "f.csv", "--out", "d", "--level", "x"], "'x' is not a number"),
        (["diagnose", "f.csv", "--out", "d", "--level", "2"], "between 0 and 1"),
        (["fit", "f.csv", "--out", "o", "--start", "x"], "--start"),
    ],
)
def test_a_call_that_cannot_be_understood_is_one_line(
    words: list[str], about: str, refusal_of: Refusal
) -> None:
    said = refusal_of(words)
    assert about in said
    assert "--help" in said
    assert "_probability" not in said


@pytest.mark.parametrize("kind", [InputError, NotAnalysableError])
def test_a_fault_in_a_worker_process_arrives_as_it_was(kind: type[InputError]) -> None:
    fault = kind("a.csv, line 7", "time_s falls", "sort the rows")
    there = pickle.loads(pickle.dumps(fault))
    assert (type(there), str(there)) == (kind, str(fault))


# What no user can have meant ends in one line and status 2, and soon.

HALF_MINUTE_S = np.arange(900) / 30.0
SWING = 0.3 * np.exp(-0.02 * HALF_MINUTE_S) * np.cos(4.0 * HALF_MINUTE_S)


def written(path: Path, time_s: object = HALF_MINUTE_S, angle_rad: object = SWING) -> Path:
    rows = zip(np.asarray(time_s).tolist(), np.asarray(angle_rad).tolist(), strict=True)
    path.write_text("time_s,angle_rad\n" + "".join(f"{t!r},{x!r}\n" for t, x in rows))
    return path


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
    times: float, values: float, problem: str, tmp_path: Path, refusal_of: Refusal
) -> None:
    file = str(written(tmp_path / "swing.csv", HALF_MINUTE_S * times, SWING * values))
    for command in (["fit"], ["diagnose"], ["page"], ["turning-points", "--out", "-"]):
        said = refusal_of([command[0], file, *command[1:]])
        assert problem in said
        assert said.endswith("check their unit")
    recording = pp.Recording(time_s=HALF_MINUTE_S * times, angle_rad=SWING * values)
    with pytest.raises(InputError, match=problem):
        pp.fit(recording)


@pytest.mark.parametrize(("times", "values"), [(1e9, 1.0), (1e-9, 1.0), (1.0, 1e-9), (1.0, 1e9)])
def test_units_of_any_size_are_none_of_these(times: float, values: float) -> None:
    """Periods of a nanosecond and of centuries, nanoradians and millions of counts."""
    fit = pp.fit(pp.Recording(time_s=HALF_MINUTE_S * times, displacement_m=SWING * values))
    assert fit["period"].value / times == pytest.approx(2 * np.pi / 4.0, rel=1e-3)
    assert fit["amplitude"].value / values == pytest.approx(0.3, rel=0.05)


def test_a_seed_below_zero_or_of_words_is_refused(tmp_path: Path, refusal_of: Refusal) -> None:
    file = str(written(tmp_path / "swing.csv"))
    for seed in ("-1", "1.5", "one", "9" * 5000):
        assert "--seed" in refusal_of(["diagnose", file, "--seed", seed])
    with pytest.raises(InputError, match="seed: it must not be negative"):
        pp.diagnose(file, seed=-1)
    with pytest.raises(InputError, match="seed: it must not be negative"):
        pp.simulate({}, seed=-1)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("title: One\nseed: " + "7" * 5000, "this is not YAML"),
        ("title: One\nseed: 1\ntitle: Two\n", "line 3: the key 'title' is listed twice"),
        ("diagnose: {enabled: true, seed: 1, enabled: false}\n", "'enabled' is listed twice"),
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


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="names of any bytes are Linux's")
@pytest.mark.parametrize("words", [["page", "--no-diagnosis"], ["fit"], ["inspect"]])
def test_a_name_that_is_no_utf8_is_a_name(words: list[str], tmp_path: Path) -> None:
    name = written(tmp_path / os.fsdecode(b"caf\xe9.csv"))
    command = [sys.executable, "-m", "pendpipe", words[0], name, *words[1:]]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert all(path.read_text(encoding="utf-8") for path in tmp_path.iterdir())


@pytest.mark.slow
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


FAILING = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static int fails(int fd) {
    char link[64], path[4096] = {0};
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    return readlink(link, path, sizeof path - 1) > 0 && strstr(path, getenv("FAILS_AT")) != NULL;
}
#define CALL(name, type)                                                    \
    ssize_t name(int fd, type buffer, size_t count) {                       \
        static ssize_t (*own)(int, type, size_t);                           \
        if (!own) own = dlsym(RTLD_NEXT, #name);                            \
        if (strcmp(getenv("FAILS_IN"), #name) == 0 && fails(fd)) {          \
            errno = atoi(getenv("FAILS_BY"));                               \
            return -1;                                                      \
        }                                                                   \
        return own(fd, buffer, count);                                      \
    }
CALL(read, void *)
CALL(write, const void *)
"""


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library that lets reading or writing of some files fail, as a disk does."""
    if sys.platform != "linux" or shutil.which("gcc") is None:
        pytest.skip("no compiler of a library that the loader takes first")
    folder = tmp_path_factory.mktemp("failing")
    (folder / "failing.c").write_text(FAILING)
    library = folder / "failing.so"
    command = ["gcc", "-shared", "-fPIC", "-o", str(library), str(folder / "failing.c"), "-ldl"]
    subprocess.run(command, check=True)
    return library


@pytest.mark.slow
@pytest.mark.parametrize(
    ("call", "at", "how", "words"),
    [
        ("write", "/.made.csv", "EIO", ["convert", "swing.csv", "made.csv"]),
        ("write", "/.made.csv", "ESTALE", ["convert", "swing.csv", "made.csv"]),
        ("write", "/.made.csv", "EDQUOT", ["convert", "swing.csv", "made.csv"]),
        ("write", "/.made.png", "EROFS", ["fit", "swing.csv", "--figure", "made.png"]),
        ("write", "/printed", "EIO", ["inspect", "swing.csv", "--json"]),
        ("read", "/swing.csv", "ESTALE", ["inspect", "swing.csv"]),
        ("read", "/there.json", "EIO", ["fit", "swing.csv", "--out", "there.json"]),
    ],
)
def test_a_disk_that_fails_is_one_line(
    failing: Path, tmp_path: Path, call: str, at: str, how: str, words: list[str]
) -> None:
    """And nothing half written stays, nor goes what was there."""
    written(tmp_path / "swing.csv")
    there = '{"made_by": "pendpipe 1"}'
    (tmp_path / "there.json").write_text(there)
    fails = {"FAILS_IN": call, "FAILS_AT": at, "FAILS_BY": str(getattr(errno, how))}
    with (tmp_path / "printed").open("w") as printed:
        done = subprocess.run(
            [sys.executable, "-m", "pendpipe", *words],
            cwd=tmp_path,
            env=os.environ | fails | {"LD_PRELOAD": str(failing)},
            stdout=printed,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("pendpipe: ")]
    assert os.strerror(getattr(errno, how)) in line
    assert (at.strip("/.") if at != "/printed" else "standard output") in line
    assert (tmp_path / "there.json").read_text() == there
    assert {path.name for path in tmp_path.iterdir()} == {"swing.csv", "there.json", "printed"}
