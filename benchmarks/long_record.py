"""Turning points of 10^8 readings, against scipy's find_peaks.

``python -m benchmarks.long_record`` needs 3 GB of memory. All readings are in memory on both
sides. Each contender has processes of its own, and in them one core: its first call there
is what a user's one call costs, who reads a record and looks for its turning points; in the
calls after it the memory that was asked for before is still at hand.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.table import Row, at_least, at_most, write
from pendpipe.analysis.turning_points.find import turning_points_of
from pendpipe.analysis.turning_points.measure import Samples

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray

SAMPLES = 100_000_000
PER_HALF_CYCLE, INTERVAL_S, AMPLITUDE, NOISE = 105.83, 0.0091, 0.068, 1e-4
RATE = math.pi / PER_HALF_CYCLE
PROCESSES, CALLS = 5, 4
_PIECE, _SMALL = 1 << 20, 6_000_000


def record(samples: int) -> Samples:
    """A slow exponential decay in white noise."""
    rng = np.random.default_rng(0)
    values, index = np.empty(samples), np.arange(samples, dtype=np.float64)
    for start in range(0, samples, _PIECE):
        piece = slice(start, min(start + _PIECE, samples))
        decay = AMPLITUDE * np.exp(-index[piece] / samples)
        noise = NOISE * rng.standard_normal(len(decay))
        values[piece] = decay * np.cos(RATE * index[piece] + 0.3) + noise
    index *= INTERVAL_S
    return Samples(index, values, "rad", None, NOISE)


def peaks_in_pieces(values: FloatArray) -> None:
    """Look for the peaks as one would with little memory."""
    from scipy.signal import find_peaks

    for start in range(0, len(values), 1 << 22):
        find_peaks(np.abs(values[start : start + (1 << 22)]), distance=80)


def peaks_of_the_whole(values: FloatArray) -> None:
    """Look for the peaks in one call."""
    from scipy.signal import find_peaks

    find_peaks(np.abs(values), distance=80)


def sum_up(values: FloatArray) -> None:
    """Read every number once: no method that does so can be faster."""
    values.sum()


def contend(name: str, samples: int) -> None:
    """In a process of its own: print the CPU time of some calls, s."""
    whole = record(samples)
    small = Samples(whole.time_s[:_SMALL], whole.values[:_SMALL], "rad", None, NOISE)
    run = {
        "ours": lambda part: turning_points_of(part),
        "pieces": lambda part: peaks_in_pieces(part.values),
        "whole": lambda part: peaks_of_the_whole(part.values),
        "sum": lambda part: sum_up(part.values),
    }[name]
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    run(small)  # libraries are loaded
    times = []
    for _ in range(CALLS):
        before = time.process_time()
        run(whole)
        times.append(time.process_time() - before)
    print(json.dumps(times))


def measured(samples: int) -> dict[str, FloatArray]:
    """Times of the contenders, which take turns: shape (processes, calls) each."""
    names = ("ours", "pieces", "whole", "sum")
    found: dict[str, list[object]] = {name: [] for name in names}
    for _ in range(PROCESSES):
        for name in names:
            done = subprocess.run(
                [sys.executable, "-m", "benchmarks.long_record", name, str(samples)],
                cwd=Path(__file__).resolve().parents[1],
                capture_output=True,
                text=True,
                check=True,
            )
            found[name].append(json.loads(done.stdout))
    return {name: np.array(times) for name, times in found.items()}


def peak_memory_mb() -> float:
    """The most memory that this process has had."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def spread(times: FloatArray) -> str:
    """Median of some times, and their range."""
    middle = statistics.median(times.ravel().tolist())
    return f"{middle:.3f} s ({times.min():.3f} to {times.max():.3f})"


def rows(samples: int = SAMPLES) -> list[Row]:
    """Measure everything."""
    times = measured(samples)
    first = {name: each[:, 0] for name, each in times.items()}
    later = {name: each[:, 1:] for name, each in times.items()}
    middle = {name: float(np.median(each)) for name, each in later.items()}
    once = {name: float(np.median(each)) for name, each in first.items()}
    whole = record(samples)
    small = Samples(whole.time_s[:_SMALL], whole.values[:_SMALL], "rad", None, NOISE)
    turning_points_of(small)
    before = peak_memory_mb()
    points = turning_points_of(whole)
    extra = peak_memory_mb() - before
    number = np.round((points.time_s / INTERVAL_S * RATE + 0.3) / math.pi)
    turning = (number * math.pi - 0.3) / RATE
    error = points.amplitude_rad - AMPLITUDE * np.exp(-turning / samples)
    shown = f"{PROCESSES} processes, {CALLS} calls in each; one core; CPU time, median (range)"
    return [
        Row(f"{samples:.0e} readings, {len(points)} turning points", shown),
        Row(
            "ours: a process's first call; the calls after it",
            f"{spread(first['ours'])}; {spread(later['ours'])}",
        ),
        Row(
            "`find_peaks` in pieces, likewise",
            f"{spread(first['pieces'])}; {spread(later['pieces'])}",
        ),
        Row(
            "`find_peaks` of the whole, likewise",
            f"{spread(first['whole'])}; {spread(later['whole'])}",
        ),
        Row("`np.sum` of the readings, the later calls: the floor", spread(later["sum"])),
        at_least("over `find_peaks` in pieces, first call", once["pieces"] / once["ours"], 6.0),
        at_least("the same, later calls", middle["pieces"] / middle["ours"], 6.0),
        at_least(
            "over `find_peaks` of the whole, first call (it must get 0.8 GB for \\|x\\|)",
            once["whole"] / once["ours"],
            15.0,
        ),
        at_least(
            "the same, later calls (15 would be below the floor)",
            middle["whole"] / middle["ours"],
            15.0,
        ),
        at_most("extra memory", extra, 64.0, " MB"),
        at_most("bias of the amplitudes over the noise", float(error.mean() / NOISE), 0.01),
        Row(
            "sd of the amplitudes over the noise",
            f"{error.std() / NOISE:.3f}",
            f"bound {math.sqrt(2.0 / PER_HALF_CYCLE):.3f}",
        ),
    ]


def main() -> None:
    """Measure, and write the part of the page; or be one of the processes."""
    if len(sys.argv) == 3 and sys.argv[2].isdigit():
        contend(sys.argv[1], int(sys.argv[2]))
    else:
        write("Turning points of a long record", rows())


if __name__ == "__main__":
    main()
