"""How fast bytes become samples, and whether the fastest device is kept up with.

``python -m benchmarks acquisition_speed`` prints it.
"""

from __future__ import annotations

import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers import DRIVERS, find_driver
from pendpipe.acquisition.recorder import acquire_simulated
from pendpipe.formats import ReadOptions, text, windaq

SAMPLES = 1 << 19
SUSTAINED_S = 20.0
ASKED = {"binary": 20e6, "ASCII": 2e6}


def speed_table(folder: Path) -> str:
    """Decoding alone, then device, recorder and decoder together on one core."""
    lines = ["| dialect | channels | million samples a second | asked for |", "|---|---|---|---|"]
    for model in DRIVERS:
        lines += [_row(DRIVERS[model].model, n, _binary(model, n), "binary") for n in (1, 4)]
    lines += [_row("DI-149, ASCII (`sc 12 -7`)", n, _captured(n), "ASCII") for n in (1, 4)]
    lines += [_row("CDC, ASCII (`0.1234, -7.5`)", n, _volts(n), "ASCII") for n in (1, 4)]
    return "\n".join([*lines, "", _sustained(folder)])


def _row(name: str, channels: int, rate: float, kind: str) -> str:
    asked = ASKED[kind]
    verdict = "" if rate >= asked else ": **missed**"
    shown = f"{rate / 1e6:.0f}" if rate > 1e8 else f"{rate / 1e6:.1f}"
    return f"| {name} | {channels} | {shown} | {asked / 1e6:.0f}{verdict} |"


def _best(work: Callable[[], object], samples: int) -> float:
    """Samples a second, the best of five runs, by the processor's clock."""
    best = np.inf
    for _ in range(5):
        begin = time.process_time()
        work()
        best = min(best, time.process_time() - begin)
    return samples / best


def _codes(bits: int, channels: int) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    half = 1 << (bits - 1)
    return np.random.default_rng(1).integers(-half, half, (SAMPLES // channels, channels))


def _binary(model: str, channels: int) -> float:
    """A stream as a whole."""
    driver = find_driver(model)
    data = DEVICES[model]().encode(_codes(driver.bits, channels))
    return _best(lambda: driver.decode(data, channels), SAMPLES)


def _captured(channels: int) -> float:
    rows = _codes(12, channels).tolist()
    lines = ["start", *("sc " + " ".join(map(str, row)) for row in rows), "stop", ""]
    data = "\n".join(lines).encode()
    return _best(lambda: windaq.read_capture(Path("a.cso"), data, ReadOptions()), SAMPLES)


def _volts(channels: int) -> float:
    rows = (_codes(16, channels) * 10 / 32768).tolist()
    data = "".join(", ".join(f"{x:.4f}" for x in row) + "\r\n" for row in rows).encode()
    return _best(lambda: text.read_table(Path("a.csv"), data, ReadOptions()), SAMPLES)


def _sustained(folder: Path) -> str:
    """The simulated DI-2108 at its fastest, everything bound to one core where that is possible."""
    if sys.platform != "linux":
        return _run_sustained(folder)
    # A process of its own: the benchmark's other threads may go where they like.
    with multiprocessing.get_context("fork").Pool(1, _bind) as pool:
        return pool.apply(_run_sustained, (folder,))


def _bind() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def _run_sustained(folder: Path) -> str:
    begin_s, begin_cpu_s = time.perf_counter(), time.process_time()
    recording = acquire_simulated(
        "di2108",
        np.sin,
        rate_hz=160e3,
        duration_s=SUSTAINED_S,
        clock_scale=1.0,
        raw_path=folder / "fast",
    )
    took_s = time.perf_counter() - begin_s
    share = (time.process_time() - begin_cpu_s) / took_s
    off = np.abs(recording.values - np.sin(recording.time_s)).max() / (recording.resolution or 1.0)
    missing = round(SUSTAINED_S * 160e3) - int(recording.usable.sum())
    cores = len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count()
    return (
        f"The simulated DI-2108 at 160 kHz for {SUSTAINED_S:g} s, on {cores} core(s): "
        f"{len(recording)} scans, {missing} missing, worst error {off:.2f} steps, notes of losses: "
        f"{'; '.join(recording.notes) or 'none'}; device, line, recorder and decoder together take "
        f"{100 * share:.0f} % of one core ({took_s:.1f} s of the wall)."
    )


def main() -> None:
    with tempfile.TemporaryDirectory(prefix="pendpipe-") as folder:
        print(speed_table(Path(folder)))


if __name__ == "__main__":
    main()
