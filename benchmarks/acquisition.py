"""What a recorder keeps: flipped bits, lost bytes, kills, full disks; nothing is lost in silence.

``python -m benchmarks.acquisition [faults] [flips] [kill] [disk]`` prints the tables.
"""

from __future__ import annotations

import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks import journal
from benchmarks.acquisition_live import flip, recorded_bytes, slow
from benchmarks.faulty_device import Fault, FaultyPath
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers import DRIVERS, find_driver
from pendpipe.acquisition.drivers.streams import marked_scans
from pendpipe.acquisition.raw import read_raw
from pendpipe.acquisition.recorder import acquire_simulated
from pendpipe.errors import InputError
from pendpipe.recording import Recording

KILLS, FLIPS, FAULTS, SCANS = 200, 500, 100_000, 24
JOURNAL = "acquisition-kills"
"""The kills done so far: a run that is broken off goes on from there."""
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


def fault_table() -> str:
    """Count, over all families of devices; what a protocol can't mark, no decoder sees."""
    random = np.random.default_rng(20261121)
    marked = {m: find_driver(m).scans_of is marked_scans for m in DRIVERS}
    cells = [(m, k) for m in DRIVERS for k in KINDS if not (marked[m] and "stop" in k)]
    tally = defaultdict(list)
    for model, label in cells:
        found = [one_fault(random, model, label) for _ in range(-(-FAULTS // len(cells)))]
        tally[label, marked[model]] += found
    lines = [
        f"One fault in each of {FAULTS} recordings of {SCANS} scans of random codes.\n",
        "| fault | family | faults | marked | scans lost, mean (most) | not marked, false scans |",
        "|---" * 6 + "|",
    ]
    for (label, mark), found in sorted(tally.items()):
        lost = [scans for seen, scans, _ in found if seen] or [0]
        silent = sum(not seen and false > 0 for seen, _, false in found)
        lines.append(
            f"| {label} | {'frame mark' if mark else 'CDC words'} | {len(found)} |"
            f" {sum(seen for seen, *_ in found) / len(found):.2%} |"
            f" {np.mean(lost):.2f} ({max(lost)}) | {silent / len(found):.2%} |"
        )
    return "\n".join(lines)


def flip_table() -> str:
    """One flipped bit at random places of raw files: the check sums see each."""
    lines = [
        "| device | flips | noticed | frames lost, most | scans lost, most | false samples |",
        "|---" * 6 + "|",
    ]
    for kind in ("di154", "di149", "di245", "di2108"):
        whole, places = recorded_bytes(kind), random.Random(7)
        flips = [flip(whole, places.randrange(8 * len(whole))) for _ in range(FLIPS)]
        lines.append(
            f"| {kind} | {FLIPS} | {sum(one.noticed for one in flips)} |"
            f" {max(one.frames_lost for one in flips)} | {max(one.scans_lost for one in flips)} |"
            f" {sum(one.false_samples for one in flips)} |"
        )
    return "\n".join(lines)


def worst_steps(recording: Recording) -> float:
    """The largest difference from the signal, in steps, over the samples there are."""
    off = np.abs(recording.values - slow(recording.time_s))
    return float(np.nanmax(off)) / (recording.resolution or 1.0)


def one_kill(raw: Path, instants: random.Random) -> dict[str, float | bool]:
    """Kill a recorder, and look at what it left."""
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
    found: dict[str, float | bool] = {
        "whole": raw.stat().st_size - kept.damaged_bytes >= size,
        "torn": kept.damaged_bytes > 0,
        "empty": not kept.data,
        "opens": True,
    }
    try:
        found["worst"] = worst_steps(decode_recording(raw))
    except InputError as fault:
        # Killed before the first scan: nothing there is to be opened.
        found["opens"] = "no scan was recorded" in str(fault) and not kept.data
    raw.unlink()
    return found


def kill_table() -> str:
    """Kill with signal 9 at random instants; results are kept as they come."""
    done = journal.read(JOURNAL, [])
    with tempfile.TemporaryDirectory() as folder:
        for number in range(len(done), KILLS):
            done.append(one_kill(Path(folder, "killed.raw"), random.Random(number)))
            journal.keep(JOURNAL, done)
    counts = [sum(each[key] for each in done) for key in ("opens", "whole", "torn", "empty")]
    return (
        "| kills | opened | all written before is there | torn last frames | before a scan |"
        f" worst error |\n{'|---' * 6}|\n| {len(done)} | {' | '.join(map(str, counts))} |"
        f" {max(each.get('worst', 0.0) for each in done):.2f} steps |"
    )


def disk_table() -> str:
    """A limit on the file's size stands for a disk that is full."""
    lines = ["| room | message | scans opened | worst error |", "|---" * 4 + "|"]
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    for room in (5_000, 50_000, 500_000):
        with tempfile.TemporaryDirectory() as folder:
            raw, said = Path(folder, "full.raw"), "**nothing**"
            resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
            try:
                acquire_simulated("di2108", slow, rate_hz=5e3, duration_s=120.0, raw_path=raw)
            except InputError as fault:
                said = fault.problem
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, before)
            kept = decode_recording(raw)
        lines.append(f"| {room} B | {said} | {len(kept)} | {worst_steps(kept):.2f} steps |")
    return "\n".join(lines)


PARTS: dict[str, Callable[[], str]] = {
    "faults": fault_table,
    "flips": flip_table,
    "kill": kill_table,
    "disk": disk_table,
}


def main() -> None:
    """Print the parts that are named, or all."""
    for part in sys.argv[1:] or PARTS:
        print(f"\n{part}\n\n{PARTS[part]()}\n\nMade by commit {journal.commit()}.", flush=True)


if __name__ == "__main__":
    main()
