"""What `inspect` says: uniformity, gaps, step, clipping; and the two commands."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.formats import inspect, read
from pendpipe.formats.table import clipped_samples, swing_of
from pendpipe.recording import find_step, read_plain

from .decays import WindaqFile, swing

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


def test_json_has_the_contracts_form(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.WDH"
    counts = np.rint(ANGLE * 20000).astype(np.int64)[:, None]
    events = [0, 0, -1000]
    path.write_bytes(WindaqFile(counts, hires=True, interval_s=0.02, events=events).pack())
    assert main(["inspect", "--json", str(path)]) == 0
    found = json.loads(capsys.readouterr().out)
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
    }
    assert found == expected
    assert list(found) == list(expected)


def test_convert_keeps_samples_constant_and_markers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "a.WDQ", tmp_path / "out.csv"
    counts = np.rint(ANGLE * 8000).astype(np.int64)[:, None]
    path.write_bytes(WindaqFile(counts, interval_s=0.02, events=[0, 0, -1000]).pack())
    assert main(["convert", str(path), str(out), "--volts-per-radian", "3.85"]) == 0
    assert "a.WDQ" in capsys.readouterr().err
    plain = read_plain(out)
    np.testing.assert_array_equal(plain.values, read(path).values)
    assert plain.number("volts_per_radian") == 3.85
    assert [mark.sample for mark in inspect(out).markers] == [0, 1000]
    assert inspect(out).format == "plain"


def test_a_fault_ends_with_2_one_line_and_no_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "a.csv", tmp_path / "out.csv"
    path.write_text("time_s,angle_rad\n0.0,0.1\n0.1,oops\n")
    assert main(["convert", str(path), str(out)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
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


def test_why_prints_a_line_a_decision(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.csv"
    rows = "".join(f"{t:.2f};{x:.5f};21\n" for t, x in zip(TIME, ANGLE, strict=True))
    path.write_text(("t [s];theta;temperature\n" + rows).replace(".", ","))
    assert main(["inspect", "--why", str(path)]) == 0
    printed = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert "column 1 't': time, in s" in printed
    assert "column 2 'theta': angle, no unit stated" in printed
    assert "columns separated by semicolons, decimal commas" in printed
    assert any(line.startswith("'theta' is in radians: its period") for line in printed)
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
