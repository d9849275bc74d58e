"""Files as phones, oscilloscopes, loggers and other programs write them, each made here."""

from __future__ import annotations

import io
import json
import struct
import time
import wave
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.io import savemat

from pendpipe.errors import InputError
from pendpipe.formats import read
from pendpipe.recording import Recording

from .decays import Floats

LENGTH_M, RATE_HZ = 0.6, 50.0
TIME = np.arange(3000) / RATE_HZ


def _pendulum(_time_s: float, state: Floats) -> list[float]:
    angle, rate = state
    return [rate, -9.81 / LENGTH_M * np.sin(angle) - 0.04 * rate - 0.01 * rate * abs(rate)]


ANGLE, RATE = solve_ivp(_pendulum, (0.0, 60.0), [0.43, 0.0], t_eval=TIME, rtol=1e-8, atol=1e-9).y
DEGREES = np.degrees(ANGLE)
STILL = 1e-3 * np.random.default_rng(5).standard_normal(len(TIME))


def rows(*columns: Floats, sign: str = ",", form: str = ".5f") -> str:
    return "".join(
        sign.join(format(x, form) for x in row) + "\n" for row in zip(*columns, strict=True)
    )


@pytest.fixture
def read_as(tmp_path: Path) -> Callable[..., Recording]:
    def read_content(content: str | bytes, name: str = "a.csv") -> Recording:
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read(path)

    return read_content


def same(recording: Recording, values: Floats = ANGLE, unit: str = "rad") -> None:
    assert recording.unit == unit
    usable = recording.usable
    np.testing.assert_allclose(
        recording.time_s - recording.time_s[0], TIME[: len(recording)], atol=2e-3
    )
    off = (recording.values - values[: len(recording)])[usable]
    assert np.abs(off - np.median(off)).max() < 3e-3 * np.ptp(values)


# --- numbers -------------------------------------------------------------------------------


def test_an_exponent_is_no_unit_where_a_cell_is_empty(read_as: Callable[..., Recording]) -> None:
    # y = -0.6 to -0.54 m: all rows end in E-1, and four frames were lost.
    lines = rows(TIME, LENGTH_M * np.sin(ANGLE), -LENGTH_M * np.cos(ANGLE), sign="\t", form=".5E")
    cells = [line.split("\t") for line in lines.splitlines()]
    for row in (300, 301, 302, 900):
        cells[row][1:] = ["", ""]
    text = "mass_A\t\t\nt\tx\ty\n" + "\n".join("\t".join(row) for row in cells) + "\n"
    recording = read_as(text, "a.txt")
    assert np.flatnonzero(~recording.usable).tolist() == [300, 301, 302, 900]
    same(recording)


@pytest.mark.parametrize(
    ("sign", "quote", "translate"),
    [
        (",", '"', str.maketrans("", "")),
        (";", "", str.maketrans(",.", ".,")),
        (";", "", str.maketrans(",", "'")),
        (";", "", str.maketrans(",.", "\N{NARROW NO-BREAK SPACE},")),
        (";", "", str.maketrans(",", "\N{THIN SPACE}")),
    ],
)
def test_signs_between_thousands(
    read_as: Callable[..., Recording], sign: str, quote: str, translate: dict[int, int]
) -> None:
    text = "".join(
        f"{quote}{f'{1e3 * t:,.1f}'.translate(translate)}{quote}{sign}"
        f"{f'{x:.3f}'.translate(translate)}\n"
        for t, x in zip(TIME, DEGREES, strict=True)
    )
    same(read_as(f"time (ms){sign}angle (deg)\n" + text))


@pytest.mark.parametrize(
    "words",
    [
        {250: "OL", 750: "---", 1250: "overrange", 1750: "#N/A"},
        {250: "#DIV/0!", 750: "#REF!", 1250: "#####", 1750: "#BEZUG!"},
        {250: "n/d", 750: ".", 1250: "k.A.", 1750: "-1.#IND00"},
    ],
)
def test_words_where_there_is_no_reading(
    words: dict[int, str], read_as: Callable[..., Recording]
) -> None:
    lines = rows(TIME, DEGREES, form=".3f").splitlines()
    for row, word in words.items():
        lines[row] = f"{TIME[row]:.3f},{word}"
    recording = read_as("time (s),angle (deg)\n" + "\n".join(lines) + "\n")
    assert np.flatnonzero(~recording.usable).tolist() == list(words)
    same(recording)


# --- times ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "told",
    [
        "Sampling: 50 Hz",
        "# interval between samples: 20 ms",
        "Abtastrate;50 Hz",
        "in air, sampled at 50 Hz",
        "in air, 50 Hz",
    ],
)
def test_a_rate_in_a_remark(read_as: Callable[..., Recording], told: str) -> None:
    same(read_as(f"Pendulum 3\n{told}\nAngle (deg)\n" + rows(DEGREES, form=".3f")))


def test_days_of_a_spreadsheet(read_as: Callable[..., Recording]) -> None:
    recording = read_as(
        "Date;Angle (deg)\n" + rows(45413.5 + TIME / 86400, DEGREES, sign=";", form=".10f")
    )
    same(recording)
    assert any("in days" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("name", "per_second", "begin"),
    [("micros", 1e6, 987654321), ("timestamp", 1e9, 54321987654321)],
)
def test_ticks_since_the_start_are_none_since_1970(
    read_as: Callable[..., Recording], name: str, per_second: float, begin: int
) -> None:
    ticks = begin + np.rint(per_second * TIME).astype(np.int64)
    text = "".join(f"{t},{x:.3f}\n" for t, x in zip(ticks.tolist(), DEGREES, strict=True))
    same(read_as(f"{name},angle (deg)\n" + text))


def test_rows_out_of_order_and_two_clocks_are_refused(
    read_as: Callable[..., Recording],
) -> None:
    order = np.arange(len(TIME))
    order[0:2800:7], order[3:2803:7] = order[3:2803:7].copy(), order[0:2800:7].copy()
    falling = np.concatenate((TIME[:1500], TIME[700:2200] + 0.011))
    for stamps, angle in ((TIME[order], DEGREES[order]), (falling, DEGREES)):
        with pytest.raises(InputError, match="the time falls"):
            read_as("time (s),angle (deg)\n" + rows(stamps, angle))


def test_several_runs_with_a_header_each(read_as: Callable[..., Recording]) -> None:
    blocks = [
        f"Run {number}\nLength (m),0.60\nTime (s),Angle (deg)\n"
        + rows(TIME[:1500], size * DEGREES[:1500])
        for number, size in enumerate((1.0, 0.8, 0.6), start=1)
    ]
    recording = read_as("\n".join(blocks))
    assert len(recording) == 1500
    same(recording)
    assert "3 runs stand below one another" in recording.weak_guesses[0]


def test_seconds_and_their_parts_in_two_columns(read_as: Callable[..., Recording]) -> None:
    for head, begin, per_second in (("sec,nsec", 0, 1e9), ("secs,nsecs", 1714567890, 1e9)):
        whole = begin + np.floor(TIME + 1e-9)
        part = np.rint((TIME + begin - whole) * per_second)
        text = rows(whole, part, DEGREES, form=".10g")
        same(read_as(f"{head},angle (deg)\n" + text))
    clock = [f"12:00:{int(t):02d},{1000 * (t % 1):.0f}" for t in TIME + 1e-6]
    text = "".join(f"{t},{x:.3f}\n" for t, x in zip(clock, DEGREES, strict=True))
    same(read_as("time,ms,angle (deg)\n" + text))


@pytest.mark.parametrize(
    "form", ["[2024-05-01 12:00:{:06.3f}] {:.4f}", "0 days 00:00:{:09.6f},{:.4f}"]
)
def test_times_of_terminals_and_of_pandas(read_as: Callable[..., Recording], form: str) -> None:
    head = "" if form.startswith("[") else "elapsed,angle (rad)\n"
    lines = [form.format(t, x) for t, x in zip(TIME, ANGLE, strict=True)]
    same(read_as(head + "\n".join(lines) + "\n", "a.log"))


def test_a_table_that_lies_on_its_side(read_as: Callable[..., Recording]) -> None:
    lines = [
        ",".join([name, *(f"{x:.4f}" for x in values)])
        for name, values in (("t (s)", TIME), ("theta (rad)", ANGLE))
    ]
    same(read_as("\n".join(lines) + "\n"))


# --- phones and microcontrollers -------------------------------------------------------------


def test_text_between_the_rows_of_a_serial_log(read_as: Callable[..., Recording]) -> None:
    lines = rows(1e3 * TIME + 5120, DEGREES, form=".2f").splitlines()
    for at in range(2800, 0, -700):
        lines.insert(at, "WARN: buffer 80 %")
    text = "Pendulum logger v1.2\nCalibrating... done\nms,angle (deg)\n" + "\n".join(lines) + "\n"
    recording = read_as(text, "a.log")
    same(recording)
    assert any("4 line(s) of text" in note for note in recording.notes)
    # A row with a garbled cell is no remark: it is counted as damaged.
    torn = read_as(text.replace(lines[100], lines[100].split(",")[0] + ",1x.5"), "b.log")
    assert any("1 damaged row(s) left out (line 104" in note for note in torn.notes)


def test_a_phone_in_units_of_g_or_without_any(read_as: Callable[..., Recording]) -> None:
    columns = (TIME, 0.02 * RATE, STILL, 1 + STILL, np.abs(0.02 * RATE))
    recording = read_as("time,gFx,gFy,gFz,TgF\n" + rows(*columns))
    same(recording, 0.02 * RATE, "1")
    assert "gFx" in recording.weak_guesses[0]
    recording = read_as("time,seconds_elapsed,z,y,x\n" + rows(TIME + 3, TIME, STILL, RATE, STILL))
    same(recording, RATE, "1")
    assert "x, y, z" in recording.weak_guesses[0]


def test_a_bob_seen_from_a_pivot_that_is_tracked_too(read_as: Callable[..., Recording]) -> None:
    x, y = 3.2 + STILL, 5.1 - STILL
    bob = x + LENGTH_M * np.sin(ANGLE), y - LENGTH_M * np.cos(ANGLE)
    same(read_as("t,x_pivot,y_pivot,x_bob,y_bob\n" + rows(TIME, x, y, *bob)))


def test_rows_that_were_printed_as_lists(read_as: Callable[..., Recording]) -> None:
    text = rows(TIME, ANGLE, sign=", ").replace("\n", ")\n").splitlines()
    same(read_as("\n".join("(" + line for line in text) + "\n", "a.txt"))


def test_counts_of_an_encoder_are_no_degrees_and_go_on_beyond_its_zero(
    read_as: Callable[..., Recording],
) -> None:
    few = np.rint(ANGLE * 400 / (2 * np.pi))
    recording = read_as("t (s),Right encoder\n" + rows(TIME, few, form=".6g"))
    assert recording.unit == "counts"
    assert "whole numbers" in recording.weak_guesses[0]
    counts = np.rint(ANGLE * 4096 / (2 * np.pi))
    recording = read_as("t (s),raw_angle\n" + rows(TIME, np.mod(counts, 4096), form=".6g"))
    same(recording, counts, "counts")
    assert any("jump by a turn of 4096" in note for note in recording.notes)


def test_a_degree_sign_that_was_decoded_twice(read_as: Callable[..., Recording]) -> None:
    same(read_as("Time (s),Angle [Â°]\n" + rows(TIME, DEGREES, form=".3f")))


def test_remarks_with_a_number_are_no_names(read_as: Callable[..., Recording]) -> None:
    same(read_as("mass 0.15\nlength 0.60\n" + rows(TIME, ANGLE, sign=" ")))


# --- oscilloscopes, LabVIEW, Audacity --------------------------------------------------------


def oscilloscopes() -> dict[str, str]:
    volts = 2.5 * ANGLE
    tektronix = [
        "Record Length,3.0e+03,Points",
        "Sample Interval,2.0e-02,s",
        "Source,CH1,",
        "Vertical Units,V,",
        "Horizontal Units,s,",
        "Model Number,TDS2014C,",
    ]
    right = rows(TIME - 30, volts).splitlines()
    left = tektronix + [",,"] * (len(right) - len(tektronix))
    return {
        "Rigol": "X,CH1,Start,Increment,\nSequence,VOLT,0.0e+00,2.0e-02,\n"
        + "".join(f"{row},{x:.6e},,\n" for row, x in enumerate(volts)),
        "Tektronix": "".join(f"{a},{b},\n" for a, b in zip(left, right, strict=True)),
        "Siglent": "Record Length,Analog:3000\nSample Interval,Analog:2.0e-02\n"
        "Vertical Units,CH1:V,CH2:V\nHorizontal Units,s\nModel Number,SDS1104X-E\n"
        "Source,CH1,CH2\nSecond,Volt,Volt\n" + rows(TIME - 30, volts, STILL),
        "Keysight": "x-axis,1,2\nsecond,Volt,Volt\n" + rows(TIME - 30, volts, STILL, form="+.6E"),
        "LabVIEW": "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nX_Columns\tOne\n"
        "Date\t2023/11/07\nTime\t14:03:11.5\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
        "Samples\t3000\t3000\t\nDate\t2023/11/07\t2023/11/07\t\n"
        "Time\t14:03:11.5\t14:03:11.5\t\nY_Unit_Label\tVolts\tVolts\t\n"
        "X_Dimension\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.02\t0.02\t\n"
        "***End_of_Header***\t\t\t\nX_Value\tVoltage_0\tVoltage_1\tComment\n"
        + rows(TIME, volts, STILL, sign="\t").replace("\n", "\t\n"),
    }


@pytest.mark.parametrize("maker", oscilloscopes())
def test_volts_of_an_oscilloscope(read_as: Callable[..., Recording], maker: str) -> None:
    same(read_as(oscilloscopes()[maker]), 2.5 * ANGLE, "V")


def test_samples_that_audacity_exports(read_as: Callable[..., Recording]) -> None:
    head = (
        "Sample Rate: 50 Hz. Sample values on linear scale.\n"
        "Length processed: 3000 samples, 60.00000 seconds.\n\n"
    )
    recording = read_as(head + rows(TIME, 0.7 * ANGLE, sign="\t"), "a.txt")
    same(recording, 0.7 * ANGLE, recording.unit)
    assert recording.weak_guesses


# --- arrays with names -----------------------------------------------------------------------


def arrays() -> dict[str, bytes]:
    pairs = list(zip(TIME.round(3).tolist(), ANGLE.round(6).tolist(), strict=True))
    packed, plain, old = io.BytesIO(), io.BytesIO(), io.BytesIO()
    np.savez(packed, time=TIME, angle_deg=DEGREES)
    np.save(plain, np.column_stack([TIME, ANGLE]))
    savemat(old, {"t": TIME, "theta": ANGLE}, format="4")
    log = {"unit": "deg", "data": {"time_s": TIME.tolist(), "angle_deg": [None, *DEGREES[1:]]}}
    clock = [f"2024-05-01T12:00:{t:06.3f}Z" for t in TIME[:2900]]
    return {
        "lines.jsonl": "".join(json.dumps({"t": t, "theta": x}) + "\n" for t, x in pairs).encode(),
        "records.json": json.dumps([{"time": t, "angle_rad": x} for t, x in pairs]).encode(),
        "arrays.json": json.dumps(log).encode(),
        "clock.json": json.dumps({"timestamp": clock, "angle_rad": ANGLE[:2900].tolist()}).encode(),
        "packed.npz": packed.getvalue(),
        "plain.npy": plain.getvalue(),
        "version4.mat": old.getvalue(),
    }


@pytest.mark.parametrize("name", arrays())
def test_arrays_with_names(read_as: Callable[..., Recording], name: str) -> None:
    recording = read_as(arrays()[name], name)
    recording.values[~recording.usable] = np.nan
    same(recording)


def test_hdf5_and_matlab_73(read_as: Callable[..., Recording], tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("run1")
        group.create_dataset("time", data=TIME).attrs["units"] = "s"
        group.create_dataset("phi", data=DEGREES).attrs["units"] = "deg"
    same(read(tmp_path / "a.h5"))
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file.create_dataset("t", data=TIME[None, :])
        file.create_dataset("theta", data=ANGLE[None, :])
    content = bytearray((tmp_path / "a.mat").read_bytes())
    content[:19], content[124:128] = b"MATLAB 7.3 MAT-file", b"\x00\x02IM"
    same(read_as(bytes(content), "b.mat"))


def sound(samples: Floats, rate: int) -> bytes:
    stream = io.BytesIO()
    with wave.open(stream, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(np.rint(32767 * samples).astype("<i2").tobytes())
    return stream.getvalue()


def test_a_swing_as_sound_and_as_the_strength_of_a_tone(
    read_as: Callable[..., Recording],
) -> None:
    same(read_as(sound(ANGLE, 50), "a.wav"), ANGLE, "1")
    time = np.arange(60 * 8000) / 8000
    strength = 0.5 + np.interp(time, TIME, ANGLE)
    recording = read_as(sound(strength * np.sin(2 * np.pi * 1000 * time), 8000), "b.wav")
    expected = np.interp(recording.time_s + 0.0025, time, strength) / np.sqrt(2)
    np.testing.assert_allclose(recording.values, expected, atol=2e-3)
    assert any("a tone whose strength swings" in note for note in recording.notes)


def old_workbook(cells: list[list[str | float]]) -> bytes:
    """An .xls of one sheet, byte by byte: BIFF8 records in an OLE container."""

    def record(kind: int, content: bytes) -> bytes:
        return struct.pack("<HH", kind, len(content)) + content

    sheet = record(0x809, struct.pack("<HHHHII", 0x600, 0x10, 0, 1997, 0, 6))
    for row, values in enumerate(cells):
        for column, value in enumerate(values):
            place = struct.pack("<HHH", row, column, 0)
            if isinstance(value, str):
                text = struct.pack("<HB", len(value), 0) + value.encode("latin-1")
                sheet += record(0x204, place + text)
            else:
                sheet += record(0x203, place + struct.pack("<d", value))
    begin = record(0x809, struct.pack("<HHHHII", 0x600, 0x5, 0, 1997, 0, 6))
    at = len(begin) + 4 + 6 + 2 + 3 + 4
    book = begin + record(0x85, struct.pack("<IHBB", at, 0, 3, 0) + b"Raw") + record(0x0A, b"")
    stream = (book + sheet + record(0x0A, b"")).ljust(4096, b"\0")
    stream += b"\0" * (-len(stream) % 512)
    sectors, fats = len(stream) // 512, 1
    while 128 * fats < sectors + 1 + fats:
        fats += 1
    chain = [*range(1, sectors), 0xFFFFFFFE, 0xFFFFFFFE, *[0xFFFFFFFD] * fats]
    chain += [0xFFFFFFFF] * (128 * fats - len(chain))

    def entry(name: str, kind: int, child: int, start: int, size: int) -> bytes:
        text = (name + "\0").encode("utf-16-le")
        head = text.ljust(64, b"\0") + struct.pack("<HBB", len(text), kind, 1)
        none = 0xFFFFFFFF
        return head + struct.pack("<III36xIII", none, none, child, start, size, 0)

    root = entry("Root Entry", 5, 1, 0xFFFFFFFE, 0)
    folder = root + entry("Workbook", 2, 0xFFFFFFFF, 0, len(stream)) + b"\0" * 256
    header = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 16
    header += struct.pack(
        "<HHHHH6xIIIIIIIII",
        0x3E,
        3,
        0xFFFE,
        9,
        6,
        0,
        fats,
        sectors,
        0,
        4096,
        0xFFFFFFFE,
        0,
        0xFFFFFFFE,
        0,
    )
    places = [*range(sectors + 1, sectors + 1 + fats)]
    header += struct.pack("<109I", *places, *[0xFFFFFFFF] * (109 - fats))
    return header + stream + folder + struct.pack(f"<{len(chain)}I", *chain)


def test_an_old_workbook_as_phyphox_writes_it(read_as: Callable[..., Recording]) -> None:
    pytest.importorskip("xlrd")
    cells: list[list[str | float]] = [["Time (s)", "Tilt (deg)"]]
    cells += [[t, x] for t, x in zip(TIME.tolist(), DEGREES.tolist(), strict=True)]
    same(read_as(old_workbook(cells), "a.xls"))


# --- how people and programs write tables ----------------------------------------------------


def _octave(**columns: Floats) -> str:
    head = "# Created by Octave 6.4.0, Mon May 06 11:02:01 2024 CEST <lab@pc>\n"
    return head + "".join(
        f"# name: {name}\n# type: matrix\n# rows: 3000\n# columns: 1\n"
        + "".join(f" {x:.6f}\n" for x in values)
        + "\n\n"
        for name, values in columns.items()
    )


TABLES = {
    "units in the cells": "t,angle\n"
    + "".join(f"{t:.2f} s,{x:.3f} deg\n" for t, x in zip(TIME, DEGREES, strict=True)),
    "signs of degrees and decimal commas in the cells": "Zeit;Auslenkung\n"
    + "".join(f"{t:.2f} s;{x:.3f}°\n" for t, x in zip(TIME, DEGREES, strict=True)).replace(
        ".", ","
    ),
    "a web page": "<!DOCTYPE html><html><head><title>run</title></head><body><table>"
    "<tr><th>Time (s)</th><th>Angle (deg)</th></tr>\n"
    + "".join(
        f"<tr>\n <td>{t:.2f}</td><td>{x:.3f}</td></tr>" for t, x in zip(TIME, DEGREES, strict=True)
    )
    + "</table></body></html>",
    "columns below one another": _octave(t=TIME, phi=ANGLE),
    "statistics below the table": "Time (s),Angle (deg)\n"
    + rows(TIME, DEGREES)
    + "\nMean,-0.103\nStd. Dev.,9.12\nN,3000\n",
    "numbers of the rows without a name": '"time" "angle"\n'
    + "".join(f'"{n}" {t:.2f} {x:.5f}\n' for n, (t, x) in enumerate(zip(TIME, ANGLE, strict=True))),
    "an error behind every number": "t (s),theta (deg)\n"
    + "".join(f"{t:.2f} ± 0.01,{x:.3f} ± 0.05\n" for t, x in zip(TIME, DEGREES, strict=True)),
    "numbers as NumPy shows them": "t (s), theta (rad)\n"
    + "".join(
        f"np.float64({t:.2f}), np.float64({x:.5f})\n" for t, x in zip(TIME, ANGLE, strict=True)
    ),
    "all rows in one line": "data = ["
    + ", ".join(f"({t:.2f}, {x:.5f})" for t, x in zip(TIME, ANGLE, strict=True))
    + "]\n",
    "the brackets of MATLAB": "% run 3\nA = [\n"
    + "".join(f"  {t:.2f} {x:.5f};\n" for t, x in zip(TIME, ANGLE, strict=True))
    + "];\n",
    "one column with a unit": "Sample rate: 50 Hz\nAngular position (deg)\n" + rows(DEGREES),
}


@pytest.mark.parametrize("kind", TABLES)
def test_angles_in_a_table_with(read_as: Callable[..., Recording], kind: str) -> None:
    same(read_as(TABLES[kind], "a.txt"))


@pytest.mark.parametrize(
    ("head", "encoding"),
    [
        ("时间(s),角度(°)", "gb18030"),
        ("時間[s],角度[deg]", "cp932"),
        ("시간(s),각도(°)", "cp949"),
        ("Время (с),Угол (град)", "cp1251"),
        ("temps (s),élongation (°)", "cp1252"),
    ],
)
def test_headers_in_the_encodings_of_older_programs(
    read_as: Callable[..., Recording], head: str, encoding: str
) -> None:
    recording = read_as((head + "\n" + rows(TIME, DEGREES)).encode(encoding))
    same(recording)
    assert not recording.weak_guesses


def test_runs_beside_one_another_may_share_their_time(read_as: Callable[..., Recording]) -> None:
    head = "time (s),run1,run2\n"
    recording = read_as(head + rows(TIME, DEGREES, 0.7 * DEGREES))
    same(recording)
    assert "'run1' (not run2)" in recording.weak_guesses[0]


def test_the_rate_of_the_header_tells_what_a_clock_ticks(
    read_as: Callable[..., Recording],
) -> None:
    head = "// Update Rate: 50.0Hz\nPacketCounter\tSampleTimeFine\tPitch (deg)\n"
    ticks = [f"{900 + n}\t{400_000 + 200 * n}\t{x:.4f}\n" for n, x in enumerate(DEGREES)]
    recording = read_as(head + "".join(ticks), "a.txt")
    same(recording)
    assert not recording.weak_guesses


def test_of_a_phone_the_axis_is_read_that_swings_once_a_cycle(
    read_as: Callable[..., Recording],
) -> None:
    """Along the string a phone is pulled twice in each cycle, and more than across it."""
    along = 9.81 * np.cos(ANGLE) + LENGTH_M * RATE**2
    across = 0.03 * ANGLE
    head = "Time (s),acceleration x (m/s^2),acceleration y (m/s^2),acceleration z (m/s^2)\n"
    recording = read_as(head + rows(TIME, STILL, along, across))
    np.testing.assert_allclose(recording.values, across, atol=1e-5)


def test_a_position_whose_period_grows_as_an_angles_is_one(
    read_as: Callable[..., Recording],
) -> None:
    """Robots publish joints so; a length of 0.6 m swings otherwise."""
    same(read_as("time (s),position\n" + rows(TIME, ANGLE)))
    assert read_as("time (s),position\n" + rows(TIME, LENGTH_M * np.sin(ANGLE))).unit == "1"


def test_an_attribute_of_an_array_may_give_its_rate(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        angle = file.create_dataset("run/angle", data=ANGLE)
        angle.attrs["sample_rate"], angle.attrs["units"] = RATE_HZ, "rad"
    same(read(tmp_path / "a.h5"))


@pytest.mark.parametrize("mark", [-1, 0, 9999])
def test_a_mark_far_from_the_swing_is_no_reading(
    read_as: Callable[..., Recording], mark: int
) -> None:
    """Trackers write -1 where they lose the bob."""
    pixels = 640.0 + 400.0 * np.sin(ANGLE)
    lost = np.isin(np.arange(len(pixels)), (70, 500, 501, 2200))
    recording = read_as("time_s,x_px\n" + rows(TIME, np.where(lost, mark, pixels)))
    assert np.array_equal(recording.usable, ~lost)
    np.testing.assert_allclose(recording.values[~lost], pixels[~lost], atol=1e-5)


def test_axes_of_a_sensor_are_no_position(read_as: Callable[..., Recording]) -> None:
    """An accelerometer shows gravity on one axis: that is no distance from a pivot."""
    across, along = 300.0 * np.sin(ANGLE), np.full(len(ANGLE), -1000.0) + 1e3 * STILL
    recording = read_as("Time (s),x,y,z\n" + rows(TIME, across, along, 1e3 * STILL, form=".0f"))
    np.testing.assert_array_equal(recording.values, np.rint(across))
    assert recording.weak_guesses


@pytest.mark.parametrize(("head", "unit"), [("s_m", "m"), ("Skalenteile", "divisions")])
def test_a_name_may_hold_the_unit(read_as: Callable[..., Recording], head: str, unit: str) -> None:
    same(read_as(f"t (s),{head}\n" + rows(TIME, ANGLE)), unit=unit)


@pytest.mark.parametrize(
    "endless", ["<table>" + "<" * 900_000, "1" * 900_000, "(1" * 400_000, "1 ± 1,5" * 120_000]
)
def test_signs_without_end_are_refused_at_once(
    read_as: Callable[..., Recording], endless: str
) -> None:
    """A pattern that ran on from each of them would take hours."""
    began = time.process_time()
    with pytest.raises(InputError):
        read_as(endless, "a.txt")
    assert time.process_time() - began < 5.0
