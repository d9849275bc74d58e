"""Evidence of the acquisition: faults by the hundred thousand, kills, full disks, a pulled plug.

``python -m benchmarks.acquisition`` prints the tables. A part may be named:
``faults``, ``slips``, ``live``, ``kill``, ``flips``, ``disk``, ``plug``, ``speed``,
``windaq``, ``fuzz``.
Kills and fuzzing go on where they were broken off, as long as the code is the same.
"""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import journal
from benchmarks.acquisition_live import flip_table, live_table
from benchmarks.acquisition_speed import speed_table
from benchmarks.faulty_device import Fault, FaultyPath, acquire_faulty
from benchmarks.fuzz import fuzz_table
from benchmarks.fuzz_seeds import windaq
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers import find_driver
from pendpipe.acquisition.drivers.streams import out_of_step
from pendpipe.acquisition.raw import read_raw
from pendpipe.acquisition.recorder import acquire_simulated
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.formats import inspect, read
from pendpipe.recording import MISSING, Recording

KILLS = 200
JOURNAL = "acquisition-kills"
"""The kills done so far: a run that is broken off goes on from there."""


def slow(time_s: FloatArray) -> FloatArray:
    return np.asarray(5.0 * np.sin(0.02 * time_s))


def worst_volts(recording: Recording) -> float:
    """The largest difference from the signal, over the samples there are."""
    return float(np.nanmax(np.abs(recording.values - slow(recording.time_s))))


def child(raw: Path, kind: str) -> int:
    """Record without end in a process of its own."""
    process = os.fork()
    if not process:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        try:
            acquire_simulated(
                kind, slow, rate_hz=200.0, duration_s=1e6, clock_scale=50.0, raw_path=raw
            )
        finally:
            os._exit(1)
    return process


def one_kill(raw: Path, instants: random.Random) -> dict[str, float | bool | str]:
    """Kill a recorder, and look at what it left."""
    kind = instants.choice(["di154", "di2108"])
    process = child(raw, kind)
    while not raw.exists() or not raw.stat().st_size:
        time.sleep(0.002)
    time.sleep(instants.uniform(0.0, 0.4))
    size = raw.stat().st_size
    os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    kept = read_raw(raw)
    told: dict[str, float | bool | str] = {
        "kind": kind,
        "whole_before": raw.stat().st_size - kept.damaged_bytes >= size,
        "torn_bytes": kept.damaged_bytes,
        "empty": not kept.data,
        "opens": True,
    }
    try:
        recording = decode_recording(raw)
        told["worst_steps"] = worst_volts(recording) / (recording.resolution or 1.0)
    except InputError as fault:
        # Killed before the first scan: nothing there is to be opened.
        told["opens"] = "no scan was recorded" in str(fault) and not kept.data
    raw.unlink()
    return told


def kill_table(folder: Path) -> str:
    """Kill with signal 9 at random instants; results are kept as they come."""
    done = journal.read(JOURNAL, [])
    for number in range(len(done), KILLS):
        done.append(one_kill(folder / "killed.raw", random.Random(number)))
        journal.keep(JOURNAL, done)
    worst = max(entry.get("worst_steps", 0.0) for entry in done)
    return (
        "| kills | opened | all written before the kill was there | torn last frames | "
        "killed before the first scan | worst error of a sample |\n|---|---|---|---|---|---|\n"
        f"| {len(done)} | {sum(e['opens'] for e in done)} | "
        f"{sum(e['whole_before'] for e in done)} | {sum(e['torn_bytes'] > 0 for e in done)} | "
        f"{sum(e['empty'] for e in done)} | {worst:.2f} steps |"
    )


def disk_table(folder: Path) -> str:
    """A small file system where one may be mounted, a limit on the file's size, /dev/full."""
    lines = [
        "| the disk | room | message | scans opened | worst error |",
        "|---|---|---|---|---|",
    ]
    small = folder / "small"
    small.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(small)]
    if shutil.which("mount") and not subprocess.run(mount, capture_output=True).returncode:
        try:
            lines.append(_full("file system of 64 kB (tmpfs)", 65536, small / "a.raw"))
        finally:
            subprocess.run(["umount", str(small)], check=True)
    else:
        lines.append("| file system of 64 kB | - | may not be mounted here: not tried | - | - |")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    for room in (5_000, 50_000, 500_000):
        resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
        try:
            lines.append(_full("limit on the file's size", room, folder / f"{room}.raw"))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
    return "\n".join(lines)


def _full(what: str, room: int, raw: Path) -> str:
    said = "nothing (!)"
    try:
        acquire_simulated("di2108", slow, rate_hz=5e3, duration_s=120.0, raw_path=raw)
    except InputError as fault:
        said = fault.problem
    recording = decode_recording(raw)
    worst = worst_volts(recording) / (recording.resolution or 1.0)
    return f"| {what} | {room} B | {said} | {len(recording)} | {worst:.2f} steps |"


def plug_table(_folder: Path) -> str:
    """Unplugged for 15 s of the device, plugged in again: the gap against the truth."""
    lines = [
        "Clock scale 10 (a millisecond of this machine is 10 ms of the recording); the error of "
        "time is that of the readings behind the gap, of a signal that tells its time.",
        "",
        "| device | runs | resumed | rows missing | error of time behind the gap, worst |",
        "|---|---|---|---|---|",
    ]
    for kind in ("di154", "di149", "di245", "di2108"):
        missing, errors_s, resumed = [], [], 0
        for number in range(5):
            recording = acquire_faulty(
                kind,
                lambda t: 0.05 * t,
                [Fault("unplug", at=1000 + 300 * number, duration_s=15.0)],
                rate_hz=100.0,
                duration_s=40.0,
                clock_scale=10.0,
            )
            resumed += any("resumed" in note for note in recording.notes)
            quality = np.zeros(1) if recording.quality is None else recording.quality
            missing.append(int(np.sum(quality == MISSING)))
            late = recording.values[-500:] / 0.05 - recording.time_s[-500:]
            errors_s.append(abs(float(np.median(late))))
        lines.append(
            f"| {kind} | 5 | {resumed} | {min(missing)} to {max(missing)} | "
            f"{1e3 * max(errors_s):.0f} ms |"
        )
    return "\n".join(lines)


MODELS = [
    "di154",
    "di194",
    "di149",
    "di155",
    "di245",
    "di1100",
    "di1110",
    "di1120",
    "di2108",
    "di2108p",
    "di4108",
    "di4208",
    "di4718b",
]
MARKED = set(MODELS[:5])
SCANS = 24
FAULTS = 100_000
KINDS = [
    "drop 1",
    "drop 2",
    "drop 3",
    "drop scan",
    "duplicate 1",
    "duplicate 2",
    "flip mark",
    "flip data",
    "overflow",
]
LABELS = {
    "drop 1": "one byte lost",
    "drop 2": "two bytes lost",
    "drop 3": "three bytes lost",
    "drop scan": "a whole scan lost",
    "duplicate 1": "one byte twice",
    "duplicate 2": "two bytes twice",
    "flip mark": "bit 0 of a byte flipped",
    "flip data": "another bit flipped",
    "overflow": "`stop 01` to `stop 03` in the stream",
}


def draw(random: np.random.Generator, kind: str, scan_bytes: int) -> Fault:
    """One fault at a random byte, away from the ends by two scans."""
    at = int(random.integers(2 * scan_bytes, (SCANS - 3) * scan_bytes))
    name, _, what = kind.partition(" ")
    if kind == "drop scan":
        return Fault("lost scans", at=at // scan_bytes * scan_bytes)
    if name in ("drop", "duplicate"):
        return Fault(name, at=at, count=int(what))
    if name == "flip":
        return Fault("flip", at=at, bit=0 if what == "mark" else int(random.integers(1, 8)))
    return Fault("overflow", at=at, code=int(random.integers(1, 4)))


def one(random: np.random.Generator, model: str, kind: str) -> tuple[bool, int, int]:
    """Return whether a fault was flagged, the good scans it cost, and the false ones it made.

    A scan is false when it is delivered as good and was never sent.
    """
    driver, device = find_driver(model), DEVICES[model]()
    channels = int(random.integers(1, 5))
    half = 2 ** (driver.bits - 1)
    # Distinct, so that every scan tells where it belongs.
    codes = random.choice(2 * half, size=(SCANS, channels), replace=False) - half
    sent = device.encode(codes)
    scan_bytes = 2 * channels
    path = FaultyPath([draw(random, kind, scan_bytes)])
    scans = driver.decode(path.stream(sent, scan_bytes), channels)
    true = {tuple(row) for row in codes.tolist()}
    good = [tuple(row) for row in scans.counts[~scans.suspect].tolist()]
    false = sum(row not in true for row in good)
    return bool(scans.losses), SCANS - len(set(good) & true), false


def fault_table(_folder: Path) -> str:
    """Count, over all families."""
    random = np.random.default_rng(20261121)
    tally: dict[tuple[str, bool], list[tuple[bool, int, int]]] = defaultdict(list)
    cells = [(model, kind) for model in MODELS for kind in KINDS]
    cells = [(m, k) for m, k in cells if not (k == "overflow" and m in MARKED)]
    each = -(-FAULTS // len(cells))
    for model, kind in cells:
        for _ in range(each):
            tally[kind, model in MARKED].append(one(random, model, kind))
    lines = [
        f"{each * len(cells)} faults in recordings of {SCANS} scans of 1 to 4 channels, "
        'random codes; one fault each. "False" is a scan delivered as good that was never '
        "sent.",
        "",
        "| fault | family | faults | flagged | scans lost, mean (most) | unflagged with false "
        "scans | unflagged without |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in KINDS:
        for marked in (True, False):
            found = tally[kind, marked]
            if not found:
                continue
            flagged = [lost for seen, lost, _ in found if seen]
            worst = f"{np.mean(flagged):.2f} ({max(flagged)})" if flagged else "-"
            silent = sum(not seen and false > 0 for seen, _, false in found)
            clean = sum(not seen and not false for seen, _, false in found)
            lines.append(
                f"| {LABELS[kind]} | {'frame mark' if marked else 'CDC words'} | {len(found)} | "
                f"{100 * len(flagged) / len(found):.2f} % | {worst} | "
                f"{100 * silent / len(found):.2f} % | {100 * clean / len(found):.2f} % |"
            )
    flagged_false = [
        (kind, false)
        for (kind, marked), found in tally.items()
        if marked
        for seen, _, false in found
        if seen and false
    ]
    total = sum(seen for (_, marked), found in tally.items() if marked for seen, _, _ in found)
    lines += [
        "",
        f"Of {total} flagged faults in the families with a frame mark, {len(flagged_false)} left "
        f"a false scan beside the flag (at most {max((n for _, n in flagged_false), default=0)}): "
        "bytes cut off a scan before and behind that make a whole one.",
    ]
    return "\n".join(lines)


RUNS = 500
SLIP_SCANS = 4000
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
    phase = 2 * np.pi * (cycles * np.arange(SLIP_SCANS)[:, None] + random.random()) + place
    decay = np.exp(-1e-4 * np.arange(SLIP_SCANS)[:, None])
    motion = amplitude * decay * np.cos(phase) + 1500.0 * place
    motion += noise * random.standard_normal(motion.shape)
    codes = np.clip(np.rint(motion / step) * step, -32768, 32768 - step)
    return codes.astype("<i2").tobytes()


def slip_table(_folder: Path) -> str:
    """One byte lost, doubled, or three lost, in smooth and in other signals."""
    random = np.random.default_rng(20261123)
    lines = [
        f"{RUNS} streams of {SLIP_SCANS} scans a line; a byte lost, a byte doubled or three lost, "
        "away from the ends by 200 scans. Covered: every scan from there on is suspect.",
        "",
        "| signal (a swing of 200 scans a cycle, unless noted) | found | covered | "
        "good scans marked with them, mean | found where nothing was lost |",
        "|---|---|---|---|---|",
    ]
    for swing in SIGNALS:
        found = covered = early = invented = 0
        size = 2 * swing[4]
        for run in range(RUNS):
            data = _codes(random, swing)
            invented += bool(out_of_step(data, swing[4]).any())
            at = int(random.integers(200 * size, (SLIP_SCANS - 200) * size))
            gone = (1, 3, -1)[run % 3]
            damaged = data[:at] + data[at + gone :] if gone > 0 else data[: at + 1] + data[at:]
            suspect = out_of_step(damaged, swing[4])
            found += bool(suspect.any())
            covered += bool(suspect[at // size :].all())
            early += int(suspect[: at // size].sum())
        lines.append(
            f"| {swing[0]} | {100 * found / RUNS:.1f} % | {100 * covered / RUNS:.1f} % | "
            f"{early / max(1, found):.0f} | {100 * invented / RUNS:.1f} % |"
        )
    return "\n".join(lines)


RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "recordings"


@dataclass(frozen=True)
class Known:
    """What the README says of a file; ``None`` where it says nothing."""

    channels: int | None
    rate_hz: float | None
    scans: int | None
    markers: list[int] | int | None = None
    pause: tuple[int, float] | None = None


KNOWN = {
    "windaq-vendor-sample/SAMPLE.WDQ": Known(4, 250.0, 5000, [0, 591, 3002]),
    "windaq-vendor-sample/SAMPLE.WDH": Known(2, 100.0, 2208, [0, 860, 1116]),
    "windaq-vendor-sample/SAMPLE.WHC": Known(1, 200.0, 2000),
    "windaq-windaq3/AUTO.WDQ": Known(6, 9.375, 4067, 6),
    "windaq-windaq3/DI-2108_sine_sample.WDH": Known(1, 1000.0, 1000),
    "wdq-peter-t-ruehr/example_0.WDQ": Known(4, 20.0, 943, [0, 886], (886, 113.0)),
    "wdq-peter-t-ruehr/example_1.WDQ": Known(4, 20.0, 563),
}


def windaq_table(_folder: Path) -> str:
    """Decode every file there is; where there is none, say so."""
    if not RECORDINGS.is_dir():
        return "There is no ../shared/recordings here: the real files were skipped."
    names = [*KNOWN]
    for pattern in ("windaq-pytool/*.WDH", "windaq-pylle-di149-ascii/*.cso"):
        names += sorted(str(path.relative_to(RECORDINGS)) for path in RECORDINGS.glob(pattern))
    lines = [
        "| file | channels | scans | rate, Hz | markers at scans | pause | as its README says |",
        "|---|---|---|---|---|---|---|",
        *map(_row, names),
        "",
        "Damaged files: what is said.",
        "",
        "| file | outcome |",
        "|---|---|",
    ]
    broken = sorted(RECORDINGS.glob("windaq-vendor-broken/*"))
    lines += [f"| {path.relative_to(RECORDINGS)} | {_said(path)} |" for path in broken]
    return "\n".join([*lines, *_damaged(_folder)])


def _row(name: str) -> str:
    """One file."""
    found = inspect(RECORDINGS / name)
    marks = [mark.sample for mark in found.markers]
    gaps = [(gap.after_sample + 1, gap.missing_s) for gap in found.gaps]
    known = KNOWN.get(name) or Known(*_by_folder(name))
    right = [
        known.channels in (None, len(found.channels)),
        known.scans in (None, found.samples),
        known.rate_hz is None or abs(found.sample_rate_hz / known.rate_hz - 1) < 1e-4,
        known.markers in (None, marks, len(marks)),
        known.pause is None
        or (
            len(gaps) == 1
            and gaps[0][0] == known.pause[0]
            and abs(gaps[0][1] - known.pause[1]) < 1.0
        ),
    ]
    pause = "; ".join(f"{missing:.1f} s before scan {scan}" for scan, missing in gaps) or "-"
    shown = ", ".join(map(str, marks)) or "-"
    verdict = "yes" if all(right) else f"**no**: {known}"
    return (
        f"| {name} | {len(found.channels)} | {found.samples} | {found.sample_rate_hz:.6g} | "
        f"{shown} | {pause} | {verdict} |"
    )


def _by_folder(name: str) -> tuple[int | None, float | None, int | None]:
    """What the README says of all files in a folder: channels, rate, scans."""
    if name.startswith("windaq-pytool"):
        return 2, 100.0, None
    return None, 750_000 / 65535, None


def _said(path: Path) -> str:
    """What reading a file ends in."""
    try:
        recording = read(path)
    except InputError as fault:
        return f"refused: {fault.problem}"
    notes = [note for note in recording.notes if "reading is taken" not in note]
    return f"{len(recording)} samples; {'; '.join(notes) or 'nothing is said'}"


def _damaged(folder: Path) -> list[str]:
    """The vendor's list of illegal header values, put into a file of our own."""
    whole = windaq(hires=False, scans=400)
    cases = {
        "data size 268475456 (byte 8)": (8, struct.pack("<I", 268475456)),
        "size of the events (byte 12)": (12, struct.pack("<I", 0x7FFFFFFF)),
        "size of the annotations (byte 16)": (16, b"\xff\xff"),
        "interval -1.2e-41 s (byte 28)": (28, struct.pack("<d", -1.2e-41)),
        "compression 0 (byte 44)": (44, b"\0\0\0\0"),
        "compression -5 (byte 44)": (44, struct.pack("<i", -5)),
        "no channels (byte 0)": (0, b"\0\0"),
        "no mark 0x8001": (1154, b"\0\0"),
        "cut within the samples": (-1, b""),
        "cut within the header": (-2, b""),
    }
    rows = []
    for name, (at, junk) in cases.items():
        data = bytearray(whole)
        if at >= 0:
            data[at : at + len(junk)] = junk
        path = folder / "damaged.WDQ"
        path.write_bytes(bytes(data[: {-1: 2001, -2: 900}.get(at, len(data))]))
        rows.append(f"| made here: {name} | {_said(path)} |")
    return rows


PARTS: dict[str, Callable[[Path], str]] = {
    "faults": fault_table,
    "slips": slip_table,
    "live": live_table,
    "kill": kill_table,
    "flips": flip_table,
    "disk": disk_table,
    "plug": plug_table,
    "speed": speed_table,
    "windaq": windaq_table,
    "fuzz": fuzz_table,
}


def main(arguments: list[str] | None = None) -> int:
    for part in arguments or list(PARTS):
        with tempfile.TemporaryDirectory(prefix="pendpipe-") as folder:
            table = PARTS[part](Path(folder))
        print(f"\n{part}\n\n{table}\n\nMade by commit {journal.commit()}.", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
