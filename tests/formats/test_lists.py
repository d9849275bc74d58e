"""Lists and signals that are no recordings of a free decay are reported as what they are."""

import json
from pathlib import Path

import numpy as np
import pytest

from pendpipe.cli import main
from pendpipe.errors import InputError
from pendpipe.formats import ReadOptions, inspect, read

from .decays import Floats

TIME_S = 1.9 * np.arange(24)
SIZE = 0.25 * np.exp(-0.03 * np.arange(24))
TURNS = SIZE * (-1.0) ** np.arange(24)
ERROR = 0.001 + 0.0001 * np.arange(24) % 3


def rows(*columns: Floats, sign: str = ",", digits: int = 5) -> str:
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
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(LISTS[kind])
    word = {"periods": "holds periods", "spectrum": "a spectrum", "passages": "light gate"}[kind]
    assert main(["convert", str(path), str(tmp_path / "copy.csv")]) == 2
    assert word in capsys.readouterr().err
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
    tmp_path: Path, values: Floats, beside: Floats | None, said: str
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
    with pytest.raises(InputError, match=r"no such file; did you mean string-pendulum\.csv\?"):
        read(tmp_path / "strin-pendulum.csv")
    with pytest.raises(InputError, match="no such file; check the path"):
        read(tmp_path / "rod.mat")
