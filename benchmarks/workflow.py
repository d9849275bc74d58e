"""What the workflow costs beside the computations themselves.

The default campaign runs twice from nothing: once by Snakemake, a process a job, and once
in one bare Python process that makes the same calls of the command line in the same order.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

BARE = """
import json, sys
from pendpipe.cli import main
for call in json.load(sys.stdin):
    if main(call) != 0:
        sys.exit(" ".join(call))
"""


def children_cpu_s() -> float:
    """CPU seconds of all ended child processes."""
    spent = os.times()
    return spent.children_user + spent.children_system


def measured(command: list[str], feed: str | None = None) -> tuple[float, float, str]:
    """Run a command; return wall and CPU seconds of it and its children, and its output."""
    began, before = time.perf_counter(), children_cpu_s()
    done = subprocess.run(command, input=feed, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stdout + done.stderr)
    wall = time.perf_counter() - began
    return wall, children_cpu_s() - before, done.stdout + done.stderr


def calls_of(output: str, folder: str) -> list[list[str]]:
    """The command line's calls in the order in which Snakemake made them."""
    found = re.findall(r"^Shell command:\s*(pendpipe [^\n]*)$", output, flags=re.MULTILINE)
    calls = []
    for line in found:
        for part in line.split("&&"):
            words = shlex.split(re.sub(r"2>>? \S+", "", part))
            calls.append([word.replace(folder, folder + "-bare") for word in words[1:]])
    return calls


def main() -> None:
    """Measure and print."""
    import json

    with tempfile.TemporaryDirectory() as scratch:
        results = Path(scratch, "results").as_posix()
        override = Path(scratch, "config.yaml")
        override.write_text(yaml.safe_dump({"results": results}), encoding="utf-8")
        snakemake = [sys.executable, "-m", "snakemake", "--cores", "2", "--configfile"]
        wall, cpu, output = measured([*snakemake, str(override), "--printshellcmds", "--nolock"])
        calls = calls_of(output, results)
        jobs = int(re.findall(r"^total\s+(\d+)", output, flags=re.MULTILINE)[0])
        bare_wall, bare_cpu, _ = measured([sys.executable, "-c", BARE], feed=json.dumps(calls))
    allowed = 0.6 * jobs + 4.0
    print(f"jobs                          {jobs}")
    print(f"wall, snakemake --cores 2     {wall:.1f} s (at most 60 s asked)")
    print(f"CPU, snakemake                {cpu:.1f} s")
    print(f"wall, one bare process        {bare_wall:.1f} s for the same {len(calls)} calls")
    print(f"CPU, one bare process         {bare_cpu:.1f} s")
    print(f"CPU beyond the bare process   {cpu - bare_cpu:.1f} s (at most {allowed:.1f} s asked)")


if __name__ == "__main__":
    main()
