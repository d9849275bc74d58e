"""What must come out of a reader or a decoder: a clean error in one line, or a valid recording."""
# ruff: noqa: ARG002 - a line without a clock has no use for time limits

from __future__ import annotations

import atexit
import json
import os
import shutil
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random

import numpy as np

from benchmarks.fuzz_mutations import mutate
from pendpipe.acquire.clock import ScaledClock
from pendpipe.acquire.decode import decode_recording
from pendpipe.acquire.devices.dialect import Dialect
from pendpipe.acquire.devices.models import DEVICES
from pendpipe.acquire.drivers import find_driver
from pendpipe.acquire.line import Line
from pendpipe.errors import InputError
from pendpipe.formats import inspect, read
from pendpipe.formats.writing import windaq_hires
from pendpipe.recording import Recording, check


class InvalidError(Exception):
    """Something came out that is neither a clean error nor a valid recording."""


@dataclass(frozen=True)
class Case:
    """One input: its bytes, and under what name they go into a file."""

    data: bytes
    suffix: str = ""
    detail: str = ""


@cache
def _folder() -> Path:
    """A folder of this process, in memory where there is one."""
    shm = Path("/dev/shm")
    place = shm if shm.is_dir() and os.access(shm, os.W_OK) else None
    folder = Path(tempfile.mkdtemp(prefix="pendpipe-fuzz-", dir=place))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _one_line(fault: InputError) -> None:
    if "\n" in str(fault) or len(str(fault)) > 2000:
        raise InvalidError(f"no message of one line: {str(fault)[:300]!r}")


def _hold(recording: Recording) -> None:
    """Refuse a recording that is not one."""
    check("fuzzed", recording)
    if recording.time_s.shape != recording.values.shape:
        raise InvalidError("times and values differ in length")
    if recording.quality is not None and len(recording.quality) != len(recording):
        raise InvalidError("quality and values differ in length")
    step = recording.resolution
    if step is not None and not (np.isfinite(step) and step > 0):
        raise InvalidError(f"resolution {step}")


def run_file(case: Case) -> bool:
    """Read a file and write it for WinDaq; inspect every other; whether it was readable."""
    path = _folder() / f"fuzzed{case.suffix}"
    path.write_bytes(case.data)
    readable = False
    try:
        recording = read(path)
    except InputError as fault:
        _one_line(fault)
    else:
        readable = True
        _hold(recording)
        try:
            windaq_hires("out.wdh", recording)
        except InputError as fault:
            _one_line(fault)
    if len(case.data) % 2:
        return readable
    try:
        json.dumps(inspect(path).as_json())
    except InputError as fault:
        _one_line(fault)
    return readable


def run_raw(case: Case) -> bool:
    """Decode a raw recording."""
    try:
        recording = decode_recording(case.data)
    except InputError as fault:
        _one_line(fault)
        return False
    _hold(recording)
    return True


def run_decoder(case: Case) -> bool:
    """Decode a stream whole and in pieces: nothing is lost to the books, both give the same."""
    model, channels, seed = case.detail.split()
    driver, count, random = find_driver(model), int(channels), Random(int(seed))
    whole = driver.decoder(count)
    one, end = whole.feed(case.data), whole.finish()
    counts = np.concatenate([one.counts, end.counts])
    losses = [*one.losses, *end.losses]
    limit = 1 << (driver.bits - 1)
    if counts.shape[1:] != (count,) or (
        len(counts) and not -limit <= counts.min() <= counts.max() < limit
    ):
        raise InvalidError(f"counts {counts.shape}")
    spent = len(counts) * whole.bytes_per_scan + sum(loss.discarded_bytes for loss in losses)
    if not 0 <= len(case.data) - spent < whole.bytes_per_scan:
        raise InvalidError(f"{spent} of {len(case.data)} bytes accounted for")
    places = [loss.after_scan for loss in losses]
    if places != sorted(places) or any(not 0 <= place <= len(counts) for place in places):
        raise InvalidError(f"losses after scans {places}")
    cut = driver.decoder(count)
    pieces, at = [], 0
    while at < len(case.data):
        step = random.choice((1, 2, 3, 7, 64))
        pieces.append(cut.feed(case.data[at : at + step]).counts)
        at += step
    pieces.append(cut.finish().counts)
    if not np.array_equal(np.concatenate(pieces), counts):
        raise InvalidError("pieces give other scans than the whole")
    return bool(len(counts))


class AnsweringLine(Line):
    """A line to a device without a clock, whose answers are damaged on the way."""

    def __init__(self, device: Dialect, random: Random, rate: float) -> None:
        self.port = "FUZZ"
        self._device, self._random, self._rate = device, random, rate
        self._arrived = b""

    def set_baudrate(self, baudrate: int) -> None:
        pass

    def write(self, data: bytes) -> None:
        answer = self._device.respond(data)
        if answer and self._random.random() < self._rate:
            answer = mutate(answer, self._random)[:4096]
        self._arrived += answer

    def receive(self, limit_s: float) -> bytes:
        data, self._arrived = self._arrived, b""
        return data

    def read(self, size: int, limit_s: float) -> bytes:
        data, self._arrived = self._arrived[:size], self._arrived[size:]
        return data

    def read_until(self, end: bytes, limit_s: float) -> bytes:
        before, found, self._arrived = self._arrived.partition(end)
        return before + found

    def discard(self, quiet_s: float, limit_s: float = 1.0) -> bytes:
        return self.receive(0.0)[-64:]

    def close(self) -> None:
        pass


def run_answers(case: Case) -> bool:
    """Identify, configure, start and stop, with damaged answers."""
    model, seed = case.detail.split()
    random = Random(int(seed))
    line = AnsweringLine(DEVICES[model](), random, random.choice((0.1, 0.5, 1.0)))
    driver = find_driver(model)(line, ScaledClock(1e9))
    try:
        driver.identify()
        driver.configure((1, 2), 50.0)
        driver.start()
        driver.read(0.0)
        driver.stop()
    except InputError as fault:
        _one_line(fault)
        return False
    return True
