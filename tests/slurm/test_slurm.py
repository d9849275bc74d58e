"""A campaign on a real Slurm of one node ends with the results of a local run.

It needs root, Debian's slurm-wlm and munge, and the extra `slurm` of pendpipe. 20 records by
default; ``PENDPIPE_SLURM_RECORDS=100 pytest tests/slurm`` is the evidence of docs/scale.md.
"""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
RECORDS = int(os.environ.get("PENDPIPE_SLURM_RECORDS", "20"))
QUICK = (
    *("--slurm-status-command", "squeue", "--slurm-no-account"),
    *("--slurm-init-seconds-before-status-checks", "1", "--seconds-between-status-checks", "1"),
)
"""The node has no accounting, and its scheduler nothing else to do."""


def missing() -> list[str]:
    """What this machine lacks."""
    names = [name for name in ("munged", "slurmctld", "slurmd", "sbatch") if not shutil.which(name)]
    if sys.platform != "linux" or os.geteuid() != 0:
        names.append("root")
    if importlib.util.find_spec("snakemake_executor_plugin_slurm") is None:
        names.append("snakemake-executor-plugin-slurm")
    own = Path("/etc/slurm/slurm.conf")
    if own.exists() and "ClusterName=pendtest" not in own.read_text(encoding="utf-8"):
        names.append("the place of another cluster's slurm.conf")
    return names


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(missing()), reason=f"a Slurm of one node can't be started without {missing()}"
    ),
]


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A Slurm on this machine, ended afterwards."""
    monkeypatch.delenv("SLURM_CONF")
    script = str(ROOT / "tests/slurm/cluster.sh")
    subprocess.run([script, "up", str(tmp_path / "slurm")], check=True)
    try:
        yield
    finally:
        subprocess.run([script, "down", str(tmp_path / "slurm")], check=True)


def write_campaign(folder: Path, records: int = RECORDS) -> None:
    """Decays of 2,048 readings, one of which is none."""
    random = np.random.default_rng(1)
    time_s = np.arange(2048) / 30.0
    lines = ["record\tsource"]
    for number in range(records):
        loss, frequency = random.uniform(0.005, 0.02), random.uniform(0.8, 0.9)
        swing = 0.15 * np.exp(-loss * time_s) * np.cos(2.0 * np.pi * frequency * time_s)
        angle = (number != 7) * swing + 3e-4 * random.standard_normal(len(time_s))
        np.savetxt(
            folder / f"{number}.csv",
            np.column_stack([time_s, angle]),
            delimiter=",",
            header="time_s,angle_rad",
            comments="",
        )
        lines.append(f"decay-{number:03d}\t{number}.csv")
    (folder / "records.tsv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    configuration = folder / "config/config.yaml"
    configuration.parent.mkdir()
    configuration.write_text(
        "title: Slurm\nrecords: records.tsv\ndiagnose: {enabled: false}\n", encoding="utf-8"
    )


def run(
    folder: Path, results: str, *words: str, options: tuple[str, ...] = (), faults: str = ""
) -> None:
    rest = ("--", *options, "--config", f"results={results}")
    done = subprocess.run(
        [sys.executable, "-m", "pendpipe", "campaign", *words, *rest],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, (faults, str(ROOT / "src"))))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    print(done.stderr)


def contents(folder: Path) -> dict[str, bytes]:
    """All results; the logs carry times."""
    paths = (path for path in folder.rglob("*") if path.is_file() and "logs" not in path.parts)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def test_slurm_ends_with_the_results_of_this_machine(cluster: None, tmp_path: Path) -> None:
    write_campaign(tmp_path)
    run(tmp_path, "here", "--cores", "2")
    run(tmp_path, "there", "--profile", "slurm", options=QUICK)
    here, there = contents(tmp_path / "here"), contents(tmp_path / "there")
    assert sum(name.count("/") == 1 and name.endswith("/fit.json") for name in here) == RECORDS
    assert "decay-007/refused.json" in here
    assert here.keys() == there.keys()
    assert [name for name in here if here[name] != there[name]] == []


FAULTS = """
import os, sys, time

def first(name):
    try:
        os.close(os.open(os.path.join(os.path.dirname(__file__), name), os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True

if "SLURM_JOB_ID" in os.environ and "stage" in sys.orig_argv:
    if "acquire" in sys.orig_argv:
        ended = first("acquire")
        hoard = b"x" * (1500 << 20)  # the rule asks for 1000 MB, then for twice as much
        if ended:
            time.sleep(3600)
    if "fit" in sys.orig_argv and first("fit"):
        time.sleep(3600)
"""


@pytest.mark.skipif(
    "PENDPIPE_SLURM_RECORDS" not in os.environ,
    reason="Slurm ends a job after a minute at the soonest: with PENDPIPE_SLURM_RECORDS=100 alone",
)
def test_a_job_that_slurm_ends_is_tried_once_more_with_twice_as_much(
    cluster: None, tmp_path: Path
) -> None:
    """One needs more memory than its rule asks for, another hangs until its time is over."""
    write_campaign(tmp_path, 1)
    faults = tmp_path / "faults"
    faults.mkdir()
    (faults / "sitecustomize.py").write_text(FAULTS, encoding="utf-8")
    short = ("--set-resources", "fit:runtime=attempt")
    run(tmp_path, "there", "--profile", "slurm", options=(*QUICK, *short), faults=str(faults))
    shown = subprocess.run(
        ["scontrol", "--oneliner", "show", "job"], capture_output=True, text=True, check=True
    ).stdout
    jobs = [dict(re.findall(r"(\w+)=(\S+)", line)) for line in shown.splitlines()]
    stages = {
        rule: [job for job in jobs if f"rule_{rule}_" in job["Comment"]]
        for rule in ("acquire", "fit")
    }
    assert [job["MinMemoryNode"] for job in stages["acquire"]] == ["1000M", "2000M"]
    assert [job["TimeLimit"] for job in stages["fit"]] == ["00:01:00", "00:02:00"]
    assert [job["JobState"] for job in stages["fit"]] == ["TIMEOUT", "COMPLETED"]
    assert (tmp_path / "there/decay-000/fit.json").is_file()
