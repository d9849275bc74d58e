"""A campaign on a real Slurm of one node ends with the results of a local run.

It needs root, Debian's slurm-wlm and munge, and the extra `slurm` of pendpipe. 20 records by
default; ``PENDPIPE_SLURM_RECORDS=100 pytest tests/slurm`` is the evidence of docs/scale.md.
"""

from __future__ import annotations

import importlib.util
import os
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
    return names


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        bool(missing()), reason=f"a Slurm of one node can't be started without {missing()}"
    ),
]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[None]:
    """A Slurm on this machine, ended afterwards."""
    script = str(ROOT / "tests/slurm/cluster.sh")
    subprocess.run([script, "up", str(tmp_path / "slurm")], check=True)
    try:
        yield
    finally:
        subprocess.run([script, "down", str(tmp_path / "slurm")], check=True)


def write_campaign(folder: Path) -> None:
    """Decays of 2,048 readings, one of which is none."""
    random = np.random.default_rng(1)
    time_s = np.arange(2048) / 30.0
    lines = ["record\tsource"]
    for number in range(RECORDS):
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


def run(folder: Path, results: str, *words: str, options: tuple[str, ...] = ()) -> None:
    rest = ("--", *options, "--config", f"results={results}")
    done = subprocess.run(
        [sys.executable, "-m", "pendpipe", "campaign", *words, *rest],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")},
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
