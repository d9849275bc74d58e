"""One swing in files of arrays, in workbooks, archives and projects; and what these may not do."""

import bz2
import gzip
import io
import json
import lzma
import os
import struct
import subprocess
import sys
import tracemalloc
import wave
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pytest
from scipy.io import savemat

from pendpipe.errors import InputError
from pendpipe.formats import containers, inspect, read, table, trees

from .cases import ANGLE, DEGREES, TIME, Case, Floats, check, each, read_as, same, text

PLAIN = text(TIME, ANGLE, head="t (s),theta (rad)\n")
PAIRS = list(zip(TIME.round(3).tolist(), ANGLE.round(6).tolist(), strict=True))
LISTS = {"time": TIME.tolist(), "angle_rad": ANGLE.tolist()}
RECORDS = [dict(zip(LISTS, pair, strict=True)) for pair in PAIRS]
OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"


def stream(write: Callable[[io.BytesIO], object]) -> bytes:
    """What is written into a file."""
    held = io.BytesIO()
    write(held)
    return held.getvalue()


def matlab(form: str = "5", **arrays: object) -> bytes:
    return stream(lambda held: savemat(held, arrays, format=form))


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


def hdf5(
    arrays: Mapping[str, Floats],
    attributes: Mapping[str, Mapping[str, object]] = {},
    userblock: int = 0,
) -> bytes:
    def write(held: io.BytesIO) -> None:
        with h5py.File(held, "w", userblock_size=userblock) as file:
            for name, values in arrays.items():
                file.create_dataset(name, data=values)
            for name, own in attributes.items():
                file[name].attrs.update(own)

    return stream(write)


def matlab_73() -> bytes:
    content = bytearray(hdf5({"t": TIME[None, :], "theta": ANGLE[None, :]}, userblock=512))
    content[:19], content[124:128] = b"MATLAB 7.3 MAT-file", b"\x00\x02IM"
    return bytes(content)


def simulink(values: object) -> dict[str, object]:
    return {"time": TIME[:, None], "signals": {"values": values, "dimensions": 1}}


def scope() -> dict[str, object]:
    """Simulink's structure with time, of two signals."""
    signals = np.zeros((2,), dtype=[("values", object), ("label", object)])
    signals[0] = (np.ones((len(TIME), 1)), "Switch")
    signals[1] = (ANGLE[:, None], "PendPos")
    return {"time": TIME[:, None], "signals": signals, "blockName": "model/Scope"}


def opendocument(rows: str) -> bytes:
    names = "xmlns:office='o' xmlns:table='t' xmlns:text='x'"
    body = f"<office:body {names}><table:table table:name='run'>{rows}</table:table></office:body>"
    kind = "application/vnd.oasis.opendocument.spreadsheet"
    return zipped(mimetype=kind, content__xml=body)


def opendocument_table() -> bytes:
    """A table whose empty rest is sixteen thousand cells wide and a million rows long."""
    empty = "<table:table-cell table:number-columns-repeated='{}'/>"
    cell = "<table:table-cell office:value='{}'><text:p>{}</text:p></table:table-cell>"
    head = "".join(
        f"<table:table-cell><text:p>{name}</text:p></table:table-cell>"
        for name in ("t (s)", "Winkel (rad)")
    )
    rows = "".join(
        f"<table:table-row>{cell.format(t, str(t)[:5])}{cell.format(x, str(x)[:5])}"
        f"{empty.format(1000)}</table:table-row>"
        for t, x in PAIRS
    )
    rest = "<table:table-row table:number-rows-repeated='1000000'>" + empty.format(16384)
    return opendocument(f"<table:table-row>{head}</table:table-row>{rows}{rest}</table:table-row>")


def logger_pro() -> str:
    column = (
        "<DataColumn><DataObjectName>{}</DataObjectName><ColumnUnits>{}</ColumnUnits>"
        "<ColumnCells>\n{}</ColumnCells></DataColumn>"
    )
    columns = (column.format("Time", "s", text(TIME)), column.format("Angle", "rad", text(ANGLE)))
    return f"<Document><DataSet>{''.join(columns)}</DataSet></Document>"


def tracker(start: int = 3, tilt: float = 0.0) -> str:
    """A project of Tracker: pixels of a bob 400 px below the origin (320, 40)."""
    cabrillo = "org.opensourcephysics.cabrillo.tracker"
    media = "org.opensourcephysics.media.core"
    seen = ANGLE + np.radians(tilt)
    marks = each(
        f'<property name="[{{0}}]" type="object"><object class="{cabrillo}.PointMass$FrameData">'
        '<property name="n" type="int">{1}</property><property name="x" type="double">{2}'
        '</property><property name="y" type="double">{3}</property></object></property>',
        range(len(TIME)),
        range(start, len(TIME) + start),
        320 + 400 * np.sin(seen),
        40 + 400 * np.cos(seen),
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<object class="{cabrillo}.TrackerPanel">
<property name="videoclip" type="object"><object class="{media}.VideoClip">
<property name="startframe" type="int">{start}</property></object></property>
<property name="clipcontrol" type="object"><object class="x.StepperClipControl">
<property name="delta_t" type="double">{1000 / 50}</property></object></property>
<property name="coords" type="object"><object class="{media}.ImageCoordSystem">
<property name="framedata" type="array"><property name="[0]" type="object">
<object class="{media}.ImageCoordSystem$FrameData">
<property name="xorigin" type="double">320</property><property name="yorigin" type="double">40
</property><property name="angle" type="double">{tilt}</property>
<property name="xscale" type="double">500</property><property name="yscale" type="double">500
</property></object></property></property></object></property>
<property name="tracks" type="collection"><property name="item" type="object">
<object class="{cabrillo}.PointMass">
<property name="framedata" type="array">{marks}</property></object></property></property>
</object>"""


def sound(samples: Floats, rate: int) -> bytes:
    def write(held: io.BytesIO) -> None:
        with wave.open(held, "wb") as file:
            file.setparams((1, 2, rate, 0, "NONE", ""))
            file.writeframes(np.rint(32767 * samples).astype("<i2").tobytes())

    return stream(write)


def old_workbook(cells: list[Sequence[str | float]]) -> bytes:
    """An .xls of one sheet, byte by byte: BIFF8 records in an OLE container."""

    def record(kind: int, content: bytes) -> bytes:
        return struct.pack("<HH", kind, len(content)) + content

    def entry(name: str, kind: int, child: int, start: int, size: int) -> bytes:
        head = (name + "\0").encode("utf-16-le")
        sizes = struct.pack("<HBBIII36x", len(head), kind, 1, none, none, child)
        return head.ljust(64, b"\0") + sizes + struct.pack("<III", start, size, 0)

    none, end = 0xFFFFFFFF, 0xFFFFFFFE
    sheet = record(0x809, struct.pack("<HHHHII", 0x600, 0x10, 0, 1997, 0, 6))
    for row, values in enumerate(cells):
        for column, value in enumerate(values):
            place = struct.pack("<HHH", row, column, 0)
            sheet += (
                record(0x204, place + struct.pack("<HB", len(value), 0) + value.encode())
                if isinstance(value, str)
                else record(0x203, place + struct.pack("<d", value))
            )
    begin = record(0x809, struct.pack("<HHHHII", 0x600, 0x5, 0, 1997, 0, 6))
    listed = struct.pack("<IHBB", len(begin) + 19, 0, 3, 0) + b"Raw"
    book = begin + record(0x85, listed) + record(0x0A, b"") + sheet + record(0x0A, b"")
    content = book.ljust(4096, b"\0") + b"\0" * (-max(len(book), 4096) % 512)
    sectors = len(content) // 512
    fats = next(n for n in range(1, 109) if 128 * n >= sectors + 1 + n)
    chain = [*range(1, sectors), end, end, *[0xFFFFFFFD] * fats]
    chain += [none] * (128 * fats - len(chain))
    root = entry("Root Entry", 5, 1, end, 0)
    folder = root + entry("Workbook", 2, none, 0, len(content)) + b"\0" * 256
    head = struct.pack("<HHHHH6x", 0x3E, 3, 0xFFFE, 9, 6)
    head += struct.pack("<IIIIIIIII", 0, fats, sectors, 0, 4096, end, 0, end, 0)
    places = [*range(sectors + 1, sectors + 1 + fats), *[none] * (109 - fats)]
    fat = struct.pack(f"<{len(chain)}I", *chain)
    return OLE + b"\0" * 16 + head + struct.pack("<109I", *places) + content + folder + fat


DATES = np.datetime64("2025-05-01T10:00:00") + np.rint(1e6 * TIME).astype("m8[us]")
CLOCK = [f"2024-05-01T12:00:{t:09.6f}Z" for t in TIME]
TILT = [("Time (s)", "Tilt (deg)"), *zip(TIME.tolist(), DEGREES.tolist(), strict=True)]
TWO = {"Time": TIME, "Acc": np.vstack([ANGLE, 0.8 * ANGLE])}
LOST = {"unit": "deg", "data": {"time_s": LISTS["time"], "angle_deg": [None, *DEGREES[1:]]}}
PUSHED = {f"-Nx{at:04d}": record for at, record in enumerate(RECORDS)}
FEEDS = [{"t": t, "angle_deg": f"{np.degrees(x):.4f}"} for t, x in PAIRS]
TEXTS = {"time_s": [f"{t:.2f}" for t in TIME], "angle_deg": [f"{x:.2f}" for x in DEGREES]}
UNLIKE = {"data": [[1.0, 2.0, 3.0], LISTS["time"], LISTS["angle_rad"]]}
NESTED = [
    {"device": "logger 3"},
    *(
        {"at": at, "arm": {"theta_rad": x, "bob": "brass"}}
        for at, x in zip(CLOCK, ANGLE, strict=True)
    ),
]  # fmt: skip
COMMAS = [[f"{t:.4f}".replace(".", ","), f"{x:.6f}".replace(".", ",")] for t, x in PAIRS]

FILES: dict[str, Callable[[], Case]] = {
    "MATLAB, by names": lambda: Case(
        matlab(t=TIME, theta2=ANGLE[:, None], u=np.zeros(5), note="free"), said="another length"
    ),
    "MATLAB, pi is down in Simulink's log": lambda: Case(
        matlab(Distance=simulink(np.zeros((1000, 1))), Theta1=simulink((ANGLE + np.pi)[:, None])),
        said="1 half turn",
    ),
    "MATLAB, time in front of a matrix": lambda: Case(matlab(data=np.column_stack([TIME, ANGLE]))),
    "MATLAB, a rate beside no time": lambda: Case(matlab(angle=ANGLE, fs=50.0)),
    "MATLAB, Simulink's structure with time": lambda: Case(matlab(ScopeData=scope())),
    "MATLAB, nested structures": lambda: Case(matlab(Fe={"Out": TWO}), unit="1"),
    "MATLAB 4": lambda: Case(matlab("4", t=TIME, theta=ANGLE)),
    "MATLAB 7.3": lambda: Case(matlab_73()),
    "MATLAB, a clock that is infinite twice": lambda: Case(
        matlab(t=np.where(np.isin(TIME, TIME[1:3]), np.inf, TIME), theta=ANGLE),
        np.delete(ANGLE, [1, 2]),
        time_s=np.delete(TIME, [1, 2]),
    ),
    "HDF5, units in attributes": lambda: Case(
        hdf5(
            {"run1/time": TIME, "run1/phi": DEGREES},
            {"run1/time": {"units": "s"}, "run1/phi": {"units": "deg"}},
        )
    ),
    "HDF5, the rate in the array's attribute": lambda: Case(
        hdf5({"run/arm": ANGLE}, {"run/arm": {"sample_rate": 50.0, "units": "rad"}})
    ),
    "HDF5, the rate in the file's attribute": lambda: Case(
        hdf5({"arm": ANGLE}, {"arm": {"unit": "rad"}, "/": {"sample_rate_hz": 50.0}})
    ),
    "NumPy, two arrays": lambda: Case(
        stream(lambda held: np.savez(held, time=TIME, angle_deg=DEGREES)), name="a.npz"
    ),
    "NumPy, dates": lambda: Case(
        stream(lambda held: np.savez(held, time=DATES, angle_rad=ANGLE)), name="a.npz"
    ),
    "NumPy, one matrix": lambda: Case(
        stream(lambda held: np.save(held, np.column_stack([TIME, ANGLE]))), name="a.npy"
    ),
    "JSON, a record a line": lambda: Case(
        "".join(json.dumps({"t": t, "theta": x}) + "\n" for t, x in PAIRS), name="a.jsonl"
    ),
    "JSON, records": lambda: Case(json.dumps(RECORDS)),
    "JSON, records with texts": lambda: Case(json.dumps(NESTED)),
    "JSON, rows by their numbers": lambda: Case(
        json.dumps({name: dict(enumerate(values)) for name, values in LISTS.items()})
    ),
    "JSON, records by their keys": lambda: Case(json.dumps({"run": PUSHED})),
    "JSON, a channel's feeds": lambda: Case(json.dumps({"channel": {"id": 1}, "feeds": FEEDS})),
    "JSON, a unit beside and a lost reading": lambda: Case(json.dumps(LOST), lost=[0]),
    "JSON, clock times": lambda: Case(
        json.dumps({"timestamp": CLOCK, "angle_rad": LISTS["angle_rad"]})
    ),
    "JSON, numbers as texts": lambda: Case(json.dumps(TEXTS)),
    "JSON, lists of unlike lengths": lambda: Case(json.dumps(UNLIKE)),
    "Excel, without a header": lambda: Case(
        workbook(notes=[["measured on a Monday"]], swing=PAIRS), said="^sheet 'swing'"
    ),
    "Excel, with a header": lambda: Case(
        workbook(swing=[["Experiment 3"], ["Zeit [s]", "Winkel [°]"], *TILT[1:]])
    ),
    "Excel, texts with decimal commas": lambda: Case(
        workbook(Sheet=[["t (s)", "theta (rad)"], *COMMAS])
    ),
    "Excel, as phyphox writes it": lambda: Case(
        workbook(Raw=TILT, Metadata=[["START", 0.0]]), name="a.xlsx"
    ),
    "Excel of 1997, as phyphox writes it": lambda: Case(old_workbook(list(TILT)), name="a.xls"),
    "OpenDocument, with its empty rest": lambda: Case(opendocument_table(), name="a.ods"),
    "a zip of phyphox": lambda: Case(
        zipped(
            Raw__csv=text(TIME, DEGREES, head='"Time (s)","Tilt (deg)"\n'),
            meta___time__csv='"event","experiment time"\n"START",0.0\n"PAUSE",50.0\n',
        )
    ),
    "Logger Pro": lambda: Case(logger_pro(), name="a.cmbl"),
    "Tracker's project": lambda: Case(tracker(), name="a.trk"),
    "Tracker's project, axes turned by 5 degrees": lambda: Case(tracker(tilt=5.0), name="a.trk"),
    "Tracker's archive": lambda: Case(zipped(a__trk=tracker()), name="a.trz"),
    "a sound": lambda: Case(sound(ANGLE, 50), unit="1", name="a.wav"),
    "gzip": lambda: Case(gzip.compress(PLAIN.encode()), name="a.csv.gz"),
    "bzip2": lambda: Case(bz2.compress(PLAIN.encode()), name="a.csv.bz2"),
    "xz": lambda: Case(lzma.compress(PLAIN.encode()), name="a.csv.xz"),
}


@pytest.mark.parametrize("case", FILES)
def test_a_swing_is_read_from_a_file_of(tmp_path: Path, case: str) -> None:
    check(tmp_path, FILES[case]())


def test_the_strength_of_a_tone_may_swing(tmp_path: Path) -> None:
    time_s = np.arange(20 * 8000) / 8000
    strength = 0.5 + np.interp(time_s, TIME, 0.5 * ANGLE)
    content = sound(strength * np.sin(2 * np.pi * 1000 * time_s), 8000)
    recording = read_as(tmp_path, content, "b.wav")
    expected = np.interp(recording.time_s + 0.0025, time_s, strength) / np.sqrt(2)
    np.testing.assert_allclose(recording.values, expected, atol=2e-3)
    assert any("a tone whose strength swings" in note for note in recording.notes)


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
    "a cut file of MATLAB": (matlab(t=TIME, theta=ANGLE)[:1000], "a.mat", "can't be read"),
    "a cell of text": (
        workbook(run=[[t, "lost" if n % 42 == 41 else x] for n, (t, x) in enumerate(PAIRS)]),
        "a.xlsx",
        "line 42: 'lost' is no number",
    ),
    "Capstone's project": (zipped(main__xml="<x/>"), "a.cap", "PASCO Capstone"),
    "Capstone's experiment": (zipped(a__cap="x", b__csv=PLAIN), "a.zip", "export its data"),
    "Capstone's data": (zipped(data___17__tmp="x", b__csv=PLAIN), "a.zip", "export its data"),
    "an archive without a table": (zipped(a__jpg="x"), "a.zip", "no CSV"),
    **{
        f"a cut file of {name}": (pack(PLAIN.encode())[:-9], "a", "cut short|can't be unpacked")
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
        (lambda: json.dumps(NESTED), "more than 1000 cells"),
        (lambda: gzip.compress(bytes(300 << 20), 1), "too large"),
    ],
    ids=["Excel", "rows", "depth", "width", "JSON", "gzip"],
)
def test_cells_and_bytes_are_counted_as_they_come(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    content: Callable[[], bytes | str],
    said: str,
) -> None:
    monkeypatch.setattr(containers, "_MOST_CELLS", 600_000 if "600000" in said else 1000)
    monkeypatch.setattr(trees, "_MOST_CELLS", 1000)
    with pytest.raises(InputError, match=said):
        read_as(tmp_path, content())


def test_what_unpacks_to_more_than_any_recording_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, book = tmp_path / "a.mat", tmp_path / "a.xlsx"
    savemat(path, {"t": TIME, "theta": ANGLE, "more": np.zeros(20_000)}, do_compression=True)
    book.write_bytes(workbook(run=[["t", "angle"]]))
    same(read(path))
    for module, file, said in (
        (trees, path, "its compressed data are more than 0 MB"),
        (table, book, "it unpacks to 0 MB"),
    ):
        monkeypatch.setattr(module, "most_unpacked", lambda _: 9_000)
        with pytest.raises(InputError, match=said):
            read(file)


@pytest.mark.parametrize("form", ["npz", "h5"])
def test_arrays_are_counted_before_they_are_unpacked(tmp_path: Path, form: str) -> None:
    """Three hundred megabytes of zeros pack into three hundred kilobytes."""
    path, zeros = tmp_path / f"a.{form}", np.zeros(40_000_000)
    if form == "npz":
        np.savez_compressed(path, time_s=TIME, angle_rad=zeros)
    else:
        with h5py.File(path, "w") as file:
            file.create_dataset("angle_rad", data=zeros, chunks=(10**6,), compression=1)
    del zeros
    tracemalloc.start()
    with pytest.raises(InputError, match="it unpacks to 305 MB"):
        read(path)
    peak_bytes = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak_bytes < 50e6


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"t,theta\n" + b"1," * 10_000_000 + b"1\n" + b"2," * 10_000_000 + b"2\n", "letters long"),
        (b"9" * 100_000_000, "letters long"),
        (b"#\n" * 10_000_000, "no row of numbers|no block of rows"),
    ],
    ids=["columns", "line", "remarks"],
)
def test_hostile_text_is_refused_in_little_memory(
    tmp_path: Path, content: bytes, said: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(content)
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
    for content, form in ((matlab(t=TIME, theta=ANGLE), "matlab-v5"), (workbook(a=PAIRS), "excel")):
        (tmp_path / "a").write_bytes(content)
        assert inspect(tmp_path / "a").format == form
