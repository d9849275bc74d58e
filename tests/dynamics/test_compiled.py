"""The engine's machine code: kept, found again, renewed, and never trusted when damaged."""

from __future__ import annotations

import ctypes
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import cfunc

from pendpipe.dynamics import Eq8, compiled, machine_code
from pendpipe.dynamics.layout import FIELDS, REQUEST, sums_size, work_size

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
        [sys.executable, "-c", FIRST_CALL + more],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return run.stdout.split()


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    """Return a folder with the machine code of this installation, compiled if need be."""
    compiled.engine()
    name = compiled.file_name()
    here = [folder / name for folder in compiled.folders()]
    for path in (*here, compiled.SHIPPED / compiled.shipped_name(name)):
        if path.exists():
            (tmp_path / name).write_bytes(path.read_bytes())
            return tmp_path
    pytest.skip("no folder to keep compiled code in")


def test_a_new_process_runs_the_kept_code_without_numba(kept: Path) -> None:
    assert first_call(kept) == ["11", "False", "False"]


def test_numba_works_in_a_process_that_has_loaded_the_kept_code(kept: Path) -> None:
    """What the kept code is linked with is named for the whole process; Numba finds it sound."""
    assert first_call(kept, NUMBA_AFTERWARDS) == ["11", "False", "False", "3.0", "zero"]


def test_damaged_code_is_compiled_anew(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = kept / compiled.file_name()
    code = path.read_bytes()
    assert machine_code.load(path) is not None
    path.write_bytes(code[:-1] + bytes([code[-1] ^ 1]))
    assert machine_code.load(path) is None
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(kept))
    monkeypatch.setattr(compiled, "SHIPPED", kept / "nothing")
    # The compiler itself takes half a minute: set-up runs it, and every test runs its code.
    monkeypatch.setattr(compiled, "compile_engine", lambda: [a_small_function])
    renewed = compiled.engine.__wrapped__()
    assert renewed.owner == [a_small_function]
    assert machine_code.load(path) is not None


@cfunc("float64(float64)")
def a_small_function(x: float) -> float:
    return math.sqrt(x) + math.cos(x)


def test_code_is_kept_and_found_again(tmp_path: Path) -> None:
    path = tmp_path / "new folder" / "code"
    machine_code.keep(path, [(a_small_function.inspect_llvm(), a_small_function.native_name)])
    loaded = machine_code.load(path)
    assert loaded is not None
    (address,), _owner = loaded
    function = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(address)
    assert function(2.0) == math.sqrt(2.0) + math.cos(2.0)


def test_shipped_code_runs_on_processors_that_can_and_is_left_alone_by_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not machine_code.can_be_portable():
        pytest.skip("no code is shipped for this processor")
    parts = [(a_small_function.inspect_llvm(), a_small_function.native_name)]
    machine_code.keep(tmp_path / "code", parts, portable=True)
    loaded = machine_code.load(tmp_path / "code")
    assert loaded is not None
    function = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(loaded[0][0])
    assert function(2.0) == pytest.approx(math.sqrt(2.0) + math.cos(2.0), rel=1e-15)
    monkeypatch.setattr(machine_code.llvm, "get_host_cpu_features", dict)
    assert machine_code.load(tmp_path / "code") is None


def test_a_new_process_runs_shipped_code_without_compiling(
    kept: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = (kept / compiled.file_name()).read_bytes()
    (kept / compiled.shipped_name(compiled.file_name())).write_bytes(code)
    monkeypatch.setattr(compiled, "SHIPPED", kept)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(kept / "empty"))
    monkeypatch.setattr(compiled, "compile_engine", lambda: pytest.fail("compiled"))
    assert callable(compiled.engine.__wrapped__())


def test_an_installation_brings_the_code_of_its_sources_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not machine_code.can_be_portable():
        pytest.skip("no code is shipped for this processor")
    monkeypatch.setattr(compiled, "SHIPPED", tmp_path)
    (tmp_path / "engine-older.bin").write_bytes(b"")
    compiled.ship(compiled.file_name(), lambda: [a_small_function])
    (found,) = tmp_path.iterdir()
    assert found.name == compiled.shipped_name(compiled.file_name())
    assert machine_code.load(found) is not None
    compiled.ship(compiled.file_name(), lambda: pytest.fail("compiled again"))


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
        if "kernel" in path.read_text() or "numba" in path.read_text().split('"""')[2]
    }
    assert importing_numba <= set(compiled.SOURCES)


@pytest.mark.parametrize("directions", [0, 3, 4])
@pytest.mark.parametrize("samples", [0, 1, 1000])
@pytest.mark.parametrize("tabulate", [True, False])
@pytest.mark.parametrize("compared", [True, False])
def test_the_engine_writes_only_where_it_may(
    directions: int, samples: int, tabulate: bool, compared: bool
) -> None:
    # The engine works on bare memory: everything it gets is embedded in guards here.
    guard = 100

    def guarded(size: int) -> tuple[np.ndarray, int]:
        array = np.full(size + 2 * guard, np.pi)
        return array, array.ctypes.data + 8 * guard

    model = Eq8(3.2, 0.4, 0.01, 0.02, 1e-4)
    columns = directions + 4 if directions else 0
    buffer, buffer_at = guarded(work_size(directions, samples))
    inside = buffer[guard:]
    inside[:12] = (*model.shape(), 3.2, 0.0, 0.0, 1.0, 1.0, 0.1, 100.0)
    inside[FIELDS["rate"].offset :][:directions] = 0.1
    derivatives = model.shape_derivatives()[:directions].ravel()
    inside[FIELDS["directions"].offset :][: 4 * directions] = derivatives
    time_s = np.linspace(0.0, 100.0, samples)
    angle, angle_at = guarded(samples)
    jacobian, jacobian_at = guarded(0 if compared else columns * samples)
    sums, sums_at = guarded(sums_size(columns))
    readings = np.zeros(samples)
    turning, turning_at = guarded((2 + 2 * columns) * 50)
    request = (ctypes.c_int64 * len(REQUEST))(
        buffer_at,
        directions,
        tabulate,
        50 if samples == 0 else 2**60,
        time_s.ctypes.data,
        samples,
        angle_at,
        jacobian_at,
        turning_at,
        50,
        readings.ctypes.data,
        samples if compared else 0,
        sums_at,
    )
    compiled.engine()(request)
    for array in (buffer, angle, jacobian, turning, sums):
        np.testing.assert_array_equal(array[:guard], np.pi)
        np.testing.assert_array_equal(array[-guard:], np.pi)
