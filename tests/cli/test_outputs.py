"""No command writes over what it was given, nor over what pendpipe did not make."""

import io
import os
import re
import shutil
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import pendpipe as pp
from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.files import (
    _TOLD,
    MADE_BY,
    MARK,
    check_output,
    damage_of,
    replaced,
    write_json,
    write_whole,
    writing,
)
from pendpipe.recording import Recording, write_plain

TIME_S = np.arange(900) / 30.0
SWING = 0.1 * np.exp(-0.01 * TIME_S) * np.cos(4.0 * TIME_S)
MODEL = """
[pendulum]
frequency_hz = 0.5
c = 1e-3
release_angle_rad = 0.1
[sampling]
sample_rate_hz = 20.0
duration_s = 10.0
"""
CALIPER = "angle_rad,volts\n" + "".join(f"{a / 10},{0.385 * a + 0.001}\n" for a in range(-4, 5))
COMMANDS: dict[str, list[str]] = {
    "convert": ["convert", "{recording}", "{out}"],
    "turning-points": ["turning-points", "{recording}", "--out", "{out}"],
    "fit": ["fit", "{recording}", "--out", "{out}"],
    "page": ["page", "{recording}", "--no-diagnosis", "--out", "{out}"],
    "refused": ["fit", "{recording}", "--out", "{other}", "--refused", "{out}"],
    "simulate": ["simulate", "{model}", "{out}"],
    "simulate by option": ["simulate", "{model}", "--out", "{out}"],
    "calibrate": ["calibrate", "{table}", "--out", "{out}"],
}
"""Commands with an output, each with its own input."""
FORM = {"page": "mine.html"}
INPUT = {"simulate": "model", "simulate by option": "model", "calibrate": "table"}


@pytest.fixture
def given(tmp_path: Path) -> dict[str, Path]:
    """Files of a user."""
    files = {name: tmp_path / f"user's {name}.csv" for name in ("recording", "model", "table")}
    lines = [f"{t!r},{x!r}\n" for t, x in zip(TIME_S.tolist(), SWING.tolist(), strict=True)]
    files["recording"].write_text("time_s,angle_rad\n" + "".join(lines))
    files["model"].write_text(MODEL)
    files["table"].write_text(CALIPER)
    return files


def call(command: str, out: Path, given: dict[str, Path]) -> list[str]:
    places = {**given, "out": out, "other": out.with_name("other.json")}
    return [word.format(**places) for word in COMMANDS[command]]


def itself(path: Path) -> Path:
    return path


def dotted(path: Path) -> Path:
    return path.parent / "." / ".." / path.parent.name / path.name


def hard_link(path: Path) -> Path:
    link = path.with_name("hard.csv")
    os.link(path, link)
    return link


def symbolic_link(path: Path) -> Path:
    link = path.with_name("soft.csv")
    link.symlink_to(path)
    return link


@pytest.mark.parametrize(
    ("command", "name", "force"),
    [
        *((command, itself, force) for command in COMMANDS for force in ((), ("--force",))),
        *(("fit", name, ("--force",)) for name in (dotted, hard_link, symbolic_link)),
    ],
)
def test_an_output_that_is_an_input_is_refused(
    given: dict[str, Path],
    command: str,
    name: Callable[[Path], Path],
    force: Sequence[str],
    answer_of: Any,
) -> None:
    path = given[INPUT.get(command, "recording")]
    before = path.read_bytes()
    assert (
        "this output is one of the inputs"
        in answer_of([*call(command, name(path), given), *force], 2).err
    )
    assert path.read_bytes() == before


def test_a_recording_that_pendpipe_has_written_is_an_input_as_well(given: dict[str, Path]) -> None:
    given["recording"].unlink()
    write_plain(given["recording"], Recording(TIME_S, SWING, "angle_rad"))
    before = given["recording"].read_bytes()
    assert main(call("fit", given["recording"], given)) == 2
    assert given["recording"].read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_a_file_of_others_is_replaced_only_with_force(
    given: dict[str, Path],
    command: str,
    tmp_path: Path,
    refusal_of: Any,
) -> None:
    """And what a command has written it may write again."""
    content = b'\x00{"made by": "me"}'
    out = tmp_path / FORM.get(command, "mine.csv")
    out.write_bytes(content)
    words = call(command, out, given)
    assert re.search("pendpipe did not make this file.*--force", refusal_of(words))
    assert out.read_bytes() == content
    if command != "refused":  # what stands there is read first
        assert main([*words, "--force"]) == 0
        assert out.read_bytes() != content
        assert main(words) == 0


@pytest.mark.slow
@pytest.mark.parametrize("form", ["svg", "png", "pdf"])
def test_a_figure_replaces_a_figure_of_ours_and_no_other(
    given: dict[str, Path], tmp_path: Path, form: str
) -> None:
    figure = tmp_path / f"decay.{form}"
    words = ["fit", str(given["recording"]), "--figure", str(figure)]
    assert [main(words), main(words)] == [0, 0]
    figure.write_bytes(figure.read_bytes().replace(b"pendpipe", b"inkscape"))
    assert main(words) == 2


@pytest.mark.parametrize("name", ["again.csv", "again.wdh"])
def test_a_converted_recording_is_made_again_and_an_instruments_is_not(
    given: dict[str, Path], tmp_path: Path, name: str, answer_of: Any
) -> None:
    words = ["convert", str(given["recording"]), str(tmp_path / name)]
    assert [main(words), main(words)] == [0, 0]
    device = ["acquire", "--device", "simulated:di2108", "--clock-scale", "100", "--duration", "8"]
    recorded = [*device, "--out", str(tmp_path / f"recorded-{name}")]
    assert main(recorded) == 0
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    said = (
        "did not make" if name.endswith(".wdh") else "it is a recording; name another file; --force"
    )
    assert said in answer_of(recorded, 2).err
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_raw_file_is_never_replaced(given: dict[str, Path], tmp_path: Path) -> None:
    device = ["acquire", "--device", "simulated:di2108", "--clock-scale", "100", "--duration", "8"]
    assert main([*device, "--out", str(tmp_path / "recorded.csv")]) == 0
    raw = tmp_path / "recorded.raw"
    before = raw.read_bytes()
    shutil.copy(raw, tmp_path / "copy.csv")
    assert main(["convert", str(given["recording"]), str(tmp_path / "copy.csv"), "--force"]) == 2
    notes = given["table"]
    for kept in (raw, notes):
        words = [*device, "--out", str(tmp_path / "new.csv"), "--raw", str(kept), "--force"]
        assert main(words) == 2
    assert notes.read_text() == CALIPER
    assert main(["acquire", "--recover", str(raw), "--out", str(raw), "--force"]) == 2
    assert raw.read_bytes() == before


def test_a_diagnosis_leaves_the_users_figures_alone(
    given: dict[str, Path], tmp_path: Path, answer_of: Any
) -> None:
    folder = tmp_path / "diagnosis"
    folder.mkdir()
    mine = folder / "decay.svg"
    mine.write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
    assert (
        "decay.svg: pendpipe did not make this file"
        in answer_of(["diagnose", str(given["recording"]), "--out", str(folder)], 2).err
    )
    assert [path.name for path in folder.iterdir()] == ["decay.svg"]


@pytest.mark.slow
def test_the_front_door_goes_the_same_way(given: dict[str, Path], tmp_path: Path) -> None:
    fit = pp.fit(given["recording"])
    fit.save(tmp_path / "fit")
    fit.save(tmp_path / "fit")
    for name in ("fit.json", "turning_points.csv", "fit.svg", "fit.png"):
        path = tmp_path / "fit" / name
        ours = path.read_bytes()
        path.write_text("mine")
        with pytest.raises(InputError, match=f"{name}.* did not make"):
            fit.save(tmp_path / "fit")
        path.write_bytes(ours)
    path.write_text("mine")
    fit.save(tmp_path / "fit", force=True)


def test_streams_devices_and_empty_files_are_no_files_of_others(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    files = tmp_path / "empty", tmp_path / "none"
    for path in ("-", "/dev/stdout", os.devnull, "/dev/fd/1", *files):
        check_output(path)


@pytest.mark.parametrize("out", ["-", "/dev/stdout"])
@pytest.mark.parametrize("command", ["convert", "turning-points", "fit", "simulate", "calibrate"])
def test_what_goes_to_standard_output_is_the_result_alone(
    given: dict[str, Path],
    command: str,
    out: str,
    answer_of: Any,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    words = [out if word == "OUT" else word for word in call(command, Path("OUT"), given)]
    printed = answer_of(words).out
    assert printed.startswith(("# made_by: pendpipe ", '{\n "made_by": "pendpipe '))
    assert len({*tmp_path.iterdir()} - {*given.values()}) == 0
    written = tmp_path / "written"
    assert main(call(command, written, given)) == 0
    assert printed == written.read_text()


def test_standard_input_is_an_input(
    given: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with given["recording"].open() as stream:
        before = os.dup(0)
        os.dup2(stream.fileno(), 0)
        try:
            with writing(inputs=["-"]), pytest.raises(InputError, match="one of the inputs"):
                check_output(given["recording"])
        finally:
            os.dup2(before, 0)
            os.close(before)


def test_all_that_is_written_says_so_and_nothing_else_is_taken_for_ours(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"n": 1})
    write_whole(tmp_path / "stub.csv", "# refused: too short\n")
    for path in tmp_path.iterdir():
        check_output(path)
    others = "pendpipe", "notes on made_by: pendpipe 1\n", "# my own\n1,2\n"
    for number, text in enumerate(others):
        mine = tmp_path / f"{number}.txt"
        mine.write_text(text)
        with pytest.raises(InputError, match="did not make"), replaced(mine) as stream:
            stream.write("gone")
        assert mine.read_text() == text


FORMS = ("json", "csv", "html", "tex", "xlsx", "svg", "png", "pdf", "wdh", "points.csv", "parquet")


def made_in(form: str, given: dict[str, Path], folder: Path) -> Path:
    """Let pendpipe write a file in one of its forms."""
    out, recording = folder / f"made.{form}", str(given["recording"])
    if form == "parquet":
        schema = pa.schema([("n", pa.int64())], metadata={MARK: MADE_BY})
        stream = io.BytesIO()
        parquet.write_table(pa.table({"n": [1]}, schema=schema), stream)
        write_whole(out, stream.getvalue())
        return out
    words = {
        "wdh": ["convert", recording, str(out)],
        "points.csv": ["turning-points", recording, "--out", str(out)],
    }
    drawn = ["fit", recording, "--figure", str(out)]
    table = ["fit", recording, recording, "--out", str(out)]
    assert main(words.get(form) or (drawn if form in ("svg", "png", "pdf") else table)) == 0
    return out


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_what_was_edited_since_is_the_persons(
    given: dict[str, Path], tmp_path: Path, form: str
) -> None:
    """Any byte of it, those of the mark too."""
    out = made_in(form, given, tmp_path)
    check_output(out)
    made = out.read_bytes()
    assert 16 * b"0" not in made
    random = np.random.default_rng(0)
    for at in [0, len(made) - 1, *random.integers(0, len(made), 30).tolist()]:
        out.write_bytes(made[:at] + bytes([made[at] ^ 1]) + made[at + 1 :])
        with pytest.raises(InputError, match=r"edited|did not make"):
            check_output(out)
        with writing(force=True):
            check_output(out)
    for edited in (made + b"\n", made[:-1]):
        out.write_bytes(edited)
        with pytest.raises(InputError, match=r"edited|did not make"):
            check_output(out)
    out.write_bytes(made)
    check_output(out)


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_what_an_earlier_version_made_is_ours_once_more(
    given: dict[str, Path], tmp_path: Path, form: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """It kept no digest; who has edited such a file is told."""
    out = made_in(form, given, tmp_path)
    if form == "parquet":  # its lengths are counted
        out.write_bytes(re.sub(rb"sha256:[0-9a-f]{16}", b"sha256:" + 16 * b"0", out.read_bytes()))
    else:
        out.write_bytes(re.sub(rb" sha256:[0-9a-f]{16}", b"", out.read_bytes()))
    capsys.readouterr()
    _TOLD.clear()
    check_output(out)
    check_output(out)
    (said,) = capsys.readouterr().err.splitlines()
    assert "an earlier version made it" in said


@pytest.mark.slow
def test_a_png_with_its_digest_is_sound(given: dict[str, Path], tmp_path: Path) -> None:
    from PIL import Image

    with Image.open(made_in("png", given, tmp_path)) as picture:
        picture.verify()
        assert re.fullmatch(r"pendpipe \S+ sha256:[0-9a-f]{16}", picture.info["Software"])


def test_what_quotes_our_mark_is_not_ours(given: dict[str, Path], tmp_path: Path) -> None:
    """A thesis about a page of ours, a table with ours copied into it."""
    page, table = made_in("html", given, tmp_path), made_in("points.csv", given, tmp_path)
    tag = re.search(r'<meta name="generator"[^>]*>', page.read_text(encoding="utf-8"))
    assert tag is not None
    old = re.sub(" sha256:[0-9a-f]*", "", tag[0])
    texts = [
        f"<!doctype html>\n<html>\n<head>\n{tag[0]}\n<title>My thesis</title>",
        f"<!doctype html>\n<html><body>My thesis. Its head has\n{old}\n",
        "# my notes\n" + table.read_text(encoding="utf-8"),
        "\\documentclass{article}\n% made_by: pendpipe 1.0\n",
        "%PDF-1.5 /Creator (LaTeX) we read /Creator (pendpipe) in it: /Creator (me)\n",
    ]
    for number, text in enumerate(texts):
        mine = tmp_path / f"thesis-{number}.txt"
        mine.write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=r"edited|did not make"):
            check_output(mine)


def test_who_writes_a_file_at_once_with_others_leaves_one_that_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda n: write_json(path, {"n": n, "text": n * "x"}), range(200)))
    assert damage_of(path) is None
    check_output(path)
