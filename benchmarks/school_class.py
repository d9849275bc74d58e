"""A class of thirty: files as phones, cameras, rangers, gates and interfaces write them.

    python -m benchmarks.school_class [FOLDER]

Six files of each of five instruments, every pupil with a pendulum of its own, are written and used
as a new user would: the first answer, all to one table, a sheet of each. It prints what that took
(seconds of the clock, and of the processors, which others do not lengthen), and how far T0 and Q
are from the truth, in percent and in their errors.
"""

from __future__ import annotations

import csv
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.analysis.fit.decrement import loss_of
from pendpipe.analysis.torque import swing_phase
from pendpipe.dynamics import Eq8, Release, sample

GRAVITY: Final = 9.81
Floats = np.ndarray[Any, np.dtype[np.float64]]
INSTRUMENTS: Final = ("phyphox", "tracker", "ultrasonic", "photogate", "cassy")
LIMITS_S: Final = {"first answer": 1.0, "thirty files": 15.0, "thirty sheets": 120.0}


def phyphox(law: Eq8, y0: float, rng: np.random.Generator) -> str:
    """Write a gyroscope in the pocket of the pendulum, at 100 Hz, its axis askew."""
    time_s = np.arange(0.0, 60.0, 0.01) + 1e-4 * rng.normal(size=6000)
    late, early = (sample(law, Release(-0.3, y0), time_s + dt) for dt in (1e-4, -1e-4))
    rate = (late - early) / 2e-4
    axes = [k * rate + 3e-3 * rng.normal(size=rate.size) for k in (0.02, 0.999, -0.03)]
    head = '"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)"\n'
    return head + _rows(time_s, *axes, form="{:.9E}")


def tracker(law: Eq8, y0: float, rng: np.random.Generator) -> str:
    """Write the position of a bob seen from the pivot, at 30 pictures a second."""
    time_s = np.arange(0.0, 60.0, 1.0 / 30.0)
    length = GRAVITY / law.angular_frequency**2
    angle = sample(law, Release(-0.3, y0), time_s)
    x = length * np.sin(angle) + 4e-4 * rng.normal(size=angle.size)
    y = -length * np.cos(angle) + 4e-4 * rng.normal(size=angle.size)
    return "mass_A\t\t\nt\tx\ty\n" + _rows(time_s, x, y, form="{:.6E}", sign="\t")


def ultrasonic(law: Eq8, y0: float, rng: np.random.Generator) -> str:
    """Write the distance of a bob from a ranger, in whole millimetres, at 20 Hz."""
    time_s = np.arange(0.0, 60.0, 0.05)
    length = GRAVITY / law.angular_frequency**2
    distance = 0.8 + length * np.sin(sample(law, Release(-0.3, y0), time_s))
    distance += 1e-3 * rng.normal(size=time_s.size)
    return "Time (s),Distance (m)\n" + _rows(time_s, distance, form="{:.3f}")


def photogate(law: Eq8, y0: float, rng: np.random.Generator) -> str:
    """Write the speed of a bob at every passage of a gate at the lowest point."""
    time_s = np.arange(0.0, 200.0, 0.002)
    angle = sample(law, Release(-0.3, y0), time_s)
    passed = np.flatnonzero(angle[:-1] * angle[1:] < 0.0)
    length = GRAVITY / law.angular_frequency**2
    speed = length * np.abs(angle[passed + 1] - angle[passed]) / 0.002
    speed *= 1.0 + 2e-3 * rng.normal(size=speed.size)
    return "Time (s),Speed (m/s)\n" + _rows(time_s[passed], speed, form="{:.4f}")


def cassy(law: Eq8, y0: float, rng: np.random.Generator) -> str:
    """Write the angle of a rotary sensor as CASSY Lab 2 exports it, at 40 Hz."""
    time_s = np.arange(0.0, 60.0, 0.025)
    angle = np.rint(sample(law, Release(-0.3, y0), time_s) / 1e-3 + 0.5 * rng.normal()) * 1e-3
    head = "MIN=0\t-1\nMAX=60\t1\nSCALE=60\t0,5\nDEC=3\t3\n"
    head += 'DEF="Zeit" t / s\t"Winkel" &j / rad\n'
    return head + _rows(time_s, angle, form="{:.3f}", sign="\t").replace(".", ",")


def _rows(*columns: Floats, form: str, sign: str = ",") -> str:
    return "".join(sign.join(map(form.format, row)) + "\n" for row in zip(*columns, strict=True))


WRITERS: Final[dict[str, Callable[[Eq8, float, np.random.Generator], str]]] = {
    name: globals()[name] for name in INSTRUMENTS
}


def make(folder: Path, of_each: int = 6) -> dict[str, tuple[Eq8, float]]:
    """Write the files; return the law and the first amplitude of each."""
    folder.mkdir(parents=True, exist_ok=True)
    made = {}
    for instrument, writer in WRITERS.items():
        for pupil in range(1, of_each + 1):
            rng = np.random.default_rng([INSTRUMENTS.index(instrument), pupil])
            omega = math.sqrt(GRAVITY / rng.uniform(0.3, 1.1))
            b = 0.5 * omega / rng.uniform(120.0, 400.0)
            y0 = rng.uniform(0.12, 0.4)
            law = Eq8(omega, 0.4 * b / y0, 0.0, 0.6 * b, 0.02 * b * y0, "sine")
            name = f"{instrument}-{pupil}.{'txt' if instrument in ('tracker', 'cassy') else 'csv'}"
            (folder / name).write_text(writer(law, y0, rng), encoding="utf-8")
            made[name] = law, y0
    return made


def true_quality(law: Eq8, amplitude: float) -> float:
    """Q of a law at an amplitude in rad."""
    half_s = float(swing_phase(np.array([amplitude, amplitude]), "sine")[0])
    return math.pi * law.angular_frequency / (2.0 * half_s * loss_of(law, amplitude))


def _call(*words: str, folder: Path) -> tuple[str, float, float]:
    """Call pendpipe; return what it prints, the seconds it took, and those of processors."""
    began, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-m", "pendpipe.cli", *words],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if done.returncode:
        print(done.stderr)
    return done.stdout, time.monotonic() - began, spent


def run(folder: Path) -> Iterator[str]:
    """Use the files of a class, and yield what it took and how right it is."""
    made = make(folder)
    files = list(made)
    _, *first = _call("fit", files[0], folder=folder)
    table, *fits = _call("fit", *files, "--out", "class.csv", folder=folder)
    _, *sheets = _call("page", *files, "--out", "class.html", folder=folder)
    yield table
    yield "| | clock (s) | processors (s) | asked, of two free processors (s) |\n|---|---|---|---|"
    for (what, most), (clock, spent) in zip(LIMITS_S.items(), (first, fits, sheets), strict=True):
        yield f"| {what} | {clock:.1f} | {spent:.1f} | {most:g} |"
    yield f"\n{len(list(folder.glob('class_pages/*.html')))} sheets\n"
    yield "| file | light | T0 | Q |\n|---|---|---|---|"
    with (folder / "class.csv").open(encoding="utf-8") as stream:
        for row in csv.DictReader(stream):
            law, _ = made[row["file"]]
            cells = [_off(row, "T0_s", "T0_sd_s", math.tau / law.angular_frequency), ""]
            if row["amplitude_unit"] in ("rad", "m") and row["Q"]:
                # Of a position x = L sin A.
                y, omega = float(row["amplitude"]), law.angular_frequency
                y = y if row["amplitude_unit"] == "rad" else math.asin(y * omega**2 / GRAVITY)
                cells[1] = _off(row, "Q", "Q_sd", true_quality(law, y))
            yield f"| {row['file']} | {row['light']} | {' | '.join(cells)} |"


def _off(row: dict[str, str], name: str, sd: str, truth: float) -> str:
    if row[name] in ("", "nan"):
        return "not shown"
    off = float(row[name]) - truth
    return f"{100.0 * off / truth:+.3f} % ({off / float(row[sd]):+.1f} sd)"


def main() -> None:
    """Use a class's files, in a folder that is kept or in one of its own."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(tempfile.mkdtemp())
    for line in run(folder):
        print(line, flush=True)


if __name__ == "__main__":
    main()
