"""What a campaign of many records costs: planning, CPU a record, memory, page.

    python -m benchmarks.scale                              10, 100, 1,000; 10,000 are planned
    python -m benchmarks.scale --run --diagnose             the plans of 10,000 alone

Records are files of 2,048 readings. CPU seconds count, since others may use the machine. The second
plan is that after one more record; where a number of records is planned only, what its stages would
have left is pretended. The rows are those of docs/scale.md; a stopped run goes on.
"""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
import tempfile
import time
from itertools import product
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from benchmarks.journal import ROOT, answers, commit, judge_parser
from benchmarks.table import head, table_row
from pendpipe.configuration.load import load_campaign, read_configuration
from pendpipe.files import write_json
from pendpipe.stages.archive import pack
from pendpipe.stages.chunks import STAGES, chunks_of

FILES: Final = 100
"""Decays that are made; more records are of the same files."""
SOURCES: Final = (
    *("src/pendpipe/stages/*.py", "src/pendpipe/commands/stage.py"),
    *("workflow/rules/*.smk", "workflow/Snakefile", "benchmarks/scale.py"),
)
"""What plans and runs: other code has other costs."""


class Cost(NamedTuple):
    """Of one call: seconds of the clock and of the processors, and the largest process."""

    clock_s: float
    cpu_s: float
    memory_mb: float


def write_decay(path: Path, size: float, loss: float, frequency_hz: float, seed: int = 1) -> None:
    """Write 2,048 readings of a viscous decay with noise, 30 a second."""
    time_s = np.arange(2048) / 30.0
    swing = size * np.exp(-loss * time_s) * np.cos(2.0 * np.pi * frequency_hz * time_s)
    angle = swing + 3e-4 * np.random.default_rng(seed).standard_normal(len(time_s))
    columns = np.column_stack([time_s, angle])
    np.savetxt(path, columns, ("%.4f", "%.6f"), ",", header="time_s,angle_rad", comments="")


def write_campaign(folder: Path, records: int, *, diagnosed: bool) -> None:
    """Write a configuration, its table, and the files of decays."""
    random = np.random.default_rng(1)
    (folder / "config").mkdir()
    (folder / "config/config.yaml").write_text(
        f"title: {records} records\nrecords: records.tsv\n"
        f"diagnose: {{enabled: {str(diagnosed).lower()}}}\n",
        encoding="utf-8",
    )
    for number in range(min(records, FILES)):
        loss, frequency = random.uniform(0.005, 0.02), random.uniform(0.8, 0.9)
        write_decay(folder / f"{number}.csv", 0.15, loss, frequency, number)
    lines = (f"r{number:05d}\t{number % FILES}.csv\n" for number in range(records))
    (folder / "records.tsv").write_text("record\tsource\n" + "".join(lines), encoding="utf-8")


def cost(folder: Path, *words: str, command: str = "campaign") -> Cost:
    """Run `pendpipe campaign`, or another command, in a process that measures its children."""
    code = (
        "import resource, subprocess, sys\n"
        "status = subprocess.run(sys.argv[1:]).returncode\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print('used', used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)\n"
        "sys.exit(status)"
    )
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code, sys.executable, "-m", "pendpipe", command, *words],
        cwd=folder,
        # Compiled modules are kept, as they are where users run them.
        env=os.environ | {"PYTHONPATH": str(ROOT / "src"), "PYTHONDONTWRITEBYTECODE": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(done.stdout + done.stderr)
    cpu, memory = re.findall(r"^used (\S+) (\S+)$", done.stdout, flags=re.MULTILINE)[-1]
    return Cost(time.perf_counter() - began, float(cpu), float(memory))


def pretend(folder: Path) -> None:
    """Leave what the records' stages would: archives of results of a word."""
    configuration = folder / "config/config.yaml"
    with contextlib.chdir(folder):
        campaign = load_campaign(read_configuration(configuration), configuration)
        chunks = chunks_of(campaign)
        for (chunk, records), stage in product(chunks.items(), STAGES.values()):
            paths = [Path("pretended", record.record, stage.output) for record in records]
            for path in paths:
                write_json(path, {})
            made = {record.record: {"read": {}} for record in records}
            pack(stage.path(campaign, chunk), Path("pretended"), paths, made)
    cost(folder, "--", "--touch", "--until", "fit", "diagnose")


def measure(key: tuple[int, bool, bool]) -> list[str]:
    """Plan a campaign of so many records, run it, plan it with one more; return a row."""
    records, diagnosed, to_end = key
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_campaign(folder, records, diagnosed=diagnosed)
        first, ran, size = cost(folder, "-n"), [""] * 4, ""
        if to_end:
            run = cost(folder, "--cores", "2")
            ran = [f"{run.cpu_s:.0f}", f"{run.cpu_s / records:.2f}"]
            ran += [f"{run.clock_s:.0f}", f"{run.memory_mb:.0f}"]
            size = f"{(folder / 'results/report.html').stat().st_size / 1e6:.1f}"
        else:
            pretend(folder)
        with (folder / "records.tsv").open("a", encoding="utf-8") as table:
            table.write("added\t0.csv\n")
        again = f"{cost(folder, '-n').cpu_s:.1f}"
    row = ["yes" if diagnosed else "no", f"{first.cpu_s:.1f}", f"{first.memory_mb:.0f}", *ran]
    return [*row, again, size, f"{os.getloadavg()[0]:.0f}", commit()]


def main() -> None:
    """Measure what is not kept, and print."""
    parser = judge_parser(__doc__, "scale", 0)
    parser.add_argument("--run", type=int, nargs="*", default=[10, 100, 1000])
    parser.add_argument("--plan", type=int, nargs="*", default=[10000])
    parser.add_argument("--diagnose", type=int, nargs="*", default=[100])
    told = parser.parse_args()
    keys = [(n, False, True) for n in told.run] + [(n, True, True) for n in told.diagnose]
    keys += [(n, True, False) for n in told.plan]
    titles = ("records", "diagnosis", "first plan, CPU s", "MB", "run, CPU s", "a record")
    more = ("clock, s", "largest process, MB", "plan after one more, CPU s", "page, MB", "load")
    print(head(*titles, *more, "commit"))
    for (records, *_), row in zip(keys, answers(told, keys, measure, SOURCES), strict=True):
        print(table_row(f"{records:,}", row), flush=True)


if __name__ == "__main__":
    main()
