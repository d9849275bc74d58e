"""What the workflow costs beside the computations themselves.

The default campaign runs twice from nothing: once by Snakemake, a process a job, and once
in one bare Python process that makes the same calls of the command line in the same order.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

# Each call is named before it is made, so that even one that kills the process is known.
BARE = """
import json, sys
from pendpipe.cli import main
for call in json.load(sys.stdin):
    print("call: pendpipe", *call, file=sys.stderr, flush=True)
    status = main(call)
    if status:
        sys.exit(status)
"""


def children_cpu_s() -> float:
    """CPU seconds of all ended child processes."""
    spent = os.times()
    return spent.children_user + spent.children_system


def measured(command: list[str], feed: str | None = None) -> tuple[float, float, str]:
    """Run a command; return wall and CPU seconds of it and its children, and its output."""
    began, before = time.perf_counter(), children_cpu_s()
    done = subprocess.run(command, input=feed, capture_output=True, text=True, check=False)
    wall, cpu = time.perf_counter() - began, children_cpu_s() - before
    said = done.stdout + done.stderr
    if done.returncode:
        calls = re.findall(r"^call: (.*)", done.stderr, flags=re.MULTILINE)
        name = calls[-1] if calls else shlex.join(command)
        tail = "\n".join(said.splitlines()[-15:])
        raise SystemExit(f"{name}\nended with status {done.returncode} (-N: signal N):\n{tail}")
    return wall, cpu, said


def calls_of(output: str) -> list[list[str]]:
    """The command line's calls in the order in which Snakemake made them."""
    found = re.findall(r"^Shell command:\s*(pendpipe [^\n]*)$", output, flags=re.MULTILINE)
    parts = [part for line in found for part in line.split("&&")]
    return [shlex.split(re.sub(r"\s\d?>>?\s?\S+", "", part))[1:] for part in parts]


def elsewhere(calls: list[list[str]], results: Path, bare: Path) -> list[list[str]]:
    """The same calls with another folder of results, in the configuration too."""
    configurations = {call[call.index("--campaign") + 1] for call in calls if "--campaign" in call}
    moved = {}
    for path in configurations:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        copy = results.parent / Path(path).name
        copy.write_text(json.dumps(content | {"results": bare.as_posix()}), encoding="utf-8")
        moved[path] = copy.as_posix()
    return [
        [moved.get(word, word.replace(results.as_posix(), bare.as_posix())) for word in call]
        for call in calls
    ]


def main() -> None:
    """Measure and print."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as Snakemake's jobs have it
    with tempfile.TemporaryDirectory() as scratch:
        results, bare = Path(scratch, "results"), Path(scratch, "bare")
        override = Path(scratch, "config.yaml")
        override.write_text(yaml.safe_dump({"results": results.as_posix()}), encoding="utf-8")
        snakemake = [sys.executable, "-m", "snakemake", "--cores", "2", "--configfile"]
        wall, cpu, output = measured([*snakemake, str(override), "--printshellcmds", "--nolock"])
        calls = elsewhere(calls_of(output), results, bare)
        jobs = int(re.findall(r"^total\s+(\d+)", output, flags=re.MULTILINE)[0])
        bare_wall, bare_cpu, _ = measured([sys.executable, "-c", BARE], feed=json.dumps(calls))
        same = numbers(results) == numbers(bare)
    allowed = 0.6 * jobs + 4.0
    beyond = cpu - bare_cpu
    print(f"jobs                          {jobs}")
    print(f"wall, snakemake --cores 2     {wall:.1f} s (at most 60 s asked, on two idle cores)")
    print(f"CPU, snakemake                {cpu:.1f} s")
    print(f"wall, one bare process        {bare_wall:.1f} s for the same {len(calls)} calls")
    print(f"CPU, one bare process         {bare_cpu:.1f} s")
    print(f"CPU beyond the bare process   {beyond:.1f} s, {beyond / jobs:.2f} s a job")
    print(f"asked at most                 {allowed:.1f} s (0.6 s a job and 4 s)")
    print(f"the same campaign.json        {'yes' if same else 'NO'}")


def numbers(results: Path) -> object:
    """The campaign's numbers, without what tells one run from another."""
    content = json.loads((results / "campaign.json").read_text(encoding="utf-8"))
    content.pop("provenance", None)
    return content


if __name__ == "__main__":
    main()
