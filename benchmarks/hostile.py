"""Hostile input: what the command line answers, in what time and in how much memory.

    python -m benchmarks.hostile             the table; rows that this code has done are kept
    python -m benchmarks.hostile pipe YAML   the rows with one of these words, anew

A row is right when its process ends within 10 s (of the processor, since others may be at work;
a diagnosis within 20)
and 1 GB without a traceback, with the exit status that it should have and, where that is 2, one
line of standard error that is the fault (notes on what was guessed may stand before it), and when
what it left is as it should be.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import threading
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import yaml

from benchmarks import journal
from benchmarks.hostile_recordings import recordings
from benchmarks.kills import Project
from pendpipe.files import read_json, write_json
from pendpipe.recording import read_plain
from pendpipe.report.page import BUDGET_BYTES

ROOT = Path(__file__).resolve().parents[1]
MOST_SECONDS = 10.0
MOST_DIAGNOSIS_SECONDS = 20.0
MOST_MB = 1000.0
WRONG = "**wrong** "
SOURCES = ("src/pendpipe/**/*.py", "benchmarks/hostile*.py")
"""What a row's answer is of."""
RIGHT = ((2,), (0, 2))
"""Statuses of an input that must be refused, and of one that may also be read."""


@dataclass(frozen=True)
class Row:
    """A hostile input.

    Parameters
    ----------
    name
        What it is.
    command
        Makes it in a folder and returns the words of the command.
    statuses
        The exit statuses that are right.
    left
        Says what is wrong with what the command has left in the folder.
    end
        A signal that the process gets once it has recorded something.
    most_cpu_s
        Seconds of the processor within which it must end.
    """

    name: str
    command: Callable[[Path], list[str]]
    statuses: tuple[int, ...] = RIGHT[0]
    left: Callable[[Path], str] = lambda _: ""
    end: signal.Signals | None = None
    most_cpu_s: float = MOST_SECONDS


def rows() -> Iterator[Row]:
    """All hostile inputs."""
    yield Row("workbook of 600,000 cells", lambda f: _workbook(f, 6_000), RIGHT[1])
    yield Row("workbook of 2 million cells", lambda f: _workbook(f, 20_000))
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
    yield Row("calibration points 1e12", lambda f: _caliper(f, b"1e12,1e12\n"))
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
    if hasattr(os, "mknod") and os.geteuid() == 0:
        yield Row("output that is a device", _device, (0,), _no_device)
    for odd in ODD_FOLDERS:
        yield Row(f"refused, from {odd}/", lambda f, o=odd: _refused(f, o), (0,), _names_folder)  # type: ignore[misc]
    for number in (signal.SIGTERM, signal.SIGHUP):
        yield Row(f"{number.name} while recording", _recorder, (0,), _no_recording, number)
    for count in (100, 300):
        yield Row(f"page of {count} records", lambda f, n=count: _page(f, n), (0,), _too_large)  # type: ignore[misc]
    for name, write in recordings():
        yield Row(
            f"diagnose: {name}",
            lambda f, w=write: ["diagnose", str(w(f)), "--out", str(f / "out")],  # type: ignore[misc]
            RIGHT[1],
            _large_figure,
            most_cpu_s=MOST_DIAGNOSIS_SECONDS,
        )


def main() -> None:
    """Run the rows that are asked for and print the table; status 1 where one is wrong."""
    asked = sys.argv[1:]
    done: dict[str, list[str]] = journal.read("hostile", {}, SOURCES)
    chosen = [row for row in rows() if not asked or any(word in row.name for word in asked)]
    # Under nohup the recorder would inherit that SIGHUP is ignored.
    signal.signal(signal.SIGHUP, lambda *_: None)
    # The first fit on a machine compiles the engine: that is no row's time.
    subprocess.run([sys.executable, "-m", "pendpipe.warm_up"], check=True)
    print("| input | s | s of the processor | MB | exit | answer |\n|---|---|---|---|---|---|")
    for row in chosen:
        if asked or row.name not in done:
            done[row.name] = _cells(row)
            journal.keep("hostile", done, SOURCES)
        print(f"| {' | '.join([row.name, *done[row.name]])} |", flush=True)
    wrong = sum(done[row.name][-1].startswith(WRONG) for row in chosen)
    print(f"\n{wrong} wrong. Made by commit {journal.commit()}.")
    sys.exit(wrong > 0)


def _cells(row: Row) -> list[str]:
    """Run a row, and return what stands in the table behind its name."""
    with tempfile.TemporaryDirectory() as folder:
        used = _measured(row.command(Path(folder)), Path(folder), row.end)
        said = re.sub(
            r"(\S{20})\S{80,}",
            r"\1...",
            used.said.replace(folder + os.sep, "").replace(folder, "FOLDER"),
        )
        left = row.left(Path(folder)) if used.status in row.statuses else ""
    right = (
        used.cpu_s < row.most_cpu_s
        and used.megabytes < MOST_MB
        and used.status in row.statuses
        and "Traceback" not in said
        and (used.status != 2 or len(re.findall("^pendpipe: ", said, re.MULTILINE)) == 1)
        and not left
    )
    line = left or (said.splitlines()[-1] if said else "")
    return [
        f"{used.seconds:.1f}",
        f"{used.cpu_s:.1f}",
        f"{used.megabytes:.0f}",
        str(used.status),
        ("" if right else WRONG) + line[:150].replace("|", "\\|"),
    ]


@dataclass(frozen=True)
class Used:
    """What a call took and said: seconds, of the processor too, peak memory, status, errors."""

    seconds: float
    cpu_s: float
    megabytes: float
    status: int
    said: str


def _measured(words: list[str], folder: Path, end: signal.Signals | None) -> Used:
    """Call pendpipe."""
    with tempfile.TemporaryFile() as errors:
        began = time.monotonic()
        running = subprocess.Popen(
            [sys.executable, "-m", "pendpipe.cli", *words],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
        )
        stop = threading.Timer(60 * MOST_SECONDS, running.kill)
        stop.start()
        if end is not None:
            while running.poll() is None and not any(
                path.stat().st_size > 2000 for path in folder.glob("*.raw")
            ):
                time.sleep(0.05)
            running.send_signal(end)
        _, state, used = os.wait4(running.pid, 0)
        stop.cancel()
        seconds = time.monotonic() - began
        running.returncode = os.waitstatus_to_exitcode(state)
        errors.seek(0)
        said = errors.read().decode(errors="replace").strip()
    cpu_s = used.ru_utime + used.ru_stime
    return Used(seconds, cpu_s, used.ru_maxrss / 1024, running.returncode, said)


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
    row = b"<row>" + b'<c r="A1"><v>0.123456</v></c>' * 100 + b"</row>"
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


def _device(folder: Path) -> list[str]:
    """A null device of our own: a file in its place would be the end of it."""
    os.mknod(folder / "null.csv", stat.S_IFCHR | 0o666, os.makedev(1, 3))
    return ["convert", "examples/string-pendulum.csv", str(folder / "null.csv")]


def _no_device(folder: Path) -> str:
    there = stat.S_ISCHR((folder / "null.csv").stat().st_mode)
    return "" if there else "it was replaced by a file"


ODD_FOLDERS = ("my data", "a, b", "c;d (1)", "e'f\"g", "two  blanks", "été")
_REFUSED = """
title: Odd
records: {folder}/records.tsv
results: {folder}/results
apparatus: null
calibration: null
simulated: null
typical_record: null
"""


def _refused(folder: Path, odd: str) -> list[str]:
    """A record without numbers, of a file in a folder with an odd name."""
    (folder / odd).mkdir()
    (folder / odd / "run 7.csv").write_text("time_s,angle_rad\nno,number\n")
    table = f"record\tsource\nx\t{folder / odd}/run 7.csv\n"
    (folder / "records.tsv").write_text(table, encoding="utf-8")
    (folder / "config.yaml").write_text(_REFUSED.format(folder=folder), encoding="utf-8")
    home = folder / "results/x"
    call = ["acquire", "--campaign", str(folder / "config.yaml"), "--record", "x"]
    return [*call, "--out", f"{home}/recording.csv", "--refused", f"{home}/refused.json"]


def _names_folder(folder: Path) -> str:
    reason = str(read_json(folder / "results/x/refused.json")["reason"])
    return "" if reason.startswith("run 7.csv") and str(folder) not in reason else reason


def _recorder(folder: Path) -> list[str]:
    call = "acquire --device simulated:di2108 --rate 100 --duration 600 --out"
    return [*call.split(), str(folder / "a.csv")]


def _no_recording(folder: Path) -> str:
    with suppress(Exception):
        return "" if len(read_plain(folder / "a.csv")) > 10 else "there are few samples"
    return "there is no recording"


def _page(folder: Path, count: int) -> list[str]:
    """The page of a campaign in which three records, each under another name, are repeated."""
    project = Project(folder / "project")
    status, said = project.run()
    if status:
        raise SystemExit(said)
    comparison = read_json(project.results / "comparison.json")
    summary = read_json(project.results / "campaign.json")
    (stored,) = (project.folder / ".snakemake/pendpipe").glob("*.json")
    for content in (comparison, summary):
        once = content["records"]
        repeated = [{**once[n % len(once)], "record": f"r{n}"} for n in range(count)]
        content["records"] = repeated
    names = [entry["record"] for entry in read_json(project.results / "comparison.json")["records"]]
    for n in range(count):
        place = project.results / f"r{n}"
        shutil.copytree(project.results / names[n % len(names)], place)
        shutil.rmtree(place / "manifest")
    write_json(folder / "comparison.json", comparison)
    write_json(folder / "campaign.json", summary)
    configuration = read_json(stored) | {"results": str(project.results)}
    (folder / "config.json").write_text(json.dumps(configuration))
    call = ["report", "--campaign", str(folder / "config.json")]
    call += ["--comparison", str(folder / "comparison.json")]
    call += ["--summary", str(folder / "campaign.json"), "--figures", f"{project.results}/figures"]
    return [*call, "--out", str(folder / "page.html")]


def _large_figure(folder: Path) -> str:
    large = [path.name for path in folder.glob("out/*.svg") if path.stat().st_size > 1e6]
    return f"more than 1 MB: {', '.join(large)}" if large else ""


def _too_large(folder: Path) -> str:
    size = (folder / "page.html").stat().st_size
    return "" if size <= BUDGET_BYTES else f"{size} bytes"


if __name__ == "__main__":
    main()
