"""Kills at random instants, file systems that fill, a plug that is pulled."""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np

from benchmarks import journal
from pendpipe.acquire.decode import decode_recording
from pendpipe.acquire.devices.faults import Fault
from pendpipe.acquire.raw import read_raw
from pendpipe.acquire.simulated import acquire_simulated
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
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
        "| the disk | room | what is said | scans opened | worst error |",
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
            recording = acquire_simulated(
                kind,
                lambda t: 0.05 * t,
                rate_hz=100.0,
                duration_s=40.0,
                clock_scale=10.0,
                faults=[Fault("unplug", at=1000 + 300 * number, duration_s=15.0)],
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
