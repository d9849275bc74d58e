"""What a campaign of many records costs: planning, CPU a record, memory, page.

    python -m benchmarks.scale                              10, 100, 1,000; 10,000 are planned
    python -m benchmarks.scale --run 10 100 --plan 10000    fewer
    python -m benchmarks.scale --profile slurm --run 10 100 --plan --diagnose
                                                            on a Slurm of one node (tests/slurm)

Records are files of 2,048 readings. CPU seconds count, since others may use the machine; on a
cluster those of the jobs are not seen, and the clock stands for them. The table is written
into docs/scale.md.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

ROOT: Final = Path(__file__).resolve().parents[1]
PAGE: Final = ROOT / "docs" / "scale.md"
SAMPLES: Final = 2048
FILES: Final = 100
"""Decays that are made; more records are of the same files."""


SLURM: Final = (
    *("--", "--slurm-status-command", "squeue", "--slurm-no-account"),
    *("--slurm-init-seconds-before-status-checks", "1", "--seconds-between-status-checks", "1"),
)
"""The node has no accounting, and its scheduler nothing else to do."""


@contextmanager
def one_node() -> Iterator[None]:
    """A Slurm on this machine while it is measured."""
    script = str(ROOT / "tests/slurm/cluster.sh")
    with tempfile.TemporaryDirectory() as place:
        subprocess.run([script, "up", place], check=True)
        try:
            yield
        finally:
            subprocess.run([script, "down", place], check=True)


class Cost(NamedTuple):
    """Of one call: seconds of the clock and of the processors, and the largest process."""

    clock_s: float
    cpu_s: float
    memory_mb: float


class Row(NamedTuple):
    """A line of the table."""

    records: int
    diagnosed: bool
    first_plan: Cost
    run: Cost | None
    next_plan: Cost | None
    page_mb: float | None


def write_campaign(folder: Path, records: int, *, diagnosed: bool) -> None:
    """Write a configuration, its table, and the files of decays."""
    random, time_s = np.random.default_rng(1), np.arange(SAMPLES) / 30.0
    (folder / "config").mkdir()
    (folder / "config/config.yaml").write_text(
        f"title: {records} records\nrecords: records.tsv\n"
        f"diagnose: {{enabled: {str(diagnosed).lower()}}}\n",
        encoding="utf-8",
    )
    for number in range(min(records, FILES)):
        loss, frequency = random.uniform(0.005, 0.02), random.uniform(0.8, 0.9)
        swing = 0.15 * np.exp(-loss * time_s) * np.cos(2.0 * np.pi * frequency * time_s)
        angle = swing + 3e-4 * random.standard_normal(SAMPLES)
        rows = (f"{t:.4f},{y:.6f}\n" for t, y in zip(time_s.tolist(), angle.tolist(), strict=True))
        (folder / f"{number}.csv").write_text("time_s,angle_rad\n" + "".join(rows), "utf-8")
    lines = (f"r{number:05d}\t{number % FILES}.csv\n" for number in range(records))
    (folder / "records.tsv").write_text("record\tsource\n" + "".join(lines), encoding="utf-8")


def cost(folder: Path, *words: str) -> Cost:
    """Run `pendpipe campaign` in a process that measures its own children."""
    code = (
        "import resource, subprocess, sys\n"
        "status = subprocess.run(sys.argv[1:]).returncode\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print('used', used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)\n"
        "sys.exit(status)"
    )
    command = [sys.executable, "-m", "pendpipe", "campaign", *words]
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code, *command],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(done.stdout + done.stderr)
    cpu, memory = re.findall(r"^used (\S+) (\S+)$", done.stdout, flags=re.MULTILINE)[-1]
    return Cost(time.perf_counter() - began, float(cpu), float(memory))


def measure(records: int, *, diagnosed: bool, to_end: bool, profile: str) -> Row:
    """Plan, run and plan again a campaign of so many records."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_campaign(folder, records, diagnosed=diagnosed)
        first = cost(folder, "-n")
        if not to_end:
            return Row(records, diagnosed, first, None, None, None)
        asked = SLURM if profile == "slurm" else ()
        run = cost(folder, "--cores", "2", "--profile", profile, *asked)
        with (folder / "records.tsv").open("a", encoding="utf-8") as table:
            table.write("added\t0.csv\n")
        page_mb = (folder / "results/report.html").stat().st_size / 1e6
        return Row(records, diagnosed, first, run, cost(folder, "-n"), page_mb)


def table(rows: list[Row], profile: str) -> str:
    """Write the rows as a table of Markdown."""
    head = (
        *("records", "diagnosis", "first plan, CPU s", "MB", "run, CPU s", "a record"),
        *("clock, s", "largest process, MB", "plan after one more, CPU s", "page, MB"),
    )
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for row in rows:
        cells = [f"{row.records:,}", "yes" if row.diagnosed else "no"]
        cells += [f"{row.first_plan.cpu_s:.1f}", f"{row.first_plan.memory_mb:.0f}"]
        if row.run is not None and row.next_plan is not None and row.page_mb is not None:
            ours = profile == "default"
            cells += [f"{row.run.cpu_s:.0f}", f"{row.run.cpu_s / row.records:.2f}"]
            cells = cells if ours else [*cells[:-2], "", ""]
            cells += [f"{row.run.clock_s:.0f}", f"{row.run.memory_mb:.0f}"]
            cells += [f"{row.next_plan.cpu_s:.1f}", f"{row.page_mb:.1f}"]
        cells += [""] * (len(head) - len(cells))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Measure, print, and write the table into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=int, nargs="*", default=[10, 100, 1000])
    parser.add_argument("--plan", type=int, nargs="*", default=[10000])
    parser.add_argument("--diagnose", type=int, nargs="*", default=[100])
    parser.add_argument("--profile", default="default")
    arguments = parser.parse_args()
    asked = [(n, False, True) for n in arguments.run]
    asked += [(n, True, True) for n in arguments.diagnose]
    asked += [(n, True, False) for n in arguments.plan]
    rows = []
    with one_node() if arguments.profile == "slurm" else nullcontext():
        for records, diagnosed, to_end in asked:
            row = measure(records, diagnosed=diagnosed, to_end=to_end, profile=arguments.profile)
            rows.append(row)
            print(table([row], arguments.profile).splitlines()[-1], flush=True)
    text = table(rows, arguments.profile)
    load = os.getloadavg()[0]
    text += (
        f"\n\n{platform.python_version()}, {os.cpu_count()} cores, {platform.machine()};"
        f" load {load:.0f} while it was measured.\n"
    )
    begin, end = f"<!-- {arguments.profile}: begin -->", f"<!-- {arguments.profile}: end -->"
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(begin)
    _, _, after = rest.partition(end)
    PAGE.write_text(f"{before}{begin}\n\n{text}\n{end}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
