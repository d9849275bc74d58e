"""Fuzzing of every reader and decoder: a million damaged inputs in fixed order.

    python -m benchmarks.fuzz                all of it; goes on where it was broken off
    python -m benchmarks.fuzz --seconds 8    as much as fits, from the beginning (CI)
    python -m benchmarks.fuzz --case "WinDaq" 1234    one input again, with its traceback

An input is right when it ends in one clean line or in a valid recording, in less than five
seconds of the processor, and with a peak of memory (one input in forty is traced) below
`MOST_TIMES` its size and `SPARE_BYTES`. What is wrong is kept in ``.evidence/fuzz/``.
"""

from __future__ import annotations

import argparse
import os
import resource
import signal
import sys
import time
import traceback
import tracemalloc
import warnings
from collections import Counter
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from random import Random
from typing import Any

from benchmarks import journal
from benchmarks.fuzz_checks import Case, InvalidError
from benchmarks.fuzz_targets import targets

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


def run(seconds: float | None = None, only: str | None = None) -> dict[str, Tally]:
    """Run every block that is not done, or what fits; a worker that dies is a finding."""
    whole = seconds is None
    done: Blocks = journal.read(JOURNAL, {}) if whole else {}
    queue = [
        (name, number)
        for number in range(max(-(-t.inputs // BLOCK) for t in _targets().values()))
        for name, target in _targets().items()
        if number * BLOCK < target.inputs and only in (None, name)
    ]
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
                (name, number), future = next(iter(running.items()))
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
                    **tally, "wrong": [[number * BLOCK, said]]
                }  # fmt: skip


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
    total = run(arguments.seconds, arguments.only)
    print(table(total))
    _tell_wrong(total)
    return 1 if any(tally["wrong"] for tally in total.values()) else 0


if __name__ == "__main__":
    raise SystemExit(main())
