"""Made-up readings in the dress of other laboratories' programs and instruments."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest

from pendpipe.formats import read
from pendpipe.recording import Recording

from .decays import Floats

RATE_HZ, PERIOD_S = 50.0, 1.352
TIME = np.arange(1500) / RATE_HZ
ANGLE = 0.2 * np.exp(-0.03 * TIME) * np.cos(2 * np.pi * TIME / PERIOD_S)
DEGREES = np.degrees(ANGLE)
COUNTS = np.rint(1e5 * ANGLE)
HALF = len(TIME) // 2


def read_as(tmp_path: Path, content: str | bytes, name: str = "a.txt") -> Recording:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read(path)


def same(recording: Recording, values: Floats = ANGLE) -> None:
    assert len(recording) == len(TIME)
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], TIME, atol=1.1e-3)
    np.testing.assert_allclose(recording.values, values, atol=1e-3 * np.ptp(values))


def each(form: str, *columns: Floats) -> str:
    """Write the rows; `form` may hold several lines."""
    return "".join(form.format(*row) for row in zip(*columns, strict=True))


def segments(head: str, foot: str = "") -> str:
    """Two segments of a seismograph, six samples a line."""
    text = ""
    for first in (0, HALF):
        some = COUNTS[first : first + HALF].astype(int).tolist()
        lines = [" ".join(map(str, some[at : at + 6])) for at in range(0, HALF, 6)]
        text += head.format(first / RATE_HZ) + "\n".join(lines) + "\n" + foot
    return text


WHOLE = np.floor(TIME + 1e-9)
NANOSECONDS = np.rint(1e9 * (TIME - WHOLE))
ANGLES = {
    "a serial monitor's clock, and names": "12:34:55.001 -> Ready\n12:34:55.101 -> ms,angle_deg\n"
    + each("12:34:{:06.3f} -> {:.0f},{:.3f}\n", TIME % 60, 1e3 * TIME + 500, DEGREES),
    "topics of a robot": each(
        "header:\n  stamp:\n    sec: {:.0f}\n    nanosec: {:.0f}\n  frame_id: base\nname:\n- arm\n"
        "angle:\n- {:.6f}\neffort: []\n---\n",
        *(1718030736 + WHOLE, NANOSECONDS, ANGLE),
    ),
    "seconds and nanoseconds without names": each(
        "{:.0f},{:.0f},base,arm,{:.6f}\n", 1718030736 + WHOLE, NANOSECONDS, ANGLE
    ),
    "a broker's log": each('lab/arm {{"t": {:.3f}, "angle_deg": {:.4f}}}\n', TIME, DEGREES),
    "attributes": "<run>\n" + each("<row t='{:.3f}' angle_deg='{:.4f}'/>\n", TIME, DEGREES),
    "elements": "<?xml version='1.0'?>\n<run>\n"
    + each("<row>\n<time>{:.3f}</time>\n<angle unit='rad'>{:.5f}</angle>\n</row>\n", TIME, ANGLE)
    + "</run>\n",
    "matrices of Octave": "# Created by Octave 6.4.0\n# name: t\n# type: matrix\n# rows: 1\n "
    + " ".join(f"{t:.3f}" for t in TIME)
    + "\n\n# name: theta_rad\n# type: matrix\n# rows: 1\n "
    + " ".join(f"{x:.5f}" for x in ANGLE),
    "segments of LabVIEW": "LabVIEW Measurement\t\nX_Columns\tOne\n***End_of_Header***\t\n\t\n"
    + "\t\n".join(
        "Channels\t1\t\nDate\t2019/03/05\t\nY_Unit_Label\tdeg\t\nDelta_X\t0.02\t\n"
        "***End_of_Header***\t\t\nX_Value\tArm\tComment\n"
        + each("{:.3f}\t{:.4f}\t\n", TIME[part], DEGREES[part])
        for part in (slice(HALF), slice(HALF, None))
    ),
    "waves of Igor": "IGOR\nWAVES/D\tclock, arm\nBEGIN\n"
    + each("\t{:.3f}\t{:.4f}\n", TIME, DEGREES)
    + 'END\nX SetScale/P x 0,1,"", clock; SetScale y 0,0,"s", clock\n'
    'X SetScale/P x 0,1,"", arm; SetScale y 0,0,"deg", arm\n',
    "a logger of two-digit years": '"Plot Title: arm"\n"#","Date Time, GMT+02:00",'
    '"Tilt, deg (LGR S/N: 1, SEN S/N: 1)"\n'
    + each("{:.0f},05/01/25 12:00:{:06.3f} PM,{:.4f}\n", RATE_HZ * TIME, TIME, DEGREES),
    "a logger's four lines of names": '"TOA5","CR1000"\n"TIMESTAMP","RECORD","Angle"\n"TS","RN",'
    '"deg"\n"","","Smp"\n'
    + each('"2025-05-01 12:00:{:06.3f}",{:.0f},{:.4f}\n', TIME, RATE_HZ * TIME, DEGREES),
    "labels before the header's rows": "Kanal;1;2\nName;Zeit;Winkel\nEinheit;s;Grad\n"
    + each(";{:.3f};{:.4f}\n", TIME, DEGREES).replace(".", ","),
    "months as words": "Time,Angle (deg)\n"
    + each("01-May-2025 12:00:{:06.3f},{:.4f}\n", TIME, DEGREES),
    "dates as C prints them": "Time,Angle (deg)\n"
    + each("Thu May  1 12:00:{:06.3f} 2025,{:.4f}\n", TIME, DEGREES),
    "minutes past the hour": "Time,Angle (deg)\n"
    + "".join(
        f"{int(t // 60) % 60:02d}:{t % 60:06.3f},{x:.4f}\n"
        for t, x in zip(TIME + 3590, DEGREES, strict=True)
    ),
    "hours, minutes and seconds in columns": "hour,minute,second,angle_deg\n"
    + each("12,{:.0f},{:.3f},{:.4f}\n", (1790 + TIME) // 60, (1790 + TIME) % 60, DEGREES),
    "seconds and milliseconds in columns": "s,ms,angle (deg)\n"
    + each("{:.0f},{:.0f},{:.4f}\n", WHOLE, NANOSECONDS / 1e6, DEGREES),
    "times since the row above": "dt (ms),angle (deg)\n" + each("20,{:.4f}\n", DEGREES),
    "a sign that the header lacks": "t (ms)\trate (deg/s)\tangle (deg)\n"
    + each("{:.0f}\t0.0\t{:.4f}\t\n", 1e3 * TIME, DEGREES),
    "an array that was printed": "["
    + each("[{: .8e} {: .8e}]\n ", TIME, 0.3 + ANGLE).rstrip()
    + "]\n",
    "a dash between": "time angle_rad\n" + each("{:.3f} - {:.5f}\n", TIME, ANGLE + 1.0),
}


WITHOUT_UNIT = (
    *("topics of a robot", "seconds and nanoseconds without names"),
    *("elements", "an array that was printed"),
)


@pytest.mark.parametrize("dress", ANGLES)
def test_an_angle_is_read_in_any_dress(tmp_path: Path, dress: str) -> None:
    recording = read_as(tmp_path, ANGLES[dress])
    assert recording.unit == ("1" if dress in WITHOUT_UNIT else "rad")
    level = {"a dash between": 1.0, "an array that was printed": 0.3}.get(dress, 0.0)
    same(recording, ANGLE + level)


OTHERS = {
    "SLIST": (
        segments(
            f"TIMESERIES XX_ARM__BHZ_D, {HALF} samples, 50 sps,"
            " 2025-05-01T12:00:{:09.6f}, SLIST, INTEGER, Counts\n"
        ),
        COUNTS,
    ),
    "GSE2": (
        segments(
            f"WID2 2025/05/01 12:00:{{:06.3f}} ARM   BHZ      INT {HALF:8d}   50.000000   1.00e+00"
            "   1.000 STS-2  -1.0 -1.0\nSTA2  -99.0000 -999.00000 -.999 -.999\nDAT2\n",
            "CHK2   123456\n\n",
        ),
        COUNTS,
    ),
    "SAC": (
        "".join(
            "".join(f"{x:15.7g}" for x in ([0.02] + [-12345.0] * 4 if row == 0 else [-12345.0] * 5))
            + "\n"
            for row in range(14)
        )
        + ("    -12345" * 5 + "\n") * 8
        + "-12345  -12345  -12345  \n" * 8
        + each("{:15.7g}{:15.7g}{:15.7g}{:15.7g}{:15.7g}\n", *COUNTS.reshape(-1, 5).T),
        COUNTS,
    ),
    "two prints a sample": (each("{:.0f}\n{:.1f},7\n", 1e3 * TIME, 1e3 * ANGLE), 1e3 * ANGLE),
    "an oscilloscope's settings": (
        "Record Length,Analog:1500\nSample Rate,50.0\nVertical Offset,CH1:0.00000\n"
        "Horizontal Scale, 0.000010000\nSecond,Volt\n" + each("{:.5f},{:.6f}\n", TIME, ANGLE),
        ANGLE,
    ),
    "a clock of 32 bits without a name": (
        each("{:.0f} {:.0f}\n", np.mod(2.0**32 - 7e6 + 1e6 * TIME, 2.0**32), COUNTS),
        COUNTS,
    ),
}


@pytest.mark.parametrize("dress", OTHERS)
def test_so_are_readings_of_other_kinds(tmp_path: Path, dress: str) -> None:
    content, values = OTHERS[dress]
    same(read_as(tmp_path, content), values)


def test_a_swing_beside_its_own_size_is_read(tmp_path: Path) -> None:
    """The size of an acceleration goes through two cycles in one of the swing."""
    text = "time;ax;ay;az;aT\n" + each(
        "{0:.3f};{1:.5f};0.001;0.002;{2:.5f}\n", TIME, ANGLE, np.abs(ANGLE)
    )
    same(read_as(tmp_path, text.replace(".", ",")))


def test_arrays_of_dates_of_numbered_rows_and_rates_in_attributes(tmp_path: Path) -> None:
    stream = io.BytesIO()
    dates = np.datetime64("2025-05-01T10:00:00") + np.rint(1e6 * TIME).astype("m8[us]")
    np.savez(stream, time=dates, angle_rad=ANGLE)
    same(read_as(tmp_path, stream.getvalue(), "a.npz"))
    columns = {"time": TIME.tolist(), "angle_rad": ANGLE.tolist()}
    numbered = {name: dict(enumerate(values)) for name, values in columns.items()}
    same(read_as(tmp_path, json.dumps(numbered), "a.json"))
    rows = [{"t": t, "angle_rad": x} for t, x in zip(TIME, ANGLE, strict=True)]
    keyed = {"run": {f"-Nx{at:04d}": row for at, row in enumerate(rows)}}
    same(read_as(tmp_path, json.dumps(keyed), "b.json"))
    feeds = [{"t": row["t"], "angle_deg": f"{np.degrees(row['angle_rad']):.4f}"} for row in rows]
    same(read_as(tmp_path, json.dumps({"channel": {"id": 1}, "feeds": feeds}), "c.json"))
    h5py = pytest.importorskip("h5py")
    for where in ("file", "array"):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            array = file.create_dataset("arm", data=ANGLE)
            array.attrs["unit"] = "rad"
            (array if where == "array" else file).attrs["sample_rate_hz"] = RATE_HZ
        same(read(tmp_path / "a.h5"))


def test_rows_of_two_sensors_that_take_turns_stay_rows(tmp_path: Path) -> None:
    arm = [f"{x:.5f}" if row % 2 == 0 else "" for row, x in enumerate(ANGLE)]
    text = "".join(
        f"{t:.3f},{x},{'' if row % 5 else '9.81'}\n"
        for row, (t, x) in enumerate(zip(TIME, arm, strict=True))
    )
    recording = read_as(tmp_path, "Time (s),Angle (rad),Force (N)\n" + text)
    assert np.flatnonzero(recording.usable).tolist() == list(range(0, len(TIME), 2))


def test_a_first_row_glued_to_the_names_is_told(tmp_path: Path) -> None:
    text = "x y0 0.2\n" + each("{:.3f} {:.5f}\n", TIME, ANGLE)
    assert any(
        "names and the first row in one line" in note for note in read_as(tmp_path, text).notes
    )


def test_the_rate_of_rounded_stamps_is_known_as_well_as_they_allow(tmp_path: Path) -> None:
    text = "time,angle_deg\n" + each("5/1/2025 12:00:{:02.0f},{:.4f}\n", WHOLE, DEGREES)
    (note,) = (note for note in read_as(tmp_path, text).notes if "rounded" in note)
    assert "the rate is known to 0.07 %" in note
