"""What a campaign of many records costs: planning, CPU a record, memory, page.

    python -m benchmarks.scale                              10, 100, 1,000; 10,000 are planned
    python -m benchmarks.scale --run --diagnose             the plans of 10,000 alone
    python -m benchmarks.scale --profile slurm              on a Slurm of one node (tests/slurm)

Records are files of 2,048 readings. CPU seconds count, since others may use the machine; on a
cluster those of the jobs are not seen, and the clock stands for them. The second plan is that after
one more record; where a number of records is planned only, what its stages would have left is
pretended. Each row is written into the table of docs/scale.md when it is there, and kept in
``.evidence`` for as long as the code is the same: a stopped run goes on.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from itertools import product
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from benchmarks import journal
from pendpipe.configuration.load import load_campaign, read_configuration
from pendpipe.files import write_json
from pendpipe.manifest import Manifest, sum_of
from pendpipe.stages.chunks import STAGES, chunks_of, write_chunk

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


GUARDS: Final = (
    *("pendpipe.manifest", "pendpipe.commands.stage", "pendpipe.commands.small"),
    *("workflow/rules/*.smk", "workflow/Snakefile"),
)
"""What plans and runs: other code has other costs."""


class Cost(NamedTuple):
    """Of one call: seconds of the clock and of the processors, and the largest process."""

    clock_s: float
    cpu_s: float
    memory_mb: float


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


def pretend(folder: Path) -> None:
    """Leave what the records' stages would: results of a word, manifests, and chunks."""
    configuration = folder / "config/config.yaml"
    with contextlib.chdir(folder):
        campaign = load_campaign(read_configuration(configuration), configuration)
        chunks = chunks_of(campaign)
        for (chunk, records), stage in product(chunks.items(), STAGES.values()):
            for record in records:
                home = campaign.folder / record.record
                write_json(home / stage.output, {})
                made = {stage.output: sum_of(home / stage.output)}
                read = [record.file] if record.file and not stage.inputs else []
                sources = {path.name: sum_of(path) for path in read}
                Manifest(home, stage.name, made, {}, sources, key="pretended").write()
            write_chunk(campaign, stage, records, stage.path(campaign, chunk))
    cost(folder, "--", "--touch", "--until", "fit", "diagnose")


def measure(records: int, *, diagnosed: bool, to_end: bool, profile: str) -> list[str]:
    """Plan a campaign of so many records, run it, plan it with one more; return a row."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_campaign(folder, records, diagnosed=diagnosed)
        first = cost(folder, "-n")
        row = [f"{records:,}", "yes" if diagnosed else "no"]
        row += [f"{first.cpu_s:.1f}", f"{first.memory_mb:.0f}"]
        if to_end:
            asked = SLURM if profile == "slurm" else ()
            run = cost(folder, "--cores", "2", "--profile", profile, *asked)
            cpu = [f"{run.cpu_s:.0f}", f"{run.cpu_s / records:.2f}"]
            row += cpu if profile == "default" else ["", ""]
            row += [f"{run.clock_s:.0f}", f"{run.memory_mb:.0f}"]
        else:
            pretend(folder)
            row += [""] * 4
        with (folder / "records.tsv").open("a", encoding="utf-8") as table:
            table.write("added\t0.csv\n")
        page = folder / "results/report.html"
        size = f"{page.stat().st_size / 1e6:.1f}" if to_end else ""
        return [*row, f"{cost(folder, '-n').cpu_s:.1f}", size]


def write_page(rows: list[list[str]], profile: str) -> None:
    """Write the rows into the page's table; what was not measured again stays."""
    head = (
        *("records", "diagnosis", "first plan, CPU s", "MB", "run, CPU s", "a record"),
        *("clock, s", "largest process, MB", "plan after one more, CPU s", "page, MB"),
        *("load", "commit"),
    )
    begin, end = f"<!-- {profile}: begin -->", f"<!-- {profile}: end -->"
    page = PAGE.read_text(encoding="utf-8")
    before, _, rest = page.partition(begin)
    old, _, after = rest.partition(end)
    kept = [[cell.strip() for cell in line.split("|")[1:-1]] for line in old.split("\n")]
    all_rows = [row for row in kept if row and row[0].replace(",", "").isdigit()] + rows
    # By what was run: the last of each counts.
    found = {(row[1], row[6] == "", int(row[0].replace(",", ""))): row for row in all_rows}
    table = [head, ["---"] * len(head), *(found[what] for what in sorted(found))]
    text = "\n".join(f"| {' | '.join(cells)} |" for cells in table)
    machine = f"{platform.python_version()}, {os.cpu_count()} cores, {platform.machine()}."
    PAGE.write_text(f"{before}{begin}\n\n{text}\n\n{machine}\n\n{end}{after}", encoding="utf-8")


def main() -> None:
    """Measure what is not kept, print, and write the table into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--run", type=int, nargs="*", default=[10, 100, 1000])
    parser.add_argument("--plan", type=int, nargs="*", default=[10000])
    parser.add_argument("--diagnose", type=int, nargs="*", default=[100])
    parser.add_argument("--profile", default="default")
    arguments = parser.parse_args()
    asked = [(n, False, True) for n in arguments.run]
    asked += [(n, True, True) for n in arguments.diagnose]
    asked += [(n, True, False) for n in arguments.plan]
    name = f"scale-{arguments.profile}"
    kept: dict[str, list[str]] = journal.read(name, {}, GUARDS)
    with one_node() if arguments.profile == "slurm" else nullcontext():
        for records, diagnosed, to_end in asked:
            what = f"{records} {diagnosed} {to_end}"
            if what not in kept:
                row = measure(
                    records, diagnosed=diagnosed, to_end=to_end, profile=arguments.profile
                )
                kept[what] = [*row, f"{os.getloadavg()[0]:.0f}", journal.commit()]
                journal.keep(name, kept, GUARDS)
            print(f"| {' | '.join(kept[what])} |", flush=True)
            write_page(list(kept.values()), arguments.profile)


if __name__ == "__main__":
    main()
