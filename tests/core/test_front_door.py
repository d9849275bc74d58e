"""The front door: recordings, fits, and all that README and pages promise."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from matplotlib.figure import Figure
from pandas import DataFrame

import pendpipe as pp
from pendpipe import cli
from pendpipe.analysis.fit.result import FitResult
from pendpipe.analysis.readings import motion_of
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.facts import Fact
from pendpipe.figures.style import ShownFigure
from pendpipe.process import _AHEAD
from pendpipe.recording import Recording, read_plain, write_plain

from ..recordings import white
from ..refusals import refused

# The lines of the README, the pages and the notebook do what they say.

README = Path(__file__).parents[2] / "README.md"


@pytest.mark.slow
def test_the_lines_of_the_readme_answer(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    mpl.use("Agg")
    time_s = np.arange(3000) / 50.0
    angle_rad = 0.1 * np.exp(-0.01 * time_s) * np.cos(4.0 * time_s) + white(1, 3000, 1e-4)
    lines = README.read_text().split("```python\n")[1].split("```")[0]
    names = {"time_s": time_s, "angle_rad": angle_rad}
    exec(lines, names)
    printed = capsys.readouterr().out
    assert "period" in printed
    assert "nothing is missing" in printed

    fit = names["fit"]
    assert fit["b"].value == pytest.approx(0.01, abs=4.0 * fit["b"].sd)
    frame = fit.to_frame()
    assert frame.loc["b", "value"] == fit.to_dict()["parameters"]["b"]["value"]
    assert (frame.low95 <= frame.value).all()
    assert (frame.value <= frame.high95).all()
    assert fit.plot().axes[0].get_xlabel() == "Time (s)"
    with pytest.raises(pp.errors.InputError, match=r"plot: .*take that of pendpipe\.fit"):
        replace(fit, drawn_by=None).plot()
    fit.save(tmp_path / "data", figures=False)
    assert {path.name for path in (tmp_path / "data").iterdir()} == {
        "fit.json",
        "turning_points.csv",
    }
    fit.save(tmp_path / "fit")
    pp.diagnose(names["recording"]).save(tmp_path / "fit")
    made = {path.name for path in (tmp_path / "fit").iterdir()}
    assert {"fit.json", "turning_points.csv", "fit.svg", "diagnosis.json"} <= made


SET_UP = re.compile(r"\.venv|pip install|\bmake ")
INSTRUMENT = re.compile(r"--port|--anew|^pendpipe open\b")
CAMPAIGN = re.compile(r"^pendpipe campaign\b", re.MULTILINE)


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(README, marks=pytest.mark.slow),
        *sorted((README.parent / "docs").glob("*.md")),
    ],
    ids=lambda page: page.name,
)
def test_the_commands_of_the_pages_run(page: Path, tmp_path: Path) -> None:
    """Those that wait for a device or a browser have options that there are; CI does the set-up.

    A campaign is planned: `tests/workflow` runs one that `init` began. What records takes 2 s.
    """
    blocks = re.findall(
        r"```sh\n(.*?)```",
        page.read_text(encoding="utf-8").replace("--duration 20 ", "--duration 2 "),
        re.DOTALL,
    )
    shutil.copytree(README.parent / "examples", tmp_path / "examples")
    (tmp_path / "data").mkdir()
    time_s = np.arange(600) / 20.0
    angle_rad = 0.1 * np.exp(-0.02 * time_s) * np.cos(4.0 * time_s) + white(1, 600, 1e-3)
    for name in ("swing.csv", "data/rod.csv", "data/string.csv"):
        write_plain(tmp_path / name, pp.Recording(time_s, angle_rad, "angle_rad"))
    angles = "\n".join(f"{0.4 * step:g},{0.1 * step:g}" for step in range(-4, 5))
    (tmp_path / "caliper.csv").write_text(f"volts,angle_rad\n{angles}\n", encoding="utf-8")
    heights = "\n".join(f"{1.42 * cycle:g},{20 - 0.8 * cycle:g}" for cycle in range(15))
    (tmp_path / "ruler.csv").write_text(f"time (s),amplitude (cm)\n{heights}\n", encoding="utf-8")
    tools = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for block in blocks:
        lines = [line for line in block.splitlines() if line.strip() and not SET_UP.search(line)]
        for line in filter(INSTRUMENT.search, lines):
            assert cli.parse(shlex.split(line, comments=True)[1:]).declared
        commands = "\n".join(line for line in lines if not INSTRUMENT.search(line))
        done = subprocess.run(
            ["bash", "-ec", CAMPAIGN.sub("pendpipe campaign -n", commands)],
            cwd=tmp_path,
            env=os.environ | {"PATH": tools, "MPLBACKEND": "Agg"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{block}\n{done.stderr}"


EXAMPLES = Path(__file__).parents[2] / "examples"


def test_every_cell_of_the_notebook_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(EXAMPLES)
    notebook = json.loads((EXAMPLES / "first_steps.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) > 5
    names: dict[str, object] = {}
    for source in cells:
        exec(compile(source, "first_steps.ipynb", "exec"), names)


# Fits of one recording and of many: taken in order, shown, and handed on.


def decay(number: int) -> pp.Recording:
    """A decay of some 70 swings whose damping rate names it."""
    time_s = np.arange(2048) / 30.0
    swing = 0.1 * np.exp(-0.004 * number * time_s) * np.cos(6.0 * time_s)
    return pp.Recording(time_s=time_s, angle_rad=swing + white(number, len(time_s), 1e-4))


REST = pp.Recording(time_s=np.arange(500) / 30.0, angle_rad=np.zeros(500))


@pytest.mark.parametrize("processes", [1, 2])
def test_fits_come_in_the_order_of_the_recordings_and_an_error_in_its_place(
    processes: int,
) -> None:
    given = [decay(1), "no such file.csv", decay(2), REST, decay(3)]
    results = list(pp.fit_many(given, processes=processes))
    for recording, result in zip(given, results, strict=True):
        if isinstance(recording, pp.Recording) and recording is not REST:
            assert not isinstance(result, pp.InputError)
            assert result.to_dict() == pp.fit(recording).to_dict()
    assert isinstance(results[1], pp.InputError)
    assert results[1].place == "no such file.csv"
    assert isinstance(results[3], pp.InputError)
    assert results[3].place.startswith("recording 4")


@pytest.mark.parametrize("processes", [1, 2])
def test_recordings_are_read_as_their_fits_are_taken(processes: int) -> None:
    """A generator of any length: what is in memory depends on the processes alone."""
    read = 0

    def recordings() -> Iterator[pp.Recording]:
        nonlocal read
        for _ in range(10**6):
            read += 1
            yield decay(1)

    fits = pp.fit_many(recordings(), processes=processes)
    for taken, _ in enumerate(islice(fits, 6), start=1):
        assert read <= taken + _AHEAD * processes
    assert isinstance(fits, Iterator)
    fits.close()  # type: ignore[attr-defined]


def test_an_executor_of_the_caller_runs_the_fits_and_is_left_open() -> None:
    """As a cluster's does: it gets no more than it was told that it runs, and outlives the fits."""
    with ThreadPoolExecutor(2) as executor:
        given = [decay(1), "no such file.csv", decay(2)]
        fits = list(pp.fit_many(given, executor=executor, processes=1))
        assert [isinstance(each, pp.InputError) for each in fits] == [False, True, False]
        left = pp.fit_many([decay(1)] * 9, executor=executor, processes=2)
        next(left)
        left.close()  # type: ignore[attr-defined]
        assert executor.submit(int, "3").result() == 3
    with pytest.raises(RuntimeError, match="shutdown"):
        list(pp.fit_many([decay(1)], executor=executor))


def test_options_are_those_of_a_fit_and_a_bar_counts(capsys: pytest.CaptureFixture[str]) -> None:
    (held,) = pp.fit_many([decay(2)], processes=1, fixed={"c": 0.0})
    assert not isinstance(held, pp.InputError)
    assert held["c"].value == 0.0
    assert not capsys.readouterr().err, "no terminal, no bar"
    list(pp.fit_many([decay(1)] * 2, processes=1, progress=True))
    assert "2/2" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "value"), [("processes", 0), ("name", "mine")])
def test_what_makes_no_sense_is_refused_before_a_recording_is_read(
    option: str, value: object
) -> None:
    def unread() -> Iterator[pp.Recording]:
        raise AssertionError
        yield

    with pytest.raises(pp.InputError, match=option):
        pp.fit_many(unread(), **{option: value})  # type: ignore[arg-type]


TIME = np.arange(0.0, 60.0, 0.02)
NOISE = 1e-4


def angle(time_s: FloatArray) -> FloatArray:
    return np.asarray(0.2 * np.exp(-0.02 * time_s) * np.cos(5.0 * time_s + 1.0))


@pytest.fixture(scope="module")
def fit() -> FitResult:
    return pp.fit(TIME, angle(TIME) + white(3, len(TIME), NOISE), restoring="linear")


def test_arrays_degrees_and_a_dataframe_give_the_same_fit(fit: FitResult) -> None:
    values = fit.decay.values
    table = DataFrame({"time_s": fit.decay.time_s, "angle_rad": values})
    for source in (pp.Recording(time_s=fit.decay.time_s, angle_deg=np.degrees(values)), table):
        again = pp.fit(source, restoring="linear")
        assert again["b"].value == pytest.approx(fit["b"].value, rel=1e-6)
    with pytest.raises(pp.InputError, match="give columns time_s and one of"):
        pp.fit(table.rename(columns={"angle_rad": "x"}))


def test_the_prediction_is_the_motion_and_the_residual_the_noise(fit: FitResult) -> None:
    assert np.max(np.abs(fit.predict(TIME) - angle(TIME))) < 0.3 * NOISE
    assert np.std(fit.residual) == pytest.approx(NOISE, rel=0.05)
    # Times in any order.
    some = np.array([10.0, 2.0])
    assert fit.predict(some) == pytest.approx(angle(some), abs=NOISE)
    again = FitResult.from_json(fit.to_dict())
    with pytest.raises(pp.InputError, match="fit the recording anew"):
        again.predict([1.0])


def test_pictures_show_themselves_and_are_drawn_on_axes_of_others(fit: FitResult) -> None:
    picture = fit.plot()
    assert isinstance(picture, ShownFigure)
    assert picture._repr_png_().startswith(b"\x89PNG")
    own = Figure()
    axes = own.subplots()
    assert fit.plot(ax=axes) is own
    assert axes.get_xlabel() == "Time (s)"
    html = fit._repr_html_()
    assert "<dt>misfit</dt>" in html
    assert "Q = " in html


@pytest.mark.parametrize(
    ("option", "value"), [("method", "wavefrom"), ("restoring", "sin"), ("baseline", "eq9")]
)
def test_an_option_that_is_none_is_refused(option: str, value: str) -> None:
    asked: dict[str, Any] = {option: value}
    with pytest.raises(pp.InputError, match=f"{value}' is not a valid choice"):
        pp.fit(TIME, angle(TIME), **asked)


def test_the_help_begins_with_the_five_verbs() -> None:
    first = str(pp.__doc__).split(">>>", maxsplit=1)[0]
    assert all(f"`{verb}`" in first for verb in ("read", "fit", "diagnose", "simulate", "acquire"))


# A recording survives the disk unchanged, and a faulty one is refused with its line.

finite = st.floats(-1e300, 1e300, allow_nan=False)


@given(values=st.lists(finite, min_size=1, max_size=50), start=st.floats(-1e6, 1e6))
@settings(max_examples=50)
def test_every_digit_survives_the_disk(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], start: float
) -> None:
    path = tmp_path_factory.mktemp("plain") / "recording.csv"
    time = start + 0.01 * np.arange(len(values))
    quality = np.arange(len(values), dtype=np.uint8) % 3
    readings = np.where(quality == 2, np.nan, values)
    metadata = {"source": "a: b", "bits": "16"}
    recording = Recording(time, readings, "volts", quality=quality, metadata=metadata)
    write_plain(path, recording)
    again = read_plain(path)
    assert again.usable.tolist() == (quality < 2).tolist()
    np.testing.assert_array_equal(again.time_s, time)
    np.testing.assert_array_equal(again.values, recording.values)
    assert again.quantity == "volts"
    assert dict(again.metadata) == dict(recording.metadata)


def test_volts_become_radians_by_the_sensor_constant(tmp_path: Path) -> None:
    """3.85 V is one radian, and the converter's step shrinks with it."""
    (tmp_path / "v.csv").write_text(
        "# volts_per_radian: 3.85\n# bits: 16\n# range_volts: 10\ntime_s,volts\n0,3.85\n1,0\n"
    )
    motion = motion_of(read_plain(tmp_path / "v.csv"))
    assert motion.values.tolist() == [1.0, 0.0]
    assert motion.resolution == pytest.approx(20 / 2**16 / 3.85, rel=1e-15)


FAULTS = {
    "missing column": ("time,volts\n0,1\n", "line 1", "time_s is missing"),
    "no reading": ("time_s,current\n0,1\n", "line 1", "exactly one of"),
    "two readings": ("time_s,volts,angle_rad\n0,1,2\n", "line 1", "exactly one of"),
    "text in a number": ("time_s,volts\n0,1\n1,two\n", "line 3", "'two' is not a number"),
    "short row": ("time_s,volts\n0,1\n1\n", "line 3", "1 cells, not 2"),
    "time falls": ("time_s,volts\n0,1\n2,1\n1,1\n", "line 4", "does not rise"),
    "time repeats": ("time_s,volts\n0,1\n0,1\n", "line 3", "does not rise"),
    "NaN": ("time_s,volts\n0,1\n1,nan\n", "line 3", "NaN or infinite"),
    "empty": ("", "", "is empty"),
    "only a header": ("time_s,volts\n", "", "no samples"),
    "odd quality": ("time_s,volts,quality\n0,1,7\n", "line 2", "not 0, 1 or 2"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_faulty_file_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, place, said = FAULTS[name]
    path = tmp_path / "faulty.csv"
    path.write_text(text)
    with refused(said, f"{path}, {place}" if place else str(path)):
        read_plain(path)


def test_volts_without_a_sensor_constant_stay_volts_and_say_so() -> None:
    recording = Recording(np.arange(3.0), np.zeros(3), "volts")
    motion = motion_of(recording)
    assert motion.unit == "V"
    assert "--volts-per-radian" in motion.weak_guesses[0]
    assert motion_of(motion).weak_guesses == motion.weak_guesses
    assert motion_of(recording, 2.0).unit == "rad"
    with pytest.raises(InputError, match="the sensor constant is 0"):
        motion_of(
            Recording(np.arange(3.0), np.zeros(3), "volts", metadata={"volts_per_radian": "0"})
        )


def test_arrays_in_memory_are_a_recording() -> None:
    recording = Recording(time_s=[0, 1, 2], volts=[0.1, 0.2, 0.1], volts_per_radian=2.0)
    assert recording.values.dtype == np.float64
    np.testing.assert_array_equal(motion_of(recording).values, [0.05, 0.1, 0.05])


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ({"angle_rad": [1.0, 2.0]}, "3 times and 2 readings"),
        ({"angle_rad": [1.0, 2.0, 3.0], "volts": [1.0, 2.0, 3.0]}, "exactly one quantity"),
        ({}, "exactly one quantity is needed, not none"),
        ({"values": [1.0, 2.0, 3.0], "quantity": "deg"}, "quantity 'deg'"),
        ({"angle_rad": ["a", "b", "c"]}, "angle_rad holds no numbers"),
        ({"angle_rad": [1.0, float("nan"), 3.0]}, "sample 1: 1 value"),
        ({"time_s": [2.0, 1.0, 0.0], "angle_rad": [1.0, 2.0, 3.0]}, "time_s does not rise"),
        ({"time_s": [[0.0, 1.0]], "angle_rad": [1.0, 2.0]}, "2 dimensions"),
    ],
)
def test_arrays_that_are_no_recording_are_refused(arguments: dict, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        Recording(**({"time_s": [0.0, 1.0, 2.0]} | arguments))


def test_a_reading_of_any_unit_keeps_it_in_the_plain_form(tmp_path: Path) -> None:
    recording = Recording(
        np.arange(3.0),
        np.array([4.0, 5.0, 6.0]),
        "reading",
        metadata={"unit": "counts"},
        facts=(Fact("reading", "counts", "guessed", "the column is a guess"),),
    )
    write_plain(tmp_path / "counts.csv", recording)
    again = read_plain(tmp_path / "counts.csv")
    assert (again.quantity, again.unit) == ("reading", "counts")
    assert motion_of(again) is again
    assert again.facts == recording.facts
    assert again.weak_guesses == ("the column is a guess (--column)",)
    assert dict(again.metadata) == {"unit": "counts"}
    np.testing.assert_array_equal(again.values, recording.values)


@given(cut=st.integers(1, 40))
def test_the_last_row_of_a_cut_file_is_no_sample(
    cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Wherever it was cut: a number without its last digits would be a wrong reading."""
    path = tmp_path_factory.mktemp("cut") / "recording.csv"
    time_s = np.arange(10) / 15.0
    write_plain(path, Recording(time_s, np.sin(time_s), "angle_rad"))
    text = path.read_text()
    path.write_text(text[:-cut])
    again = read_plain(path)
    whole = text[:-cut].count("\n") - 2  # the remark of who made it, and the header
    np.testing.assert_array_equal(again.values, np.sin(time_s[:whole]))
    assert len(again.notes) == (0 if text[:-cut].endswith("\n") else 1)


@pytest.mark.parametrize("level", [np.pi, 2 * np.pi, 0.5 * np.pi])
def test_angles_given_as_arrays_hang_at_zero_and_do_not_jump(level: float) -> None:
    time_s = np.arange(400) / 50.0
    angle = 0.8 * np.exp(-0.05 * time_s) * np.cos(4.0 * time_s)
    wrapped = (angle + level + np.pi) % (2 * np.pi) - np.pi
    motion = motion_of(Recording(time_s=time_s, angle_rad=wrapped))
    np.testing.assert_allclose(motion.values, angle, atol=1e-12)
    assert motion_of(motion) is motion
    if level != 2 * np.pi:  # so many turns leave nothing to do
        assert "hangs near 0" in motion.notes[-1]


@pytest.mark.parametrize(
    ("level", "share", "unit", "refused"),
    [
        (9.81, 1.0, "m/s^2", True),
        (-9.7, 1.0, "m/s^2", True),
        (0.2, 1.0, "m/s^2", False),
        (9.81, 1.0, "counts", False),
        (9.81, 0.0, "m/s^2", False),
    ],
)
def test_a_pull_along_the_string_is_refused(
    level: float, share: float, unit: str, refused: bool
) -> None:
    """It swings twice in a period, about g (3 cos x - 2 cos A); an axis along the swing about 0.

    One that hangs near g and whose level does not follow its size may be either.
    """
    time = np.arange(0.0, 20.0, 0.01)
    size = 0.5 * np.exp(-time / 20.0)
    along = 3.0 * np.cos(size * np.cos(3.0 * time)) - 2.0 * np.cos(size)
    pull = level * (share * along + (1.0 - share) * (1.0 + 0.1 * size * np.cos(3.0 * time)))
    phone = Recording(time, pull, "reading", metadata={"unit": unit})
    with (
        pytest.raises(InputError, match=r"twice per period; give the axis along")
        if refused
        else nullcontext()
    ):
        assert len(motion_of(phone).weak_guesses) == (share == 0.0)


def test_a_number_that_a_fit_has_not_is_answered_with_those_that_it_has() -> None:
    fit = pp.fit("examples/rod-pendulum.csv", gravity=9.81)
    assert fit["length"].value == pytest.approx(9.81 * (fit["period"].value / (2.0 * np.pi)) ** 2)
    with pytest.raises(pp.InputError, match=r"there is no such number; give one of a, b, c"):
        print(fit["Z"])
