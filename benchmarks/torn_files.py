"""Tear, empty and alter every result of the small campaign, and run it again.

    python -m benchmarks.torn_files [--limit N] [--seed N]

A row a file and a damage: whether the next run names it, which jobs it takes, and whether
campaign.json ends as it was, byte for byte. What was tried is kept in ``.evidence`` for as
long as the code is the same, so that a stopped run goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from pendpipe.provenance import code_version

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".evidence/torn_files"
RESULTS = FOLDER / "results"
RECORD = "air-07"
FILES = (
    "calibration/caliper.csv",
    "calibration/sensor.json",
    "calibration/manifest/sensor.json",
    f"{RECORD}/recording.csv",
    f"{RECORD}/calibration.json",
    f"{RECORD}/turning_points.csv",
    f"{RECORD}/fit.json",
    f"{RECORD}/diagnosis/diagnosis.json",
    f"{RECORD}/diagnosis/damping.svg",
    f"{RECORD}/figures/decay.svg",
    f"{RECORD}/manifest/fit.json",
    "broken/recording.csv",
    "broken/refused.json",
    "separation.json",
    "comparison.json",
    "campaign.json",
    "figures/fig05.svg",
    "figures/drawn.json",
    "report.html",
    "manifest/compare.json",
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


def tried(name: str, damage: str, draw: random.Random, before: bytes) -> list[str]:
    """Damage one file, run again, and return the table's row."""
    path = RESULTS / name
    change, old_time = DAMAGES[damage]
    status = path.stat()
    path.write_bytes(change(path.read_bytes(), draw))
    if old_time:
        os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))
    began = time.perf_counter()
    output = snakemake()
    spent = time.perf_counter() - began
    jobs = re.search(r"^total +(\d+)$", output, flags=re.MULTILINE)
    kept = list(path.parent.glob(f"{path.name}.damaged-*"))
    row = [
        name,
        damage,
        "yes" if f"{path}: " in output else "**no**",
        "yes" if len(kept) == 1 else "**no**",
        jobs[1] if jobs else "0",
        "the same" if (RESULTS / "campaign.json").read_bytes() == before else "**differs**",
        "nothing" if "Nothing to be done" in snakemake("-n") else "**jobs**",
        f"{spent:.0f}",
    ]
    for copy in kept:
        copy.unlink()
    return row


def main() -> None:
    """Try what is left to try, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--limit", type=int, help="how many rows to try in this run")
    parser.add_argument("--seed", type=int, default=0, help="of the random bytes")
    arguments = parser.parse_args()
    code = code_version("pendpipe.commands.report") + code_version("pendpipe.commands.fit")
    journal = FOLDER / f"{code}-{arguments.seed}.json"
    FOLDER.mkdir(parents=True, exist_ok=True)
    rows = json.loads(journal.read_text(encoding="utf-8")) if journal.exists() else []
    done = {(row[0], row[1]) for row in rows}
    snakemake()
    before = (RESULTS / "campaign.json").read_bytes()
    left = [(name, damage) for name in FILES for damage in DAMAGES if (name, damage) not in done]
    for name, damage in left[: arguments.limit]:
        draw = random.Random(f"{arguments.seed} {name} {damage}")
        rows.append(tried(name, damage, draw, before))
        journal.write_text(json.dumps(rows), encoding="utf-8")
        print(f"{len(rows)} of {len(FILES) * len(DAMAGES)}: {rows[-1]}", file=sys.stderr)
    head = ["file", "damage", "named", "set aside", "jobs", "campaign.json", "left to do", "s"]
    for row in (head, ["---"] * len(head), *rows):
        print(f"| {' | '.join(row)} |")
    print(f"\n{len(rows)} of {len(FILES) * len(DAMAGES)} tried")


if __name__ == "__main__":
    main()
