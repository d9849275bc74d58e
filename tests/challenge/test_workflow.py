"""The challenge's rules: four jobs of their own, none in the campaign."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_the_challenge_is_four_jobs_and_its_target(tmp_path: Path) -> None:
    for name in ("Snakefile", "config", "workflow", "profiles"):
        source = ROOT / name
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, tmp_path / name)
    run = subprocess.run(
        [sys.executable, "-m", "snakemake", "challenge", "-n", "--nolock", "--cores", "2"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    said = run.stdout + run.stderr
    assert run.returncode == 0, said
    jobs = {line.split()[0] for line in said.splitlines() if line.startswith("challenge")}
    assert {"challenge_make", "challenge_solve", "challenge_open", "challenge_score"} <= jobs
    assert "acquire" not in said
