"""What a recorder keeps of lost bytes and flipped bits: nothing is lost in silence.

    python -m benchmarks.acquisition [faults] [flips] [--number N]

prints the tables: one fault in each of 100,000 recordings of 24 scans of random codes (a protocol
that can't mark it gives no decoder a sign), and a flipped bit in each of 2,000 raw files. Status 1
where a false scan stands beside a flagged fault, or a flip costs more than a frame.
"""

from __future__ import annotations

import random
import tempfile
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.faulty_device import Fault, FaultyPath
from benchmarks.journal import commit, judge_parser
from benchmarks.table import head, table_row
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers import DRIVERS, find_driver
from pendpipe.acquisition.drivers.streams import marked_scans
from pendpipe.acquisition.raw import read_raw
from pendpipe.acquisition.recorder import acquire_simulated
from pendpipe.arrays import FloatArray
from pendpipe.recording import GOOD

SCANS = 24
KINDS = {
    "one byte lost": ("drop", 1),
    "two bytes lost": ("drop", 2),
    "three bytes lost": ("drop", 3),
    "a whole scan lost": ("lost scans", 1),
    "one byte twice": ("duplicate", 1),
    "two bytes twice": ("duplicate", 2),
    "bit 0 of a byte flipped": ("flip", 0),
    "another bit flipped": ("flip", 1),
    "`stop 01` to `stop 03` in the stream": ("overflow", 1),
}


def fault_at(random: np.random.Generator, label: str, scan_bytes: int) -> Fault:
    """One fault at a random byte, away from the ends by two scans."""
    kind, number = KINDS[label]
    at = int(random.integers(2 * scan_bytes, (SCANS - 3) * scan_bytes))
    if kind == "flip":
        return Fault(kind, at=at, bit=int(random.integers(1, 8)) if number else 0)
    if kind == "overflow":
        return Fault(kind, at=at, code=int(random.integers(1, 4)))
    return Fault(kind, at=at // scan_bytes * scan_bytes if "scans" in kind else at, count=number)


def one_fault(random: np.random.Generator, model: str, label: str) -> tuple[bool, int, int]:
    """Whether a fault was marked, the good scans it cost, and those called good but never sent."""
    driver, device = find_driver(model), DEVICES[model]()
    channels, half = int(random.integers(1, 5)), 1 << (driver.bits - 1)
    # Distinct, so that every scan tells where it belongs.
    codes = random.choice(2 * half, size=(SCANS, channels), replace=False) - half
    path = FaultyPath(fault_at(random, label, 2 * channels))
    scans = driver.decode(path.stream(device.encode(codes), 2 * channels), channels)
    good = [tuple(row) for row in scans.counts[~scans.suspect].tolist()]
    true = {tuple(row) for row in codes.tolist()}
    return bool(scans.losses), SCANS - len(set(good) & true), sum(row not in true for row in good)


def faults(told: Any) -> bool:
    """Count over all families of devices."""
    random = np.random.default_rng(20261121)
    marked = {m: find_driver(m).scans_of is marked_scans for m in DRIVERS}
    cells = [(m, k) for m in DRIVERS for k in KINDS if not (marked[m] and "stop" in k)]
    tally = defaultdict(list)
    for model, label in cells:
        found = [
            one_fault(random, model, label)
            for _ in range(-(-(told.number or 100_000) // len(cells)))
        ]
        tally[label, marked[model]] += found
    print(head("fault", "family", "faults", "marked, %", "scans lost, mean (most)", "silent, %"))
    for (label, mark), found in sorted(tally.items()):
        lost = [scans for seen, scans, _ in found if seen] or [0]
        shares = [100.0 * np.mean([seen for seen, *_ in found])]
        shares += [100.0 * np.mean([not seen and false > 0 for seen, _, false in found])]
        cost = f"{np.mean(lost):.2f} ({max(lost)})"
        kind = "frame mark" if mark else "CDC words"
        print(table_row(label, [kind, len(found), f"{shares[0]:.2f}", cost, f"{shares[1]:.2f}"]))
    flagged = [false for found in tally.values() for seen, _, false in found if seen]
    print(f"\n{sum(map(bool, flagged))} of {len(flagged)} flagged faults left a false scan beside")
    return not any(flagged)


def slow(time_s: FloatArray) -> FloatArray:
    return np.asarray(5.0 * np.sin(0.02 * time_s))


def recorded_bytes(kind: str) -> bytes:
    """A raw recording of 40 s of the simulated device, some hundred frames."""
    with tempfile.TemporaryDirectory(prefix="pendpipe-") as folder:
        raw = Path(folder, "flips.raw")
        acquire_simulated(
            kind, slow, rate_hz=100.0, duration_s=40.0, clock_scale=20.0, raw_path=raw
        )
        return raw.read_bytes()


class Flip(NamedTuple):
    """What one flipped bit of a raw file costs; samples are false that are called good."""

    noticed: bool
    frames_lost: int
    scans_lost: int
    false_samples: int


def flip(whole: bytes, bit: int) -> Flip:
    """Flip a bit of a raw file and decode it."""
    damaged = bytearray(whole)
    damaged[bit // 8] ^= 1 << bit % 8
    before, after = decode_recording(whole), decode_recording(bytes(damaged))
    raw_before, raw_after = read_raw(whole), read_raw(bytes(damaged))
    good = after.usable if after.quality is None else after.usable & (after.quality == GOOD)
    index = np.rint(after.time_s[good] / before.interval_s).astype(np.int64)
    inside = index < len(before)
    false = int(np.sum(before.values[index[inside]] != after.values[good][inside]))
    false += int(np.sum(~inside))
    return Flip(
        any("damaged" in note for note in after.notes),
        len(raw_before.arrival_s) - len(raw_after.arrival_s),
        len(before) - int(np.sum(good)),
        false,
    )


def flips(told: Any) -> bool:
    """Flip one bit at random places of raw files: the check sums see each."""
    print(head("device", "flips", "noticed", "frames lost, most", "scans lost", "false samples"))
    good = True
    for kind in ("di154", "di149", "di245", "di2108"):
        whole, places = recorded_bytes(kind), random.Random(7)
        found = [flip(whole, places.randrange(8 * len(whole))) for _ in range(told.number or 500)]
        noticed, false = sum(each.noticed for each in found), sum(e.false_samples for e in found)
        most = [
            max(getattr(each, name) for each in found) for name in ("frames_lost", "scans_lost")
        ]
        print(table_row(kind, [len(found), noticed, *most, false]), flush=True)
        good &= noticed == len(found) and not false and most[0] <= 1
    return good


PARTS: dict[str, Callable[[Any], bool]] = {each.__name__: each for each in (faults, flips)}


def main() -> int:
    """Print the parts that are named, or all."""
    parser = judge_parser(__doc__, "acquisition", 0)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="all, if none is named")
    told = parser.parse_args()
    missed = []
    for name in told.parts or PARTS:
        print(f"\n{name}\n")
        missed += [] if PARTS[name](told) else [name]
    print(f"\nmissed: {', '.join(missed) or 'none'}. Made by commit {commit()}.")
    return len(missed)


if __name__ == "__main__":
    raise SystemExit(main())
