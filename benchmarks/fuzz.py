"""Damage every kind of input: each ends in one clean line or in a valid recording.

    python -m benchmarks.fuzz [--archives] [--number 20000] [--case NUMBER]

Seeds are the sample files of `tests/formats`, the small files of ../shared/recordings, raw
recordings of simulated devices, and bytes of every device's stream, of which each must be accounted
for. Input N is the same on every machine that has the same seeds. An input has 5 s of the
processor and 3 GB.

With ``--archives`` they are zips, workbooks, HDF5 files and packed arrays whose names, prefixes,
links and sizes are drawn; each has 10 s of the processor and 1 GB above the program's own, and what
it reads of another file is wrong.
"""

from __future__ import annotations

import gzip
import os
import resource
import signal
import sys
import tempfile
import traceback
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from random import Random

import h5py
import numpy as np
import openpyxl

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
    # Their names, by whose order a case is drawn, are the same wherever the repository lies.
    found = {
        p.relative_to(
            SHARED.parent if p.is_relative_to(SHARED) else ROOT
        ).as_posix(): p.read_bytes()
        for p in small
        if p.suffix not in (".py", ".md")
    }
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


SECRET = 0.3 * np.cos(6.1 * np.arange(500.0) / 20.0)
"""What another file of the reader's holds."""


def name_of_member(random: Random) -> str:
    """A path as a zip may have it."""
    names = (
        "a.csv",
        "data.tsv",
        "é.txt",
        "x" * 300 + ".csv",
        "noend",
        "a.trk",
        "\u202e.csv",
        "CON",
    )
    folders = (
        "",
        "",
        "",
        "",
        "run/",
        "xl/",
        "xl/worksheets/",
        "meta/",
        "../../",
        "/etc/",
        "__MACOSX/",
        "a\\b/",
        "./",
    )
    return random.choice(folders) + random.choice(
        (*names, "sheet1.xml", "styles.xml", "content.xml")
    )


def swing(random: Random, rows: int) -> str:
    """A table of time and angle, of cells that may be texts."""
    sign = random.choice((",", ";", "\t"))
    body = (f"{k / 20:.2f}{sign}{0.2 * np.cos(k / 3.7):.4f}" for k in range(rows))
    return "\n".join([f"t (s){sign}angle (rad)", *body])


def sheet(random: Random, rows: int) -> str:
    """XML of a sheet, with any prefix, encoding, place of the cells and number of formats."""
    prefix = random.choice(("", "", "s:", "x14:"))
    first = random.choice(("", "<?xml version='1.0' encoding='utf-16'?>", "<!DOCTYPE a>", "   "))
    cell = random.choice(('r="A1"', "", 'r="XFD1048576"', "r='ZZZ9'", 't="inlineStr"', 's="99999"'))
    row = f"<{prefix}row>" + f"<{prefix}c {cell}><{prefix}v>0.12</{prefix}v></{prefix}c>" * 4
    others = "<xf/>" * random.choice((*[0] * 9, 10, 200_000))
    rows *= 100 if random.random() < 0.03 else 1
    return (
        f"{first}<{prefix}worksheet>{(row + f'</{prefix}row>') * rows}{others}</{prefix}worksheet>"
    )


def zip_of(random: Random, folder: Path) -> Path:
    """A zip, a workbook or an OpenDocument table of members that are drawn."""
    path = folder / f"a{random.choice(('.zip', '.xlsx', '.ods', '.phyphox'))}"
    if random.random() < 0.3:
        openpyxl.Workbook().save(path)
    packing = random.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    with zipfile.ZipFile(path, "a", packing) as archive:
        for number in range(random.choice((*[1, 1, 2, 3, 5] * 8, 30, 300, 12_000))):
            name = name_of_member(random) + str(number) * (random.random() < 0.2)
            rows = 0 if number > 5 else random.choice((0, 3, 300, 300, 300, 1000))
            content = sheet(random, rows) if name.endswith(".xml") else swing(random, rows)
            # One at most: an archive is no larger than 64 MB.
            large = number == 0 and random.random() < 0.02
            bomb = b"0,0\n" * random.choice((1 << 20, 12 << 20)) if large else b""
            coding = "utf-16" if "utf-16" in content[:60] else "utf-8"
            archive.writestr(name, bomb or content.encode(coding))
    return path


def arrays_of(random: Random, folder: Path) -> Path:
    """An HDF5 file whose arrays lie anywhere: in it, in another file, behind a link, in a pipe."""
    path, other = folder / "a.h5", folder / random.choice(("other.h5", "pipe"))
    if other.name == "pipe":
        os.mkfifo(other)
    else:
        with h5py.File(other, "w") as file:
            file["secret"] = SECRET
    with h5py.File(path, "w") as file:
        file["t"] = np.arange(500.0) / 20.0
        for number in range(random.choice((*[1, 1, 2, 3] * 10, 2000))):
            place, size = f"{random.choice(('', 'run/', 'a/b/'))}x{number}", (len(SECRET),)
            match random.choice("cccccsevlg") if number < 5 else "c":
                case "s":
                    file.create_dataset(place, size, "f8", external=[(str(other), 0, 8 * size[0])])
                case "e":
                    file[place] = h5py.ExternalLink(str(other), "secret")
                case "v":
                    layout = h5py.VirtualLayout(size, "f8")
                    layout[:] = h5py.VirtualSource(str(other), "secret", size)
                    file.create_virtual_dataset(place, layout)
                case "l":
                    file[place] = h5py.SoftLink(random.choice(("/", "/t", f"/{place}", "/none")))
                case "g":
                    many = random.choice((10**6, 10**8, 10**10))
                    file.create_dataset(place, (many,), "i1", chunks=(10**6,), compression=1)
                case _:
                    file[place] = 0.1 * np.cos(np.arange(float(size[0])))
    return path


def packed_of(random: Random, folder: Path) -> Path:
    """Packed text or arrays of any size."""
    count = random.choice((*[10, 500, 500, 500, 10**4] * 10, 10**5, 10**6, 2 * 10**7))
    if random.random() < 0.5:
        path = folder / "a.csv.gz"
        path.write_bytes(gzip.compress(b"0.5,0.25\n" * count, 1))
    else:
        path = folder / "a.npz"
        np.savez_compressed(
            path, t=np.arange(500.0), x=np.zeros(count, random.choice(("i1", "f8")))
        )
    return path


def archive(number: int, *, show: bool = False) -> tuple[str, str]:
    """The kind of an archive, and ``read``, ``refused`` or what is wrong."""
    random = Random(number)
    make = random.choice((zip_of, zip_of, arrays_of, arrays_of, packed_of))
    with tempfile.TemporaryDirectory() as folder:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            path = make(random, Path(folder))
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

        def run() -> None:
            try:
                found = read(path).values
                same = len(found) == len(SECRET) and np.allclose(found, SECRET)
                assert not same, "it read another file"
            finally:
                inspect(path)

        outcome = judged(run, 10.0, show=show)
        taken = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        return make.__name__, f"wrong: {taken >> 10} MB" if taken > 1 << 20 else outcome


def answer(number: int, *, show: bool = False) -> tuple[str, str]:
    """The seed of an input, and ``read``, ``refused`` or what is wrong."""
    random = Random(number)
    name = random.choice(sorted(seeds()))
    data, (kind, _, suffix) = damaged(seeds()[name], random), name.rpartition(".")
    if show:
        print(f"{name}: {len(data)} bytes, {data[:300]!r}")

    def run() -> None:
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

    return name, judged(run, LONGEST_S, show=show)


def judged(run: Callable[[], None], longest_s: float, *, show: bool) -> str:
    """Run within the limits: ``read``, ``refused`` in one line, or what is wrong."""
    begin()
    signal.setitimer(signal.ITIMER_PROF, longest_s)
    try:
        run()
    except InputError as fault:
        clean = "\n" not in str(fault) and len(str(fault)) < 2000
        return "refused" if clean else f"no single line: {str(fault)[:200]!r}"
    except BaseException as fault:
        if show:
            traceback.print_exc()
        last = traceback.extract_tb(fault.__traceback__)[-1]
        where = f"{Path(last.filename).name}:{last.lineno}"
        return f"wrong: {type(fault).__name__} {str(fault)[:120]} ({where})"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return "read"


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
    parser.add_argument("--archives", action="store_true", help="zips, workbooks, files of arrays")
    told = parser.parse_args()
    of = archive if told.archives else answer
    told.journal = told.journal.with_stem(of.__name__ if told.archives else told.journal.stem)
    if told.case is not None:
        print(*of(told.case, show=True))
        return 0
    said = Counter[str]()
    sources = ("src/pendpipe/**/*.py", "benchmarks/fuzz.py")
    for case, (name, outcome) in enumerate(answers(told, range(told.number), of, sources)):
        said[outcome.partition(":")[0]] += 1
        if outcome not in ("read", "refused"):
            print(f"{case} ({name}): {outcome}", file=sys.stderr, flush=True)
    what = "archives" if told.archives else f"inputs of {len(seeds())} seeds"
    print(f"{told.number} {what}: {dict(said)}. Made by commit {commit()}.")
    return int(set(said) > {"read", "refused"})


if __name__ == "__main__":
    raise SystemExit(main())
