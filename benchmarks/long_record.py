"""Turning points of 10^8 readings, against scipy's find_peaks.

``python -m benchmarks.long_record`` needs 2 GB of memory. All readings are in memory on both sides.
"""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.table import Row, at_least, at_most, cpu_seconds, write
from pendpipe.analysis.turning_points.find import turning_points_of
from pendpipe.analysis.turning_points.samples import Samples

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray

SAMPLES = 100_000_000
PER_HALF_CYCLE, INTERVAL_S, AMPLITUDE, NOISE = 105.83, 0.0091, 0.068, 1e-4
RATE = math.pi / PER_HALF_CYCLE
_PIECE = 1 << 20


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


def peak_memory_mb() -> float:
    """The most memory that this process has had."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def rows(samples: int = SAMPLES) -> list[Row]:
    """Measure everything."""
    whole = record(samples)
    values = whole.values
    turning_points_of(Samples(whole.time_s[:6_000_000], values[:6_000_000], "rad", None, NOISE))
    before = peak_memory_mb()
    points = turning_points_of(whole)
    extra = peak_memory_mb() - before
    contenders = {
        "ours": (lambda: turning_points_of(whole), 2),
        "pieces": (lambda: peaks_in_pieces(values), 1),
    }
    cpu = cpu_seconds(contenders, 5)
    wall = cpu_seconds(contenders, 5, clock=time.perf_counter)
    at_once = cpu_seconds({"whole": (lambda: peaks_of_the_whole(values), 1)}, 1)["whole"]
    number = np.round((points.time_s / INTERVAL_S * RATE + 0.3) / math.pi)
    turning = (number * math.pi - 0.3) / RATE
    error = points.amplitude_rad - AMPLITUDE * np.exp(-turning / samples)
    return [
        Row(f"{samples:.0e} readings, {len(points)} turning points",
            f"{wall['ours']:.3f} s ({cpu['ours']:.3f} s of CPU)"),
        at_least("over `find_peaks` in pieces, wall time (all cores against one)",
                 wall["pieces"] / wall["ours"], 6.0),
        at_least("the same in CPU time", cpu["pieces"] / cpu["ours"], 6.0),
        at_least("over `find_peaks` of the whole, CPU time", at_once / cpu["ours"], 15.0),
        at_most("extra memory", extra, 64.0, " MB"),
        at_most("bias of the amplitudes over the noise", float(error.mean() / NOISE), 0.01),
        Row("sd of the amplitudes over the noise", f"{error.std() / NOISE:.3f}",
            f"bound {math.sqrt(2.0 / PER_HALF_CYCLE):.3f}"),
    ]  # fmt: skip


def main() -> None:
    """Measure, and write the part of the page."""
    write("long", "Turning points of a long record", rows())


if __name__ == "__main__":
    main()
