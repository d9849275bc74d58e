"""Recordings made to hurt: steps, spans, rates, rests and files at their extremes.

Each is a decay of Q pi f/b with white noise unless its name tells more. `benchmarks.hostile`
diagnoses them within 20 s of the processor and 1 GB.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Writer = Callable[[Path], Path]


def decay(
    count: int,
    per_cycle: float,
    *,
    quality: float = 200.0,
    amplitude: float = 0.1,
    noise: float = 1e-4,
    frequency_hz: float = 1.0,
) -> tuple[Array, Array]:
    """Times and angles."""
    time_s = np.arange(count) / (per_cycle * frequency_hz)
    phase = 2.0 * np.pi * frequency_hz * time_s
    swing = amplitude * np.exp(-0.5 * phase / quality) * np.cos(phase + 0.3)
    return time_s, swing + noise * np.random.default_rng(count).standard_normal(count)


def text(time_s: Array, angle: Array, digits: int = 7) -> Writer:
    """A CSV with so many decimals."""

    def write(folder: Path) -> Path:
        path = folder / "a.csv"
        rows = np.column_stack([time_s, angle])
        np.savetxt(
            path, rows, ("%.9f", f"%.{digits}f"), ",", header="time_s,angle_rad", comments=""
        )
        return path

    return write


def arrays(time_s: Array, angle: Array) -> Writer:
    """An `.npz`, without a step."""

    def write(folder: Path) -> Path:
        np.savez(folder / "a.npz", time_s=time_s, angle_rad=angle)
        return folder / "a.npz"

    return write


def recordings() -> Iterator[tuple[str, Writer]]:
    """Names and writers."""
    for digits in (4, 6, 8, 12):
        yield f"6,000 readings, step 1e-{digits}", text(*decay(6000, 100), digits)
    for digits in (6, 8, 10):
        time_s, angle = decay(6000, 200, quality=12.6, amplitude=0.3, noise=6e-6)
        yield f"at rest in the end, step 1e-{digits}", text(time_s, angle, digits)
        time_s, angle = decay(51_000, 200, quality=107.0, amplitude=0.3, noise=6e-6)
        yield f"51,000 readings at rest in the end, step 1e-{digits}", text(time_s, angle, digits)
    for per_cycle in (8, 12, 24, 100, 1000):
        yield (
            f"20,000 readings, {per_cycle} a cycle",
            arrays(*decay(20_000, per_cycle, quality=2e3)),
        )
    for count, per_cycle, quality in (
        (193_000, 1000, 37.0),
        (193_000, 200, 500.0),
        (600_000, 1000, 600.0),
        (600_000, 200, 3000.0),
        (600_000, 60, 10_000.0),
        (1_000_000, 1000, 1000.0),
        (1_000_000, 200, 5000.0),
        (1_000_000, 30, 50_000.0),
        (1_000_000, 6, 150_000.0),
    ):
        yield (
            f"{count:,} readings, {per_cycle} a cycle",
            arrays(*decay(count, per_cycle, quality=quality)),
        )
    yield "10^6 readings of step 1e-9 as text", text(*decay(10**6, 500, quality=2e3), 9)
    for noise in (1e-9, 1e-7, 1e-5, 1e-2):
        yield f"noise {noise:g}", arrays(*decay(8000, 40, noise=noise))
    for size in (1e-6, 1e-3, 1.0, 3.0):
        swing = decay(8000, 40, amplitude=size, noise=1e-4 * size)
        yield f"linear swings of {size:g} rad", arrays(*swing)
    time_s, angle = decay(6000, 40)
    twice = time_s.copy()
    twice[3000] = np.nextafter(twice[2999], np.inf)
    yield "two readings a rounding apart", arrays(twice, angle)
    near = time_s - time_s[100]
    near[101] = 1e-300
    yield "two readings 1e-300 s apart", arrays(near, angle)
    yield "clipped at a half", arrays(time_s, np.clip(angle, -0.05, 0.05))
    yield "one value a third of the time", arrays(time_s, np.where(time_s > 100.0, 0.0, angle))
    gaps = np.random.default_rng(2).random(6000) < 0.3
    yield "a third of the rows lost", arrays(time_s[~gaps], angle[~gaps])
    yield "from the epoch", arrays(time_s + 1.7e9, angle)
    yield "157 readings of Q 6", arrays(*decay(157, 26, quality=6.0, noise=1e-3))
    wild = angle.copy()
    wild[::100] = 1e6
    yield "every hundredth reading is 10^6", arrays(time_s, wild)
    yield "a drift of a hundred amplitudes", arrays(time_s, angle + time_s / 15.0)
