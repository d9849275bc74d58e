"""Faults of a process end it in one line, and no module needs what POSIX alone has."""

import os
import pkgutil
import subprocess
import sys

import pytest

import pendpipe
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


POSIX_ONLY = ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty")

PROGRAM = """
import importlib, sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name in {blocked!r}:
            raise ModuleNotFoundError(f"no module named {{name!r}} on this system")
# Other people's packages take care of themselves: they stay imported, ours do not.
for name in {modules!r}:
    importlib.import_module(name)
for name in list(sys.modules):
    if name in {blocked!r} or name.split(".")[0] == "pendpipe":
        del sys.modules[name]
sys.meta_path.insert(0, Blocked())
for name in {modules!r}:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        print(f"{{name}}: {{error}}")
"""


@pytest.mark.slow
def test_every_module_imports_without_the_posix_modules() -> None:
    modules = [
        found.name
        for found in pkgutil.walk_packages(pendpipe.__path__, "pendpipe.")
        if not found.name.endswith("__main__")
    ]
    program = PROGRAM.format(blocked=POSIX_ONLY, modules=modules)
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "", done.stdout + done.stderr
    assert done.returncode == 0, done.stderr
