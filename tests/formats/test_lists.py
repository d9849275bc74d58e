"""Lists and signals that are no free decay are reported as what they are."""

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pendpipe.analysis.readings import find_step
from pendpipe.arrays import FloatArray
from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.facts import KINDS
from pendpipe.formats import ReadOptions, inspect, read
from pendpipe.formats.saturation import clipped_samples
from pendpipe.formats.table import swing_of
from pendpipe.recording import read_plain

from .cases import WindaqFile, swing

TIME_S = 1.9 * np.arange(24)
SIZE = 0.25 * np.exp(-0.03 * np.arange(24))
TURNS = SIZE * (-1.0) ** np.arange(24)
ERROR = 0.001 + 0.0001 * np.arange(24) % 3


def rows(*columns: FloatArray, sign: str = ",", digits: int = 5) -> str:
    lines = zip(*columns, strict=True)
    return "".join(sign.join(f"{x:.{digits}f}" for x in line) + "\n" for line in lines)


AMPLITUDES = {
    "one side": ("time,theta (rad)\n" + rows(TIME_S, SIZE), "rad", 1.0),
    "no header": (rows(TIME_S, SIZE), "1", 1.0),
    "both sides in turn": ("t (s)\tx (mm)\n" + rows(TIME_S, 1e3 * TURNS, sign="\t"), "m", 1.0),
    "about a ruler's mark": ("t (s),x (cm)\n" + rows(TIME_S, 20 + 100 * TURNS), "m", 1.0),
    "decimal commas": (
        "Zeit (s);Amplitude (°)\n" + rows(TIME_S, 100 * SIZE, sign=";").replace(".", ","),
        "rad",
        100 * np.pi / 180,
    ),
    "errors beside": (
        "t (s),amplitude (deg),error\n" + rows(TIME_S, SIZE, ERROR),
        "rad",
        np.pi / 180,
    ),
    "numbers of the swings": (
        "n,t (s),A (m)\n" + rows(np.arange(24.0), TIME_S, SIZE),
        "m",
        1.0,
    ),
    "speeds at a gate": ("time (s),v (m/s)\n" + rows(TIME_S, SIZE), "m/s", 1.0),
    "our own turning points": (
        "half_cycle,time_s,time_sd_s,angle_rad,angle_sd_rad,level_rad\n"
        + rows(np.arange(24.0), TIME_S, ERROR, TURNS, ERROR, 0.0 * ERROR),
        "rad",
        1.0,
    ),
    "five of them": ("t (s),theta (rad)\n" + rows(TIME_S[::5], SIZE[::5]), "rad", 1.0),
}  # fmt: skip


@pytest.mark.parametrize("layout", AMPLITUDES)
def test_amplitudes_against_time_are_read_as_such(tmp_path: Path, layout: str) -> None:
    content, unit, factor = AMPLITUDES[layout]
    path = tmp_path / "peaks.csv"
    path.write_text(content, encoding="utf-8")
    recording = read(path)
    assert recording.holds_amplitudes
    size, time_s = (a[::5] if layout.startswith("five") else a for a in (SIZE, TIME_S))
    np.testing.assert_allclose(recording.time_s, time_s, atol=1e-6)
    # The level of turning points is known to a fraction of the last loss.
    np.testing.assert_allclose(recording.values, factor * size, atol=3e-4 * factor)
    assert recording.unit == unit
    assert inspect(path).kind == "amplitudes"


def test_a_copy_in_the_plain_form_holds_amplitudes_too(tmp_path: Path) -> None:
    path, copy = tmp_path / "peaks.csv", tmp_path / "copy.csv"
    path.write_text(AMPLITUDES["both sides in turn"][0])
    assert main(["convert", str(path), str(copy)]) == 0
    again = read(copy)
    assert again.holds_amplitudes
    np.testing.assert_allclose(again.values, read(path).values)


@pytest.mark.parametrize("wavers", [0.0, 0.5])
def test_amplitudes_without_times_are_refused_as_amplitudes(tmp_path: Path, wavers: float) -> None:
    count = np.arange(40)
    sizes = 33 * np.exp(-0.03 * count) + wavers * np.sin(2.0 * count)
    path = tmp_path / "a.txt"
    path.write_text("deg\n" + rows(np.rint(2 * sizes) / 2, digits=1))
    with pytest.raises(InputError, match=r"only falls: amplitudes.*no time column.*--sample-rate"):
        read(path)
    assert read(path, ReadOptions(sample_rate=0.5)).holds_amplitudes


LISTS = {
    "periods": "period (s)\n" + rows(1.6 + 0.01 * ERROR),
    "spectrum": "frequency (Hz),power\n" + rows(0.01 * np.arange(1.0, 25.0), SIZE),
    "passages": "".join(f"{n};{800 * n + n % 3}\n" for n in range(1, 60)),
}


@pytest.mark.parametrize("kind", LISTS)
def test_a_list_is_reported_as_what_it_is_by_inspect_and_convert(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], answer_of: Any, kind: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(LISTS[kind])
    word = {"periods": "holds periods", "spectrum": "a spectrum", "passages": "light gate"}[kind]
    assert word in answer_of(["convert", str(path), str(tmp_path / "copy.csv")], 2).err
    status = main(["inspect", str(path), "--json"])
    said = capsys.readouterr()
    assert word in said.out + said.err
    assert status == 2 or json.loads(said.out)["kind"] == kind


STATE = """:ACQUIRE:STOPAFTER RUNSTOP;STATE 1;MODE SAMPLE;NUMAVG 16
:DISPLAY:FORMAT YT;STYLE VECTORS
:CH1:PROBE 1.0E1;SCALE 5.0E-1;POSITION 0.0E0;COUPLING DC
:HORIZONTAL:SCALE 1.0E-2;POSITION 0.0E0
:TRIGGER:MAIN:MODE AUTO;LEVEL 2.4E-1
"""
SETTINGS = "[Channel 1]\nProbe=10\nScale=0.5\nCoupling=DC\n[Time base]\nScale=0.01\nMode=Auto\n"


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("setup.txt", STATE),
        ("a.ini", SETTINGS),
        ("a.set", "\0\1\2\3" * 500),
        ("a.json", json.dumps({"channel": {"scale": 0.5, "coupling": "DC"}, "mode": "auto"})),
    ],
)
def test_saved_settings_of_an_instrument_are_refused(
    tmp_path: Path, name: str, content: str
) -> None:
    path = tmp_path / name
    path.write_text(content)
    for reader in (read, inspect):
        with pytest.raises(InputError, match=r"settings of an instrument.*waveform"):
            reader(path)


T = np.arange(3000) / 50.0


@pytest.mark.parametrize(
    ("values", "beside", "said"),
    [
        (np.sin(5.0 * T), None, "stays the same"),
        (np.sin(5.0 * T) * (1.0 - 0.3 * np.exp(-0.1 * T)), np.sin(5.0 * T), "'drive' beside it"),
        (np.sin(5.0 * T) * np.exp(-0.004 * T), None, ""),
        (np.sin(5.0 * T) * np.exp(-0.004 * T), np.sin(5.0 * T) * (T < 9.0), ""),
    ],
)
def test_a_steady_or_driven_signal_is_reported(
    tmp_path: Path, values: FloatArray, beside: FloatArray | None, said: str
) -> None:
    columns = [T, values] if beside is None else [T, values, beside]
    path = tmp_path / "a.csv"
    path.write_text("t (s),angle (rad)" + ",drive" * (beside is not None) + "\n" + rows(*columns))
    notes = [note for note in read(path).notes if "no free decay" in note]
    assert len(notes) == bool(said)
    assert all(said in note for note in notes)
    assert inspect(path).kind == ("steady or driven" if said else "motion")


def test_a_misspelt_file_is_answered_by_the_nearest_name(tmp_path: Path) -> None:
    (tmp_path / "string-pendulum.csv").write_text("t,deg\n0,1\n")
    with pytest.raises(InputError, match=r"no such file; did you mean 'string-pendulum\.csv'\?"):
        read(tmp_path / "strin-pendulum.csv")
    with pytest.raises(InputError, match="no such file; check the path"):
        read(tmp_path / "rod.mat")


TIME, ANGLE = swing(2000)


@given(digits=st.integers(3, 5), middle=st.floats(-0.02, 0.02))
def test_numbers_of_as_many_digits_each_have_no_step(digits: int, middle: float) -> None:
    """0.0938 and 0.104 are rounded to different places: no bit of a converter is stuck."""
    values = [float(f"{value:.{digits}g}") for value in middle + 0.25 * ANGLE]
    assert find_step(np.array(values)) is None


@given(
    step=st.floats(1e-5, 1e-1), offset=st.floats(-5, 5), decimals=st.sampled_from([None, 4.4, 7.3])
)
def test_the_step_of_any_converter_is_found(
    step: float, offset: float, decimals: float | None
) -> None:
    amplitude = 200 * step
    values = offset + step * np.rint(amplitude / step * ANGLE)
    if decimals is not None:
        # Printed with few digits: a step of the converter is that many of the print.
        quantum = step / decimals
        values = np.rint(values / quantum) * quantum
    assert find_step(values) == pytest.approx(step, rel=2e-2 if decimals else 1e-6)


def test_a_computed_reading_has_no_step() -> None:
    assert find_step(ANGLE) is None
    assert find_step(ANGLE + 1e-4 * np.random.default_rng(1).standard_normal(2000)) is None


def test_one_flat_top_and_one_flat_bottom_are_clipped_but_no_held_readings() -> None:
    time = np.arange(400)
    strong = np.round(np.exp(-0.02 * time) * np.cos(0.25 * time), 3)
    cut = np.clip(strong, -0.6, 0.7)
    assert clipped_samples(cut, 1e-3) == np.sum((cut == -0.6) | (cut == 0.7))
    assert clipped_samples(np.repeat(strong, 4), 1e-3) == 0
    assert clipped_samples(np.repeat(np.round(np.cos(0.25 * time), 1), 4), 0.1) == 0


def test_json_has_the_contracts_form(tmp_path: Path, answer_of: Any) -> None:
    path = tmp_path / "a.WDH"
    counts = np.rint(ANGLE * 20000).astype(np.int64)[:, None]
    events = [0, 0, -1000]
    path.write_bytes(WindaqFile(counts, hires=True, interval_s=0.02, events=events).pack())
    found = json.loads(answer_of(["inspect", "--json", str(path)]).out)
    expected = {
        "made_by": found["made_by"],
        "schema_version": 1,
        "format": "windaq-hires",
        "channels": [{"name": "channel 1", "unit": "Volt"}],
        "samples": 2000,
        "sample_rate_hz": pytest.approx(50.0),
        "uniform": True,
        "duration_s": pytest.approx(39.98),
        "resolution": pytest.approx(10 / 16384 / 4),
        "gaps": [],
        "markers": [
            {"sample": 0, "time_s": 0.0, "comment": ""},
            {"sample": 1000, "time_s": 20.0, "comment": ""},
        ],
        "clipped_samples": 0,
        **{key: found[key] for key in ("warnings", "chosen", "unit", "level", "weak_guesses")},
        "kind": found["kind"],
        "facts": found["facts"],
    }
    told = [tuple(fact[key] for key in ("kind", "value", "how")) for fact in found["facts"]]
    assert told[0] == ("layout", "windaq-hires", "stated")
    assert told[1] == ("reading", "'channel 1'", "stated")
    assert found == expected
    assert list(found) == list(expected)


def test_convert_keeps_samples_constant_and_markers(tmp_path: Path, answer_of: Any) -> None:
    path, out = tmp_path / "a.WDQ", tmp_path / "out.csv"
    counts = np.rint(ANGLE * 8000).astype(np.int64)[:, None]
    path.write_bytes(WindaqFile(counts, interval_s=0.02, events=[0, 0, -1000]).pack())
    assert "a.WDQ" in answer_of(["convert", str(path), str(out), "--volts-per-radian", "3.85"]).err
    plain = read_plain(out)
    np.testing.assert_array_equal(plain.values, read(path).values)
    assert plain.number("volts_per_radian") == 3.85
    assert [mark.sample for mark in inspect(out).markers] == [0, 1000]
    assert inspect(out).format == "plain"


def test_a_fault_ends_with_2_one_line_and_no_file(tmp_path: Path, refusal_of: Any) -> None:
    path, out = tmp_path / "a.csv", tmp_path / "out.csv"
    path.write_text("time_s,angle_rad\n0.0,0.1\n0.1,oops\n")
    refusal_of(["convert", str(path), str(out)])
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("last", [0.5, 0.05, 0.02])
def test_the_cycles_of_a_decay_are_graded(last: float) -> None:
    """Of an exponential decay to 1/20, ln(8.5)/ln(20) of the cycles lie from 0.85 to 0.1 of it."""
    cycle = np.arange(20000) / 100.0
    values = last ** (cycle / cycle[-1]) * np.cos(2.0 * np.pi * cycle)
    lies = math.log(max(last, 0.1) / 0.85) / math.log(last)
    assert swing_of(values).graded == pytest.approx(lies, abs=0.03)


@pytest.mark.parametrize("off", [0.0, 0.05])
def test_a_drive_that_is_switched_on_and_off_is_not_graded(off: float) -> None:
    cycle = np.arange(20000) / 100.0
    size = np.where(cycle % 50.0 < 25.0, 1.0, off)
    assert swing_of(size * np.cos(2.0 * np.pi * cycle)).graded < 0.03


def test_why_prints_a_line_a_decision(tmp_path: Path, answer_of: Any) -> None:
    path = tmp_path / "a.csv"
    rows = "".join(f"{t:.2f};{x:.5f};21\n" for t, x in zip(TIME, ANGLE, strict=True))
    path.write_text(("t [s];theta;temperature\n" + rows).replace(".", ","))
    printed = [line.strip() for line in answer_of(["inspect", "--why", str(path)]).out.splitlines()]
    assert "column 1 't': time, in s" in printed
    assert "column 2 'theta': angle, no unit stated" in printed
    facts = [re.split("  +", line) for line in printed if "  " in line]
    shown = [(kind, value, how) for kind, value, how, *_ in facts]
    layout, unit = (f"shown (p = {KINDS[kind].wrong})" for kind in ("layout", "unit"))
    assert ("layout", "columns separated by semicolons, decimal commas", layout) in shown
    assert ("unit", "rad", unit) in shown
    assert printed[-1] == "so 2000 readings of theta, in rad"


@pytest.mark.parametrize("head", ["Frequency,Amplitude", "f (Hz),Amplitude (rad)"])
def test_a_spectrum_is_refused(tmp_path: Path, head: str) -> None:
    path = tmp_path / "a.csv"
    frequency = np.arange(1.0, 200.0) / 50.0
    size = 1.0 / (1.0 + (20.0 * (frequency - 1.0)) ** 2)
    rows = "".join(f"{f:.3f},{x:.5f}\n" for f, x in zip(frequency, size, strict=True))
    path.write_text(head + "\n" + rows)
    for look in (inspect, read):
        with pytest.raises(InputError, match="a spectrum, no recording of the swing"):
            look(path)
