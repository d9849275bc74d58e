"""What engine, fit and diagnosis cost in CPU time, as ratios where others do the same.

    python -m benchmarks.speed [--number 15]

The reference record: f 0.516 Hz, y0 0.068 rad, b 0.01192 1/s (half hysteretic, half viscous),
a 0.45 1/(rad s), c 1.4e-6 rad/s, 32,768 readings over 300 s, noise 0.1 mrad. Contenders take turns,
and the lower quartiles are compared, since others at work on the machine only add.
"""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import cycle, islice
from multiprocessing import get_context
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage
from typing import Final

import numpy as np

import pendpipe as pp
from benchmarks.journal import judge_parser
from benchmarks.table import head, table_row
from pendpipe.arrays import FloatArray as Array
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian, turning_points
from pendpipe.recording import write_plain

OMEGA: Final = 2.0 * math.pi * 0.516
MODEL: Final = Eq8(OMEGA, quadratic=0.45, hysteretic=0.00596, viscous=0.00596, coulomb=1.4e-6)
SINE: Final = Eq8(OMEGA, 0.02, 0.00596, 0.00596, 1.4e-6, restoring="sine")
START: Final = Release(0.0, 0.068)
END_S, NOISE = 300.0, 1e-4
SAMPLES: Final = np.linspace(0.0, END_S, 32768)
MANY: Final = 200
"""Decays of 2,048 readings that are fitted at once."""


def solve_ivp_turning_points(count: int) -> Array:
    """Turning points by scipy's DOP853 at rtol 1e-12, each half cycle ended by an event."""
    from scipy.integrate import solve_ivp

    omega, a, b_h, b_v, c = OMEGA, 0.45, 0.00596, 0.00596, 1.4e-6

    def turn(_t: float, state: Array, _sign: float) -> float:
        return float(state[1])

    turn.terminal = True  # type: ignore[attr-defined]

    def rates(_t: float, state: Array, sign: float) -> tuple[float, float]:
        x, v = state
        square = (omega * x) ** 2 + v * v
        loss = 0.5 * math.pi * (omega * c + b_h * math.sqrt(square) + a / omega * square)
        return v, -(omega**2) * x - loss * sign - 2.0 * b_v * v

    at_s, angle, sign, found = 0.0, START.angle_rad, -1.0, [START.angle_rad]
    while len(found) < count:
        turn.direction = -sign  # type: ignore[attr-defined]
        half = solve_ivp(
            *(rates, (at_s, at_s + 2.0 * math.pi / omega), (angle, 0.0), "DOP853"),
            rtol=1e-12,
            atol=1e-18,
            events=turn,
            args=(sign,),
        )
        at_s, angle, sign = half.t_events[0][0], half.y_events[0][0][0], -sign
        found.append(angle)
    return np.array(found)


def fit_of_peaks(values: Array) -> Array:
    """a, b, c by find_peaks, told of the noise, and curve_fit of the paper's Eq. 14."""
    from scipy.optimize import curve_fit
    from scipy.signal import find_peaks

    def eq_14(t: Array, y0: float, a: float, b: float, c: float) -> Array:
        r = np.sqrt(complex(b * b - 4.0 * a * c))
        p = (2.0 * a * y0 + b - r) / (2.0 * a * y0 + b + r) * np.exp(-r * t)
        return np.real((b * (p - 1.0) + r * (p + 1.0)) / (2.0 * a * (1.0 - p)))

    size = np.abs(values - np.median(values))
    at, _ = find_peaks(size, prominence=5.0 * NOISE)
    start = [size[at[0]], 0.4, 0.01, 1e-6]
    return np.asarray(curve_fit(eq_14, SAMPLES[at] - SAMPLES[at[0]], size[at], start)[0][1:])


def fit_of_cosine(recording: pp.Recording, *, by_lmfit: bool = False) -> Array:
    """Size, loss, frequency, phase and level of a damped cosine by curve_fit, from the spectrum."""
    import lmfit
    from scipy.optimize import curve_fit

    def swing(t: Array, size: float, loss: float, rate: float, phase: float, level: float) -> Array:
        return size * np.exp(-loss * t) * np.cos(rate * t + phase) + level

    time_s, values = recording.time_s, recording.values
    peak = int(np.argmax(np.abs(np.fft.rfft(values - values.mean()))))
    rate = 2.0 * math.pi * peak / float(time_s[-1] - time_s[0])
    start = [float(np.ptp(values)) / 2.0, 0.01, rate, 0.0, float(values.mean())]
    if by_lmfit:
        model = lmfit.Model(swing)
        names = dict(zip(model.param_names, start, strict=True))
        return np.array([*model.fit(values, t=time_s, **names).best_values.values()])
    return np.asarray(curve_fit(swing, time_s, values, start)[0])


def cold_s(command: str, recording: pp.Recording) -> float:
    """CPU seconds of a command on a file, in a process of its own: the least of three."""
    words, spent = [sys.executable, "-m", "pendpipe", command, "decay.csv"], list[float]()
    with tempfile.TemporaryDirectory() as folder:
        write_plain(Path(folder, "decay.csv"), recording)
        for _ in range(3):
            before = getrusage(RUSAGE_CHILDREN)
            subprocess.run(words, cwd=folder, check=True, capture_output=True)
            after = getrusage(RUSAGE_CHILDREN)
            spent.append(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
    return min(spent)


def long_s() -> tuple[float, float]:
    """CPU seconds of the turning points of 10^7 readings, 100 a second, and of find_peaks there."""
    from scipy.signal import find_peaks

    law, time_s = Eq8(OMEGA, hysteretic=5e-6, viscous=5e-6), np.arange(10_000_000) / 100.0
    noise = NOISE * np.random.default_rng(0).standard_normal(len(time_s))
    many = pp.Recording(time_s=time_s, angle_rad=sample(law, START, time_s) + noise)
    both: dict[str, Callable[[], object]] = {
        "points": lambda: pp.turning_points(many),
        "peaks": lambda: find_peaks(many.values, prominence=5.0 * NOISE),
    }
    spent = cpu_s(both, 2)
    return spent["points"], spent["peaks"]


_AT_ONCE: Final = 1_000_000
"""Readings that are made at once."""


def alone(ask: str, count: int, in_cycle: float, first_rad: float) -> tuple[float, float]:
    """CPU seconds and peak memory in MB of a call on a clean decay, in a process of its own."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(_alone, ask, count, in_cycle, first_rad).result()


def _alone(ask: str, count: int, in_cycle: float, first_rad: float) -> tuple[float, float]:
    time_s = 2.0 * math.pi / OMEGA / in_cycle * np.arange(count)
    law = Eq8(OMEGA, hysteretic=1.0 / time_s[-1], viscous=1.0 / time_s[-1], restoring="sine")
    random, values = np.random.default_rng(0), np.empty(count)
    for first in range(0, count, _AT_ONCE):  # less than what is measured
        part = slice(first, first + _AT_ONCE)
        values[part] = sample(law, Release(0.0, first_rad), time_s[part])
        values[part] += NOISE * random.standard_normal(len(values[part]))
    recording, begun = pp.Recording(time_s=time_s, angle_rad=values), time.process_time()
    getattr(pp, ask)(recording)
    return time.process_time() - begun, getrusage(RUSAGE_SELF).ru_maxrss / 1024.0


def cpu_s(contenders: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Lower quartile of the CPU time of each contender; each is called once before."""
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for number in range(rounds + 1):
        for name, run in contenders.items():
            begun = time.process_time()
            run()
            times[name] += [time.process_time() - begun] * bool(number)
    return {name: float(np.quantile(values, 0.25)) for name, values in times.items()}


def decays(count: int) -> list[pp.Recording]:
    """Decays of some 60 swings in 2,048 readings: frequency, loss and noise differ."""
    random, time_s = np.random.default_rng(1), np.arange(2048) / 30.0
    made = []
    for _ in range(count):
        size, loss, frequency = random.uniform((0.1, 0.005, 0.8), (0.2, 0.02, 0.9))
        swing = size * np.exp(-loss * time_s) * np.cos(2.0 * np.pi * frequency * time_s)
        noise = 3e-4 * random.standard_normal(len(time_s))
        made.append(pp.Recording(time_s=time_s, angle_rad=swing + noise))
    return made


def many_s() -> float:
    """CPU seconds a fit in `fit_many` of two processes, those of the processes too."""

    def spent() -> float:
        each = (getrusage(RUSAGE_SELF), getrusage(RUSAGE_CHILDREN))
        return sum(used.ru_utime + used.ru_stime for used in each)

    made, before = cycle(decays(60)), spent()
    assert sum(1 for _ in pp.fit_many(islice(made, MANY), processes=2, progress=False)) == MANY
    return (spent() - before) / MANY


def rows(rounds: int) -> list[tuple[str, str, str, bool]]:
    """What was measured, the figure, the bound, and whether it is kept."""
    # While this process is small: a new one begins with its peak.
    ten, few, many_cycles, wide = (
        alone(*call)
        for call in (
            ("fit", 10_000_000, 200.0, 0.068),
            ("diagnose", 1_000_000, 2500.0, 0.068),
            ("diagnose", 1_000_000, 30.0, 0.068),
            ("diagnose", 9_000, 30.0, 1.5),
        )
    )
    noise = NOISE * np.random.default_rng(0).standard_normal(len(SAMPLES))
    values = sample(MODEL, START, SAMPLES) + noise
    recording = pp.Recording(time_s=SAMPLES, angle_rad=values)
    plain = decays(1)[0]
    shaken = pp.Recording(
        time_s=plain.time_s, angle_rad=plain.values + 0.001 * np.cos(7.0 * plain.time_s)
    )
    count = turning_points(MODEL, START, until_s=END_S).time_s.size
    contenders: dict[str, Callable[[], object]] = {
        "cos": lambda: np.cos(SAMPLES),
        "turns": lambda: turning_points(MODEL, START, until_s=END_S),
        "samples": lambda: sample(MODEL, START, SAMPLES),
        "jacobian": lambda: sample_with_jacobian(MODEL, START, SAMPLES),
        "sine": lambda: sample(SINE, Release(0.0, 1.0), SAMPLES),
        "sine jacobian": lambda: sample_with_jacobian(SINE, Release(0.0, 1.0), SAMPLES),
        "fit": lambda: pp.fit(recording),
        "peaks": lambda: fit_of_peaks(values),
        "one": lambda: pp.fit(plain),
        "cosine": lambda: fit_of_cosine(plain),
        "lmfit": lambda: fit_of_cosine(plain, by_lmfit=True),
    }
    t = cpu_s(contenders, rounds)
    t |= cpu_s({"solve_ivp": lambda: solve_ivp_turning_points(count)}, 1)
    t |= cpu_s({"null": lambda: pp.diagnose(plain), "line": lambda: pp.diagnose(shaken)}, 2)
    with tempfile.TemporaryDirectory() as folder:
        fitted, target = pp.fit(plain), Path(folder, "fit")
        t |= cpu_s({"save": lambda: fitted.save(target, figures=False, force=True)}, rounds)
    many, (points, peaks) = many_s(), long_s()
    found = (
        (f"`solve_ivp` DOP853 over {count} turning points", t["solve_ivp"] / t["turns"], 1e4, 1),
        ("32,768 samples over one `np.cos` of them", t["samples"] / t["cos"], 0.5, 0),
        ("with 8 columns of derivatives", t["jacobian"] / t["cos"], 3.0, 0),
        ("32,768 samples with sin x from 1 rad", t["sine"] / t["cos"], 3.0, 0),
        ("with 8 columns of derivatives", t["sine jacobian"] / t["cos"], 3.0, 0),
        ("`pp.fit` of 32,768 readings, ms", 1e3 * t["fit"], 5.0, 0),
        ("over `find_peaks`, `curve_fit`", t["fit"] / t["peaks"], 1.0, 0),
        ("`pp.fit` of 2,048 readings, ms", 1e3 * t["one"], 3.0, 0),
        ("over `curve_fit` of a damped cosine", t["one"] / t["cosine"], 1.0, 0),
        ("over `lmfit` of it", t["one"] / t["lmfit"], 1.0, 0),
        ("`fit_many` in two processes over `fit`, a recording", many / t["one"], 2.0, 0),
        ("fits a second in two processes, on two free cores", 2.0 / many, 400.0, 1),
        ("`FitResult.save` without figures, ms", 1e3 * t["save"], 1.0, 0),
        ("`pendpipe fit FILE` in a new process, s", cold_s("fit", plain), 0.45, 0),
        ("`pendpipe inspect FILE` in a new process, s", cold_s("inspect", plain), 0.3, 0),
        ("`pp.turning_points` of 10⁷ readings over `find_peaks`", points / peaks, 1.0, 0),
        ("`pp.diagnose` where nothing is missing, 2,048 readings, s", t["null"], 1.0, 0),
        ("`pp.diagnose` where a line is missing, s", t["line"], 3.0, 0),
        ("`pp.diagnose` from 1.5 rad, 300 cycles, s", wide[0], 20.0, 0),
        ("`pp.fit` of 10⁷ readings of 50,000 cycles, MB", ten[1], 1000.0, 0),
        ("`pp.diagnose` of 10⁶ readings of 400 cycles, MB", few[1], 600.0, 0),
        ("`pp.diagnose` of 10⁶ readings of 33,000 cycles, MB", many_cycles[1], 600.0, 0),
    )
    return [
        (what, f"{value:.3g}", f"at {'least' if least else 'most'} {bound:g}", kept)
        for what, value, bound, least in found
        for kept in [value >= bound if least else value <= bound]
    ]


def main() -> None:
    """Measure and print."""
    parser = judge_parser(__doc__, "speed", 15)
    arguments = parser.parse_args()
    print(head("what", "measured", "bound", "kept"))
    for what, *cells, kept in rows(arguments.number):
        print(table_row(what, [*cells, "yes" if kept else "**no**"]))


if __name__ == "__main__":
    main()
