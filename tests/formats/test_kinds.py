"""Kinds of files that laboratories write, each made here, and what must be read from them."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from scipy.io import savemat

from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.formats import ReadOptions, containers, inspect, read, trees
from pendpipe.formats.text import column_of_clock_times
from pendpipe.recording import Recording

from .decays import Floats, swing

TIME, ANGLE = swing(1500, 30.0, 0.5)
RATE = np.gradient(ANGLE, TIME)


def text(*columns: Floats, sign: str = ",", digits: int = 6, head: str = "") -> str:
    rows = zip(*columns, strict=True)
    return head + "".join(sign.join(f"{x:.{digits}f}" for x in row) + "\n" for row in rows)


def read_text(tmp_path: Path, content: str | bytes, name: str = "a.txt") -> Recording:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read(path)


def same(recording: Recording, values: Floats = ANGLE, time: Floats = TIME) -> None:
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], time - time[0], atol=2e-3)
    np.testing.assert_allclose(recording.values, values, atol=2e-4)


# --- the times -----------------------------------------------------------------------------


def test_frames_that_are_missing_among_such_times_are_found(tmp_path: Path) -> None:
    kept = np.delete(np.arange(len(TIME)), [100, 101, 640])
    rows = "".join(f"{TIME[row]:.2E}\t{ANGLE[row]:.5f}\n" for row in kept)
    recording = read_text(tmp_path, "t\ttheta\n" + rows)
    # The place of a lost frame is known to a few rows, their number exactly.
    np.testing.assert_allclose(recording.time_s, TIME[kept], atol=0.08)
    assert recording.time_s[-1] == pytest.approx(TIME[-1], abs=0.04)
    assert any("with 3 missing" in note for note in recording.notes)


def test_rows_with_the_time_of_an_older_row_are_left_out(tmp_path: Path) -> None:
    lines = text(TIME, ANGLE, -ANGLE, head="t,theta,other\n").splitlines()
    for row in (300, 500, 900):
        lines[row] = lines[row - 2]
    recording = read_text(tmp_path, "\n".join(lines) + "\n")
    assert len(recording) == len(TIME) - 3
    assert any("3 row(s) that repeat the time" in note for note in recording.notes)


def test_steps_of_ten_are_seconds_and_said_first(tmp_path: Path) -> None:
    slow = np.arange(0, 15000, 10.0)
    unnamed = read_text(tmp_path, text(slow, np.sin(2 * np.pi * slow / 217), digits=4))
    assert unnamed.time_s[-1] == slow[-1]
    assert any("a period of 217" in guess for guess in unnamed.weak_guesses)


def test_microcontroller_milliseconds_are_a_guess(tmp_path: Path) -> None:
    rows = "".join(f"{round(1e3 * t)},{x:.5f}\n" for t, x in zip(TIME, ANGLE, strict=True))
    recording = read_text(tmp_path, "t,theta (rad)\n" + rows)
    same(recording)
    assert any("milliseconds" in guess for guess in recording.weak_guesses)


def test_a_clock_that_rounds_is_no_gap(tmp_path: Path) -> None:
    time = np.rint(1e3 * np.arange(1500) * 0.0503) / 1e3
    (tmp_path / "a.csv").write_text(text(time, ANGLE, digits=3, head="t (s),theta (rad)\n"))
    assert inspect(tmp_path / "a.csv").gaps == ()


def test_runs_below_one_another_are_not_one_run(tmp_path: Path) -> None:
    half = len(TIME) // 2
    rows = text(
        np.tile(TIME[:half], 2),
        np.concatenate((ANGLE[:half], 0.8 * ANGLE[:half])),
        head="t (s),theta (rad)\n",
    )
    recording = read_text(tmp_path, rows)
    assert len(recording) == half
    assert "2 runs stand below one another" in recording.weak_guesses[0]


# --- the column ----------------------------------------------------------------------------


def test_a_header_with_commas_may_stand_over_rows_with_tabs(tmp_path: Path) -> None:
    drive = np.where(TIME < 10, np.sin(5 * TIME), 0.0)
    rows = text(TIME, drive, ANGLE, sign="\t", head="--- torsione ---\nTempo,Forzante,Pendolo\n")
    same(read_text(tmp_path, rows))


def test_without_names_the_drive_is_not_the_pendulum(tmp_path: Path) -> None:
    drive = np.where(TIME < 30, np.sin(5 * TIME), 0.0)
    recording = read_text(tmp_path, text(TIME, drive, ANGLE))
    same(recording)
    assert "whose swing decays" in " ".join((*recording.notes, *recording.weak_guesses))


def test_what_drifts_beside_a_slow_decay_is_not_its_pendulum(tmp_path: Path) -> None:
    # A swing of one size and the height that a moving camera sees.
    swing = 200 * np.exp(-0.002 * TIME) * np.cos(2.9 * TIME)
    drift = 590 + 30 * np.cumsum(np.random.default_rng(3).normal(size=len(TIME))) / 40
    recording = read_text(tmp_path, text(TIME, swing, drift)[: 6 * 4000])
    np.testing.assert_allclose(recording.values, swing[: len(recording)], atol=1e-3)


@pytest.mark.parametrize("names", ["posicao_x_px,posicao_y_px", "x1 (px),y1 (px)", "Bob X,Bob Y"])
def test_the_place_of_a_bob_is_known_by_its_axes(tmp_path: Path, names: str) -> None:
    x, y = 1288 + 1664 * np.sin(0.5 * ANGLE), -744 + 1664 * np.cos(0.5 * ANGLE)
    same(read_text(tmp_path, text(TIME, x, y, head=f"tempo_s,{names}\n")), 0.5 * ANGLE)


def test_a_letter_with_an_index_keeps_its_meaning(tmp_path: Path) -> None:
    recording = read_text(tmp_path, text(0.01 * ANGLE, TIME, head="x_10s,t_10s\n"))
    np.testing.assert_allclose(recording.values, 0.01 * ANGLE, atol=1e-6)
    assert recording.time_s[-1] == pytest.approx(TIME[-1])


def test_an_oscilloscopes_input_is_no_drive(tmp_path: Path) -> None:
    """The unused one reads zero."""
    table = text(TIME, 0.0 * TIME, ANGLE, head="% Time (s),Input A (V),Input B (V)\n")
    recording = read_text(tmp_path, table)
    assert recording.unit == "V"
    np.testing.assert_allclose(recording.values, ANGLE, atol=1e-6)


@pytest.mark.parametrize("cells", [["38:05.6", "39:00.7"], ["38:05,6", "39:00,7"]])
def test_a_spreadsheets_minutes_and_seconds_are_no_hours(cells: list[str]) -> None:
    """It shows them as mm:ss.0, whatever the hour."""
    seconds = column_of_clock_times(cells)
    assert seconds is not None
    np.testing.assert_allclose(seconds, [2285.6, 2340.7])


def test_neither_row_counter_nor_error_is_the_reading(tmp_path: Path) -> None:
    count = np.arange(len(TIME), dtype=float)
    error = 1e-3 * (1 + np.abs(RATE))
    head = "Pt#,Seconds,X',Laser\n"
    recording = read_text(tmp_path, text(count, TIME, error, 1e-3 * ANGLE, head=head))
    np.testing.assert_allclose(recording.values, 1e-3 * ANGLE, atol=1e-6)


def test_runs_side_by_side_are_offered_by_name(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = ["t1;theta1;omega1;t2;theta2;omega2"]
    for row in range(len(TIME)):
        one = f"{TIME[row]:.4f};{ANGLE[row]:.6f};{RATE[row]:.4f}"
        two = f"{TIME[row]:.4f};{2 * ANGLE[row]:.6f};{2 * RATE[row]:.4f}" if row < 900 else ";;"
        rows.append(f"{one};{two}")
    path.write_text("\n".join(rows) + "\n")
    same(read(path))
    assert any("--column: theta2" in note for note in read(path).notes)
    for options in (ReadOptions(column="theta2"), ReadOptions(channel="theta2")):
        same(read(path, options), 2 * ANGLE[:900], TIME[:900])


def test_pixels_from_a_corner_are_no_angle_about_it(tmp_path: Path) -> None:
    x, y = 640 + 60 * ANGLE, 480 - 3 * ANGLE**2
    recording = read_text(tmp_path, text(TIME, x, y, digits=2, head="t,x,y\n"))
    assert (recording.quantity, recording.unit) == ("reading", "1")
    assert "analysed in its own" in recording.weak_guesses[0]
    np.testing.assert_allclose(recording.values, x, atol=0.01)


# --- the unit ------------------------------------------------------------------------------


def test_digits_that_were_printed_in_the_other_unit_give_the_unit(tmp_path: Path) -> None:
    """A step alone does not, though it be a turn over the lines of an encoder."""
    small, count = 0.2 * ANGLE, 2 * np.pi / 4096
    table = text(TIME, count * np.rint(small / count), digits=9, head="t,theta\n")
    assert read_text(tmp_path, table).unit == "1"
    printed = np.radians(np.rint(1e5 * np.degrees(small)) / 1e5)
    recording = read_text(tmp_path, text(TIME, printed, digits=12, head="x,y\n"))
    assert any("its values are multiples of 1e-05" in note for note in recording.notes)
    assert recording.quantity == "angle_rad"


def test_a_header_that_contradicts_the_period_is_doubted_first(tmp_path: Path) -> None:
    time, angle = swing(1500, 30.0, 1.1)
    recording = read_text(tmp_path, text(time, angle, head="t (s),theta (deg)\n"))
    np.testing.assert_allclose(recording.values, angle, atol=1e-6)
    assert "headed in degrees" in recording.weak_guesses[0]


@pytest.mark.parametrize("amplitude", [8.0, 150.0])
def test_a_torsion_pendulum_may_swing_beyond_pi(tmp_path: Path, amplitude: float) -> None:
    wheel = amplitude * np.exp(-0.05 * TIME) * np.cos(3 * TIME)
    recording = read_text(tmp_path, text(TIME, wheel, head="t (s),theta (rad)\n"))
    np.testing.assert_allclose(recording.values, wheel, atol=1e-5)
    assert recording.unit == "rad"


@pytest.mark.parametrize("level", [np.pi, 5.46, -1.2])
def test_it_may_hang_anywhere(tmp_path: Path, level: float) -> None:
    recording = read_text(tmp_path, text(TIME, ANGLE + level, head="t (s),theta (rad)\n"))
    values = recording.values
    np.testing.assert_allclose(values - values.mean(), ANGLE - ANGLE.mean(), atol=1e-5)


# --- programs that write text in their own way ---------------------------------------------


def test_frames_that_a_tracker_lost_are_missing(tmp_path: Path) -> None:
    for lost in ("nan", "NaN", ""):
        lines = text(TIME, ANGLE, head="t (s),theta (rad)\n").splitlines()
        lines[100] = lines[100].split(",")[0] + f",{lost}"
        recording = read_text(tmp_path, "\n".join(lines) + "\n")
        assert np.flatnonzero(~recording.usable).tolist() == [99]


def test_a_serial_monitors_arrows_and_labels(tmp_path: Path) -> None:
    arrows = "".join(
        f"12:03:{t % 60:06.3f} -> {round(1e3 * t)},{x:.6f}\n"
        for t, x in zip(TIME, ANGLE, strict=True)
    )
    same(read_text(tmp_path, arrows))
    bare = "".join(f"12:03:{t % 60:06.3f} -> {x:.6f}\n" for t, x in zip(TIME, ANGLE, strict=True))
    same(read_text(tmp_path, bare))
    pairs = zip(TIME, ANGLE, strict=True)
    labels = "".join(f"t:{t:.4f},theta:{x:.6f}\n" for t, x in pairs)
    same(read_text(tmp_path, labels))
    same(read_text(tmp_path, "ready\n" + labels.replace(":", "=").replace(",", " ")))


def test_logger_pro_labview_and_pandas_as_text(tmp_path: Path) -> None:
    rows = text(TIME, ANGLE, sign="\t")
    vernier = "Vernier Format 2\nUntitled\n3/4/2019 10:10:10\nRun 1\nTime\tAngle\nt\tθ\ns\trad\n\n"
    recording = read_text(tmp_path, vernier + rows)
    same(recording)
    assert not recording.weak_guesses
    labview = (
        "LabVIEW Measurement\t\nSeparator\tTab\nTime\t10:10:10,5\n***End_of_Header***\t\n\n"
        "Channels\t1\nY_Unit_Label\tVolts\nDelta_X\t0.033333\n***End_of_Header***\t\n"
        "X_Value\tVoltage\n"
    )
    recording = read_text(tmp_path, labview + rows)
    assert recording.quantity == "volts"
    np.testing.assert_allclose(recording.values, ANGLE, atol=1e-5)
    index = np.arange(len(TIME), dtype=float)
    pandas = text(index, TIME, ANGLE, head=",t,theta\n")
    same(read_text(tmp_path, pandas))


def test_tracker_as_text_and_dates_beside_times(tmp_path: Path) -> None:
    across = text(
        TIME,
        np.sin(ANGLE),
        -np.cos(ANGLE),
        np.degrees(ANGLE) - 90,
        sign="\t",
        head="t\tx\ty\tθ_{r}\n",
    )
    recording = read_text(tmp_path, "#mass_A\n" + across)
    assert inspect(tmp_path / "a.txt").chosen == "θ_r"
    same(recording)
    dated = "".join(
        f"5/1/2024,12:{int(t // 60):02d}:{t % 60:06.3f},{np.degrees(x):.4f}\n"
        for t, x in zip(TIME, ANGLE, strict=True)
    )
    same(read_text(tmp_path, "Date,Time,Angle (deg)\n" + dated))


def test_frames_that_are_only_counted_need_a_rate(tmp_path: Path) -> None:
    count = np.arange(len(TIME), dtype=float)
    rows = text(count, ANGLE, digits=6, head="frame,theta (rad)\n")
    with pytest.raises(InputError, match=r"'frame' only counts.*--sample-rate"):
        read_text(tmp_path, rows)
    same(read_text(tmp_path, "fps: 30\n" + rows))


def test_minus_signs_and_blanks_of_a_typesetter(tmp_path: Path) -> None:
    rows = text(TIME, ANGLE, head="t (s),theta (rad)\n")
    same(
        read_text(tmp_path, rows.replace("-", "\N{MINUS SIGN}").replace(",", ",\N{NO-BREAK SPACE}"))
    )


def test_a_workbook_of_texts_with_decimal_commas(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(["t (s)", "theta (rad)"])
    for t, x in zip(TIME, ANGLE, strict=True):
        sheet.append([f"{t:.4f}".replace(".", ","), f"{x:.6f}".replace(".", ",")])
    book.save(tmp_path / "a.xlsx")
    same(read(tmp_path / "a.xlsx"))


# --- containers ----------------------------------------------------------------------------


def test_simulinks_structure_with_time_and_nested_structures(tmp_path: Path) -> None:
    signals = np.zeros((2,), dtype=[("values", object), ("label", object)])
    signals[0] = ((np.ones((len(TIME), 1))), "Switch")
    signals[1] = (ANGLE[:, None], "PendPos")
    log = {"time": TIME[:, None], "signals": signals, "blockName": "model/Scope"}
    savemat(tmp_path / "a.mat", {"ScopeData": log})
    same(read(tmp_path / "a.mat"))
    savemat(
        tmp_path / "b.mat", {"Fe": {"Out": {"Time": TIME, "Acc": np.vstack([ANGLE, 0.8 * ANGLE])}}}
    )
    recording = read(tmp_path / "b.mat")
    assert (recording.quantity, recording.unit) == ("reading", "1")
    np.testing.assert_allclose(recording.values, ANGLE)


def test_logger_pro(tmp_path: Path) -> None:
    def column(name: str, unit: str, values: Floats) -> str:
        cells = "\n".join(f"{x:.6f}" for x in values)
        return (
            f"<DataColumn><DataObjectName>{name}</DataObjectName><ColumnUnits>{unit}</ColumnUnits>"
            f"<ColumnCells>\n{cells}\n</ColumnCells></DataColumn>"
        )

    columns = column("Time", "s", TIME) + column("Angle", "rad", ANGLE)
    xml = f"<Document><DataSet>{columns}</DataSet></Document>"
    same(read_text(tmp_path, xml, "a.cmbl"))


def tracker(start: int = 3, tilt: float = 0.0) -> str:
    """A project of Tracker: pixels of a bob 400 px below the origin (320, 40)."""
    marks = []
    for row, x in enumerate(ANGLE + np.radians(tilt)):
        px, py = 320 + 400 * np.sin(x), 40 + 400 * np.cos(x)
        marks.append(
            f'<property name="[{row}]" type="object"><object class="org.opensourcephysics.cabrillo'
            f'.tracker.PointMass$FrameData"><property name="n" type="int">{row + start}</property>'
            f'<property name="x" type="double">{px}</property>'
            f'<property name="y" type="double">{py}</property></object></property>'
        )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<object class="org.opensourcephysics.cabrillo.tracker.TrackerPanel">
<property name="videoclip" type="object"><object class="org.opensourcephysics.media.core.VideoClip">
<property name="startframe" type="int">{start}</property></object></property>
<property name="clipcontrol" type="object"><object class="x.StepperClipControl">
<property name="delta_t" type="double">{1000 / 30}</property></object></property>
<property name="coords" type="object">
<object class="org.opensourcephysics.media.core.ImageCoordSystem">
<property name="framedata" type="array"><property name="[0]" type="object">
<object class="org.opensourcephysics.media.core.ImageCoordSystem$FrameData">
<property name="xorigin" type="double">320</property><property name="yorigin" type="double">40
</property><property name="angle" type="double">{tilt}</property>
<property name="xscale" type="double">500</property><property name="yscale" type="double">500
</property></object></property></property></object></property>
<property name="tracks" type="collection"><property name="item" type="object">
<object class="org.opensourcephysics.cabrillo.tracker.PointMass">
<property name="framedata" type="array">{"".join(marks)}</property></object></property></property>
</object>"""


@pytest.mark.parametrize("tilt", [0.0, 5.0])
def test_trackers_project(tmp_path: Path, tilt: float) -> None:
    same(read_text(tmp_path, tracker(tilt=tilt), "a.trk"))
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as zipped:
        zipped.writestr("a.trk", tracker(tilt=tilt))
    same(read_text(tmp_path, archive.getvalue(), "a.trz"))


def test_phyphox_as_zip_and_as_workbook(tmp_path: Path) -> None:
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as zipped:
        head = '"Time (s)","Tilt (deg)"\n'
        zipped.writestr("Raw Data.csv", text(TIME, np.degrees(ANGLE), head=head))
        zipped.writestr("meta/time.csv", '"event","experiment time"\n"START",0.0\n"PAUSE",50.0\n')
    same(read_text(tmp_path, archive.getvalue(), "a.zip"))
    book = openpyxl.Workbook()
    sheet = book.active
    assert sheet is not None
    sheet.append(["Time (s)", "Tilt (deg)"])
    for t, x in zip(TIME.tolist(), np.degrees(ANGLE).tolist(), strict=True):
        sheet.append([t, x])
    meta = book.create_sheet("Metadata Time")
    meta.append(["START", 0.0])
    book.save(tmp_path / "a.xlsx")
    same(read(tmp_path / "a.xlsx"))


@pytest.mark.parametrize(
    ("content", "name", "said"),
    [
        (b"<!DOCTYPE x [<!ENTITY a 'b'>]><cassylab/>", "a.labx", "no reader knows|entities"),
        (b"<?xml version='1.0'?><!DOCTYPE x [<!ENTITY a 'b'>]><x/>", "a.labx", "entities"),
        (b"<?xml version='1.0'?><svg/>", "a.svg", "no reader knows"),
        (b"<?xml version='1.0'?><cassylab><a>", "a.labx", "the XML is damaged"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 600, "a.xls", "can't be read"),
        (b"\x89HDF\r\n\x1a\n" + b"\0" * 600, "a.mat", "file of arrays can't be read"),
        (b"TDSm" + b"\0" * 600, "a.tdms", "file of arrays can't be read"),
    ],
)
def test_what_can_not_be_read_is_refused_for_its_reason(
    tmp_path: Path, content: bytes, name: str, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        read_text(tmp_path, content, name)


def test_a_project_of_capstone_and_a_zip_without_a_table_are_refused(tmp_path: Path) -> None:
    for member, said in (("main.xml", "PASCO Capstone"), ("a.jpg", "no CSV")):
        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w") as zipped:
            zipped.writestr(member, "<x/>")
        with pytest.raises(InputError, match=said):
            read_text(tmp_path, archive.getvalue(), "a.cap")


def test_standard_input_and_output(tmp_path: Path) -> None:
    rows = text(TIME, ANGLE, head="t (s),theta (rad)\n").encode()
    done = subprocess.run(
        [sys.executable, "-m", "pendpipe.cli", "convert", "-", "-"],
        input=rows,
        capture_output=True,
        check=True,
        cwd=tmp_path,
    )
    (tmp_path / "plain.csv").write_bytes(done.stdout)
    same(read(tmp_path / "plain.csv"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plain.csv"]
    again = subprocess.run(
        [sys.executable, "-m", "pendpipe.cli", "inspect", "-"],
        input=done.stdout,
        capture_output=True,
        check=True,
    )
    assert b"format      plain" in again.stdout


# --- cut and hostile files -----------------------------------------------------------------


@pytest.mark.parametrize("cut", [2, 4, 9, 12])
def test_the_last_row_of_a_cut_file_is_no_sample(tmp_path: Path, cut: int) -> None:
    whole = text(TIME, ANGLE, head="t (s),theta (rad)\n")
    recording = read_text(tmp_path, whole[:-cut])
    assert len(recording) == len(TIME) - 1
    assert any("cut short" in note for note in recording.notes)
    # Without its line end alone it is whole.
    assert len(read_text(tmp_path, whole[:-1])) == len(TIME)


def test_devices_pipes_and_huge_files_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(InputError, match="a device or a pipe"):
            read(path)
    with (tmp_path / "sparse.WDQ").open("wb") as stream:
        stream.truncate(5 << 30)
    with pytest.raises(InputError, match=r"5\.4 GB"):
        read(tmp_path / "sparse.WDQ")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"t,theta\n" + b"1," * 10_000_000 + b"1\n" + b"2," * 10_000_000 + b"2\n", "letters long"),
        (b"9" * 100_000_000, "letters long"),
        (b"# nothing\n" * 4_000_000, "no row of numbers|no block of rows"),
        (b"#\n" * 20_000_000, "no row of numbers|no block of rows"),
    ],
    ids=["columns", "line", "remarks", "short remarks"],
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


def test_the_cells_of_a_workbook_are_counted_before_they_are_read(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.xlsx", "w", zipfile.ZIP_DEFLATED) as archive:
        row = b"<row>" + b'<c r="A1"><v>1</v></c>' * 100 + b"</row>"
        archive.writestr("xl/worksheets/sheet1.xml", b"<sheetData>" + row * 20_000)
    with pytest.raises(InputError, match="more than 600000 cells"):
        read(tmp_path / "a.xlsx")


@pytest.mark.parametrize(
    ("name", "times", "values"), [("times", 1e300, 1), ("readings", 1, 1e-300)]
)
def test_an_absurd_scale_is_refused(tmp_path: Path, name: str, times: float, values: float) -> None:
    rows = "".join(f"{times * t},{values * x}\n" for t, x in zip(TIME, ANGLE, strict=True))
    with pytest.raises(InputError, match=f"the {name} span"):
        read_text(tmp_path, "t (s),theta (rad)\n" + rows)


def test_times_before_zero_are_kept_and_named(tmp_path: Path) -> None:
    rows = "".join(f"{t - 100},{x}\n" for t, x in zip(TIME, ANGLE, strict=True))
    recording = read_text(tmp_path, "t (s),theta (rad)\n" + rows)
    assert recording.time_s[0] == TIME[0] - 100
    assert "the times begin at -100 s, before their zero" in recording.notes


# --- long tables, rows with words, packed files --------------------------------------------


def long_table(order: str) -> str:
    theta = [f"{t:.4f},theta,{x:.6f}" for t, x in zip(TIME, ANGLE, strict=True)]
    omega = [f"{t:.4f},omega,{x:.6f}" for t, x in zip(TIME, RATE, strict=True)]
    rows = theta + omega if order == "one below the other" else zip(theta, omega, strict=True)
    lines = [row if isinstance(row, str) else "\n".join(row) for row in rows]
    return "time,variable,value\n" + "\n".join(lines) + "\n"


@pytest.mark.parametrize("order", ["one below the other", "in turn"])
def test_a_long_table_is_read_by_the_quantity_that_it_names(tmp_path: Path, order: str) -> None:
    path = tmp_path / "long.csv"
    path.write_text(long_table(order))
    assert inspect(path).chosen == "theta"
    same(read(path))
    np.testing.assert_allclose(read(path, ReadOptions(column="omega")).values, RATE, atol=1e-5)


def test_runs_that_a_column_numbers_stand_side_by_side(tmp_path: Path) -> None:
    runs = ((1, ANGLE), (2, 0.6 * ANGLE))
    body = "".join(text(np.full(1500, n), TIME, x) for n, x in runs)
    recording = read_text(tmp_path, "run,t_s,theta_rad\n" + body)
    same(recording)
    assert any("several runs" in note for note in recording.notes)


def test_a_flag_beside_times_that_rise_makes_no_long_table(tmp_path: Path) -> None:
    flags = "".join(
        f"{t:.4f},{x:.6f},{'ok' if row % 7 else 'late'}\n"
        for row, (t, x) in enumerate(zip(TIME, ANGLE, strict=True))
    )
    same(read_text(tmp_path, "t,theta_rad,flag\n" + flags))


@pytest.mark.parametrize(
    "row",
    [
        "t={ms:.3f} ms, angle={deg:.4f} deg",
        "t: {s:.5f} s | theta: {deg:.4f}°",
        "2024-05-01 12:00:{s:09.6f} INFO sensor: angle = {deg:.4f} deg",
        "{{{s:.5f}, {mathematica}}},",
    ],
)
def test_rows_that_say_the_same_words_each_time(tmp_path: Path, row: str) -> None:
    time, angle = TIME[:1450], ANGLE[:1450]
    rows = [
        row.format(s=t, ms=1e3 * t, deg=np.degrees(x), mathematica=f"{x:.6e}".replace("e", "*^"))
        for t, x in zip(time, angle, strict=True)
    ]
    same(read_text(tmp_path, "ready\n" + "\n".join(rows) + "\n"), angle, time)


@pytest.mark.parametrize("packed", ["gz", "bz2", "xz"])
def test_a_packed_table_is_unpacked(tmp_path: Path, packed: str) -> None:
    pack = {"gz": gzip.compress, "bz2": bz2.compress, "xz": lzma.compress}[packed]
    content = pack(text(TIME, ANGLE, head="t_s,theta_rad\n").encode())
    same(read_text(tmp_path, content, f"a.csv.{packed}"))
    with pytest.raises(InputError, match=r"cut short|can't be unpacked"):
        read_text(tmp_path, content[:-9], f"b.csv.{packed}")


def test_a_packed_file_may_not_fill_the_memory(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="too large"):
        read_text(tmp_path, gzip.compress(bytes(300 << 20), 1), "a.gz")


def opendocument(rows: str) -> bytes:
    held = io.BytesIO()
    names = "xmlns:office='o' xmlns:table='t' xmlns:text='x'"
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        body = f"<table:table table:name='run'>{rows}</table:table>"
        archive.writestr("content.xml", f"<office:body {names}>{body}</office:body>")
    return held.getvalue()


def cell(value: str, kind: str = "float") -> str:
    of = f"office:value='{value}'" if kind == "float" else ""
    return f"<table:table-cell {of}><text:p>{value[:5]}</text:p></table:table-cell>"


def test_an_opendocument_table_with_its_empty_rest(tmp_path: Path) -> None:
    empty = "<table:table-cell table:number-columns-repeated='{}'/>"
    head = cell("t (s)", "text") + cell("Winkel (rad)", "text").replace("Winke", "Winkel (rad)")
    rows = "".join(
        f"<table:table-row>{cell(f'{t:.6f}')}{cell(f'{x:.6f}')}{empty.format(1000)}</table:table-row>"
        for t, x in zip(TIME, ANGLE, strict=True)
    )
    rest = "<table:table-row table:number-rows-repeated='1000000'>" + empty.format(16384)
    content = opendocument(
        f"<table:table-row>{head}</table:table-row>{rows}{rest}</table:table-row>"
    )
    recording = read_text(tmp_path, content, "a.ods")
    same(recording)
    assert recording.unit == "rad"


@pytest.mark.parametrize(
    "rows",
    [
        "<table:table-row/>" * 5000,
        "<a>" * 5000 + "</a>" * 5000,
        "<table:table-row>"
        + "<table:table-cell office:value='1' table:number-columns-repeated='99999'/>" * 20
        + "</table:table-row>",
    ],
)
def test_the_cells_of_an_opendocument_table_are_counted_as_they_come(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: str
) -> None:
    monkeypatch.setattr(containers, "_MOST_CELLS", 1000)
    with pytest.raises(InputError, match="more than 1000 cells"):
        read_text(tmp_path, opendocument(rows), "b.ods")


def test_records_of_json_with_texts_are_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    records = [
        {"at": f"2024-05-01T12:00:{t:09.6f}Z", "arm": {"theta_rad": x, "bob": "brass"}}
        for t, x in zip(TIME[:1400], ANGLE, strict=False)
    ]
    content = json.dumps([{"device": "logger 3"}, *records])
    recording = read_text(tmp_path, content, "a.json")
    same(recording, ANGLE[:1400], TIME[:1400])
    assert recording.unit == "rad"
    monkeypatch.setattr(trees, "_MOST_CELLS", 1000)
    with pytest.raises(InputError, match="more than 1000 cells"):
        read_text(tmp_path, content, "b.json")


def test_numbers_of_json_that_are_written_as_texts_are_no_clock_times(tmp_path: Path) -> None:
    """The text "12.50" is a number, and not twelve minutes and fifty seconds."""
    some = slice(0, 1400)
    degrees = np.rad2deg(ANGLE[some])
    told = {"time_s": [f"{t:.2f}" for t in TIME[some]], "angle_deg": [f"{x:.2f}" for x in degrees]}
    recording = read_text(tmp_path, json.dumps(told), "a.json")
    np.testing.assert_allclose(recording.time_s, TIME[some], atol=0.006)
    np.testing.assert_allclose(np.rad2deg(recording.values), degrees, atol=0.006)
    assert column_of_clock_times(["12.50", "12.51", "12.52"]) is None
    assert column_of_clock_times(["12.50.01", "12.50.02"]) is not None


def test_lists_of_unlike_lengths_in_json_are_signals_of_their_own(tmp_path: Path) -> None:
    """A sensor that samples more slowly, or a remark, changes nothing for the others."""
    some = slice(0, 1400)
    lists = [[1.0, 2.0, 3.0], TIME[some].tolist(), ANGLE[some].tolist()]
    recording = read_text(tmp_path, json.dumps({"data": lists}), "a.json")
    same(recording, ANGLE[some], TIME[some])


def test_igor_origin_excel_and_seismographs_write_tables_of_their_own(tmp_path: Path) -> None:
    column = "".join(f"\t{x:.6f}\n" for x in ANGLE)
    scale = 'X SetScale/P x, 0, 0.0333333333, "s", phi; SetScale y, 0, 0, "rad", phi\n'
    same(read_text(tmp_path, f"IGOR\nWAVES/D/O\tphi\nBEGIN\n{column}END\n{scale}", "a.itx"))
    head = "Long Name\tTime\tAngle\nUnits\ts\trad\nComments\t\tPohl's wheel\n"
    rows = "".join(
        f"{n}\t{t:.5f}\t{x:.6f}\n" for n, (t, x) in enumerate(zip(TIME, ANGLE, strict=True))
    )
    same(read_text(tmp_path, head + rows, "b.dat"))
    cells = "".join(
        f"<Row><Cell><Data>{t:.5f}</Data></Cell><Cell><Data>{x:.6f}</Data></Cell></Row>"
        for t, x in zip(TIME, ANGLE, strict=True)
    )
    named = "<Row><Cell><Data>t (s)</Data></Cell><Cell><Data>theta (rad)</Data></Cell></Row>"
    office = "<?xml version='1.0'?>\n<?mso-application progid='Excel.Sheet'?>\n<Workbook><Table>"
    same(read_text(tmp_path, f"{office}{named}{cells}</Table></Workbook>", "c.xls"))
    counts = np.rint(1e6 * ANGLE).astype(int)
    lines = "\n".join("\t".join(map(str, counts[n : n + 6])) for n in range(0, 1500, 6))
    head = "TIMESERIES XX_A__BHZ_D, 1500 samples, 30 sps, 2024-05-01T22:00:00, SLIST, INTEGER, m\n"
    same(read_text(tmp_path, head + lines + "\n", "d.txt"), counts.astype(float))


def test_an_oscilloscopes_header_gives_the_volts_of_columns_without_a_name(tmp_path: Path) -> None:
    volts = 0.04 * np.rint(ANGLE / 0.01)
    head = "Format,1.0B\nMemory Length,1500\nTrigger Level,5.0E-02\nVertical Units,V\n"
    head += "Vertical Scale,5.0E-01\nSampling Period,3.3333E-02\nMode,Detail\nWaveform Data,\n"
    recording = read_text(tmp_path, head + text(TIME, volts))
    same(recording, volts)
    assert recording.unit == "V"
    bare = read_text(tmp_path, text(TIME, volts), "bare.csv")
    # A step of 0.04 is a turn over 9000 by chance: no encoder's.
    assert any("no unit" in guess for guess in bare.weak_guesses)


def test_labview_without_units_of_its_columns(tmp_path: Path) -> None:
    head = "LabVIEW Measurement\t\nX_Columns\tOne\n***End_of_Header***\t\n\t\nDelta_X\t0.02\t0.02\n"
    head += "***End_of_Header***\t\t\nX_Value\tVoltage_0\tVoltage_1\tComment\n"
    assert (
        read_text(tmp_path, head + text(TIME, ANGLE, 0.0 * ANGLE, sign="\t"), "a.lvm").unit == "V"
    )


def test_symbols_above_the_units_are_no_units(tmp_path: Path) -> None:
    head = "Vernier Format 2\nRun 1\nTime\tAngle\tVelocity\nt\tA\tv\ns\trad\trad/s\n\n"
    recording = read_text(tmp_path, head + text(TIME, ANGLE, RATE, sign="\t"))
    same(recording)
    assert recording.unit == "rad"


@pytest.mark.parametrize("form", ["yaml", "matlab", "xml"])
def test_lists_by_name_and_attributes_of_elements(tmp_path: Path, form: str) -> None:
    times, angles = ([f"{x:.6f}" for x in column] for column in (TIME, ANGLE))
    pairs = zip(times, angles, strict=True)
    content = {
        "yaml": f"bob: brass\nt: [{', '.join(times)}]\ntheta: [{', '.join(angles)}]\n",
        "matlab": f"t = [{' '.join(times)}];\ntheta = [{' '.join(angles)}];\n",
        "xml": "".join(f'<sample t="{t}" theta="{x}"/>\n' for t, x in pairs),
    }[form]
    same(read_text(tmp_path, content))


def test_the_name_of_a_section_is_no_unit(tmp_path: Path) -> None:
    head = "[Header]\nSampleRate=30\nUnit=deg\n[Data]\n"
    same(read_text(tmp_path, head + text(np.degrees(ANGLE))))


@pytest.mark.parametrize(("level", "said"), [(9.81, True), (0.0, False), (-9.81, True)])
def test_a_pull_along_the_string_is_said_to_swing_twice_in_a_period(
    level: float, said: bool, tmp_path: Path
) -> None:
    path = tmp_path / "phone.csv"
    rows = zip(TIME, level + 0.5 * RATE**2, strict=True)
    path.write_text("Time (s),Acceleration y (m/s^2)\n" + "".join(f"{t},{a}\n" for t, a in rows))
    assert any("twice in a period" in note for note in read(path).notes) is said


def test_a_level_of_gravity_is_no_unit(tmp_path: Path) -> None:
    along = 9.81 * np.cos(ANGLE) + 0.5 * RATE**2
    recording = read_text(tmp_path, text(TIME, along))
    assert recording.unit == "1"
    np.testing.assert_allclose(recording.values, along, atol=1e-6)


def test_a_column_that_counts_frames_gives_way_to_one_that_may_be_a_time(tmp_path: Path) -> None:
    content = text(np.arange(1500.0), TIME, ANGLE, head="frame,tau,theta\n")
    same(read_text(tmp_path, content))


@pytest.mark.parametrize(("share", "chosen"), [(0.35, "ch1"), (0.31, "ch2")])
def test_of_equal_columns_the_first_that_swings_a_third_as_far(
    tmp_path: Path, share: float, chosen: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text(TIME, share * ANGLE, ANGLE, head="t_s,ch1,ch2\n"))
    assert inspect(path).chosen == chosen


def test_headers_of_more_instruments(tmp_path: Path) -> None:
    volts = np.round(2.5 * ANGLE, 3)
    times = text(TIME, volts)
    counted = text(np.arange(1500.0), volts, sign=",").replace("\n", ",\n")
    bench = "".join(
        f"{n},03/12/2024 10:11:{t:06.3f}".replace(".", ":") + f",{x:.4f},0\n"
        for n, (t, x) in enumerate(zip(TIME[:1400], volts, strict=False))
    )
    for name, content in {
        "LeCroy": "LECROYWS3024z,64012,Waveform\nSegments,1,SegmentSize,1500\nTime,Ampl\n" + times,
        "Moku": "% Moku:Go Data Logger\n% Acquisition rate: 30 Hz\n% Time (s), Input 1 (V)\n"
        + times,
        "Rigol": "X,CH1,Start,Increment,\nSequence,Volt,0.0e+00,3.3333333e-02\n" + counted,
        "BenchLink": "Scan,Time,101 (VDC),Alarm 101\n" + bench,
        "Keithley": "Reading,Unit,Relative Time\n"
        + "".join(f"{x:.4f},Volt DC,{t:.5f}\n" for t, x in zip(TIME, volts, strict=True)),
    }.items():
        recording = read_text(tmp_path, content, f"{name}.csv")
        assert recording.unit == "V", name
        same(recording, volts[: len(recording)], TIME[: len(recording)])
    head = "channel names:\nDev1_ai0\nstart times:\n12.03.2024 10:23:11\ndt:\n0,033333333\ndata:\n"
    same(read_text(tmp_path, head + text(ANGLE).replace(".", ","), "SignalExpress.txt"))


# --- positions, brackets, clocks ------------------------------------------------------------


def test_a_swing_beside_the_pictures_corner_is_about_its_own_circle(tmp_path: Path) -> None:
    angle = 0.3 * ANGLE
    x, y = np.rint(206 + 536 * np.sin(angle)), np.rint(113 + 536 * np.cos(angle))
    recording = read_text(tmp_path, text(TIME, x, y, digits=3, head="t,x,y\n"))
    assert recording.unit == "rad"
    np.testing.assert_allclose(recording.values, angle, atol=0.01)
    assert not any("(0, 0)" in note for note in recording.notes)


def test_rows_of_a_hand_draw_no_circle(tmp_path: Path) -> None:
    x, y = 400 + 300 * np.sin(ANGLE), 100 + 300 * np.cos(ANGLE)
    hand = np.linspace(0.0, 1.0, 20)
    x[:20], y[:20] = 900 - 700 * hand, 700 * hand
    recording = read_text(tmp_path, text(TIME, x, y, digits=3, head="t,x,y\n"))
    assert recording.unit == "rad"
    np.testing.assert_allclose(recording.values[20:], ANGLE[20:], atol=1e-3)


@pytest.mark.parametrize("name", ["Pixel (Y) [px]", "Y (bob) <b> [px]", "Bob <2> (px) [raw]"])
def test_of_several_brackets_the_one_with_a_unit_counts(tmp_path: Path, name: str) -> None:
    still = np.ones(len(TIME))
    recording = read_text(
        tmp_path, text(TIME, still, 80 * ANGLE, sign=";", head=f"t [s];Pixel (X) [px];{name}\n")
    )
    assert recording.unit == "pixels"
    np.testing.assert_allclose(recording.values, 80 * ANGLE, atol=1e-4)


@pytest.mark.parametrize("head", ["", "t (s),ax (mg),ay (mg)\n"])
def test_the_pull_along_the_rod_gives_way_to_the_swing_within_a_bin(
    tmp_path: Path, head: str
) -> None:
    time, phase = TIME[:430], 2 * np.pi * 0.745 * TIME[:430]
    along = 900 * np.exp(-0.1 * time) * np.cos(2 * phase)
    across = 300 * np.exp(-0.05 * time) * np.cos(phase)
    recording = read_text(tmp_path, text(time, along, across, head=head))
    found = recording.values / np.abs(recording.values).max()
    np.testing.assert_allclose(found, across / across.max(), atol=1e-3)
    assert any("twice the frequency" in note for note in recording.notes)


def test_clipped_readings_are_said(tmp_path: Path) -> None:
    recording = read_text(tmp_path, text(TIME, np.clip(ANGLE, -0.3, 0.3), head="t,theta\n"))
    assert any("range" in note for note in recording.notes)
    assert not any("range" in n for n in read_text(tmp_path, text(TIME, ANGLE)).notes)


def test_of_a_clock_that_steps_back_either_part_can_be_read(tmp_path: Path) -> None:
    stamps = np.where(np.arange(len(TIME)) < 600, TIME, TIME - 0.11)
    ticks, path = 1e-3 * np.cumsum(33.0 + np.arange(len(TIME)) % 2), tmp_path / "a.csv"
    path.write_text(text(stamps, ANGLE, ticks, head="t (s),theta (rad),Step\n"))
    with pytest.raises(InputError) as fault:
        read(path)
    assert "--column 'Step:READING'" in str(fault.value)
    stop = float(str(fault.value).split("(--stop ")[1].split(")")[0])
    assert stop == pytest.approx(TIME[599], abs=1e-6)
    same(read(path, ReadOptions(stop_s=stop)), ANGLE[:600], TIME[:600])
    later = read(path, ReadOptions(start_s=stop))
    np.testing.assert_allclose(later.values, ANGLE[-len(later) :], atol=1e-5)
    assert len(later) == pytest.approx(897, abs=1)


def test_a_clock_that_steps_back_by_little_more_than_a_row_has_no_wrong_stamp(
    tmp_path: Path,
) -> None:
    """Without the row behind the step the time rises: but two rows take less than one's time."""
    stamps = np.where(np.arange(len(TIME)) < 600, TIME, TIME - 1.1 * (TIME[1] - TIME[0]))
    with pytest.raises(InputError, match="the time falls"):
        read_text(tmp_path, text(stamps, ANGLE, head="t (s),theta (rad)\n"))


def test_trackers_masses_are_named_and_chosen(tmp_path: Path) -> None:
    path, other = tmp_path / "a.csv", 0.2 * RATE
    path.write_text(
        text(
            TIME,
            ANGLE,
            0.1 * ANGLE,
            other,
            0.1 * other,
            head=",Right Mass,,Left Mass,\nt,x,y,x,y\n",
        )
    )
    recording = read(path)
    same(recording)
    note = next(note for note in recording.notes if "is taken from" in note)
    assert "'x of Right Mass'" in note
    assert "x of Left Mass" in note
    for key in ("Left Mass", "x of left mass", "x (2)", "4"):
        chosen = read(path, ReadOptions(column=key))
        np.testing.assert_allclose(chosen.values, other, atol=1e-5)
        assert chosen.unit == recording.unit


def test_inspect_prints_the_number_that_column_takes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text(text(TIME, ANGLE, 900 + 80 * ANGLE, head="t,theta,foo\n"))
    assert main(["inspect", str(tmp_path / "a.csv"), "--column", "foo"]) == 0
    told = capsys.readouterr().out.splitlines()
    assert "  channel 2   foo (--column 3)" in told
    assert next(line for line in told if "hangs at" in line).split()[-1] == "899.937"
    assert any(line.endswith("foo, in no known unit") for line in told)


@pytest.mark.parametrize("runs", [0, 3])
def test_passages_of_a_light_gate_are_no_swing(tmp_path: Path, runs: int) -> None:
    passages = [f"{n};{800 * n + n % 3}\n" for n in range(1, 60)]
    content = "".join(passages)
    if runs:
        each = (f"{run};{row}" for run in range(runs) for row in passages)
        content = "Tirada;Interrupt;t\n" + "".join(each)
    with pytest.raises(InputError, match="only counts, as passages of a light gate do"):
        read_text(tmp_path, content)
