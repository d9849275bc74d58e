"""The engine's machine code: kept, found again, renewed, and never trusted when damaged."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pendpipe.dynamics import compiled, machine_code

FIRST_CALL = """
import sys
from pendpipe.dynamics import Eq8, Release, turning_points
points = turning_points(Eq8(3.0, coulomb=1e-3), Release(0.0, 0.01))
print(points.time_s.size, "numba" in sys.modules, "scipy" in sys.modules)
"""

NUMBA_AFTERWARDS = """
import numpy as np
from numba import njit

@njit
def third(x):
    if x[0] == 0.0:
        raise ValueError("zero")
    return x[2]

print(third(np.arange(1.0, 4.0)))
try:
    third(np.zeros(3))
except ValueError as fault:
    print(fault)
"""


def first_call(folder: Path, more: str = "") -> list[str]:
    """Call the engine in a new process that keeps its code in `folder`."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder), "OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run(
        [sys.executable, "-c", FIRST_CALL + more], env=environment, capture_output=True, text=True,
        check=True,
    )  # fmt: skip
    return run.stdout.split()


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Return a folder with the machine code of this installation, compiled if need be."""
    compiled.engine()
    for folder in compiled.folders():
        if (folder / compiled.file_name()).exists():
            (tmp_path / compiled.file_name()).write_bytes(
                (folder / compiled.file_name()).read_bytes()
            )
            return tmp_path
    pytest.skip("no folder to keep compiled code in")


def test_a_new_process_runs_the_kept_code_without_numba(kept: Path) -> None:
    assert first_call(kept) == ["11", "False", "False"]


def test_numba_works_in_a_process_that_has_loaded_the_kept_code(kept: Path) -> None:
    """What the kept code is linked with is named for the whole process; Numba finds it sound."""
    assert first_call(kept, NUMBA_AFTERWARDS) == ["11", "False", "False", "3.0", "zero"]


@pytest.mark.slow
def test_damaged_code_is_compiled_anew(kept: Path) -> None:
    path = kept / compiled.file_name()
    code = path.read_bytes()
    path.write_bytes(code[:-1] + bytes([code[-1] ^ 1]))
    assert machine_code.load(path) is None
    assert first_call(kept)[:2] == ["11", "True"]
    assert machine_code.load(path) is not None


@pytest.mark.parametrize(
    "content", [b"", b"{}", b"{}\n", b"\n\n", b"\xff\xfe\n", b'{"digest": 1}\nx']
)
def test_a_file_that_is_no_code_is_not_loaded(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "code").write_bytes(content)
    assert machine_code.load(tmp_path / "code") is None


def test_other_sources_have_other_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = compiled.file_name()
    source = Path(compiled.__file__).parent
    for name in compiled.SOURCES:
        (tmp_path / name).write_bytes((source / name).read_bytes())
    monkeypatch.setattr(compiled, "__file__", str(tmp_path / "compiled.py"))
    assert compiled.file_name() == before
    with (tmp_path / "panel.py").open("a") as file:
        file.write("\n")
    assert compiled.file_name() != before


def test_every_compiled_source_is_watched() -> None:
    folder = Path(compiled.__file__).parent
    importing_numba = {
        path.name
        for path in folder.glob("*.py")
        if "kernel" in path.read_text() or "@part" in path.read_text()
    }
    assert importing_numba <= set(compiled.SOURCES)
