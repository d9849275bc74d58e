"""Hostile input: what the command line answers, in what time and in how much memory.

    python -m benchmarks.hostile             the table; rows that this code has done are kept
    python -m benchmarks.hostile pipe noise  the rows with one of these words

A row is right when its process ends within 10 s of the processor (a diagnosis within 20, since
others may be at work by the clock) and 1 GB without a traceback, with an exit status that it may
have and, where that is 2, one line of standard error that is the fault (notes on what was guessed
may stand before it), and leaves no figure above 1 MB.
"""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import yaml

from benchmarks.hostile_recordings import recordings
from benchmarks.journal import ROOT, answers, commit, judge_parser
from benchmarks.table import head, table_row

MOST_CPU_S, MOST_DIAGNOSIS_CPU_S, MOST_MB = 10.0, 20.0, 1000.0
WRONG: Final = "**wrong** "
SOURCES: Final = ("src/pendpipe/**/*.py", "benchmarks/hostile*.py")
Row = tuple[Callable[[Path], list[str]], tuple[int, ...]]
"""What makes an input in a folder and returns the words of the command; statuses that are right."""


def rows() -> Iterator[tuple[str, Row]]:
    """All hostile inputs, by name."""
    for cells, statuses in ((600_000, (0, 2)), (2_000_000, (2,)), (8_000_000, (2,))):
        yield f"workbook of {cells:,} cells", (lambda f, n=cells: _workbook(f, n // 100), statuses)
    for name, parts in (
        ("CSV of 10^7 columns", [b"1," * 10**6] * 10 + [b"1\n2,3\n"]),
        ("a line of 100 MB", [b"9" * 10**6] * 100),
        ("40 MB of # lines", [b"# nothing\n" * 10**5] * 40),
        ("recording that is not text", [b"\xff\xfe\x00\x81" * 1000]),
    ):
        yield name, (lambda f, p=parts: ["inspect", _written(f / "a.csv", *p)], (2,))
    yield "sparse WinDaq of 5 GB", (_sparse, (2,))
    yield "pipe", (_pipe, (2,))
    yield "/dev/zero", (lambda _: ["inspect", "/dev/zero"], (2,))
    yield "a folder as recording", (lambda f: ["inspect", str(f)], (2,))
    long = "x" * 300 + ".csv"
    convert = ["convert", "examples/string-pendulum.csv"]
    yield "output name of 300 letters", (lambda f: [*convert, str(f / long)], (2,))
    for name, last in (("points 1e12", b"1e12,1e12\n"), ("not UTF-8", b"\xff,\xfe\n")):
        table = b"volts,angle_rad\n" + b"".join(b"%d,%d\n" % (i, i) for i in range(5)) + last
        yield (
            f"calibration {name}",
            (lambda f, t=table: ["calibrate", _written(f / "a.csv", t)], (2,)),
        )
    for value, keys in (
        (float("nan"), ("geometries", "low-1", "weights_m", "upper")),
        (float("inf"), ("apparatus", "rod", "mass_kg")),
        ("a;touch PWNED;", ("results",)),
        ("/", ("records",)),
    ):
        name = f"configuration with {value} as {keys[-1]}"
        yield name, (lambda f, v=value, k=keys: _changed(f, v, *k), (2,))
    for odd in ("my data", "a, b", "c;d (1)", "e'f\"g", "two  blanks", "été"):
        yield f"from {odd}/", (lambda f, o=odd: _from(f / o), (0,))
    for name, write in recordings():
        yield (
            f"diagnose: {name}",
            (lambda f, w=write: ["diagnose", str(w(f)), "--out", str(f / "out")], (0, 2)),
        )


def _written(path: Path, *parts: bytes) -> str:
    path.parent.mkdir(exist_ok=True)
    with path.open("wb") as stream:
        stream.writelines(parts)
    return str(path)


def _sparse(folder: Path) -> list[str]:
    with (folder / "a.WDQ").open("wb") as stream:
        stream.truncate(5 << 30)
    return ["inspect", str(folder / "a.WDQ")]


def _pipe(folder: Path) -> list[str]:
    os.mkfifo(folder / "pipe.csv")
    return ["inspect", str(folder / "pipe.csv")]


def _workbook(folder: Path, count: int) -> list[str]:
    """A workbook as openpyxl writes it, its sheet replaced by so many rows of 100 cells."""
    import openpyxl

    plain, path = folder / "plain.xlsx", folder / "a.xlsx"
    openpyxl.Workbook().save(plain)
    row = b"<row>" + b'<c r="A1"><v>0.123456</v></c>' * 100 + b"</row>"
    space = b"http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    with zipfile.ZipFile(plain) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            with new.open(name, "w") as part:
                if not name.endswith("sheet1.xml"):
                    part.write(old.read(name))
                    continue
                part.write(b'<worksheet xmlns="%b"><sheetData>' % space)
                for _ in range(count):
                    part.write(row)
                part.write(b"</sheetData></worksheet>")
    return ["inspect", str(path)]


def _changed(folder: Path, value: object, *keys: str) -> list[str]:
    content = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))
    holder = content
    for key in keys[:-1]:
        holder = holder[key]
    holder[keys[-1]] = value
    return ["config", _written(folder / "config.yaml", yaml.safe_dump(content).encode())]


def _from(folder: Path) -> list[str]:
    """The fit of a recording in a folder with an odd name."""
    content = (ROOT / "examples/string-pendulum.csv").read_bytes()
    return ["fit", _written(folder / "run 7.csv", content), "--out", str(folder / "fit.json")]


def cells(name: str) -> list[str]:
    """Run a row, and return what stands in the table behind its name."""
    make, statuses = dict(rows())[name]
    with tempfile.TemporaryDirectory() as place, tempfile.TemporaryFile() as errors:
        folder, began = Path(place), time.monotonic()
        call = [sys.executable, "-m", "pendpipe.cli", *make(folder)]
        quiet: dict[str, Any] = dict.fromkeys(("stdin", "stdout"), subprocess.DEVNULL)
        with subprocess.Popen(call, cwd=ROOT, stderr=errors, **quiet) as running:
            resource.prlimit(running.pid, resource.RLIMIT_CPU, (120, 120))
            _, state, used = os.wait4(running.pid, 0)
            running.returncode = status = os.waitstatus_to_exitcode(state)
        spent = time.monotonic() - began
        errors.seek(0)
        said = errors.read().decode(errors="replace").strip()
        said = re.sub(r"(\S{20})\S{80,}", r"\1...", said.replace(place + os.sep, ""))
        large = [path.name for path in folder.glob("out/*.svg") if path.stat().st_size > 1e6]
    cpu_s, megabytes = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
    right = (
        cpu_s < (MOST_DIAGNOSIS_CPU_S if name.startswith("diagnose") else MOST_CPU_S)
        and megabytes < MOST_MB
        and status in statuses
        and "Traceback" not in said
        and (status != 2 or len(re.findall("^pendpipe: ", said, re.MULTILINE)) == 1)
        and not large
    )
    line = f"above 1 MB: {large}" if large else (said.splitlines() or [""])[-1]
    shown = ("" if right else WRONG) + line[:150].replace("|", "\\|")
    return [f"{spent:.1f}", f"{cpu_s:.1f}", f"{megabytes:.0f}", str(status), shown]


def main() -> int:
    """Run the rows that are asked for and print the table; status 1 where one is wrong."""
    parser = judge_parser(__doc__, "hostile", 0)
    parser.add_argument("words", nargs="*", help="of the rows; all, if none is named")
    told = parser.parse_args()
    chosen = [
        name for name, _ in rows() if not told.words or any(word in name for word in told.words)
    ]
    chosen = chosen[: told.number or None]
    # The first fit on a machine compiles the engine: that is no row's time.
    subprocess.run([sys.executable, "-m", "pendpipe.warm_up"], check=True)
    print(head("input", "s", "s of the processor", "MB", "exit", "answer"))
    wrong = 0
    for name, found in zip(chosen, answers(told, chosen, cells, SOURCES), strict=True):
        print(table_row(name, found), flush=True)
        wrong += found[-1].startswith(WRONG)
    print(f"\n{wrong} wrong of {len(chosen)}. Made by commit {commit()}.")
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
