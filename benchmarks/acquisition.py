"""What a recorder keeps: flipped bits, lost bytes, kills, full disks; nothing is lost in silence.

    python -m benchmarks.acquisition [faults] [flips] [kill] [disk] [--number N]

prints the tables: one fault in each of 100,000 recordings of 24 scans of random codes (a protocol
that can't mark it gives no decoder a sign), a flipped bit in each of 2,000 raw files, 200 recorders
killed at random instants, and three disks that get full. Status 1 where something is lost in
silence that the protocol marks, or a raw file does not open.
"""

from __future__ import annotations

import os
import random
import resource
import signal
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.acquisition_live import flip, recorded_bytes, slow
from benchmarks.faulty_device import Fault, FaultyPath
from benchmarks.journal import answers, commit, judge_parser
from benchmarks.table import head, table_row
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers import DRIVERS, find_driver
from pendpipe.acquisition.drivers.streams import marked_scans
from pendpipe.acquisition.raw import read_raw
from pendpipe.acquisition.recorder import acquire_simulated
from pendpipe.errors import InputError
from pendpipe.recording import Recording

SCANS = 24
SOURCES = ("pendpipe.acquisition.recorder", "benchmarks/acquisition*.py")
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
    path = FaultyPath([fault_at(random, label, 2 * channels)])
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


def worst_steps(recording: Recording) -> float:
    """The largest difference from the signal, in steps, over the samples there are."""
    off = np.abs(recording.values - slow(recording.time_s))
    return float(np.nanmax(off)) / (recording.resolution or 1.0)


def one_kill(number: int) -> dict[str, float | bool]:
    """Kill a recorder at a random instant, and look at what it left."""
    instants = random.Random(number)
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder, "killed.raw")
        kind, process = instants.choice(["di154", "di2108"]), os.fork()
        if not process:
            try:
                options = {"rate_hz": 200.0, "duration_s": 1e6, "clock_scale": 50.0}
                acquire_simulated(kind, slow, raw_path=raw, **options)
            finally:
                os._exit(1)
        while not raw.exists() or not raw.stat().st_size:
            time.sleep(0.002)
        time.sleep(instants.uniform(0.0, 0.4))
        size = raw.stat().st_size
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
        kept = read_raw(raw)
        whole = raw.stat().st_size - kept.damaged_bytes >= size
        found = {"whole": whole, "torn": kept.damaged_bytes > 0, "empty": not kept.data}
        try:
            return {**found, "opens": True, "worst": worst_steps(decode_recording(raw))}
        except InputError as fault:
            # Killed before the first scan: nothing there is to be opened.
            return {**found, "opens": "no scan was recorded" in str(fault) and not kept.data}


def kill(told: Any) -> bool:
    """Kill with signal 9 at random instants."""
    done = list(answers(told, range(told.number or 200), one_kill, SOURCES))
    counts = {key: sum(each[key] for each in done) for key in ("opens", "whole", "torn", "empty")}
    print(head("kills", "opened", "all that was written is there", "torn", "empty", "worst, steps"))
    worst = max(each.get("worst", 0.0) for each in done)
    print(table_row(len(done), [*counts.values(), f"{worst:.2f}"]))
    return counts["opens"] == counts["whole"] == len(done)


def disk(_told: Any) -> bool:
    """Record where a limit on the file's size stands for a disk that is full."""
    print(head("room, B", "message", "scans opened", "worst, steps"))
    before, good = resource.getrlimit(resource.RLIMIT_FSIZE), True
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    for room in (5_000, 50_000, 500_000):
        with tempfile.TemporaryDirectory() as folder:
            raw, said = Path(folder, "full.raw"), ""
            resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
            try:
                acquire_simulated("di2108", slow, rate_hz=5e3, duration_s=120.0, raw_path=raw)
            except InputError as fault:
                said = fault.problem
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, before)
            kept = decode_recording(raw)
        print(table_row(room, [said or "**nothing**", len(kept), f"{worst_steps(kept):.2f}"]))
        good &= bool(said)
    return good


PARTS: dict[str, Callable[[Any], bool]] = {
    each.__name__: each for each in (faults, flips, kill, disk)
}


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
