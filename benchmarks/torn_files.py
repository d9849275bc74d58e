"""Tear, empty and alter every kind of result of the small campaign, and run it again.

    python -m benchmarks.torn_files [--apart] [--limit N] [--seed N]

A row a file and a damage: whether the next run names the file, sets it aside and makes it
again, how many jobs that run has, whether campaign.json ends as it was, byte for byte, and
whether anything is left to do. All files suffer the same damage in one run, records' files
in a record each; with ``--apart`` each has a run of its own. What was tried is kept in
``.evidence`` for as long as the code is the same: a stopped run goes on where it was. The table
is printed.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks import journal
from pendpipe.commands.doctor import examine

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".evidence/torn_files"
RESULTS = FOLDER / "results"
GUARDS = (
    "pendpipe.manifest",
    "pendpipe.stages.refusal",
    "pendpipe.stages.chunks",
    "pendpipe.commands.stage",
    "workflow/rules/*.smk",
    "workflow/Snakefile",
    "./Snakefile",
)
"""What finds and mends damage: other code makes other numbers, and guards nothing."""
FILES = (
    "calibration/caliper.csv",
    "calibration/sensor.json",
    "water-low-2/recording.csv",
    "water-low-4/calibration.json",
    "water-low-5/turning_points.csv",
    "air-03/fit.json",
    "air-07/diagnosis/diagnosis.json",
    "air-11/diagnosis/damping.svg",
    "water-high-1/figures/decay.svg",
    "water-high-4/manifest/fit.json",
    "broken/refused.json",
    "separation.json",
    "comparison.json",
    "campaign.json",
    "figures/fig05.svg",
    "figures/drawn.json",
    "report.html",
)


def torn(content: bytes, draw: random.Random) -> bytes:
    """Cut at a random byte."""
    return content[: draw.randrange(1, len(content))]


def emptied(content: bytes, draw: random.Random) -> bytes:
    """Nothing is left."""
    return b""


def altered(content: bytes, draw: random.Random) -> bytes:
    """Change one random byte."""
    at = draw.randrange(len(content))
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


DAMAGES: dict[str, tuple[Callable[[bytes, random.Random], bytes], bool]] = {
    "torn": (torn, False),
    "torn, old time": (torn, True),
    "emptied": (emptied, False),
    "altered, old time": (altered, True),
}
"""What is done to the file, and whether its time of modification is put back."""


def snakemake(*arguments: str) -> str:
    """Run the small campaign."""
    command = [sys.executable, "-m", "snakemake", "--cores", "2", "--nolock", *arguments]
    command += ["--configfile", "tests/workflow/small/config.yaml"]
    done = subprocess.run(
        [*command, "--config", f"results={RESULTS.as_posix()}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout + done.stderr


def tried(names: Sequence[str], damage: str, seed: int, before: bytes) -> list[list[str]]:
    """Damage files, run again, and return the table's rows."""
    change, old_time = DAMAGES[damage]
    for name in names:
        path = RESULTS / name
        status = path.stat()
        path.write_bytes(change(path.read_bytes(), random.Random(f"{seed} {name} {damage}")))
        if old_time:
            os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    began = time.perf_counter()
    output = snakemake()
    spent = time.perf_counter() - began
    jobs = re.search(r"^(\d+) jobs to run$", output, flags=re.MULTILINE)
    wrong = {finding.path for finding in examine(RESULTS) if finding.kind != "set-aside"}
    same = (RESULTS / "campaign.json").read_bytes() == before
    nothing = "Nothing to be done" in snakemake("-n")
    rows = []
    for name in names:
        path = RESULTS / name
        kept = list(path.parent.glob(f"{path.name}.damaged-*"))
        rows.append(
            [
                name,
                damage,
                "yes" if f"{path}: " in output else "**no**",
                "yes" if len(kept) == 1 else "**no**",
                "yes" if path.is_file() and str(path) not in wrong else "**no**",
                jobs[1] if jobs else "0",
                "the same" if same else "**differs**",
                "nothing" if nothing else "**jobs**",
                f"{spent:.0f}",
            ]
        )
        for copy in kept:
            copy.unlink()
    return rows


def main() -> None:
    """Try what is left to try, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--apart", action="store_true", help="a run for each file")
    parser.add_argument("--limit", type=int, help="how many runs to make now")
    parser.add_argument("--seed", type=int, default=0, help="of the random bytes")
    arguments = parser.parse_args()
    way = "apart" if arguments.apart else "together"
    kept = f"torn_files-{way}-{arguments.seed}"
    rows: list[list[str]] = journal.read(kept, [], GUARDS)
    done = {(row[0], row[1]) for row in rows}
    snakemake()
    for copy in RESULTS.rglob("*.damaged-*"):
        copy.unlink()
    before = (RESULTS / "campaign.json").read_bytes()
    groups = [[name] for name in FILES] if arguments.apart else [list(FILES)]
    runs = [(names, damage) for damage in DAMAGES for names in groups]
    left = [run for run in runs if (run[0][0], run[1]) not in done]
    for names, damage in left[: arguments.limit]:
        rows += tried(names, damage, arguments.seed, before)
        journal.keep(kept, rows, GUARDS)
        print(f"{len(rows)} of {len(FILES) * len(DAMAGES)}", file=sys.stderr)
    head = ["file", "damage", "named", "set aside", "made again", "jobs", "campaign.json"]
    head += ["left to do", "s"]
    lines = [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]
    asked = f"{len(rows)} of {len(FILES) * len(DAMAGES)} tried, {way}"
    print(*lines, "", f"{asked}. Made by commit {journal.commit()}.", sep="\n")


if __name__ == "__main__":
    main()
