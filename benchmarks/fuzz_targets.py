"""What the fuzzer damages, how, and how many inputs there are of each kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from random import Random

from benchmarks import fuzz_seeds as seeds
from benchmarks.fuzz_checks import Case, run_answers, run_decoder, run_file, run_raw
from benchmarks.fuzz_mutations import mutate
from pendpipe.acquire.drivers import DRIVERS, find_driver
from pendpipe.acquire.drivers.sync_bit import SyncBitDecoder

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
        what = random.randrange(6)
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
            kind, time_s, body = frames[place]
            frames[place] = (kind, time_s, mutate(body, random) if body else b"x")
        elif what == 3:
            kind, time_s, body = frames[place]
            odd = random.choice([-1.0, 0.0, 1e300, float("nan"), float("inf"), time_s + 100.0, 1e7])
            frames[place] = (kind, odd, body)
        elif what == 4:
            del frames[place]
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
        "WinDaq": Target(_files(seeds.windaq_files()), run_file, 200_000),
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
        marked = isinstance(find_driver(model).decoder(1), SyncBitDecoder)
        inputs = 20_000 if marked else 25_000
        found[f"decoder {model}"] = Target(_stream(model), run_decoder, inputs)
    return found
