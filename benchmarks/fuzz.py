"""Damage every kind of input: each ends in one clean line or in a valid recording.

    python -m benchmarks.fuzz [--number 20000] [--case NUMBER]

Seeds are the sample files of `tests/formats`, the small files of ../shared/recordings, raw
recordings of simulated devices, and bytes of every device's stream, of which each must be accounted
for. Input N is the same on every machine that has the same seeds. An input has 5 s of the
processor and 3 GB.
"""

from __future__ import annotations

import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from functools import cache
from pathlib import Path
from random import Random

import numpy as np

from benchmarks.acquisition import recorded_bytes
from benchmarks.journal import ROOT, answers, commit, judge_parser
from pendpipe.acquisition.decode import decode_recording
from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.drivers import DRIVERS, find_driver
from pendpipe.errors import InputError
from pendpipe.formats import inspect, read
from pendpipe.recording import check

SHARED = ROOT.parent / "shared/recordings"
LARGEST, LONGEST_S, MEMORY = 30_000, 5.0, 3 << 30
WORDS = (
    *(b"nan", b"-inf", b"1e999", b"-", b",", b";", b"\t", b'"', b"#", b"\r", b"\n\n", b"\0"),
    *(b"\xef\xbb\xbf", b"\xff\xfe", b"\xf0\x9f\x98\x80", b"9" * 30, b"Time (s)", b"deg", b"sc "),
    *(b"stop 01", b"# bits: 0\n", b'r="XFD7"', b"&#x10ffff;", b"\x7f\xff\xff\xff", b"\xff" * 64),
)


@cache
def seeds() -> dict[str, bytes]:
    """Files by name; of raw recordings and streams the model stands for a suffix."""
    paths = [*(ROOT / "tests/formats").glob("*/*.*"), *SHARED.rglob("*.*")]
    small = [p for p in paths if p.is_file() and p.stat().st_size < LARGEST]
    found = {p.as_posix(): p.read_bytes() for p in sorted(small) if p.suffix not in (".py", ".md")}
    for model in ("di154", "di245", "di1100", "di2108"):
        found[f"raw.{model}"] = recorded_bytes(model)
    for model in DRIVERS:
        device = DEVICES[model]()
        half = 1 << (device.bits - 1)
        codes = np.random.default_rng(1).integers(-half, half, (60, 2))
        found[f"stream.{model}"] = device.encode(codes)
    return found


def damaged(data: bytes, random: Random) -> bytes:
    """Some bits flipped, bytes cut out, repeated or replaced by words, or the end lost."""
    found = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 3, 5, 8))):
        # Sizes and counts stand among the first bytes.
        within = min(len(found), random.choice((160, len(found), len(found))))
        at, length = random.randrange(within + 1), random.choice((1, 1, 2, 3, 16, 200))
        match random.randrange(6):
            case 0 if found:
                found[min(at, len(found) - 1)] ^= 1 << random.randrange(8)
            case 1:
                del found[at : at + length]
            case 2:
                found[at:at] = found[at : at + length] * random.choice((1, 2, 20))
            case 3:
                word = random.choice(WORDS)
                found[at : at + random.choice((0, len(word)))] = word
            case 4:
                found[at : at + 1] = random.randbytes(1)
            case _ if random.randrange(4) == 0:
                del found[at:]
    return bytes(found)


def decode_stream(model: str, data: bytes) -> None:
    """Decode a stream of two channels: every byte is in a scan, in a loss or waiting."""
    scans = find_driver(model).decode(data, 2)
    spent = 4 * len(scans.counts) + sum(loss.discarded_bytes for loss in scans.losses)
    assert 0 <= len(data) - spent < 4, f"{spent} of {len(data)} bytes accounted for"
    places = [loss.after_scan for loss in scans.losses]
    assert places == sorted(places), f"losses after scans {places}"


def answer(number: int, *, show: bool = False) -> tuple[str, str]:
    """The seed of an input, and ``read``, ``refused`` or what is wrong."""
    begin()
    random = Random(number)
    name = random.choice(sorted(seeds()))
    data, (kind, _, suffix) = damaged(seeds()[name], random), name.rpartition(".")
    if show:
        print(f"{name}: {len(data)} bytes, {data[:300]!r}")
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    try:
        if kind == "stream":
            decode_stream(suffix, data)
        elif kind == "raw":
            check(name, decode_recording(data))
        else:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / f"damaged.{suffix}"
                path.write_bytes(data)
                try:
                    check(name, read(path))
                finally:
                    inspect(path)
    except InputError as fault:
        clean = "\n" not in str(fault) and len(str(fault)) < 2000
        return name, "refused" if clean else f"no single line: {str(fault)[:200]!r}"
    except BaseException as fault:
        if show:
            traceback.print_exc()
        last = traceback.extract_tb(fault.__traceback__)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}"
        return name, f"wrong: {type(fault).__name__} {str(fault)[:120]} ({where})"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return name, "read"


class HangError(BaseException):
    """Out of time; no `Exception`, so that no reader catches it."""


def _alarm(*_: object) -> None:
    raise HangError


@cache
def begin() -> None:
    """Set up a worker: limits, and every warning an error."""
    warnings.simplefilter("error")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.RLIM_INFINITY))
    signal.signal(signal.SIGPROF, _alarm)


def main() -> int:
    """Print how many inputs were read, refused and wrong; status 1 where one is wrong."""
    parser = judge_parser(__doc__, "fuzz", 20_000)
    parser.add_argument("--case", type=int, metavar="NUMBER", help="one input, with its traceback")
    told = parser.parse_args()
    if told.case is not None:
        print(*answer(told.case, show=True))
        return 0
    said = Counter[str]()
    sources = ("src/pendpipe/**/*.py", "benchmarks/fuzz.py")
    for case, (name, outcome) in enumerate(answers(told, range(told.number), answer, sources)):
        said[outcome.partition(":")[0]] += 1
        if outcome not in ("read", "refused"):
            print(f"{case} ({name}): {outcome}", file=sys.stderr, flush=True)
    print(f"{told.number} inputs of {len(seeds())} seeds: {dict(said)}. Made by commit {commit()}.")
    return int(set(said) > {"read", "refused"})


if __name__ == "__main__":
    raise SystemExit(main())
