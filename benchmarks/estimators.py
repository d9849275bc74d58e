"""The rows of the table on estimators: precision against the bound, time against peers.

``python -m benchmarks.estimators [REALISATIONS] [--lmfit] [--long]``; OPENBLAS_NUM_THREADS=1.
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from benchmarks import peers_estimators
from pendpipe.analysis.fit import fit_recording
from pendpipe.analysis.turning_points.find import turning_points_of
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.dynamics import Eq8, Release, sample, sample_with_jacobian
from pendpipe.recording import Recording

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendpipe.analysis.fit.result import Method
    from pendpipe.arrays import FloatArray

OMEGA = 2.0 * math.pi * 0.516
REFERENCE = Eq8(OMEGA, quadratic=0.45, hysteretic=0.00596, viscous=0.00596, coulomb=1.4e-6)
RELEASE = Release(-0.3, 0.068, 0.003)
TIME_S = np.arange(32768) * (300.0 / 32768)
NOISE = 1e-4
TRUTH = {"a": 0.45, "b": 0.01192, "c": 1.4e-6, "Q": math.pi * 0.516 / 0.01192}


class Row(NamedTuple):
    """A line of the table."""

    what: str
    value: str
    wanted: str


def recording(seed: int) -> Recording:
    """One realisation of the reference record."""
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(TIME_S))
    return Recording(TIME_S, sample(REFERENCE, RELEASE, TIME_S) + noise, "angle_rad")


def bound() -> FloatArray:
    """Cramer-Rao bound of a, b, c, Q (b's share given; with it free it is the same)."""
    jacobian = sample_with_jacobian(REFERENCE, RELEASE, TIME_S, hysteretic_share=0.5)[1]
    sd = NOISE * np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))[:3]
    return np.array([*sd, sd[1] * TRUTH["Q"] / TRUTH["b"]])


def seconds(call: Callable[[], object], repetitions: int = 15) -> float:
    """Median time of a call."""
    spent = []
    for _ in range(repetitions):
        began = time.perf_counter()
        call()
        spent.append(time.perf_counter() - began)
    return statistics.median(spent)


def precision(method: Method, realisations: int) -> list[Row]:
    """Standard deviation over the bound, bias in standard deviations, coverage."""
    values, within = [], []
    truth = np.array(list(TRUTH.values()))
    for seed in range(realisations):
        result = fit_recording(recording(seed), method=method)
        limit = result.quality_factor_limit
        assert limit is not None
        found = [*(result.parameters[name] for name in "abc"), limit]
        values.append([estimate.value for estimate in found])
        sd = np.array([estimate.sd for estimate in found])
        ends = np.array([estimate.interval95 for estimate in found])
        off = np.abs(np.array(values[-1]) - truth)
        within.append([off < sd, (ends[:, 0] <= truth) & (truth <= ends[:, 1])])
    error = np.array(values) - truth
    cover = 100.0 * np.mean(within, axis=0)
    limits = ("1.05", "0.1") if method == "waveform" else ("1.15", "0.5")
    ratio, bias = error.std(axis=0) / bound(), error.mean(axis=0) / bound()
    head = f"{method}, {realisations} realisations (a, b, c, Q)"
    return [
        Row(f"{head}: sd/bound", _list(ratio), f"<= {limits[0]}"),
        Row(f"{head}: bias/sd", _list(bias), f"< {limits[1]}"),
        Row(f"{head}: 68 % intervals cover %", _list(cover[0]), "65 to 71"),
        Row(f"{head}: 95 % intervals cover %", _list(cover[1]), "92 to 98"),
    ]


def _list(numbers: FloatArray) -> str:
    return " ".join(f"{number:.3g}" for number in numbers)


def speed() -> list[Row]:
    """Time of the fits against find_peaks + curve_fit, interleaved."""
    one = recording(0)
    half_period = len(TIME_S) / 309.6
    calls: dict[str, Callable[[], object]] = {
        "find_peaks + curve_fit": lambda: peers_estimators.peaks_and_curve_fit(
            TIME_S, one.values, half_period, quartic=False
        ),
        "find_peaks + quartic + curve_fit": lambda: peers_estimators.peaks_and_curve_fit(
            TIME_S, one.values, half_period
        ),
        "turning-point route": lambda: fit_recording(one, method="turning-points"),
        "waveform fit": lambda: fit_recording(one),
        "np.cos of the samples": lambda: np.cos(TIME_S),
    }
    for call in calls.values():
        call()
    spent = {name: seconds(call) for name, call in calls.items()}
    peer = spent["find_peaks + quartic + curve_fit"]
    return [
        Row(name, f"{1e3 * value:.2f} ms = {value / peer:.2f} x find_peaks + quartic",
            "waveform fit <= 1")
        for name, value in spent.items()
    ]  # fmt: skip


def against_lmfit() -> list[Row]:
    """One run of lmfit over solve_ivp (half a minute and more)."""
    one = recording(0)
    began = time.perf_counter()
    found = peers_estimators.lmfit_waveform(REFERENCE, 0.068, -0.3, TIME_S, one.values)
    spent = time.perf_counter() - began
    ours = seconds(lambda: fit_recording(one))
    result = fit_recording(one)
    apart = [
        (result.value(name) - value) / result.parameters[name].sd
        for name, value in zip("abc", found, strict=True)
    ]
    return [
        Row("lmfit + solve_ivp / waveform fit, time", f"{spent / ours:.0f}", ">= 5000"),
        Row("the two apart, in sd (a, b, c)", _list(np.array(apart)), "< 0.1"),
    ]


def long_record(samples: int = 100_000_000) -> list[Row]:
    """Turning points of a long record against find_peaks, in pieces and whole."""
    import resource

    from scipy.signal import find_peaks

    per_half_cycle, interval = 105.83, 0.0091
    rate = math.pi / per_half_cycle
    rng = np.random.default_rng(0)
    values, index = np.empty(samples), np.arange(samples, dtype=np.float64)
    for start in range(0, samples, 1 << 20):
        piece = slice(start, min(start + (1 << 20), samples))
        decay = 0.068 * np.exp(-index[piece] / samples)
        noise = NOISE * rng.standard_normal(len(decay))
        values[piece] = decay * np.cos(rate * index[piece] + 0.3) + noise
    index *= interval
    whole = Samples(index, values, "rad", None, NOISE)
    turning_points_of(Samples(index[:6_000_000], values[:6_000_000], "rad", None, NOISE))

    def in_pieces() -> None:
        for start in range(0, samples, 1 << 22):
            find_peaks(np.abs(values[start : start + (1 << 22)]), distance=80)

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    points = turning_points_of(whole)
    extra = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024.0
    ours = seconds(lambda: turning_points_of(whole), 5)
    chunked = seconds(in_pieces, 3)
    at_once = seconds(lambda: find_peaks(np.abs(values), distance=80), 1)
    number = np.round((points.time_s / interval * rate + 0.3) / math.pi)
    turning = (number * math.pi - 0.3) / rate
    error = points.amplitude_rad - 0.068 * np.exp(-turning / samples)
    return [
        Row(f"{samples:.0e} samples, {len(points)} turning points", f"{ours:.3f} s", ""),
        Row("find_peaks in pieces / ours", f"{chunked / ours:.1f}", ">= 6"),
        Row("find_peaks of the whole / ours", f"{at_once / ours:.1f}", ">= 15"),
        Row("extra memory", f"{extra:.0f} MB", "< 64"),
        Row("bias / noise", f"{error.mean() / NOISE:.2g}", "< 0.01"),
        Row("sd / noise", f"{error.std() / NOISE:.3f}", f"bound {math.sqrt(2 / 105.83):.3f}"),
    ]


def rows(realisations: int, *, lmfit: bool = False, long: bool = False) -> list[Row]:
    """All rows that were asked for."""
    found = speed()
    for method in ("waveform", "turning-points"):
        found += precision(method, realisations)  # type: ignore[arg-type]
    if lmfit:
        found += against_lmfit()
    if long:
        found += long_record()
    return found


def main() -> None:
    """Print the table."""
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    for row in rows(
        numbers[0] if numbers else 100, lmfit="--lmfit" in sys.argv, long="--long" in sys.argv
    ):
        print(f"{row.what:<72} {row.value:<40} {row.wanted}")


if __name__ == "__main__":
    main()
