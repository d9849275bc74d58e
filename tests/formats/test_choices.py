"""Guesses give way to options, and where each guess has its limit."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, strategies as st
from scipy.special import ellipk

from pendpipe.analysis.half_cycles import periods
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.formats import (
    ReadOptions,
    circle,
    columns as guess,
    inspect,
    lists,
    read,
    times,
    units,
)
from pendpipe.formats.saturation import clipped_samples
from pendpipe.formats.table import (
    Column,
    derivative_slope,
    evenness,
    find_gaps,
    is_uniform,
    sine_in,
    swing_of,
)
from pendpipe.formats.text import column_of_clock_times
from pendpipe.formats.words import Role
from pendpipe.recording import sample_rate

from ..recordings import white
from ..refusals import refused
from .cases import ANGLE, DEGREES, RATE, TIME, each, read_as, same, swing, text, with_lines

# What is chosen of a file: columns, runs, spans and units, by the reader and by its user.

HEAD = "t (s),theta (rad)\n"
PLAIN = text(TIME, ANGLE, head=HEAD)


# --- columns and runs ------------------------------------------------------------------------
def test_each_guess_gives_way_to_its_option(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text(TIME, ANGLE, 3 * ANGLE, 2 * TIME, head="t,theta,phi,clock\n"))
    for options, values, second_s in (
        (ReadOptions(column="phi"), 3 * ANGLE, 0.02),
        (ReadOptions(channel="1"), ANGLE, 0.02),
        (ReadOptions(column="4:2"), ANGLE, 0.04),
        (ReadOptions(unit="ms:rad"), ANGLE, 2e-5),
        (ReadOptions(sample_rate=200), ANGLE, 0.005),
    ):
        recording = read(path, options)
        np.testing.assert_allclose(recording.values, values, atol=1e-6)
        assert recording.time_s[1] == pytest.approx(second_s)
    part = read(path, ReadOptions(start_s=1.0, stop_s=2.0))
    assert (part.time_s[0], part.time_s[-1]) == (1.0, 2.0)
    assert read(path, ReadOptions(volts_per_radian=3.85)).metadata["volts_per_radian"] == "3.85"
    for options, said in (
        (ReadOptions(column="psi"), "there is no column 'psi'; choose from: t, theta"),
        (ReadOptions(start_s=100.0), "there is no sample between"),
    ):
        with pytest.raises(InputError, match=said):
            read(path, options)


def test_runs_side_by_side_do_not_mix_and_are_offered_by_name(tmp_path: Path) -> None:
    second = [f"{t + 0.5:.4f};{2 * x:.6f}" if t < 12.0 else ";" for t, x in zip(TIME, ANGLE)]  # noqa: B905
    content = "t1;theta1;t2;theta2\n" + each("{:.4f};{:.6f};{}\n", TIME, ANGLE, second)
    recording = read_as(tmp_path, content)
    same(recording)
    assert any("--column: theta2" in note for note in recording.notes)
    for options in (
        ReadOptions(column="theta2"),
        ReadOptions(channel="theta2"),
        ReadOptions(column="4"),
    ):
        other = read(tmp_path / "a.txt", options)
        same(other, 2 * ANGLE[:600])
        assert other.time_s[0] == pytest.approx(0.5)


def test_of_runs_side_by_side_the_last_is_read_where_it_alone_swings(tmp_path: Path) -> None:
    rows = each("{:.4f};{:.6f};{:.4f};{:.6f}\n", TIME, white(5, len(TIME), 1e-3), TIME + 0.5, ANGLE)
    recording = read_as(tmp_path, "t1;theta1;t2;theta2\n" + rows)
    same(recording)
    assert recording.time_s[0] == pytest.approx(0.5)


@pytest.mark.parametrize("order", ["one below the other", "in turn"])
def test_a_long_table_is_read_by_the_quantity_that_it_names(tmp_path: Path, order: str) -> None:
    angles, rates = (
        each(f"{{:.4f}},{name},{{:.6f}}\n", TIME, values).splitlines(keepends=True)
        for name, values in (("theta", ANGLE), ("omega", RATE))
    )
    turns = [line for pair in zip(angles, rates, strict=True) for line in pair]
    lines = [*angles, *rates] if order == "one below the other" else turns
    same(read_as(tmp_path, "time,variable,value\n" + "".join(lines)))
    assert inspect(tmp_path / "a.txt").chosen == "theta"
    same(read(tmp_path / "a.txt", ReadOptions(column="omega")), RATE)


@pytest.mark.parametrize("above", ["", "pendulum three,second run\n", "a,b\nc,d\n"])
def test_a_row_of_units_is_no_row_of_names(tmp_path: Path, above: str) -> None:
    """Whatever stands above the names."""
    recording = read_as(tmp_path, text(TIME, ANGLE, head=above + "clock,theta\ns,rad\n"), "a.csv")
    same(recording)
    assert recording.unit == "rad"
    assert any("theta" in note for note in recording.notes)


def test_trackers_masses_are_named_and_chosen(tmp_path: Path) -> None:
    other = 0.2 * RATE
    columns = (TIME, ANGLE, 0.1 * ANGLE, other, 0.1 * other)
    recording = read_as(
        tmp_path, text(*columns, head=",Right Mass,,Left Mass,\nt,x,y,x,y\n"), "a.csv"
    )
    same(recording)
    note = next(note for note in recording.notes if "is taken from" in note)
    assert "'x of Right Mass'" in note
    assert "x of Left Mass" in note
    for key in ("Left Mass", "x of left mass", "x (2)", "4"):
        chosen = read(tmp_path / "a.csv", ReadOptions(column=key))
        same(chosen, other)
        assert chosen.unit == recording.unit


@pytest.mark.parametrize(("share", "chosen"), [(0.35, "ch1"), (0.31, "ch2")])
def test_of_equal_columns_the_first_that_swings_a_third_as_far(
    tmp_path: Path, share: float, chosen: str
) -> None:
    read_as(tmp_path, text(TIME, share * ANGLE, ANGLE, head="t_s,ch1,ch2\n"))
    assert inspect(tmp_path / "a.txt").chosen == chosen


@pytest.mark.parametrize("head", ["", "t (s),ax (mg),ay (mg)\n"])
def test_the_pull_along_the_rod_gives_way_to_the_swing(tmp_path: Path, head: str) -> None:
    time, phase = TIME[:700], 2 * np.pi * 0.745 * TIME[:700]
    along = 900 * np.exp(-0.1 * time) * np.cos(2 * phase)
    across = 300 * np.exp(-0.05 * time) * np.cos(phase)
    recording = read_as(tmp_path, text(time, along, across, head=head))
    found = recording.values / np.abs(recording.values).max()
    np.testing.assert_allclose(found, across / across.max(), atol=1e-3)
    assert any("twice the frequency" in note for note in recording.notes)


@pytest.mark.parametrize(("level", "said"), [(9.81, True), (0.0, False), (-9.81, True)])
def test_a_pull_along_the_string_swings_twice_in_a_period(
    tmp_path: Path, level: float, said: bool
) -> None:
    time, angle = swing(1500, 30.0)
    pull = level + np.copysign(0.5, level) * np.gradient(angle, time) ** 2
    notes = read_as(tmp_path, text(time, pull, head="Time (s),Acceleration y (m/s^2)\n")).notes
    assert any("twice in a period" in note for note in notes) is said


def test_inspect_prints_the_number_that_column_takes(tmp_path: Path, answer_of: Any) -> None:
    (tmp_path / "a.csv").write_text(text(TIME, ANGLE, 900 + 80 * ANGLE, head="t,theta,foo\n"))
    printed = answer_of(["inspect", str(tmp_path / "a.csv"), "--column", "foo"]).out.splitlines()
    assert "  channel 2   foo (--column 3)" in printed
    level = float(next(line for line in printed if "hangs at" in line).split()[-1])
    assert level == pytest.approx(900.0, abs=1.0)
    assert any(line.endswith("foo, in no known unit") for line in printed)


# --- values ----------------------------------------------------------------------------------
@pytest.mark.parametrize("level", [np.pi, 5.46, -1.2])
def test_a_pendulum_may_hang_anywhere(tmp_path: Path, level: float) -> None:
    values = read_as(tmp_path, text(TIME, ANGLE + level, head=HEAD)).values
    np.testing.assert_allclose(values - values.mean(), ANGLE - ANGLE.mean(), atol=1e-5)


def test_a_swing_beside_the_pictures_corner_is_about_its_own_circle(tmp_path: Path) -> None:
    angle = 0.3 * ANGLE
    x, y = np.rint(206 + 536 * np.sin(angle)), np.rint(113 + 536 * np.cos(angle))
    recording = read_as(tmp_path, text(TIME, x, y, digits=3, head="t,x,y\n"))
    assert recording.unit == "rad"
    np.testing.assert_allclose(recording.values, angle, atol=0.01)
    assert not any("(0, 0)" in note for note in recording.notes)


def test_rows_of_a_hand_draw_no_circle(tmp_path: Path) -> None:
    x, y, hand = 400 + 300 * np.sin(ANGLE), 100 + 300 * np.cos(ANGLE), np.linspace(0.0, 1.0, 20)
    x[:20], y[:20] = 900 - 700 * hand, 700 * hand
    recording = read_as(tmp_path, text(TIME, x, y, digits=3, head="t,x,y\n"))
    assert recording.unit == "rad"
    np.testing.assert_allclose(recording.values[20:], ANGLE[20:], atol=1e-3)


def test_clipped_readings_are_said(tmp_path: Path) -> None:
    for values, said in ((np.clip(ANGLE, -0.3, 0.3), True), (ANGLE, False)):
        notes = read_as(tmp_path, text(TIME, values, head="t,theta\n")).notes
        assert any("range" in note for note in notes) is said


def test_counts_of_an_encoder_within_one_tick_are_merged(tmp_path: Path) -> None:
    count = np.rint(swing(samples=40_000, rate=4000.0)[1] / 0.002).astype(int)
    moved = np.flatnonzero(np.diff(count)) + 1
    stamps = np.floor(moved / 4000.0 / 0.002) * 0.002
    recording = read_as(tmp_path, text(stamps, 0.002 * count[moved], digits=3, head="t,theta\n"))
    assert np.all(np.diff(recording.time_s) > 0)
    assert len(recording) == len(np.unique(stamps))
    assert recording.resolution == pytest.approx(0.002)


# --- times -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (["38:05.6", "39:00.7"], [2285.6, 2340.7]),
        (["38:05,6", "39:00,7"], [2285.6, 2340.7]),
        (["12.50.01", "12.50.02"], [46201.0, 46202.0]),
        (["12.50", "12.51", "12.52"], None),
    ],
)
def test_a_spreadsheets_minutes_and_seconds_are_no_hours(
    cells: list[str], seconds: list[float] | None
) -> None:
    """It shows them as mm:ss.0, whatever the hour; 12.50 is a number."""
    found = column_of_clock_times(cells)
    assert (found is None) if seconds is None else (found == pytest.approx(seconds))


def test_rounded_stamps_are_evened_out(tmp_path: Path) -> None:
    """At 125 Hz, printed to hundredths of a second, every fifth stamp repeats."""
    time, angle = swing(rate=125.0)
    recording = read_as(tmp_path, "t,theta\n" + each("{:.2f},{:.6f}\n", time, angle))
    same(recording, angle, time, within_s=0.006)
    assert np.ptp(np.diff(recording.time_s)) < 1e-9
    stamps = "time,angle_deg\n" + each("5/1/2025 12:00:{:02.0f},{:.4f}\n", TIME // 1, DEGREES)
    (note,) = (note for note in read_as(tmp_path, stamps).notes if "rounded" in note)
    assert "the rate is known to 0." in note


def test_a_clock_that_rounds_is_no_gap(tmp_path: Path) -> None:
    time = np.rint(1e3 * np.arange(1000) * 0.0503) / 1e3
    (tmp_path / "a.csv").write_text(text(time, ANGLE, digits=3, head=HEAD))
    assert inspect(tmp_path / "a.csv").gaps == ()


def test_of_a_clock_that_steps_back_either_part_can_be_read(tmp_path: Path) -> None:
    stamps = np.where(TIME < 12.0, TIME, TIME - 0.11)
    ticks, path = 1e-3 * np.cumsum(20.0 + np.arange(len(TIME)) % 2), tmp_path / "a.csv"
    with pytest.raises(InputError) as fault:
        read_as(tmp_path, text(stamps, ANGLE, ticks, head="t (s),theta (rad),Step\n"), "a.csv")
    assert "--column 'Step:READING'" in str(fault.value)
    stop = float(str(fault.value).split("(--stop ")[1].split(")")[0])
    assert stop == pytest.approx(TIME[599], abs=1e-6)
    same(read(path, ReadOptions(stop_s=stop)), ANGLE[:600])
    later = read(path, ReadOptions(start_s=stop))
    np.testing.assert_allclose(later.values, ANGLE[-len(later) :], atol=1e-5)
    assert len(later) == pytest.approx(395, abs=2)


ORDER = np.arange(len(TIME))
ORDER[0:930:7], ORDER[3:933:7] = ORDER[3:933:7].copy(), ORDER[0:930:7].copy()


@pytest.mark.parametrize(
    "stamps",
    [
        TIME[ORDER],
        np.concatenate((TIME[:500], TIME[200:700] + 0.011)),
        np.where(TIME < 12.0, TIME, TIME - 1.1 * TIME[1]),
    ],
    ids=["rows out of order", "two clocks", "back by little more than a row"],
)
def test_a_time_that_falls_is_refused(tmp_path: Path, stamps: FloatArray) -> None:
    with pytest.raises(InputError, match="the time falls"):
        read_as(tmp_path, text(stamps, ANGLE, head=HEAD))


# --- damage ----------------------------------------------------------------------------------
SPOILT = text(TIME, ANGLE, digits=4, head=HEAD)


def spoil(row: int, line: str) -> Callable[[str], str]:
    return lambda content: with_lines(content, {row: line})


def spoil_two_in_a_hundred(line: str) -> Callable[[str], str]:
    return lambda content: with_lines(
        content, {row: line.format(f"{TIME[row - 1]:.4f}") for row in range(50, 1000, 50)}
    )


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
        (1000, "19.98,abc"),
    ],
)
def test_a_damaged_row_is_left_out_and_counted(tmp_path: Path, number: int, row: str) -> None:
    """What a serial line has garbled; more than one row in a hundred is no accident."""
    recording = read_as(tmp_path, spoil(number, row)(SPOILT))
    np.testing.assert_allclose(recording.time_s, np.delete(TIME, number - 1))
    np.testing.assert_allclose(recording.values, np.delete(ANGLE, number - 1), atol=1e-4)
    assert any("1 " in note and "left out" in note for note in recording.notes)


def test_a_garbled_cell_is_damage_where_text_stands_between_rows(tmp_path: Path) -> None:
    content = spoil(100, "1980,1x.5")("ms,angle (deg)\n" + text(1e3 * TIME, DEGREES, digits=2))
    lines = content.splitlines()
    notes = read_as(tmp_path, "\n".join([*lines[:50], "WARN: buffer 80 %", *lines[50:]])).notes
    assert any("1 damaged row(s) left out (line 102" in note for note in notes)


@pytest.mark.parametrize("cut", [2, 4, 9])
def test_the_last_row_of_a_cut_file_is_no_sample(tmp_path: Path, cut: int) -> None:
    recording = read_as(tmp_path, PLAIN[:-cut])
    assert len(recording) == len(TIME) - 1
    assert any("cut short" in note for note in recording.notes)
    assert len(read_as(tmp_path, PLAIN[:-1])) == len(TIME)


def test_a_row_torn_among_decimal_commas_is_no_row(tmp_path: Path) -> None:
    """``20,0`` of ``20,0,3812`` is neither 20 and 0 nor 20.0: left out and counted."""
    pressure = 1013.0 + np.random.default_rng(1).random(len(TIME))
    rows = each("{:.0f},{:.3f},{:.4f}\n", 1e3 * TIME, pressure, ANGLE).replace(".", ",")
    torn = with_lines("ms,pressure,angle\n" + rows, {301: "6000,1013,25", 501: "10000,1013"})
    recording = read_as(tmp_path, torn)
    np.testing.assert_allclose(recording.values, np.delete(ANGLE, [300, 500]), atol=1e-4)
    assert any("2 damaged row(s)" in note for note in recording.notes)


def test_an_exponent_of_fortran_among_joined_decimal_commas_is_a_number(tmp_path: Path) -> None:
    """``0,1D5`` is 10000, which stands out among angles of 0.5: lost, and the file is read."""
    rows = each("{:.0f},{:.4f}\n", 1e3 * TIME, ANGLE).replace(".", ",")
    recording = read_as(tmp_path, with_lines("ms,angle\n" + rows, {501: "10000,0,1D5"}))
    lost = np.isclose(recording.time_s, 10.0)
    np.testing.assert_allclose(recording.values[~lost], ANGLE[~lost], atol=1e-4)
    assert any("stand out (10000)" in note for note in recording.notes)


def test_two_rows_whose_time_falls_are_refused_without_a_warning(tmp_path: Path) -> None:
    """One good stamp has no steps, of which no median is asked."""
    path = tmp_path / "two.csv"
    path.write_text("time,angle\n1.0,0.3\n0.5,0.2\n")
    with pytest.raises(InputError, match="line 3: the time falls"):
        inspect(path, ReadOptions(column="1:2"))


def test_a_zero_before_every_number_is_whole_or_its_own_column(tmp_path: Path) -> None:
    """``12,0,37856`` is two numbers or three: refused with both, and settled by --decimal."""
    size = 0.38 + 0.08 * np.cos(0.3 * np.arange(400))
    content = each("{},{:.5f}\n", range(0, 8000, 20), size).replace(".", ",")
    with pytest.raises(InputError, match=r"'0 \| 0 \| 46000' or '0 \| 0.46000'; give --decimal"):
        read_as(tmp_path, content)
    for decimal, values in ((",", size), (".", 1e5 * size)):
        found = read(tmp_path / "a.txt", ReadOptions(decimal=decimal)).values
        np.testing.assert_allclose(found, values, atol=2e-5 * values.max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("content", "said"),
    [
        (spoil(7, "0.12,inf")(SPOILT), "line 8: 1 reading(s) that are infinite"),
        (spoil_two_in_a_hundred("nan,0.4")(SPOILT), "line 51: the time is missing or NaN"),
        (spoil_two_in_a_hundred("{},oops")(SPOILT), "line 51: 'oops' is not a number"),
        (
            text(np.where(TIME < 0.11, TIME, TIME - 0.05), ANGLE, digits=4),
            "line 7: the time falls (0.1 is",
        ),
        (HEAD, "no block of rows with numbers"),
        ("", "the file is empty"),
        ("hello\nworld\n", "no reader knows this file: no block of rows"),
        (text(ANGLE, head="theta\n"), "no time column and no sample rate"),
        (text(TIME, head="t\n"), "no column looks like the motion"),
        (text(50.0 * TIME, ANGLE, head="frame,theta (rad)\n"), "'frame' only counts"),
        (text(1e300 * TIME, ANGLE, head=HEAD).replace(".000000", ""), "the times span"),
        (HEAD + each("{},{}\n", TIME, 1e-300 * ANGLE), "the readings span"),
        (
            text(TIME, ANGLE, head="time_s,temperature\n"),
            "angle_rad, volts, displacement_m, reading is needed",
        ),
        ("<table>" + "<" * 900_000, ""),
        ("1" * 900_000, ""),
        ("(1" * 400_000, ""),
        ("1 ± 1,5" * 120_000, ""),
    ],
)
def test_a_fault_is_one_line_with_its_place(tmp_path: Path, content: str, said: str) -> None:
    """Also of signs without end, from each of which a pattern might run on for hours."""
    with refused(said):
        read_as(tmp_path, content)


# What a column of numbers shows by itself, by exact swings on both sides of each limit.

CENTISECONDS = np.arange(4000) * 0.01


def column(values: np.ndarray, name: str = "", unit: str = "", role: Role = "unknown") -> Column:
    return Column(name, unit, np.asarray(values, dtype=float), 1, role=role)


def decay(power: float, first: float = 1.5, rate: float = 0.02) -> np.ndarray:
    """A swing whose period goes as a power of the pendulum's elliptic integral."""
    amplitude = first * np.exp(-rate * CENTISECONDS)
    period = (ellipk(np.sin(amplitude / 2) ** 2) / (np.pi / 2)) ** power
    return amplitude * np.cos(2 * np.pi * np.cumsum(0.01 / period))


@given(
    amplitude=st.floats(1e-6, 1e6),
    cycles=st.integers(5, 200),
    trend=st.floats(-3.0, 3.0),
    phase=st.floats(0.0, 6.0),
)
def test_a_steady_swing_has_its_own_size_and_period(
    amplitude: float, cycles: int, trend: float, phase: float
) -> None:
    angle = 2 * np.pi * cycles * np.arange(4000) / 4000 + phase
    ramp = trend * amplitude * np.linspace(-1, 1, 4000)
    found = swing_of(amplitude * np.sin(angle) + ramp)
    assert found.amplitude == pytest.approx(amplitude / np.sqrt(2), rel=0.06)
    assert found.samples_per_cycle == pytest.approx(4000 / cycles)
    assert found.clear
    assert found.graded == 0.0


def test_of_a_long_column_the_period_is_counted_in_its_own_samples() -> None:
    found = swing_of(np.sin(2 * np.pi * np.arange(100_000) / 1000))
    assert found.samples_per_cycle == pytest.approx(1000, rel=0.01)


def test_noise_is_no_swing_and_neither_is_a_clock() -> None:
    dice = np.random.default_rng(3)
    assert not any(swing_of(dice.standard_normal(n)).clear for n in (30, 100, 1000, 10_000))
    assert swing_of(np.round(CENTISECONDS, 1)).samples_per_cycle == 0.0


@given(period=st.floats(0.3, 5.0), level=st.floats(-10.0, 10.0), size=st.floats(1e-3, 1e3))
def test_periods_and_amplitudes_of_a_steady_swing(period: float, level: float, size: float) -> None:
    lasted, amplitude = periods(
        CENTISECONDS, size * (level + np.sin(2 * np.pi * CENTISECONDS / period + 0.3))
    )
    # A crossing is interpolated on a straight line.
    assert lasted == pytest.approx(np.full(len(lasted), period), rel=0.01)
    assert np.median(amplitude) == pytest.approx(size, rel=0.01)
    # Between turning points, one every half period, lie swings, and a period ends with the third.
    assert abs(len(lasted) - (2 * 39.99 / period - 3)) <= 1.0


@given(spikes=st.integers(8, 15), size=st.floats(1e-3, 1e3))
def test_spikes_of_a_sensor_at_rest_have_no_period(spikes: int, size: float) -> None:
    """Not half a per cent of the readings: the quantiles between which a swing lies are one."""
    at_rest = np.zeros(len(CENTISECONDS))
    at_rest[100 : 100 + 200 * spikes : 200] = size * (-1.0) ** np.arange(spikes)
    assert [len(found) for found in periods(CENTISECONDS, at_rest)] == [0, 0]


@given(power=st.floats(-1.0, 2.0), radians=st.sampled_from([1.0, np.pi / 180]))
def test_the_share_of_sine_is_the_power_with_which_the_period_goes_as_k(
    power: float, radians: float
) -> None:
    """To second order in the amplitude: at 0.6 rad the fourth makes up 1/25 of a share of 2."""
    share = sine_in(*periods(CENTISECONDS, decay(power, 0.6) / radians), radians)
    assert share is not None
    assert share.value == pytest.approx(power, abs=0.1)
    assert not (share.tells and abs(power - 1.0) > 0.5)


def test_small_swings_and_loud_ones_tell_no_unit() -> None:
    noise = np.random.default_rng(5).standard_normal(len(CENTISECONDS))
    found = (
        sine_in(*periods(CENTISECONDS, decay(1.0, 0.05) + 1e-2 * noise), 1.0),
        *(sine_in(*periods(CENTISECONDS[:few], decay(1.0)[:few]), 1.0) for few in (1000, 400)),
    )
    assert [share and share.tells for share in found] == [False, True, None]


@given(ratio=st.floats(1e-3, 1e3), upwards=st.booleans())
def test_a_derivative_is_known_by_its_ratio(ratio: float, upwards: bool) -> None:
    ratio = ratio if upwards else -ratio
    rate = -2 * np.pi * np.sin(2 * np.pi * CENTISECONDS)
    assert derivative_slope(
        CENTISECONDS, np.cos(2 * np.pi * CENTISECONDS), ratio * rate
    ) == pytest.approx(ratio, rel=2e-3)


@pytest.mark.parametrize(("late", "is_one"), [(0.40, True), (0.50, False)])
def test_a_derivative_is_within_a_ninth_of_a_turn_of_its_phase(late: float, is_one: bool) -> None:
    # The correlation of two sines is the cosine of their phase.
    other = np.sin(2 * np.pi * CENTISECONDS + late)
    assert (
        derivative_slope(CENTISECONDS, np.cos(2 * np.pi * CENTISECONDS), other) is not None
    ) == is_one


def with_steps(count: int, places: slice | list[int], step: float) -> np.ndarray:
    """Times at even steps but for some."""
    steps = np.ones(count)
    steps[places] = step
    return np.cumsum(steps)


@pytest.mark.parametrize(
    ("times", "even"),
    [
        # Within an eighth; one in a hundred may be anything.
        (with_steps(1000, slice(None, None, 10), 1.14), True),
        (with_steps(1000, slice(None, None, 10), 1.16), False),
        (with_steps(1000, slice(8), 1.5), True),
        # Gaps of whole intervals are none, but not where a fifth of the intervals are gaps.
        (with_steps(50, [10, 20, 30], 3.08), True),
        (with_steps(50, [10, 20, 30], 3.12), False),
        (with_steps(60, slice(5, None, 6), 2.0), True),
        (with_steps(40, slice(3, None, 4), 2.0), False),
    ],
)
def test_intervals_are_even_within_limits(times: np.ndarray, even: bool) -> None:
    assert is_uniform(times) == even


@given(rate=st.floats(1e-3, 1e6), missing=st.integers(1, 50), at=st.integers(0, 97))
def test_a_gap_is_where_and_as_long_as_rows_are_missing(rate: float, missing: int, at: int) -> None:
    count = np.arange(100.0)
    count[at + 1 :] += missing
    (gap,) = find_gaps(count / rate)
    assert gap.after_sample == at
    assert gap.missing_s == pytest.approx(missing / rate)
    assert sample_rate(count / rate) == pytest.approx(rate)


def test_an_encoder_s_silence_is_no_gap_until_it_is_fifty_times_as_long() -> None:
    steps = np.random.default_rng(2).uniform(0.5, 1.5, 1000)
    usual = float(np.percentile(steps, 99))
    for length, gaps in ((48.0, 0), (52.0, 1)):
        some = steps.copy()
        some[500] = length * usual
        assert len(find_gaps(np.cumsum(some))) == gaps


@given(top=st.floats(0.2, 0.7), cycles=st.integers(8, 20))
def test_flat_tops_are_counted_sample_by_sample(top: float, cycles: int) -> None:
    swing = np.cos(2 * np.pi * cycles * (np.arange(2000) + 0.25) / 2000)
    low = np.minimum(swing, top)
    assert clipped_samples(low, None) == np.count_nonzero(swing >= top)
    assert clipped_samples(-low, None) == np.count_nonzero(swing >= top)
    assert clipped_samples(swing, None) == 0
    # A span beyond all numbers, and a NaN that signals, warn of nothing: `inspect` counts what
    # `read` refuses.
    signals = np.frombuffer(np.uint64(0x7FF0_0000_0000_0001).tobytes())[0]
    assert clipped_samples(np.array([0.0, 1.7e308, 0.1, -1.7e308, signals]), None) == 0
    # A known limit is met to half a step.
    both = np.clip(swing, -0.5, 0.5)
    assert clipped_samples(both, 0.01, (-0.5, 0.5)) == np.count_nonzero(np.abs(swing) >= 0.495)


@given(
    st.lists(st.text("abc", min_size=1, max_size=80), max_size=30, unique=True), st.integers(1, 20)
)
def test_names_are_listed_up_to_a_number_and_a_length(names: list[str], most: int) -> None:
    text = guess.listing(names, most)
    assert len(text) <= most * 62 + 20
    shown = text.split(" and ")[0].split(", ")
    assert len(shown) == max(1, min(most, len(names)))
    for name, said in zip(names, shown, strict=False):
        assert said == name or (len(name) > 60 and len(said) == 60 and said[:57] == name[:57])
    assert (" and " in text) == (len(names) > most)
    assert len(names) <= most or text.endswith(f"and {len(names) - most} more")


@given(st.floats(-1e3, 1e3), st.floats(0.02, 0.98), st.booleans())
def test_one_way_is_the_share_of_steps_that_go_along(
    start: float, share: float, down: bool
) -> None:
    steps = np.where(np.arange(1000) < 1000 * share, 1.0, -1e-4)
    way = np.cumsum(np.append(start, steps)) * (-1.0 if down else 1.0)
    assert lists.one_way(way) == pytest.approx(np.mean(steps > 0))
    assert lists.one_way(np.full(20, start)) == 0.0


@pytest.mark.parametrize(("jitter", "even"), [(0.09, 1.0), (0.11, 0.75)])
def test_steps_within_a_tenth_of_the_usual_are_even(jitter: float, even: float) -> None:
    steps = np.tile([1.0, 1.0, 1.0, 1.0 + jitter], 25)
    assert evenness(np.cumsum(np.append(0.0, steps))) == pytest.approx(even)
    assert evenness(-np.cumsum(np.append(0.0, steps))) == pytest.approx(even)


def test_a_swing_does_not_count_on_however_few_its_readings() -> None:
    """It falls through half the range within one reading, but it comes down more slowly too."""
    swing = 32_768 + np.rint(32_000 * np.sin(2 * np.pi * np.arange(4000) / 4.4))
    assert np.diff(swing).min() < -(2.0**15)
    assert not guess._counted_on(column(swing, role="time")).made


@pytest.mark.parametrize(("least", "lasts"), [(0.4, True), (0.2, False)])
def test_durations_are_times_of_which_none_is_near_zero(least: float, lasts: bool) -> None:
    values = np.array([1.0, 1.1, 0.9, 1.05, least, 1.0, 1.1])
    assert lists._lasts(column(values, role="time")) == lasts
    assert not lists._lasts(column(values))
    assert not lists._lasts(column(np.arange(1.0, 9.0), role="time"))


@given(place=st.integers(0, 5), scale=st.sampled_from([1.0, 180 / np.pi]))
def test_the_printed_digit_is_the_one_that_was_printed(place: int, scale: float) -> None:
    whole = np.random.default_rng(place).integers(-9000, 9000, 500)
    assert units._printed_digit(whole * 10.0**-place / scale, scale) == 10.0**-place
    assert units._printed_digit(decay(1.0) * np.pi, scale) is None


@pytest.mark.slow
@given(bits=st.integers(8, 20), zero=st.floats(-0.2, 0.2))
def test_an_encoder_s_counts_go_on_over_its_zero(bits: int, zero: float) -> None:
    turn = 2.0**bits
    true = np.rint(turn * (zero + 0.3 * np.cos(2 * np.pi * CENTISECONDS)))
    seen = true % turn
    # So many bits are known by their use alone.
    seen[:2] = [0.0, turn - 1.0]
    found, notes = units._over_the_turn(seen.copy())
    assert np.diff(found)[2:] == pytest.approx(np.diff(true)[2:])
    assert notes
    slow = 1000.0 + np.rint(100 * np.cos(CENTISECONDS))
    assert np.array_equal(units._over_the_turn(slow.copy())[0], slow)


@pytest.mark.slow
@given(
    x=st.floats(-3.0, 3.0),
    y=st.floats(0.5, 3.0),
    arm=st.floats(0.3, 2.0),
    wide=st.floats(0.15, 1.2),
)
@example(x=0.5, y=0.5, arm=0.5, wide=0.15)
def test_the_pivot_is_the_centre_of_the_circle(x: float, y: float, arm: float, wide: float) -> None:
    angle = wide * np.exp(-0.02 * CENTISECONDS) * np.cos(2 * np.pi * CENTISECONDS)
    found = circle.pivot_of(x + arm * np.sin(angle), y - arm * np.cos(angle))
    assert found == pytest.approx([x, y], abs=1e-6)
    # About (0, 0) nothing has to be found.
    assert circle.pivot_of(arm * np.sin(angle), -arm * np.cos(angle)) is None


def test_a_wild_place_moves_no_pivot() -> None:
    angle = np.exp(-0.02 * CENTISECONDS) * np.cos(2 * np.pi * CENTISECONDS)
    x, y = 2.0 + np.sin(angle), 3.0 - np.cos(angle)
    x[100], y[200] = 3.5, 1.2
    assert circle.pivot_of(x, y) == pytest.approx([2.0, 3.0], abs=1e-6)


@pytest.mark.parametrize("start", [0.0, 1e16])
def test_blocks_under_one_stamp_are_counted_where_the_clock_has_digits_left(start: float) -> None:
    stamps = times.TimeBase(start + np.repeat(2.0 * np.arange(40), 5), np.arange(200))
    times._count_rows(guess.Choice(None, False, (), ()), stamps)
    even = np.ptp(np.diff(stamps.time_s)) < 1e-9
    assert even == (start == 0.0)
