"""What a column means, its unit and its clock: as the file states, else as one test shows."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from pendpipe.cli import main
from pendpipe.formats import ReadOptions, inspect, read

from .cases import Floats, swing

TIME_S, LARGE_RAD = swing(3000, 50.0, 0.5)
SMALL_RAD = 0.03 * swing(3000, 50.0, 0.0001)[1] / 0.0001
RATE = np.gradient(SMALL_RAD, TIME_S)
NOISE = np.random.default_rng(3).standard_normal((2, len(TIME_S)))
ARM_M = 9.81 / (2.0 * np.pi * 0.8) ** 2
"""Of a pendulum of 0.8 Hz."""


def on_circle(angle: Floats, x0: float, y0: float, arm: float) -> tuple[Floats, Floats]:
    """Positions on a circle about (x0, y0), with noise of 0.2 % of its radius."""
    x, y = arm * np.sin(angle) + 2e-3 * arm * NOISE[0], -arm * np.cos(angle) + 2e-3 * arm * NOISE[1]
    return x0 + x, y0 + y


class Case(NamedTuple):
    """Columns behind the time, under `head`: what is read, of which unit and why."""

    head: str
    columns: tuple[Floats, ...]
    values: Floats
    unit: str = "rad"
    said: str = ""
    guessed: bool = False


CASES = {
    "its rate beside it, in rad/s": Case(
        "t,theta,omega (rad/s)", (np.degrees(SMALL_RAD), RATE), SMALL_RAD, said="by 'omega'"
    ),
    "its rate beside it, in degrees a second": Case(
        "t,theta,omega (deg/s)", (SMALL_RAD, np.degrees(RATE)), SMALL_RAD, said="by 'omega'"
    ),
    "derivative first, nameless": Case(
        "", (np.gradient(LARGE_RAD, TIME_S), LARGE_RAD), LARGE_RAD, said="whose derivative"
    ),
    "derivative second, nameless": Case(
        "", (LARGE_RAD, np.gradient(LARGE_RAD, TIME_S)), LARGE_RAD, said="whose derivative"
    ),
    "period of sin x, radians": Case("t,angle", (LARGE_RAD,), LARGE_RAD, said="is in radians"),
    "period of sin x, degrees": Case(
        "t,angle", (np.degrees(LARGE_RAD),), LARGE_RAD, said="is in degrees"
    ),
    "period of sin x, turns": Case(
        "t,angle", (LARGE_RAD / (2 * np.pi),), LARGE_RAD, said="is in turns"
    ),
    "a circle about (0, 0)": Case(
        "t,x (m),y (m)", on_circle(LARGE_RAD, 0.0, 0.0, ARM_M), LARGE_RAD, said="seen from (0, 0)"
    ),
    "a circle about another place": Case(
        "t,x (cm),y (cm)", on_circle(LARGE_RAD, 30.0, 90.0, 100 * ARM_M), LARGE_RAD,
        said="the centre of their circle",
    ),
    "its length under gravity, with (0, 0) below the pivot": Case(
        "t,x (mm),y (mm)", on_circle(LARGE_RAD, 0.0, 0.2e3 * ARM_M, 1e3 * ARM_M), LARGE_RAD,
        said="the centre of their circle",
    ),
    "nothing": Case("t,theta", (SMALL_RAD,), SMALL_RAD, "1", "(--unit)", guessed=True),
    "a formula's unit in the header": Case(
        "t,x (mm),temperature", (SMALL_RAD, 20.0 + 0.0 * SMALL_RAD), 1e-3 * SMALL_RAD, "m"
    ),
    "uncertainties and a counter beside it": Case(
        "n,t,theta (rad),err",
        (SMALL_RAD, 0.001 + 1e-4 * np.abs(NOISE[0])), SMALL_RAD,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_file_says_or_physics_shows_what_is_read(tmp_path: Path, case: str) -> None:
    head, columns, values, unit, said, guessed = CASES[case]
    count = [np.arange(1.0, len(TIME_S) + 1)] if head.startswith("n,") else []
    lines = zip(*count, TIME_S, *columns, strict=True)
    path = tmp_path / "a.csv"
    path.write_text(f"{head}\n" + "".join(",".join(f"{x:.9f}" for x in r) + "\n" for r in lines))
    recording = read(path)
    assert recording.unit == unit
    # What is seen from a pivot has the noise of the positions.
    atol = 0.02 if "circle" in said or "(0, 0)" in said else 1e-6
    np.testing.assert_allclose(recording.values, values, atol=atol)
    assert said in " ".join((*recording.notes, *recording.weak_guesses))
    assert any("--unit" in guess for guess in recording.weak_guesses) == guessed


@pytest.mark.parametrize("size", [0.01, 3.0, 22.3, 180.0, 1013.0])
@pytest.mark.parametrize("name", ["theta", "position", "", "signal"])
def test_no_size_and_no_step_tells_a_unit(tmp_path: Path, size: float, name: str) -> None:
    """Small swings of any size, about any level, in the steps of an encoder: in their own unit."""
    step = size * 2 * np.pi / 4096
    values = step * np.rint((size + 0.1 * size * SMALL_RAD / SMALL_RAD[0]) / step)
    path = tmp_path / "a.csv"
    lines = "".join(f"{t:.3f},{x:.9g}\n" for t, x in zip(TIME_S, values, strict=True))
    path.write_text((f"t,{name}\n" if name else "") + lines)
    assert inspect(path).unit == "1"


def test_the_first_line_says_which_option_gives_the_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.csv"
    lines = zip(TIME_S, SMALL_RAD, strict=True)
    path.write_text("t,theta\n" + "".join(f"{t:.3f},{x:.9f}\n" for t, x in lines))
    assert main(["inspect", str(path)]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first == "a guess: 'theta' has no unit: analysed in its own (--unit)"
    assert not read(path, ReadOptions(unit="rad")).weak_guesses


CLOCK_S = np.arange(400) / 50.0
CLOCKED_RAD = 0.1 * np.exp(-0.02 * CLOCK_S) * np.cos(2.0 * np.pi * 0.7 * CLOCK_S)


def written(folder: Path, time: np.ndarray, angle: np.ndarray, header: str) -> Path:
    path = folder / "swing.csv"
    rows = "\n".join(f"{t!r},{x!r}" for t, x in zip(time.tolist(), angle.tolist(), strict=True))
    path.write_text(f"{header}\n{rows}\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("unit", "turn"),
    [("deg", 360.0), ("gon", 400.0), ("rev", 1.0), ("rad", 2.0 * math.pi), ("arcmin", 21600.0)],
)
def test_a_turn_is_two_pi_in_every_unit(tmp_path: Path, unit: str, turn: float) -> None:
    angle = CLOCKED_RAD * turn / (2.0 * math.pi)
    found = read(written(tmp_path, CLOCK_S, angle, f"time (s),angle ({unit})"))
    assert found.unit == "rad"
    np.testing.assert_allclose(found.values, CLOCKED_RAD, rtol=1e-12)


@pytest.mark.parametrize("per_second", [1, 10**3, 10**6, 10**9])
def test_a_clock_that_counts_from_a_date_is_read_in_its_own_unit(
    tmp_path: Path, per_second: int
) -> None:
    """Seconds, milliseconds, microseconds or nanoseconds since 1970: known by their size."""
    ticks = (
        1_700_000_000 * per_second + np.round(CLOCK_S * 1000).astype(np.int64) * per_second // 1000
    )
    time = ticks if per_second > 1 else 1_700_000_000.0 + CLOCK_S
    found = read(written(tmp_path, time, CLOCKED_RAD, "timestamp,angle_rad"))
    assert found.time_s[-1] - found.time_s[0] == pytest.approx(CLOCK_S[-1], abs=1e-5)


LONG_S, LONG_RAD = swing(6000, 50.0, 0.5)
RANDOM = np.random.default_rng(5)


def clock(seconds: Floats, form: str) -> list[str]:
    """Times of day by the form's h, m and s."""
    return [form.format(h=int(t // 3600), m=int(t // 60) % 60, s=t % 60) for t in seconds]


def arrival(time: Floats) -> Floats:
    late: Floats = np.maximum.accumulate(time + RANDOM.exponential(0.1, len(time)))
    return late + 1e-6 * np.arange(len(time))


def torn(time: Floats) -> Floats:
    """A clock that counts the full second a row too late."""
    stamps = time.copy()
    stamps[49:-50:50] += 0.89
    return stamps


def slowing(time: Floats) -> Floats:
    return np.where(time < 100.0, np.floor(10.0 * time + 1e-9) / 10.0, time)


class Form(NamedTuple):
    """Stamps in the column `name`; how near to the truth they are read; what is said."""

    stamps: Callable[[Floats], list[str]]
    name: str = "t (s)"
    within_s: float = 0.002
    said: str = ""


FORMS = {
    "rounded": Form(lambda t: [f"{x:.1f}" for x in t], within_s=0.05, said="counted at 50 Hz"),
    "cut": Form(lambda t: [f"{np.floor(10 * x + 1e-9) / 10:.1f}" for x in t], within_s=0.05),
    "of three digits": Form(lambda t: [f"{x:.2E}" for x in t], within_s=0.5, said="rounded"),
    "of whole seconds": Form(lambda t: [f"{int(x + 1e-9)}" for x in t], within_s=0.5),
    "slower behind 100 s": Form(lambda t: [f"{x:.2f}" for x in slowing(t)], within_s=0.1),
    "a block of eight rows": Form(lambda t: [f"{x:.3f}" for x in np.repeat(t[7::8], 8)]),
    "newest first": Form(lambda t: [f"{x:.3f}" for x in t], said="newest row"),
    "a counter of 16 bits": Form(
        lambda t: [f"{(round(1e3 * x) + 40_000) % 2**16}" for x in t], "millis"
    ),
    "a counter of 32 bits": Form(
        lambda t: [f"{(round(1e6 * x) - 9_000_000) % 2**32}" for x in t], "micros"
    ),
    "milliseconds since 1970": Form(
        lambda t: [f"{1_700_000_000_000 + round(1e3 * x)}" for x in t], "TM", said="since 1970"
    ),
    "minutes beyond sixty": Form(lambda t: clock(3540 + t, "{m:02d}:{s:06.3f}"), "time"),
    "times beyond midnight": Form(
        lambda t: clock((86_370 + t) % 86_400, "{h:02d}:{m:02d}:{s:06.3f}"), "time"
    ),
    "dates beyond midnight": Form(
        lambda t: [
            f"2024-02-{28 + int(x >= 86_400)}T{of_day}"
            for x, of_day in zip(
                86_370 + t, clock((86_370 + t) % 86_400, "{h:02d}:{m:02d}:{s:06.3f}"), strict=True
            )
        ],
        "time",
    ),
    "points in the time of day": Form(
        lambda t: clock(54_540 + t, "10/01/2025 {h:02d}.{m:02d}.{s:06.3f}"), "time"
    ),
    "of arrival": Form(
        lambda t: [f"{x:.6f}" for x in arrival(t)], within_s=0.25, said="as of arrival"
    ),
    "one in fifty torn": Form(lambda t: [f"{x:.3f}" for x in torn(t)], said="interpolated"),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_rows_are_read_at_their_times(tmp_path: Path, form: str) -> None:
    stamps, name, within_s, said = FORMS[form]
    # Times of whole milliseconds, at which every stamp above is what the logger would write.
    rows = [f"{a},{x:.5f}\n" for a, x in zip(stamps(LONG_S), LONG_RAD, strict=True)]
    rows = rows[::-1] if form == "newest first" else rows
    path = tmp_path / "a.csv"
    path.write_text(f"{name},theta (rad)\n" + "".join(rows))
    recording = read(path)
    time_s = recording.time_s - recording.time_s[0]
    assert len(recording) == len(LONG_S)
    np.testing.assert_allclose(time_s, LONG_S, atol=within_s)
    np.testing.assert_allclose(recording.values, LONG_RAD, atol=1e-5)
    assert said in " ".join((*recording.notes, *recording.weak_guesses))


def test_true_stamps_of_uneven_rows_stay(tmp_path: Path) -> None:
    kept = np.sort(RANDOM.choice(len(LONG_S), 2800, replace=False))
    lines = zip(LONG_S[kept], LONG_RAD[kept], strict=True)
    path = tmp_path / "a.csv"
    path.write_text("t (s),theta (rad)\n" + "".join(f"{t:.3f},{x:.5f}\n" for t, x in lines))
    np.testing.assert_allclose(read(path).time_s, LONG_S[kept], atol=1e-9)
