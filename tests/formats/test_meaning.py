"""What a column means, and its unit: as the file states it, else as one test of physics shows."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from pendpipe.cli import main
from pendpipe.formats import ReadOptions, inspect, read

from .decays import Floats, swing

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
