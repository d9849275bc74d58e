"""How often a slipped byte is told by the signal, where no mark tells it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pendpipe.acquire.slips import find_slips

RUNS = 500
SCANS = 4000
SIGNALS = [
    # what, amplitude and noise in codes of 16 bits, bits, channels, cycles a scan
    ("a third of the range, noise 3 codes", 10_000, 3.0, 16, 1, 0.005),
    ("nearly all of the range, noise 30 codes", 30_000, 30.0, 16, 1, 0.005),
    ("12 bits at the top of the word", 10_000, 16.0, 12, 1, 0.005),
    ("50 codes, noise 2 codes", 50, 2.0, 16, 1, 0.005),
    ("at rest, noise 1 code", 0, 1.0, 16, 1, 0.005),
    ("two channels", 10_000, 3.0, 16, 2, 0.005),
    ("four channels", 10_000, 3.0, 16, 4, 0.005),
    ("40 scans a cycle", 10_000, 3.0, 16, 1, 0.025),
    ("10 scans a cycle", 10_000, 3.0, 16, 1, 0.1),
    ("white over the whole range", 0, 9000.0, 16, 1, 0.005),
]


def _codes(random: np.random.Generator, signal: tuple[str, float, float, int, int, float]) -> bytes:
    _, amplitude, noise, bits, channels, cycles = signal
    step = 1 << (16 - bits)
    place = np.arange(channels)
    phase = 2 * np.pi * (cycles * np.arange(SCANS)[:, None] + random.random()) + place
    motion = amplitude * np.exp(-1e-4 * np.arange(SCANS)[:, None]) * np.cos(phase) + 1500.0 * place
    motion += noise * random.standard_normal(motion.shape)
    codes = np.clip(np.rint(motion / step) * step, -32768, 32768 - step)
    return codes.astype("<i2").tobytes()


def slip_table(_folder: Path) -> str:
    """One byte lost, doubled, or three lost, in smooth and in other signals."""
    random = np.random.default_rng(20261123)
    lines = [
        f"{RUNS} streams of {SCANS} scans a line; a byte lost, a byte doubled or three lost, "
        "away from the ends by 200 scans. Right: one slip, at the place where it was, and the "
        "channels in their places behind it.",
        "",
        "| signal (a swing of 200 scans a cycle, if nothing else is said) | found | right | "
        "wrong, and said to be unsure | found where nothing was lost |",
        "|---|---|---|---|---|",
    ]
    for signal in SIGNALS:
        found = right = doubted = invented = 0
        size = 2 * signal[4]
        for run in range(RUNS):
            data = _codes(random, signal)
            invented += bool(find_slips(data, signal[4]))
            at = int(random.integers(200 * size, (SCANS - 200) * size))
            gone = (1, 3, -1)[run % 3]
            damaged = data[:at] + data[at + gone :] if gone > 0 else data[: at + 1] + data[at:]
            slips = find_slips(damaged, signal[4])
            found += bool(slips)
            true = (
                len(slips) == 1
                and slips[0].last_byte <= at <= slips[0].next_byte
                and (slips[0].next_byte + gone) % size == 0
            )
            right += true
            doubted += bool(slips) and not true and not all(slip.sure for slip in slips)
        lines.append(
            f"| {signal[0]} | {100 * found / RUNS:.1f} % | {100 * right / RUNS:.1f} % | "
            f"{100 * doubted / RUNS:.1f} % | {100 * invented / RUNS:.1f} % |"
        )
    return "\n".join(lines)
