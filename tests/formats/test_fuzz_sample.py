"""The first inputs of the million that ``make evidence`` feeds to the readers and decoders."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.skipif(sys.platform == "win32", reason="the fuzzer's limits are those of POSIX")
def test_as_many_as_fit_into_a_few_seconds() -> None:
    command = [sys.executable, "-m", "benchmarks.fuzz", "--seconds", "5"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    inputs = re.search(r"\*\*all\*\* \| (\d+)", done.stdout)
    assert inputs is not None
    assert int(inputs[1]) > 0
