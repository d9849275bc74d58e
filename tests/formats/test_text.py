"""The same swing, written as laboratories write it, is read as the same swing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pendpipe.errors import InputError
from pendpipe.formats import ReadOptions, read

from .decays import Floats, swing

TIME, ANGLE = swing()


def table(
    *columns: Floats, sign: str = ",", decimal: str = ".", digits: int = 9, head: str = ""
) -> str:
    """Write columns as text."""
    rows = (sign.join(f"{value:.{digits}f}" for value in row) for row in zip(*columns, strict=True))
    return head + "".join(row.replace(".", decimal) + "\n" for row in rows)


DIALECTS: dict[str, str | bytes] = {
    "plain": table(TIME, ANGLE, head="# source: test\ntime_s,angle_rad\n"),
    "no header, blanks": table(TIME, ANGLE, sign="   "),
    "no header, tabs": table(TIME, ANGLE, sign="\t"),
    "decimal commas and semicolons": table(
        TIME, ANGLE, sign=";", decimal=",", head="Zeit t / s;Auslenkung phi / rad\n"
    ),
    "decimal commas and tabs": table(TIME, ANGLE, sign="\t", decimal=",", head="t\tθ\n"),
    "byte-order mark": "\ufeff" + table(TIME, ANGLE, head="t (s),theta (rad)\n"),
    "UTF-16": table(TIME, ANGLE, head="t (s),theta (rad)\n").encode("utf-16"),
    "Windows line ends": table(TIME, ANGLE, head="time,angle\n").replace("\n", "\r\n"),
    "degree sign in Windows-1252": table(
        TIME, np.degrees(ANGLE), sign=";", head="temps (s);angle (°)\n"
    ).encode("cp1252"),
    "milliseconds and degrees": table(TIME * 1e3, np.degrees(ANGLE), head="millis,angle_deg\n"),
    "microseconds by their steps": table(
        np.rint(TIME * 1e6), np.degrees(10 * ANGLE) / 10, digits=4, head="t,angle_deg\n"
    ).replace(".0000,", ","),
    "time of day": "clock,theta [rad]\n"
    + "".join(
        f"23:59:{50 + t:06.3f},{x:.9f}\n" if t < 10 else f"00:00:{t - 10:06.3f},{x:.9f}\n"
        for t, x in zip(TIME, ANGLE, strict=True)
    ),
    "Unix time": table(1.7e9 + TIME, ANGLE, head="timestamp,angle\n"),
    "derivatives beside it": table(
        TIME, np.gradient(ANGLE, TIME), ANGLE, head="t,angular velocity (rad/s),angle (rad)\n"
    ),
    "a comment for a header": table(TIME, ANGLE, sign=" ", head="% recorded by hand\n% t theta\n"),
    "names fewer than columns": table(
        np.zeros_like(TIME), TIME, ANGLE, np.gradient(ANGLE), sign=" ", head="%o v\n"
    ),
    "a row of units": table(TIME, ANGLE, sign="\t", head="Time\tAngle\n[s]\t[rad]\n"),
    "position from the pivot": table(
        TIME, 1.2 * np.sin(ANGLE), -1.2 * np.cos(ANGLE), sign="\t", head="mass_A\nt\tx\ty\n"
    ),
    "position without names": table(TIME, 1.2 * np.sin(ANGLE), -1.2 * np.cos(ANGLE)),
    "image rows count downwards": table(
        TIME, 300 * np.sin(ANGLE), 300 * np.cos(ANGLE), head="t,x [px],y [px]\n"
    ),
    "pi is down": table(TIME, ANGLE + np.pi, head="t,theta\n"),
    "pi is down, wrapped": table(
        TIME, np.where(ANGLE > 0, ANGLE - np.pi, ANGLE + np.pi), head="t,theta\n"
    ),
    "polar angle from the horizontal": table(TIME, np.degrees(ANGLE) - 90, head="t,θ_r\n"),
    "decimal commas in quotes": "t,phi\n"
    + "".join(f'"{t:.3f}","{x:.9f}"\n'.replace(".", ",") for t, x in zip(TIME, ANGLE, strict=True)),
    "rate in the header, no time": table(
        np.degrees(ANGLE), head="start_deg, sample_rate, seconds\n45, 50, 16\n"
    ),
    "rate as a remark": table(ANGLE, head="# Sampling frequency: 0.05 kHz\nangle_rad\n"),
    "PASCO": table(TIME, ANGLE, head='"Time (s) Run #1","Angle (rad) Run #1"\n'),
    "Vernier": table(TIME, ANGLE, head='"Latest: Time (s)","Latest: Angle (rad)"\n'),
    "phyphox": table(
        TIME,
        np.degrees(ANGLE),
        np.zeros_like(TIME),
        head='"Time (s)","Tilt up/down (deg)","Tilt left/right (deg)"\n',
    ),
    "roll among other motions": table(
        TIME, 3 + 0 * TIME, ANGLE, 1e-4 * ANGLE, head="time,x,phi,theta\n"
    ),
    "sequential ASCII": "".join(f"{x:11.8f}\n" for x in ANGLE),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_tells_the_same_swing(tmp_path: Path, dialect: str) -> None:
    text = DIALECTS[dialect]
    path = tmp_path / "recording.txt"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    options = ReadOptions(sample_rate=50) if dialect == "sequential ASCII" else ReadOptions()
    recording = read(path, options)
    assert recording.quantity == "angle_rad"
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], TIME, atol=1e-6)
    # Four digits of a degree are the coarsest that is written above.
    np.testing.assert_allclose(recording.values, ANGLE, atol=1e-6)


def test_runs_side_by_side_do_not_mix(tmp_path: Path) -> None:
    path = tmp_path / "runs.csv"
    rows = ["Time (s) Run #1,Angle (rad) Run #1,Time (s) Run #2,Angle (rad) Run #2"]
    for row in range(len(TIME)):
        second = f"{TIME[row] + 0.5},{5 * ANGLE[row]}" if row < 600 else ","
        rows.append(f"{TIME[row]},{ANGLE[row]},{second}")
    path.write_text("\n".join(rows))
    np.testing.assert_allclose(read(path).values, ANGLE)
    other = read(path, ReadOptions(column="4"))
    np.testing.assert_allclose(other.time_s, TIME[:600] + 0.5)
    np.testing.assert_allclose(other.values, 5 * ANGLE[:600])
    assert any("neither time nor reading" in note for note in other.notes)


@pytest.mark.parametrize(
    ("head", "scale", "unit"),
    [
        ("Gyroscope x (rad/s)", 1.0, "rad/s"),
        ("omega (deg/s)", np.pi / 180, "rad/s"),
        ("Acceleration y (m/s^2)", 1.0, "m/s^2"),
        ("Illuminance (lx)", 1.0, "lx"),
        ("x (px)", 1.0, "pixels"),
        ("ADC (counts)", 1.0, "counts"),
        ("Hall (foo)", 1.0, "foo"),
    ],
)
def test_what_is_no_angle_is_read_in_its_own_unit(
    tmp_path: Path, head: str, scale: float, unit: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(table(TIME, ANGLE, head=f'"Time (s)","{head}"\n'))
    recording = read(path)
    assert (recording.quantity, recording.unit) == ("reading", unit)
    assert recording.as_motion() is recording
    np.testing.assert_allclose(recording.values, scale * ANGLE, atol=1e-9)


@pytest.mark.parametrize(
    ("unit", "factor", "quantity"),
    [
        ("deg", np.pi / 180, "angle_rad"),
        ("mrad", 1e-3, "angle_rad"),
        ("V", 1.0, "volts"),
        ("mV", 1e-3, "volts"),
        ("mm", 1e-3, "displacement_m"),
    ],
)
def test_the_users_unit_goes_before_the_guess(
    tmp_path: Path, unit: str, factor: float, quantity: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(table(TIME, ANGLE, head="t,theta\n"))
    recording = read(path, ReadOptions(unit=unit))
    assert recording.quantity == quantity
    np.testing.assert_allclose(recording.values, factor * ANGLE, atol=1e-9)


def test_every_other_guess_gives_way_too(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(table(TIME, ANGLE, 3 * ANGLE, 2 * TIME, head="t,theta,phi,clock\n"))
    assert read(path, ReadOptions(column="phi")).values[0] == pytest.approx(1.5)
    assert read(path, ReadOptions(channel="1")).values[0] == pytest.approx(0.5)
    assert read(path, ReadOptions(column="4:2")).time_s[1] == pytest.approx(0.04)
    assert read(path, ReadOptions(unit="ms:rad")).time_s[1] == pytest.approx(2e-5)
    assert read(path, ReadOptions(sample_rate=200)).time_s[1] == pytest.approx(0.005)
    part = read(path, ReadOptions(start_s=1.0, stop_s=2.0))
    assert (part.time_s[0], part.time_s[-1]) == (1.0, 2.0)
    assert read(path, ReadOptions(volts_per_radian=3.85)).metadata["volts_per_radian"] == "3.85"


def test_a_decimal_comma_alone_is_no_pair_of_columns(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(table(100 * ANGLE, decimal=",", digits=2))
    recording = read(path, ReadOptions(sample_rate=50, unit="mrad"))
    np.testing.assert_allclose(recording.values, 0.1 * ANGLE, atol=1e-5)


def test_blank_cells_are_missing_rows_and_said(tmp_path: Path) -> None:
    path = tmp_path / "tracker.csv"
    lines = table(TIME, ANGLE, head="t,theta\n").splitlines()
    lines[100] = lines[100].split(",")[0] + ","
    path.write_text("\n".join(lines))
    recording = read(path)
    assert len(recording) == len(TIME)
    assert np.flatnonzero(~recording.usable).tolist() == [99]
    assert any("marked missing" in note for note in recording.notes)


def test_rows_that_repeat_are_dropped_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    lines = table(TIME, ANGLE, head="t,theta\n").splitlines()
    path.write_text("\n".join([*lines[:50], lines[49], *lines[50:]]))
    recording = read(path)
    np.testing.assert_allclose(recording.time_s, TIME)
    assert any("1 row(s) that repeat" in note for note in recording.notes)


def test_rounded_time_stamps_are_evened_out(tmp_path: Path) -> None:
    # 125 Hz printed to hundredths of a second: every fifth stamp repeats.
    time, angle = swing(rate=125.0)
    path = tmp_path / "a.csv"
    rows = (f"{t:.2f},{x:.6f}" for t, x in zip(time, angle, strict=True))
    path.write_text("t,theta\n" + "\n".join(rows))
    recording = read(path)
    assert len(recording) == len(time)
    np.testing.assert_allclose(recording.time_s, time, atol=0.006)
    assert np.ptp(np.diff(recording.time_s)) < 1e-9


def test_counts_of_an_encoder_within_one_tick_are_merged(tmp_path: Path) -> None:
    _, angle = swing(samples=40_000, rate=4000.0)
    count = np.rint(angle / 0.002).astype(int)
    moved = np.flatnonzero(np.diff(count)) + 1
    stamps = np.floor(moved / 4000.0 / 0.002) * 0.002
    path = tmp_path / "a.csv"
    rows = (f"{t:.3f},{0.002 * count[at]:.3f}" for t, at in zip(stamps, moved, strict=True))
    path.write_text("t,theta\n" + "\n".join(rows))
    recording = read(path)
    assert np.all(np.diff(recording.time_s) > 0)
    assert len(recording) == len(np.unique(stamps))
    assert recording.resolution == pytest.approx(0.002)


def spoil(row: int, text: str) -> Callable[[list[str]], list[str]]:
    def spoilt(lines: list[str]) -> list[str]:
        return [*lines[:row], text, *lines[row + 1 :]]

    return spoilt


def spoilt_in_fifty(lines: list[str], row: str) -> list[str]:
    """Spoil two rows in a hundred."""
    return [
        row.format(line.split(",")[0]) if number % 50 == 0 and number else line
        for number, line in enumerate(lines)
    ]


@pytest.mark.parametrize(
    ("number", "row"),
    [
        (7, "0.12,oops"),
        (7, "oops,0.4"),
        (7, "nan,0.4"),
        (1, "oops,0.4"),
        (2, "restarted here"),
        (400, "7.98,0.3\0\0"),
        (400, "7.980.3"),
        (400, "7.98,0.38.00,0.4"),
        (800, "15.98,abc"),
    ],
)
def test_a_damaged_row_is_left_out_and_counted(tmp_path: Path, number: int, row: str) -> None:
    """What a serial line has garbled; more than one row in a hundred is no accident."""
    path = tmp_path / "a.csv"
    lines = table(TIME, ANGLE, digits=4, head="t (s),theta (rad)\n").splitlines()
    path.write_text("\n".join(spoil(number, row)(lines)) + "\n")
    recording = read(path)
    kept = np.delete(np.arange(len(TIME)), number - 1)
    np.testing.assert_allclose(recording.time_s, TIME[kept])
    np.testing.assert_allclose(recording.values, ANGLE[kept], atol=1e-4)
    assert any("1 " in note and "left out" in note for note in recording.notes)


def set_back(lines: list[str], row: int) -> list[str]:
    """Set the clock back by 0.05 s, once."""
    later = (line.split(",") for line in lines[row:])
    return [*lines[:row], *(f"{float(time) - 0.05:.4f},{angle}" for time, angle in later)]


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (lambda lines: set_back(lines, 7), "line 8: the time falls (0.1 is followed by 0.07)"),
        (spoil(7, "0.12,inf"), "line 8: 1 reading(s) that are infinite"),
        (lambda lines: spoilt_in_fifty(lines, "nan,0.4"), "line 51: the time is missing or NaN"),
        (lambda lines: spoilt_in_fifty(lines, "{},oops"), "line 51: 'oops' is no number"),
        (lambda lines: lines[:1], "no block of rows with numbers"),
        (lambda _: [], "the file is empty"),
        (lambda _: ["hello", "world"], "no reader knows this file: no block of rows"),
        (lambda lines: [line.split(",")[1] for line in lines], "no time column and no sample rate"),
        (lambda lines: [line.split(",")[0] for line in lines], "no column looks like the motion"),
    ],
)
def test_a_fault_is_one_line_with_its_place(
    tmp_path: Path, fault: Callable[[list[str]], list[str]], said: str
) -> None:
    path = tmp_path / "a.csv"
    lines = fault(table(TIME, ANGLE, digits=4, head="t,theta\n").splitlines())
    path.write_text("\n".join(lines))
    with pytest.raises(InputError) as caught:
        read(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_plain_header_without_a_reading_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(table(TIME, ANGLE, head="time_s,temperature\n"))
    with pytest.raises(InputError, match="angle_rad, volts, displacement_m, reading is needed"):
        read(path)


def test_a_missing_file_and_a_wrong_column_are_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        read(tmp_path / "absent.csv")
    path = tmp_path / "a.csv"
    path.write_text(table(TIME, ANGLE, head="t,theta\n"))
    with pytest.raises(InputError, match="there is no column 'phi'; choose from: t, theta"):
        read(path, ReadOptions(column="phi"))
    with pytest.raises(InputError, match="there is no sample between"):
        read(path, ReadOptions(start_s=100.0))


def test_a_zero_before_every_number_is_whole_or_its_own_column(tmp_path: Path) -> None:
    """``12,0,37856`` is two numbers or three: refused with both, and settled by --decimal."""
    size = 0.38 + 0.08 * np.cos(0.3 * np.arange(400))
    path = tmp_path / "a.txt"
    path.write_text("".join(f"{20 * n},{x:.5f}\n".replace(".", ",") for n, x in enumerate(size)))
    with pytest.raises(InputError, match=r"'0 \| 0 \| 46000' or '0 \| 0.46000'; give --decimal"):
        read(path)
    np.testing.assert_allclose(read(path, ReadOptions(decimal=",")).values, size, atol=1e-5)
    np.testing.assert_allclose(read(path, ReadOptions(decimal=".")).values, 1e5 * size, atol=1.0)


def test_a_row_torn_among_decimal_commas_is_no_row(tmp_path: Path) -> None:
    """``20,0`` of ``20,0,3812`` is neither 20 and 0 nor 20.0: left out and counted."""
    size = 0.25 * np.cos(0.1 * np.arange(800))
    pressure = 1013.0 + np.random.default_rng(1).random(800)
    columns = zip(20 * np.arange(800), pressure, size, strict=True)
    lines = [f"{t},{p:.3f},{x:.4f}".replace(".", ",") for t, p, x in columns]
    lines[300], lines[500] = "6000,1013,25", "10000,1013"
    path = tmp_path / "a.txt"
    path.write_text("ms,pressure,angle\n" + "\n".join(lines) + "\n")
    recording = read(path)
    kept = np.delete(np.arange(800), [300, 500])
    np.testing.assert_allclose(recording.values, size[kept], atol=1e-4)
    assert any("2 damaged row(s)" in note for note in recording.notes)
