"""Fuzzing of every reader and decoder: a million damaged inputs in fixed order.

    python -m benchmarks.fuzz                all of it; goes on where it was broken off
    python -m benchmarks.fuzz --inputs 100000   the first so many, spread over all readers
    python -m benchmarks.fuzz --seconds 8    as much as fits, from the beginning (CI)
    python -m benchmarks.fuzz --case "WinDaq" 1234    one input again, with its traceback

An input is right when it ends in one clean line or in a valid recording, in less than five
seconds of the processor, and with a peak of memory (one input in forty is traced) below
`MOST_TIMES` its size and `SPARE_BYTES`. What is wrong is kept in ``.evidence/fuzz/``.
"""
# ruff: noqa: ARG002 - a line without a clock has no use for time limits

from __future__ import annotations

import argparse
import atexit
import json
import os
import resource
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
import tracemalloc
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import openpyxl  # noqa: F401  (an import is no memory of the first workbook)
import pandas as pd  # noqa: F401

from benchmarks import fuzz_seeds as seeds
from benchmarks import journal
from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.devices.simulated import Dialect
from pendpipe.acquisition.drivers import DRIVERS, find_driver
from pendpipe.acquisition.line import Line
from pendpipe.errors import InputError
from pendpipe.formats import inspect, read
from pendpipe.formats.writing import windaq_hires
from pendpipe.recording import Recording, check

Mutation = Callable[[bytearray, Random], None]

WORDS = [
    b"nan",
    b"-inf",
    b"1e999",
    b"1e-320",
    b"-",
    b"+",
    b".",
    b",",
    b";",
    b"\t",
    b'"',
    b"'",
    b"#",
    b"%",
    b"0x1f",
    b"1_000",
    b"12:34:56",
    b"\r",
    b"\n",
    b"\r\n",
    b"\n\n",
    b"\0",
    b"\xef\xbb\xbf",
    b"\xff\xfe",
    b"\xb0",
    b"\xc3",
    b"\xf0\x9f\x98\x80",
    b"time",
    b"Time (s)",
    b"angle",
    b"deg",
    b"x",
    b"rad",
    b"V",
    b"Hz",
    b"sample rate: ",
    b"9" * 30,
    b"1.7976931348623157e308",
    b" " * 40,
    b"stop 01",
    b"sc ",
    b"start",
    b"Resume",
    b"# volts_per_radian: 0\n",
    b"# bits: 0\n",
    b"# range_volts: nan\n",
    b'r="1048576"',
    b'r="XFD7"',
    b"A1:XFD1048576",
    b'count="99999999"',
    b"&#x10ffff;",
    b"<v>1e400</v>",
    b"srate x0\n",
    b"Relative Time,",
]
NUMBERS = [
    0,
    1,
    2,
    3,
    4,
    7,
    8,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0x8000,
    0xFFFF,
    0x10000,
    0x7FFFFFFF,
    0x80000000,
    0xFFFFFFFF,
    1 << 20,
    1 << 28,
]
REALS = [0.0, -0.0, 1.0, -1.0, 1e-310, 1e-9, 1e300, -1e300, float("inf"), float("nan"), 1e30]


def flip(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    data[at] ^= 1 << random.randrange(8)


def overwrite(data: bytearray, random: Random) -> None:
    data[random.randrange(len(data))] = random.randrange(256)


def put_number(data: bytearray, random: Random) -> None:
    width = random.choice((1, 2, 4, 4))
    at = random.randrange(len(data)) & -width
    data[at : at + width] = (random.choice(NUMBERS) & ((1 << 8 * width) - 1)).to_bytes(
        width, random.choice(("little", "little", "big"))
    )


def put_real(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data)) & -2
    data[at : at + 8] = struct.pack("<d", random.choice(REALS))


def put_word(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data) + 1)
    over = random.choice((0, 0, 1, 4))
    data[at : at + over] = random.choice(WORDS)


def cut_out(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    del data[at : at + random.choice((1, 1, 2, 3, 16, 200))]


def repeat(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    part = data[at : at + random.choice((1, 2, 16, 200))]
    data[at:at] = part * random.choice((1, 1, 2, 20))


def truncate(data: bytearray, random: Random) -> None:
    del data[random.randrange(len(data)) :]


def zeroes(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    length = random.choice((4, 64, 512))
    data[at : at + length] = bytes([random.choice((0, 0xFF))]) * length


def swap(data: bytearray, random: Random) -> None:
    one, two = random.randrange(len(data)), random.randrange(len(data))
    data[one], data[two] = data[two], data[one]


def digit(data: bytearray, random: Random) -> None:
    at = random.randrange(len(data))
    data[at : at + 1] = random.choice(b'0123456789-+.,;eE \t\n"').to_bytes(1, "little")


def header(data: bytearray, random: Random) -> None:
    """Damage among the first bytes, where sizes and counts stand."""
    at = random.randrange(min(len(data), 160))
    data[at] = random.choice((0, 1, 0x7F, 0x80, 0xFF, random.randrange(256)))


BINARY: Sequence[Mutation] = (
    flip,
    flip,
    overwrite,
    put_number,
    put_number,
    put_real,
    put_word,
    cut_out,
    repeat,
    truncate,
    zeroes,
    swap,
    header,
    header,
    header,
)
TEXT: Sequence[Mutation] = (
    flip,
    put_word,
    put_word,
    cut_out,
    repeat,
    truncate,
    swap,
    digit,
    digit,
    digit,
    digit,
    header,
)
HOW_MANY = (1, 1, 1, 2, 2, 3, 5, 8)


def mutate(data: bytes, random: Random, others: Sequence[bytes] = ()) -> bytes:
    """Return damaged bytes: some mutations, at times the end of another file."""
    damaged = bytearray(data)
    kinds = BINARY if b"\0" in data[:200] else TEXT
    if others and random.random() < 0.05:
        other = random.choice(others)
        damaged[random.randrange(len(damaged) + 1) :] = other[random.randrange(len(other) + 1) :]
    for _ in range(random.choice(HOW_MANY)):
        if not damaged:
            break
        random.choice(kinds)(damaged, random)
    return bytes(damaged)


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
    """Decode a stream: every byte is in a scan, in a loss or waiting."""
    model, channels, _ = case.detail.split()
    driver, count = find_driver(model), int(channels)
    scans = driver.decode(case.data, count)
    limit, size = 1 << (driver.bits - 1), 2 * count
    if scans.counts.shape != (len(scans.suspect), count) or (
        len(scans.counts) and not -limit <= scans.counts.min() <= scans.counts.max() < limit
    ):
        raise InvalidError(f"counts {scans.counts.shape}")
    spent = len(scans.counts) * size + sum(loss.discarded_bytes for loss in scans.losses)
    if not 0 <= len(case.data) - spent < size:
        raise InvalidError(f"{spent} of {len(case.data)} bytes accounted for")
    places = [loss.after_scan for loss in scans.losses]
    if places != sorted(places) or any(not 0 <= place <= len(scans.counts) for place in places):
        raise InvalidError(f"losses after scans {places}")
    return bool(len(scans.counts))


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
        driver.decode(driver.line.receive(0.0), 2)
        driver.stop()
    except InputError as fault:
        _one_line(fault)
        return False
    return True


MODELS = tuple(DRIVERS)


@dataclass(frozen=True)
class Target:
    """A reader: how an input is drawn, what is done with it, how many of them."""

    draw: Callable[[Random], Case]
    run: Callable[[Case], bool]
    inputs: int


def _files(files: list[tuple[str, bytes]], others: bool = True) -> Callable[[Random], Case]:
    every = [data for _, data in files]

    def draw(random: Random) -> Case:
        suffix, data = random.choice(files)
        return Case(mutate(data, random, every if others else ()), suffix)

    return draw


def _named(suffix: str, datas: list[bytes]) -> list[tuple[str, bytes]]:
    return [(suffix, data) for data in datas]


def _excel_parts(random: Random) -> Case:
    parts = dict(_workbook())
    for _ in range(random.choice((1, 1, 2))):
        name = random.choice(["xl/worksheets/sheet1.xml"] * 3 + list(parts))
        parts[name] = mutate(parts[name], random)
    return Case(seeds.zipped(parts), ".xlsx")


_workbook = cache(seeds.workbook)


def _matlab_packed(random: Random) -> Case:
    data = random.choice(_matlabs())
    return Case(seeds.repacked_matlab(data[:128] + mutate(data[128:], random)), ".mat")


_matlabs = cache(seeds.matlab)


@cache
def _raws() -> tuple[bytes, ...]:
    return (
        seeds.raw_file(),
        seeds.raw_file("di154", "DI-154RS"),
        seeds.raw_file("di245", "DI-245"),
        seeds.raw_file("di1100", "DI-1100"),
    )


def _raw_checked(random: Random) -> Case:
    """Damage under check sums that are right: what no disk, but a wrong program would do."""
    head, frames = seeds.raw_frames(random.choice(_raws()))
    for _ in range(random.choice((1, 1, 2, 4))):
        what = random.randrange(7)
        place = random.randrange(len(frames)) if frames else 0
        if what == 0:
            head = mutate(head, random).replace(b"\n", b" ")
        elif what == 1:
            key = random.choice([*seeds.RAW_HEADER, "version"])
            value = random.choice(
                [None, "", "x", -1, 0, 1e-300, 1e300, [], [0], [1, 1], ["1"], {}, True, 2**70]
            )
            head = seeds.raw_header({key: value})
        elif not frames:
            continue
        elif what == 2:
            body = frames[place].content
            frames[place] = frames[place]._replace(content=mutate(body, random) if body else b"x")
        elif what == 3:
            late_s = frames[place].time_s + 100.0
            odd = random.choice([-1.0, 0.0, 1e300, float("nan"), float("inf"), late_s, 1e7])
            frames[place] = frames[place]._replace(time_s=odd)
        elif what == 4:
            del frames[place]
        elif what == 5:
            at, stream = random.choice([0, 1, 500, 2**64 - 1]), random.choice([0, 1, 2, 65535])
            frames[place] = frames[place]._replace(at_byte=at, stream=stream)
        else:
            frames.insert(place, random.choice(frames))
    return Case(seeds.raw_joined(head, frames))


def _stream(model: str) -> Callable[[Random], Case]:
    sent = {count: seeds.streams(model, count) for count in (1, 2, 3, 4)}

    def draw(random: Random) -> Case:
        count = random.choice((1, 2, 3, 4))
        data = mutate(sent[count], random)
        return Case(data, detail=f"{model} {count} {random.randrange(1 << 30)}")

    return draw


def _answers(random: Random) -> Case:
    return Case(b"", detail=f"{random.choice(MODELS)} {random.randrange(1 << 30)}")


@cache
def _large_files() -> list[tuple[str, bytes]]:
    """Files of about a megabyte, in which what is quadratic would take its time."""
    text = ("t,theta\n" + seeds.rows("{t:.3f},{x:.5f}\n", count=60_000)).encode()
    blanks = ("t;theta\n" + seeds.rows("{t:.3f};\n", count=60_000)).encode()
    return [
        (".csv", text),
        (".csv", blanks),
        (".csv", text.replace(b"\n", b",")),
        (".csv", b"1;" * 400_000),
        (".csv", b'"' + text),
        (".WDQ", seeds.windaq(hires=False, scans=250_000)),
        (".WDH", seeds.windaq(hires=True, scans=250_000, comment=True)),
    ]


def _large(random: Random) -> Case:
    suffix, data = random.choice(_large_files())
    if suffix != ".csv" and random.random() < 0.7:
        head = mutate(data[:200], random)
        return Case(head[:200].ljust(200, b"\0") + data[200:], suffix)
    return Case(mutate(data, random), suffix)


def targets() -> dict[str, Target]:
    """All that is fuzzed; a million inputs together."""
    found = {
        "text tables": Target(_files(_named(".csv", seeds.texts())), run_file, 90_000),
        "the plain form": Target(_files(_named(".csv", seeds.plain())), run_file, 60_000),
        "WinDaq CSV": Target(_files(_named(".csv", seeds.windaq_csv())), run_file, 25_000),
        "DI-149 captures": Target(_files(_named(".cso", seeds.captures())), run_file, 40_000),
        "WinDaq": Target(_files(seeds.windaq_files()), run_file, 170_000),
        "MATLAB": Target(_files(_named(".mat", seeds.matlab())), run_file, 40_000),
        "MATLAB, inside the compression": Target(_matlab_packed, run_file, 15_000),
        "Excel": Target(_files([(".xlsx", seeds.zipped(_workbook()))]), run_file, 5_000),
        "Excel, inside the archive": Target(_excel_parts, run_file, 10_000),
        "raw recordings": Target(_files(_named("", list(_raws()))), run_raw, 60_000),
        "raw, with right check sums": Target(_raw_checked, run_raw, 60_000),
        "large files": Target(_large, run_file, 200),
        "answers of devices": Target(_answers, run_answers, 94_800),
    }
    for model in MODELS:
        marked = not find_driver(model).sends_stop_codes
        inputs = 20_000 if marked else 25_000
        found[f"decoder {model}"] = Target(_stream(model), run_decoder, inputs)
    found["XML projects and zips"] = Target(_files(seeds.projects()), run_file, 30_000)
    return found


JOURNAL = "fuzz"
BLOCK = 500
CORES = 2
LONGEST_S = 5.0
"""Of the processor, for one input."""
TRACED = 40
MOST_TIMES, SPARE_BYTES = 60, 4 << 20
ADDRESS_BYTES = 3 << 30
"""No worker gets more memory than that, so that a bomb fails instead of the machine."""

Tally = dict[str, Any]


class HangError(BaseException):
    """Out of time; no `Exception`, so that no reader catches it."""


def _alarm(_number: int, _frame: object) -> None:
    raise HangError


def begin() -> None:
    """Set up a worker: limits, and every warning an error."""
    warnings.simplefilter("error")
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_BYTES, resource.RLIM_INFINITY))
    signal.signal(signal.SIGPROF, _alarm)


def case_of(name: str, number: int) -> Case:
    """Draw an input: the same for the same number, on every machine."""
    every = _targets()
    return every[name].draw(Random((list(every).index(name) << 40) + number))


_made: dict[str, Any] = {}


def _targets() -> dict[str, Any]:
    if not _made:
        _made.update(targets())
    return _made


def judge(name: str, case: Case) -> str:
    """Run one input; say ``readable``, ``refused``, or what is wrong with it."""
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        return "readable" if _targets()[name].run(case) else "refused"
    except HangError:
        return "hang"
    except MemoryError:
        return "memory"
    except InvalidError as fault:
        return f"invalid: {fault}"
    except Exception as fault:
        last = traceback.extract_tb(fault.__traceback__)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}"
        return f"crash: {type(fault).__name__}: {str(fault)[:120]} ({where})"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def block(name: str, number: int, length: int = BLOCK) -> Tally:
    """Run a block of inputs."""
    tally: Tally = {"inputs": 0, "readable": 0, "refused": 0, "wrong": [], "times": 0.0, "cpu": 0.0}
    for place in range(number * BLOCK, number * BLOCK + length):
        case = case_of(name, place)
        traced = place % TRACED == 0
        if traced:
            tracemalloc.start()
        began = time.process_time()
        said = judge(name, case)
        if traced:
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            size = max(len(case.data), 1)
            tally["times"] = max(tally["times"], max(0, peak - SPARE_BYTES) / size)
            if peak > MOST_TIMES * size + SPARE_BYTES and said in ("readable", "refused"):
                said = f"memory: {peak} bytes at the peak for {size}"
        else:
            tally["cpu"] = max(tally["cpu"], time.process_time() - began)
        tally["inputs"] += 1
        if said in ("readable", "refused"):
            tally[said] += 1
        else:
            tally["wrong"].append([place, said])
    return tally


Blocks = dict[str, dict[str, Tally]]


def run(
    seconds: float | None = None, only: str | None = None, inputs: int | None = None
) -> dict[str, Tally]:
    """Run every block that is not done, or what fits; a worker that dies is a finding."""
    whole = seconds is None
    done: Blocks = journal.read(JOURNAL, {}) if whole else {}
    queue = [
        (name, number)
        for number in range(max(-(-t.inputs // BLOCK) for t in _targets().values()))
        for name, target in _targets().items()
        if number * BLOCK < target.inputs and only in (None, name)
    ]
    if inputs is not None:
        lengths = np.cumsum([_length(name, whole) for name, _ in queue])
        queue = queue[: int(np.searchsorted(lengths, inputs)) + 1]
    queue = [key for key in queue if str(key[1]) not in done.get(key[0], {})]
    until = time.monotonic() + (seconds or 1e9)
    while queue and time.monotonic() < until:
        _drain(queue, done, until, whole)
    if whole:
        journal.keep(JOURNAL, done)
    return {name: _total(done[name]) for name in _targets() if name in done}


def _drain(queue: list[tuple[str, int]], done: Blocks, until: float, whole: bool) -> None:
    """Hand blocks to a few workers until all are done, time is up, or one has died."""
    kept_at = time.monotonic()
    running: dict[tuple[str, int], Future[Tally]] = {}
    with ProcessPoolExecutor(CORES, initializer=begin) as pool:
        try:
            while running or (queue and time.monotonic() < until):
                while queue and len(running) < 2 * CORES and time.monotonic() < until:
                    name, number = queue.pop(0)
                    length = _length(name, whole)
                    running[name, number] = pool.submit(block, name, number, length)
                # A block of large files takes as long as twenty others.
                ready, _ = wait(running.values(), return_when=FIRST_COMPLETED)
                (name, number), future = next(i for i in running.items() if i[1] in ready)
                done.setdefault(name, {})[str(number)] = future.result()
                del running[name, number]
                if whole and time.monotonic() - kept_at > 5.0:
                    kept_at = time.monotonic()
                    journal.keep(JOURNAL, done)
                    _progress(done)
        except BrokenProcessPool:
            for name, number in running:
                tally = dict.fromkeys(("readable", "refused", "times", "cpu"), 0)
                said = "the interpreter died in this block, or in one beside it"
                tally |= {"inputs": _length(name, whole)}
                done.setdefault(name, {})[str(number)] = {
                    **tally,
                    "wrong": [[number * BLOCK, said]],
                }


def _total(blocks: dict[str, Tally]) -> Tally:
    """Join the tallies of a target."""
    first, *rest = blocks.values()
    for tally in rest:
        sums = {key: first[key] + tally[key] for key in ("inputs", "readable", "refused", "wrong")}
        first = sums | {key: max(first[key], tally[key]) for key in ("times", "cpu")}
    return first


def _length(name: str, whole: bool) -> int:
    """A block is whole; where time is short, the first inputs of one (of large files, two)."""
    inputs: int = _targets()[name].inputs
    if whole:
        return min(BLOCK, inputs)
    return 25 if inputs > BLOCK else 2


def _progress(done: Blocks) -> None:
    inputs = sum(tally["inputs"] for blocks in done.values() for tally in blocks.values())
    wrong = sum(len(tally["wrong"]) for blocks in done.values() for tally in blocks.values())
    print(f"\r{inputs} inputs, {wrong} wrong", end="", file=sys.stderr, flush=True)


def table(total: dict[str, Tally]) -> str:
    """Print what came out."""
    lines = [
        "| what is read | inputs | valid recordings | clean errors | crashes, hangs, invalid | "
        "memory, times the input (beyond 4 MB) | longest, s of the processor |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, tally in total.items():
        lines.append(
            f"| {name} | {tally['inputs']} | {tally['readable']} | {tally['refused']} | "
            f"{len(tally['wrong'])} | {tally['times']:.0f} | {tally['cpu']:.2f} |"
        )
    inputs = sum(tally["inputs"] for tally in total.values())
    wrong = sum(len(tally["wrong"]) for tally in total.values())
    lines.append(f"| **all** | {inputs} | | | **{wrong}** | | |")
    return "\n".join(lines)


def fuzz_table(_folder: Path) -> str:
    """All of it, for `benchmarks.acquisition`."""
    total = run()
    _tell_wrong(total)
    return table(total)


def _tell_wrong(total: dict[str, Tally]) -> None:
    for name, tally in total.items():
        kinds = Counter(said for _, said in tally["wrong"])
        first = {said: place for place, said in reversed(tally["wrong"])}
        for said, count in kinds.most_common(20):
            print(f"{name}, input {first[said]} ({count} alike): {said}", file=sys.stderr)
            wrong = journal.KEPT / "fuzz"
            wrong.mkdir(parents=True, exist_ok=True)
            path = wrong / f"{name.replace(' ', '-').replace(',', '')}-{first[said]}"
            path.write_bytes(case_of(name, first[said]).data)


def main() -> int:
    parser = argparse.ArgumentParser(description="fuzz every reader and decoder")
    parser.add_argument("--seconds", type=float, help="as much as fits, from the beginning")
    parser.add_argument("--only", help="one target")
    parser.add_argument("--inputs", type=int, help="how many, of those that are in the journal too")
    parser.add_argument("--case", nargs=2, metavar=("TARGET", "NUMBER"), help="one input again")
    arguments = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if arguments.case:
        warnings.simplefilter("error")
        name, number = arguments.case
        case = case_of(name, int(number))
        print(f"{len(case.data)} bytes {case.suffix} {case.detail}: {case.data[:300]!r}")
        print("readable" if _targets()[name].run(case) else "refused")
        return 0
    total = run(arguments.seconds, arguments.only, arguments.inputs)
    print(f"{table(total)}\n\nMade by commit {journal.commit()}.")
    _tell_wrong(total)
    return 1 if any(tally["wrong"] for tally in total.values()) else 0


if __name__ == "__main__":
    raise SystemExit(main())
