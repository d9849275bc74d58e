"""Files of arrays, workbooks, archives and projects; readers of other packages."""

import bz2
import gzip
import io
import json
import lzma
import math
import os
import re
import subprocess
import sys
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
import pytest
from scipy.io import savemat, wavfile

from pendpipe.errors import InputError
from pendpipe.formats import apart, containers, dialects, inspect, read, table, trees
from pendpipe.formats.dialects import matlab
from pendpipe.formats.plugin import HEAD, Dialect, text_dialect

from .cases import ANGLE, TIME, Case, check, read_as, same, text

# One swing in files of arrays, in workbooks, archives and projects; and what these may not do.

PLAIN = text(TIME, ANGLE, head="t (s),theta (rad)\n")
PAIRS = list(zip(TIME.round(3).tolist(), ANGLE.round(6).tolist(), strict=True))
OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"


def stream(write: Callable[[io.BytesIO], object]) -> bytes:
    """What is written into a file."""
    held = io.BytesIO()
    write(held)
    return held.getvalue()


def zipped(**members: str | bytes) -> bytes:
    """An archive; __ in a member's name is its point, ___ a folder."""

    def write(held: io.BytesIO) -> None:
        with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                archive.writestr(name.replace("___", "/").replace("__", "."), content)

    return stream(write)


def workbook(**sheets: Sequence[Sequence[object]]) -> bytes:
    book = openpyxl.Workbook()
    book.remove(book.worksheets[0])
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    return stream(book.save)


def opendocument(rows: str) -> bytes:
    names = "xmlns:office='o' xmlns:table='t' xmlns:text='x'"
    body = f"<office:body {names}><table:table table:name='run'>{rows}</table:table></office:body>"
    kind = "application/vnd.oasis.opendocument.spreadsheet"
    return zipped(mimetype=kind, content__xml=body)


SWINGS = Path(__file__).parent / "swings"
"""One swing as scipy, h5py, numpy, json and openpyxl write it; others byte by byte."""
INFINITE = [1, 2]
TEXTS = SWINGS / "json-records-with-texts.json"
EXPECTED: dict[str, dict[str, Any]] = {
    "a-sound.wav": {"unit": "1"},
    "excel-without-a-header.xlsx": {"said": "^sheet 'swing'"},
    "json-a-unit-beside-and-a-lost-reading.json": {"lost": [0]},
    "matlab-a-clock-that-is-infinite-twice.mat": {
        "values": np.delete(ANGLE, INFINITE),
        "time_s": np.delete(TIME, INFINITE),
    },
    "matlab-by-names.mat": {"said": "another length"},
    "matlab-nested-structures.mat": {"unit": "1"},
    "matlab-pi-is-down-in-simulink-s-log.mat": {"said": "1 half turn"},
}
"""What is not as usual: a unit, a lost reading, times that are left out, a note."""


@pytest.mark.parametrize("path", sorted(SWINGS.iterdir()), ids=lambda path: path.name)
def test_a_swing_is_read_from_a_file_of(tmp_path: Path, path: Path) -> None:
    check(tmp_path, Case(path.read_bytes(), name=path.name, **EXPECTED.get(path.name, {})))


SAVED = (SWINGS / "matlab-by-names.mat").read_bytes()
REFUSED: dict[str, tuple[bytes, str, str]] = {
    "entities": (b"<!DOCTYPE x [<!ENTITY a 'b'>]><cassylab/>", "a.labx", "no reader|entities"),
    "entities of XML": (
        b"<?xml version='1.0'?><!DOCTYPE x [<!ENTITY a 'b'>]><x/>",
        "a.labx",
        "entities",
    ),
    "a drawing": (b"<?xml version='1.0'?><svg/>", "a.svg", "no reader knows"),
    "damaged XML": (b"<?xml version='1.0'?><cassylab><a>", "a.labx", "the XML is damaged"),
    "no workbook": (OLE + b"\0" * 600, "a.xls", "workbook can't be read"),
    "no archive": (b"PK\x03\x04 nothing of use", "a.xlsx", "archive can't be read"),
    "no HDF5": (b"\x89HDF\r\n\x1a\n" + b"\0" * 600, "a.mat", "file of arrays can't be read"),
    "no TDMS": (b"TDSm" + b"\0" * 600, "a.tdms", "file of arrays can't be read"),
    "no MATLAB 7.3": (b"MATLAB 7.3 MAT-file, Platform" + b" " * 200, "a", "arrays can't be read"),
    "a cut file of MATLAB": (SAVED[:1000], "a.mat", "can't be read"),
    "a cell of text": (
        workbook(run=[[t, "lost" if n % 42 == 41 else x] for n, (t, x) in enumerate(PAIRS)]),
        "a.xlsx",
        "line 42: 'lost' is not a number",
    ),
    "Capstone's project": (zipped(main__xml="<x/>"), "a.cap", "PASCO Capstone"),
    "Capstone's experiment": (zipped(a__cap="x", b__csv=PLAIN), "a.zip", "export its data"),
    "Capstone's data": (zipped(data___17__tmp="x", b__csv=PLAIN), "a.zip", "export its data"),
    "an archive without a table": (zipped(a__jpg="x"), "a.zip", "no CSV"),
    **{
        f"a cut file of {name}": (pack(PLAIN.encode())[:-9], "a", "truncated|can't be unpacked")
        for name, pack in (("gzip", gzip.compress), ("bzip2", bz2.compress), ("xz", lzma.compress))
    },
}  # fmt: skip


@pytest.mark.parametrize("kind", REFUSED)
def test_what_can_not_be_read_is_refused_for_its_reason(tmp_path: Path, kind: str) -> None:
    content, name, said = REFUSED[kind]
    with pytest.raises(InputError, match=said):
        read_as(tmp_path, content, name)


# --- bounds ------------------------------------------------------------------------------------
MANY_ROWS = zipped(
    xl___worksheets___sheet1__xml=b"<sheetData>"
    + (b"<row>" + b'<c r="A1"><v>1</v></c>' * 100 + b"</row>") * 20_000
)
WIDE = "<table:table-cell office:value='1' table:number-columns-repeated='99999'/>"


def test_what_unpacks_to_more_than_any_recording_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, book = tmp_path / "a.mat", tmp_path / "a.xlsx"
    savemat(path, {"t": TIME, "theta": ANGLE, "more": np.zeros(20_000)}, do_compression=True)
    book.write_bytes(workbook(run=[["t", "angle"]]))
    same(read(path))
    for module, file, said in (
        (matlab, path, "its compressed data are more than 0 MB"),
        (table, book, "it unpacks to 0 MB"),
    ):
        monkeypatch.setattr(module, "most_unpacked", lambda _: 9_000)
        with pytest.raises(InputError, match=said):
            read(file)


def test_the_strength_of_a_tone_may_swing(tmp_path: Path) -> None:
    """A sound card passes no constant: the sensor's voltage is the strength of a tone."""
    time_s = np.arange(20 * 8000) / 8000
    strength = 0.5 + np.interp(time_s, TIME, 0.5 * ANGLE)
    tone = np.rint(32767 * strength * np.sin(2 * np.pi * 1000 * time_s)).astype(np.int16)
    content = stream(lambda held: wavfile.write(held, 8000, tone))
    recording = read_as(tmp_path, content, "b.wav")
    expected = np.interp(recording.time_s + 0.0025, time_s, strength) / np.sqrt(2)
    np.testing.assert_allclose(recording.values, expected, atol=2e-3)
    assert any("a tone whose strength swings" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("name", "content", "library"),
    [
        ("a.xls", OLE + b"\0" * 600, "xlrd"),
        ("a.tdms", b"TDSm" + b"\0" * 600, "nptdms"),
        ("a.h5", b"\x89HDF\r\n\x1a\n" + b"\0" * 600, "h5py"),
    ],
)
def test_a_file_whose_library_is_missing_is_refused_with_what_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, content: bytes, library: str
) -> None:
    """It is told from a damaged one."""
    for part in [each for each in sys.modules if each.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, part)
    monkeypatch.setitem(sys.modules, library, None)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=r"is not installed; pip install 'pendpipe\[formats\]'"):
        read(tmp_path / name)


CELL = "<table:table-cell office:value='1234567.5' table:number-columns-repeated='64'/>"


def zeros(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.create_dataset("angle_rad", data=np.zeros(40_000_000), chunks=(10**6,), compression=1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "write", "said", "most_bytes"),
    [
        # A million cells, each of which says that it stands for 64.
        (
            "a.ods",
            lambda path: path.write_bytes(
                opendocument(f"<table:table-row>{1000 * CELL}</table:table-row>" * 1000)
            ),
            "it has more than 600000 cells",
            100e6,
        ),
        # Three hundred megabytes of zeros pack into three hundred kilobytes.
        (
            "a.npz",
            lambda path: np.savez_compressed(path, time_s=TIME, angle_rad=np.zeros(40_000_000)),
            "it unpacks to 305 MB",
            50e6,
        ),
        ("a.h5", zeros, "it unpacks to 305 MB", 50e6),
    ],
    ids=["repeated cells", "npz", "h5"],
)
def test_what_is_packed_is_counted_before_it_is_there(
    tmp_path: Path, name: str, write: Callable[[Path], object], said: str, most_bytes: float
) -> None:
    write(tmp_path / name)
    tracemalloc.start()
    with pytest.raises(InputError, match=said):
        read(tmp_path / name)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak_bytes < most_bytes


@pytest.mark.slow
@pytest.mark.parametrize(
    ("content", "said"),
    [
        ([b"t,theta\n", b"1," * 10_000_000, b"1\n", b"2," * 10_000_000, b"2\n"], "characters long"),
        ([b"9" * 1_000_000] * 100, "characters long"),
        ([b"#\n" * 100_000] * 49, "no row of numbers|no block of rows"),
        ([b"#\n" * 100_000] * 55, "rows of 2 bytes"),
    ],
    ids=["columns", "line", "remarks", "rows"],
)
def test_hostile_text_is_refused_in_little_memory(
    tmp_path: Path, content: list[bytes], said: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"".join(content))
    code = (
        "import resource, sys\n"
        "resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))\n"
        "from pendpipe.errors import InputError\n"
        "from pendpipe.formats import read\n"
        "try:\n    read(sys.argv[1])\n"
        "except InputError as fault:\n    print(fault)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False
    )
    lines = done.stdout.splitlines()
    assert len(lines) == 1, done.stderr[-300:]
    assert any(part in lines[0] for part in said.split("|")), lines[0]


def test_devices_pipes_and_huge_files_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "sparse.WDQ").open("wb") as sparse:
        sparse.truncate(5 << 30)
    for path, said in (
        (tmp_path / "pipe", "a device or a pipe"),
        (Path("/dev/zero"), "a device or a pipe"),
        (tmp_path / "sparse.WDQ", r"5\.4 GB"),
    ):
        with pytest.raises(InputError, match=said):
            read(path)


@pytest.mark.slow
def test_standard_input_and_output(tmp_path: Path) -> None:
    def run(command: str, content: bytes) -> bytes:
        call = [sys.executable, "-m", "pendpipe.cli", *command.split()]
        return subprocess.run(
            call, input=content, capture_output=True, check=True, cwd=tmp_path
        ).stdout

    converted = run("convert - -", PLAIN.encode())
    assert b"format      plain" in run("inspect -", converted)
    assert not list(tmp_path.iterdir())
    same(read_as(tmp_path, converted, "plain.csv"))


def test_inspect_names_the_format(tmp_path: Path) -> None:
    for content, form in ((SAVED, "matlab-v5"), (workbook(a=PAIRS), "excel")):
        (tmp_path / "a").write_bytes(content)
        assert inspect(tmp_path / "a").format == form


# Dialects: each knows its own files, by samples; those of another package are found.

TIME_S = np.arange(200) / 20.0
ANGLE_RAD = 0.2 * np.exp(-0.1 * TIME_S) * np.cos(5.0 * TIME_S)
ROWS = "".join(f"{t:.2f}:{x:.6f}\n" for t, x in zip(TIME_S, ANGLE_RAD, strict=True))


def _lines(lines: list[str]) -> list[str]:
    return ["t (s),theta (rad)", *(line.replace(":", ",") for line in lines[1:])]


COLONS = text_dialect("table of colons", re.compile("COLONS\n").match, _lines)


def _fails(head: bytes) -> bool:
    raise ValueError("no head for this")


BROKEN = Dialect("broken reader", _fails, COLONS.read)


@dataclass(order=True)
class Entry:
    """An entry point of a package that is installed."""

    name: str

    def load(self) -> object:
        if self.name == "UNIMPORTABLE":
            raise ImportError("no module named 'nothing'")
        return {"COLONS": COLONS, "BROKEN": BROKEN}[self.name]


@pytest.fixture
def plugins(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Entry]]:
    entries: list[Entry] = []
    monkeypatch.setattr(dialects, "entry_points", lambda **_: entries)
    dialects.dialects.cache_clear()
    yield entries
    dialects.dialects.cache_clear()


def test_another_package_adds_a_dialect(tmp_path: Path, plugins: list[Entry]) -> None:
    path = tmp_path / "a.txt"
    path.write_text("COLONS\n" + ROWS)
    with pytest.raises(InputError):
        read(path)
    plugins.append(Entry("COLONS"))
    dialects.dialects.cache_clear()
    recording = read(path)
    np.testing.assert_allclose(recording.values, ANGLE_RAD, atol=1e-6)
    assert recording.unit == "rad"


@pytest.mark.parametrize("name", ["BROKEN", "ABSENT", "UNIMPORTABLE"])
def test_a_plugin_that_fails_is_named_and_passed_over(
    tmp_path: Path, plugins: list[Entry], name: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t (s),theta (rad)\n" + ROWS.replace(":", ","))
    plugins.append(Entry(name))
    recording = read(path)
    np.testing.assert_allclose(recording.values, ANGLE_RAD, atol=1e-6)
    (note,) = (note for note in recording.notes if "is skipped" in note)
    said = name.replace("BROKEN", "broken reader")
    assert said in note
    assert "\n" not in note
    path.write_bytes(b"\0\1\2" * 900)
    with pytest.raises(InputError, match=f"no reader knows this file.*'{said}' is skipped"):
        read(path)


HERE = Path(__file__).parent
SAMPLES = [path for path in sorted(HERE.glob("*/*.json")) if path.with_suffix("").exists()]


@pytest.mark.parametrize("expected", SAMPLES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_a_sample_file_reads_as_expected(expected: Path) -> None:
    path, says = expected.with_suffix(""), json.loads(expected.read_text())
    recording, found = read(path), inspect(path)
    assert (found.chosen, found.unit) == (says["chosen"], says["unit"])
    assert (found.samples, found.uniform) == (says["samples"], True)
    assert found.sample_rate_hz == pytest.approx(says["sample_rate_hz"], rel=1e-3)
    size = abs(recording.values).max()
    assert recording.values[0] == pytest.approx(says["first"], abs=2e-3 * size)
    assert recording.values[-1] == pytest.approx(says["last"], abs=2e-3 * size)
    assert recording.unit_is_stated is says.get("unit_is_stated", True)


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda path: path.stem)
def test_no_file_is_claimed_by_two_dialects(sample: Path) -> None:
    """A plain table by none."""
    head = sample.with_suffix("").read_bytes()[:HEAD]
    mine = [dialect.name for dialect in dialects.dialects()[0] if dialect.is_mine(head)]
    assert len(mine) == (sample.parent.name != "plain_table")


# --- what lies outside of a file, or is hidden in it ----------------------------------------------
@pytest.mark.parametrize("kind", ["storage", "link", "virtual set", "pipe"])
def test_arrays_of_other_files_are_not_read(tmp_path: Path, kind: str) -> None:
    """A pipe as the storage, from which nothing comes, does not hang."""
    other, path = tmp_path / "other", tmp_path / "a.h5"
    if kind == "pipe":
        os.mkfifo(other)
    else:
        with h5py.File(other, "w") as file:
            file["secret"] = ANGLE
    with h5py.File(path, "w") as file:
        file["time_s"] = TIME
        if kind == "link":
            file["angle_rad"] = h5py.ExternalLink(str(other), "secret")
        elif kind == "virtual set":
            layout = h5py.VirtualLayout(ANGLE.shape, "f8")
            layout[:] = h5py.VirtualSource(str(other), "secret", ANGLE.shape)
            file.create_virtual_dataset("run/angle_rad", layout)
        else:
            size = ANGLE.shape, "f8"
            file.create_dataset("angle_rad", *size, external=[(str(other), 0, ANGLE.nbytes)])
    with pytest.raises(InputError, match="data sets of other files belong to it"):
        read(path)


def test_a_damaged_file_that_keeps_its_library_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The heap of texts gets an object of no size, from which HDF5 steps on by nothing."""
    sound = Path(__file__).parent / "arrays" / "swing.h5"
    data, heap = sound.read_bytes(), bytes([2, *[0] * 7, 3, *[0] * 7])
    (tmp_path / "a.h5").write_bytes(data.replace(b"rad\0", 2 * heap + b"rad\0"))
    assert read(sound).values.size  # the process has begun
    monkeypatch.setattr(apart, "WITHIN_S", 0.5)
    with pytest.raises(InputError, match=r"took more than 0\.5 s"):
        read(tmp_path / "a.h5")
    monkeypatch.undo()
    assert read(sound).values.size


def hidden(path: str = "xl/worksheets/sheet1.xml", prefix: str = "", xml: str = "") -> bytes:
    """Make a workbook of too many cells, which openpyxl would read whatever its path and prefix."""
    space = f"xmlns{':' * bool(prefix)}{prefix}"
    p = prefix and f"{prefix}:"
    cells = f'<{p}c r="A1"><{p}v>1</{p}v></{p}c>' * 100
    sheet = (xml or f"<{p}worksheet {space}='x'>") + f"<{p}row>{cells}</{p}row>" * 20
    with zipfile.ZipFile(held := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
        archive.writestr(path, sheet.encode("utf-16" if "utf-16" in xml else "utf-8"))
    return held.getvalue()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (lambda: MANY_ROWS, "more than 600000 cells"),
        (lambda: opendocument("<table:table-row/>" * 5000), "more than 1000 cells"),
        (lambda: opendocument("<a>" * 5000 + "</a>" * 5000), "more than 1000 cells"),
        (
            lambda: opendocument(f"<table:table-row>{WIDE * 20}</table:table-row>"),
            "more than 1000 cells",
        ),
        (lambda: TEXTS.read_text(), "more than 1000 cells"),
        (lambda: gzip.compress(bytes(300 << 20), 1), "too large"),
        (lambda: hidden(prefix="s"), "more than 1000 cells"),
        (lambda: hidden("xl/other/anything"), "more than 1000 cells"),
        (lambda: hidden(xml="<?xml version='1.0' encoding='utf-16'?><a>"), "not UTF-8"),
        (lambda: hidden(xml="  <!DOCTYPE a [<!ENTITY b 'c'>]>"), "declares entities"),
        (lambda: zipped(**{f"a{number}__csv": PLAIN for number in range(201)}), "201 tables"),
        (lambda: zipped(**{f"a{number}": "" for number in range(10_001)}), "10001 files"),
        (lambda: "1,2\n" * 5_000_001, "5000001 rows of 4 bytes"),
        (lambda: '{"t": [' + "[]," * 2_000_000 + "[]]}", "2000000 lists and records"),
    ],
    ids=[
        *("Excel", "rows", "depth", "width", "JSON", "gzip"),
        *("prefix", "path", "encoding", "entities", "tables", "files", "lines", "lists"),
    ],
)
def test_cells_and_bytes_are_counted_as_they_come_wherever_they_hide(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    content: Callable[[], bytes | str],
    said: str,
) -> None:
    monkeypatch.setattr(containers, "_MOST_CELLS", 600_000 if "600000" in said else 1000)
    monkeypatch.setattr(trees, "_MOST_CELLS", 1000)
    with pytest.raises(InputError, match=said):
        read_as(tmp_path, content())


def test_a_scope_whose_time_is_no_number_is_refused_by_inspect_too(tmp_path: Path) -> None:
    scope = Path(__file__).with_name("tektronix_isf") / "scope.ISF"
    data = re.sub(rb"XZE [^;]*;", b"XZE 1e999;", scope.read_bytes())
    (tmp_path / "a.isf").write_bytes(data)
    for asked in (read, inspect):
        with pytest.raises(InputError, match=r"a\.isf"):
            asked(tmp_path / "a.isf")


def test_a_lone_quotation_mark_between_rows_is_no_row(tmp_path: Path) -> None:
    swing = [round(50.0 + 40.0 * math.cos(0.6 * n)) for n in range(80)]
    rows = [f"{0.05 * n:.2f} {each}" for n, each in enumerate(swing)]
    (tmp_path / "a.txt").write_text("\n".join(["t x", *rows[:5], '"', *rows[5:]]))
    assert inspect(tmp_path / "a.txt").samples > 70
