"""The Eq. 8 engine against its peers, as ratios in one run: ``python -m benchmarks.engine``.

The reference record: f 0.516 Hz, y0 0.068 rad, b 0.01192 1/s (half hysteretic, half viscous),
a 0.45 1/(rad s), c 1.4e-6 rad/s, 300 s. Contenders take turns, and the medians are compared.
Peers that are not installed are left out.
"""

from __future__ import annotations

import importlib.util
import math
import os
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import peers_engine as peers
from pendpipe.dynamics import (
    Eq8,
    Release,
    sample,
    sample_with_jacobian,
    turning_points,
)

if TYPE_CHECKING:
    from collections.abc import Callable

ROOT = Path(__file__).parents[1]
OMEGA = 2.0 * math.pi * 0.516
MODEL = Eq8(OMEGA, quadratic=0.45, hysteretic=0.00596, viscous=0.00596, coulomb=1.4e-6)
START = Release(0.0, 0.068)
END_S = 300.0
SAMPLES = np.linspace(0.0, END_S, 32768)
FIRST_CALL = """
from pendpipe.dynamics import Eq8, Release, turning_points
turning_points(Eq8(3.0, viscous=0.01), Release(0.0, 0.1), count=100)
"""


@dataclass(frozen=True)
class Row:
    """A measured figure beside its goal.

    Parameters
    ----------
    what
        What was measured.
    value, unit
        The figure.
    goal
        ``">= 30"`` or ``"<= 0.5"``.
    """

    what: str
    value: float
    unit: str
    goal: str

    @property
    def met(self) -> bool:
        """Whether the goal is met."""
        relation, bound = self.goal.split()
        return self.value >= float(bound) if relation == ">=" else self.value <= float(bound)


def rows(rounds: int = 15) -> list[Row]:
    """Measure everything."""
    return [*_speeds(rounds), *_accuracies(), _first_call(rounds)]


def _medians(
    contenders: dict[str, tuple[Callable[[], object], int]], rounds: int
) -> dict[str, float]:
    """Return the median time of each contender (with its number of calls a round), s."""
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for run, _ in contenders.values():
        run()
    for _ in range(rounds):
        for name, (run, calls) in contenders.items():
            for _ in range(calls):
                begin = time.perf_counter()
                run()
                times[name].append(time.perf_counter() - begin)
    return {name: statistics.median(values) for name, values in times.items()}


def _speeds(rounds: int) -> list[Row]:
    """Return the ratios of times."""
    count = turning_points(MODEL, START, until_s=END_S).time_s.size
    ours: dict[str, tuple[Callable[[], object], int]] = {
        "cos": (lambda: np.cos(SAMPLES), 20),
        "map": (lambda: turning_points(MODEL, START, until_s=END_S), 60),
        "clock": (lambda: turning_points(MODEL, START, until_s=END_S, method="clock"), 20),
        "samples": (lambda: sample(MODEL, START, SAMPLES), 20),
        "jacobian": (
            lambda: sample_with_jacobian(MODEL, START, SAMPLES, hysteretic_share=0.5), 20,
        ),
    }  # fmt: skip
    contenders = dict(ours)
    if importlib.util.find_spec("heyoka"):
        contenders["heyoka"] = (peers.heyoka_turning_points(MODEL, START.angle_rad, END_S), 4)
        contenders["heyoka grid"] = (peers.heyoka_samples(MODEL, START.angle_rad, SAMPLES), 2)
    t = _medians(contenders, rounds)
    slow = peers.solve_ivp_turning_points(MODEL, START.angle_rad, count)
    t["solve_ivp"] = _medians({"solve_ivp": (slow, 1)}, 3)["solve_ivp"]
    found = [
        Row(
            "turning points (map) over solve_ivp DOP853", t["solve_ivp"] / t["map"], "x", ">= 10000"
        ),
        Row("32768 samples, time over one np.cos", t["samples"] / t["cos"], "x", "<= 0.5"),
        Row("samples and 7-column Jacobian over np.cos", t["jacobian"] / t["cos"], "x", "<= 3"),
    ]
    if "heyoka" in t:
        found += [
            Row("turning points (map) over heyoka", t["heyoka"] / t["map"], "x", ">= 30"),
            Row("turning points (clock) over heyoka", t["heyoka"] / t["clock"], "x", ">= 5"),
            Row("32768 samples over heyoka's grid", t["heyoka grid"] / t["samples"], "x", ">= 20"),
        ]
    return found


def _accuracies() -> list[Row]:
    """Return the errors against 40 digits, as the tests compute them, and of the samples."""
    found = []
    by_map = sample(MODEL, START, SAMPLES)
    by_clock = sample(MODEL, START, SAMPLES, method="clock")
    points = turning_points(MODEL, START, until_s=END_S)
    envelope = np.interp(SAMPLES, points.time_s, np.abs(points.angle_rad))
    error = float(np.max(np.abs(by_map - by_clock) / envelope))
    found.append(Row("samples, map less clock, over the envelope", error, "", "<= 1e-9"))
    path = ROOT / "tests" / "dynamics" / "reference.py"
    if path.exists() and importlib.util.find_spec("mpmath") and importlib.util.find_spec("pytest"):
        times, angles = _forty_digits(path, points.time_s.size)
        for method in ("map", "clock"):
            own = turning_points(MODEL, START, until_s=END_S, method=method)  # type: ignore[arg-type]
            amplitude = float(np.max(np.abs(own.angle_rad / angles - 1.0)))
            phase = OMEGA * float(np.max(np.abs(own.time_s - times)))
            found.append(Row(f"amplitudes ({method}) against 40 digits", amplitude, "", "<= 1e-10"))
            found.append(Row(f"phases ({method}) against 40 digits", phase, "rad", "<= 1e-10"))
    return found


def _forty_digits(path: Path, count: int) -> tuple[Any, Any]:
    """Return the turning points to 40 digits, rounded."""
    specification = importlib.util.spec_from_file_location("pendpipe_reference", path)
    assert specification is not None
    assert specification.loader is not None
    reference = importlib.util.module_from_spec(specification)
    sys.modules[specification.name] = reference
    specification.loader.exec_module(reference)
    with reference.mp.workdps(reference.DIGITS):
        times, angles = reference.MpmathPendulum.of(MODEL).turning_points(START.angle_rad, count)
    return np.array([float(t) for t in times]), np.array([float(x) for x in angles])


def _first_call(rounds: int) -> Row:
    """Return how much longer a process takes to call the engine than to import numpy."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}

    def process(code: str) -> Callable[[], object]:
        command = [sys.executable, "-c", code]
        return lambda: subprocess.run(command, check=True, env=environment, cwd=ROOT)

    t = _medians({"numpy": (process("import numpy"), 1), "call": (process(FIRST_CALL), 1)}, rounds)
    return Row(
        "first call in a process, beyond import numpy", t["call"] - t["numpy"], "s", "<= 0.5"
    )


def main() -> None:
    """Print the table."""
    for row in rows():
        word = "met" if row.met else "MISSED"
        print(f"{row.what:48s} {row.value:12.3g} {row.unit:4s} goal {row.goal:10s} {word}")


if __name__ == "__main__":
    main()
