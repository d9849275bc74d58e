"""Hostile input: what the command line answers, in what time and in how much memory.

    python -m benchmarks.hostile             every row of the table
    python -m benchmarks.hostile pipe YAML   the rows with one of these words

A row is right when its process ends within 10 s and 1 GB without a traceback, with the exit
status that it should have and, where that is 2, one line of standard error that is the fault
(notes on what was guessed may stand before it).
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]
MOST_SECONDS = 10.0
MOST_MB = 1000.0
RIGHT = ((2,), (0, 2))
"""Statuses of an input that must be refused, and of one that may also be read."""


@dataclass(frozen=True)
class Row:
    """A hostile input: what makes it in a folder and returns the words of the command."""

    name: str
    command: Callable[[Path], list[str]]
    statuses: tuple[int, ...] = RIGHT[0]


def rows() -> Iterator[Row]:
    """All hostile inputs."""
    yield Row("workbook of 2 million cells", lambda f: _workbook(f, 20_000), RIGHT[1])
    yield Row("workbook of 8 million cells", lambda f: _workbook(f, 80_000))
    yield Row("CSV of 10^7 columns", lambda f: _file(f, [b"1," * 10**6] * 10 + [b"1\n2,3\n"]))
    yield Row("a line of 100 MB", lambda f: _file(f, [b"9" * 10**6] * 100))
    yield Row("40 MB of # lines", lambda f: _file(f, [b"# nothing\n" * 10**5] * 40))
    yield Row("sparse WinDaq of 5 GB", _sparse)
    yield Row("pipe", _pipe)
    yield Row("/dev/zero", lambda _: ["inspect", "/dev/zero"])
    yield Row("a folder as recording", lambda f: ["inspect", str(f)])
    yield Row("recording that is not text", lambda f: _file(f, [b"\xff\xfe\x00\x81" * 1000]))
    for scale, name in ((1e-300, "1e-300"), (1e300, "1e300")):
        yield Row(f"all values x {name}", lambda f, s=scale: _swing(f, values=s), RIGHT[1])  # type: ignore[misc]
        yield Row(f"all times x {name}", lambda f, s=scale: _swing(f, times=s), RIGHT[1])  # type: ignore[misc]
    yield Row("negative times", lambda f: _swing(f, start=-100.0), RIGHT[1])
    yield Row("output name of 300 letters", _long_output)
    yield Row("calibration points 1e12", lambda f: _caliper(f, b"1e12,1e12\n"), RIGHT[1])
    yield Row("calibration not UTF-8", lambda f: _caliper(f, b"\xff,\xfe\n"))
    for content, name in (
        (b"[" * 5000, "YAML nested 5,000 deep"),
        (b"a: \x01", "YAML with a control character"),
        (b"\xff\xfe\x81", "configuration not UTF-8"),
        (b"", "empty configuration"),
    ):
        yield Row(name, lambda f, c=content: _configuration(f, c))  # type: ignore[misc]
    yield Row("a folder as configuration", lambda f: ["config", str(f)])
    nan, infinite = float("nan"), float("inf")
    yield Row(
        "NaN geometry", lambda f: _changed(f, nan, "geometries", "low-1", "weights_m", "upper")
    )
    yield Row("infinite mass", lambda f: _changed(f, infinite, "apparatus", "rod", "mass_kg"))
    yield Row("results for the shell", lambda f: _changed(f, "a;touch PWNED;", "results"))
    yield Row("a folder as table", lambda f: _changed(f, str(f), "records"))
    yield Row("table not UTF-8", lambda f: _table(f, b"record\tsource\n\xff\tsimulated\n"))
    for ids in (
        ["campaign.json"],
        ["x" * 300],
        ["CON"],
        ["nul.txt"],
        ["a", "a."],
        ["=cmd|' /C calc'!A0"],
        ["../up"],
    ):
        name = "id " + " beside ".join(i if len(i) < 99 else f"of {len(i)} letters" for i in ids)
        lines = "".join(f"{i}\tsimulated\n" for i in ids).encode()
        yield Row(name, lambda f, t=lines: _table(f, b"record\tsource\n" + t))  # type: ignore[misc]


def main() -> None:
    """Run the rows that are asked for and print the table; status 1 where one is wrong."""
    asked = sys.argv[1:]
    wrong = 0
    print(f"{'input':<32} {'s':>5} {'MB':>5} {'exit':>4}  answer")
    for row in rows():
        if asked and not any(word in row.name for word in asked):
            continue
        with tempfile.TemporaryDirectory() as folder:
            seconds, megabytes, status, said, traced = _measured(row.command(Path(folder)))
            said = said.replace(folder + os.sep, "")
        said = re.sub(r"(\S{20})\S{80,}", r"\1...", said)
        right = (
            seconds < MOST_SECONDS
            and megabytes < MOST_MB
            and status in row.statuses
            and not traced
            and (status != 2 or len(re.findall("^pendpipe: ", said, re.MULTILINE)) == 1)
        )
        wrong += not right
        line = said.splitlines()[-1] if said else ""
        mark = "" if right else "WRONG: "
        print(
            f"{row.name:<32} {seconds:5.1f} {megabytes:5.0f} {status:4d}  {mark}{line[:150]}",
            flush=True,
        )
    print(f"{wrong} wrong")
    sys.exit(wrong > 0)


def _measured(words: list[str]) -> tuple[float, float, int, str, bool]:
    """Seconds, peak memory in MB, status, and standard error of one call of pendpipe."""
    with tempfile.TemporaryFile() as errors:
        began = time.monotonic()
        running = subprocess.Popen(
            [sys.executable, "-m", "pendpipe.cli", *words],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
        stop = threading.Timer(2 * MOST_SECONDS, running.kill)
        stop.start()
        _, state, used = os.wait4(running.pid, 0)
        stop.cancel()
        seconds = time.monotonic() - began
        running.returncode = os.waitstatus_to_exitcode(state)
        errors.seek(0)
        said = errors.read().decode(errors="replace").strip()
    return seconds, used.ru_maxrss / 1024, running.returncode, said, "Traceback" in said


def _file(folder: Path, parts: list[bytes]) -> list[str]:
    with (folder / "a.csv").open("wb") as stream:
        stream.writelines(parts)
    return ["inspect", str(folder / "a.csv")]


_BOOK = {
    "[Content_Types].xml": """<Types xmlns="http://schemas.openxmlformats.org/package/2006/\
content-types"><Override PartName="/xl/workbook.xml" ContentType="application/vnd.\
openxmlformats-officedocument.spreadsheetml.sheet.main+xml"/></Types>""",
    "xl/workbook.xml": """<workbook xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/\
main" xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships"><sheets>\
<sheet name="a" sheetId="1" r:id="r1"/></sheets></workbook>""",
    "xl/_rels/workbook.xml.rels": """<Relationships xmlns="http://schemas.openxmlformats.org/\
package/2006/relationships"><Relationship Id="r1" Target="worksheets/sheet1.xml" Type="http://\
schemas.openxmlformats.org/officeDocument/2006/relationships/worksheet"/></Relationships>""",
}
"""What makes a sheet a workbook."""


def _workbook(folder: Path, count: int) -> list[str]:
    row = b"<row>" + b"<c><v>1</v></c>" * 100 + b"</row>"
    path = folder / "a.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in _BOOK.items():
            archive.writestr(name, text)
    with (
        zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive,
        archive.open("xl/worksheets/sheet1.xml", "w") as sheet,
    ):
        sheet.write(
            b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
        )
        for _ in range(count):
            sheet.write(row)
        sheet.write(b"</sheetData></worksheet>")
    return ["inspect", str(path)]


def _sparse(folder: Path) -> list[str]:
    with (folder / "a.WDQ").open("wb") as stream:
        stream.truncate(5 << 30)
    return ["inspect", str(folder / "a.WDQ")]


def _pipe(folder: Path) -> list[str]:
    os.mkfifo(folder / "pipe.csv")
    return ["inspect", str(folder / "pipe.csv")]


def _decay() -> list[tuple[float, float]]:
    lines = (ROOT / "examples/string-pendulum.csv").read_text(encoding="utf-8").splitlines()
    cells = [line.split(",") for line in lines if re.match(r"[-\d.]+,[-\d.]+", line)]
    return [(float(row[0]), float(row[1])) for row in cells]


def _swing(folder: Path, values: float = 1.0, times: float = 1.0, start: float = 0.0) -> list[str]:
    text = "".join(f"{times * (t + start)!r},{values * x!r}\n" for t, x in _decay())
    (folder / "a.csv").write_text("t (s),theta (rad)\n" + text, encoding="utf-8")
    return ["fit", str(folder / "a.csv"), "--accept"]


def _long_output(folder: Path) -> list[str]:
    return ["convert", "examples/string-pendulum.csv", str(folder / ("x" * 300 + ".csv"))]


def _caliper(folder: Path, last: bytes) -> list[str]:
    points = b"".join(b"%d,%d\n" % (i, i) for i in range(5))
    (folder / "a.csv").write_bytes(b"volts,angle_rad\n" + points + last)
    return ["calibrate", str(folder / "a.csv")]


def _configuration(folder: Path, content: bytes) -> list[str]:
    (folder / "config.yaml").write_bytes(content)
    return ["config", str(folder / "config.yaml")]


def _changed(folder: Path, value: object, *keys: str) -> list[str]:
    content = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))
    holder = content
    for key in keys[:-1]:
        holder = holder[key]
    holder[keys[-1]] = value
    return _configuration(folder, yaml.safe_dump(content).encode())


def _table(folder: Path, content: bytes) -> list[str]:
    (folder / "records.tsv").write_bytes(content)
    return _changed(folder, str(folder / "records.tsv"), "records")


if __name__ == "__main__":
    main()
