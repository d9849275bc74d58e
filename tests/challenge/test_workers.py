"""The makers of items stand beside each other: each keeps to one thread."""

import os
from pathlib import Path

import numpy as np
import pytest

from pendpipe_challenge.sets import process_pool

TASKS = Path("/proc/self/task")


@pytest.mark.skipif(not TASKS.exists(), reason="no /proc to count a process's threads in")
def test_linear_algebra_in_a_worker_takes_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    # As Snakemake has it for a rule of four threads.
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "4")
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    with process_pool(1) as pool:
        pool.submit(np.linalg.inv, np.eye(400)).result()
        assert len(pool.submit(os.listdir, str(TASKS)).result()) == 1
    assert os.environ["OPENBLAS_NUM_THREADS"] == "4"
    assert "MKL_NUM_THREADS" not in os.environ
