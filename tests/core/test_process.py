"""What a process of ours asks of its system."""

import os
import subprocess
import sys

import pytest

from pendpipe.process import ONE_THREAD, one_thread

_FAULTS = """
import resource, sys
import numpy as np
from pendpipe.process import keep_memory
if sys.argv[1:]:
    keep_memory()
np.ones(2_000_000).sum()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    np.ones(2_000_000).sum()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_the_user_has_the_say_about_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ONE_THREAD:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    one_thread()
    assert os.environ["OMP_NUM_THREADS"] == "4"
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's")
def test_memory_that_is_kept_is_not_mapped_again() -> None:
    mapped, kept = (
        int(
            subprocess.run(
                [sys.executable, "-c", _FAULTS, *words], check=True, capture_output=True, text=True
            ).stdout
        )
        for words in ([], ["keep"])
    )
    if mapped < 100:
        pytest.skip("this system's library keeps memory by itself")
    assert kept < 0.2 * mapped
