"""Machine code: kept, found again, renewed, and never trusted when damaged."""

from __future__ import annotations  # kernels read annotations as text

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pendpipe as pp
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, machine_code, sample_with_jacobian
from pendpipe.dynamics.kernel import Kernel, Matrix, _tell, folders, kernel, shipped
from pendpipe.dynamics.layout import (
    FEW_POINTS,
    HEAD,
    MOST_PANELS,
    MOST_POINTS,
    NODE_COUNT,
    REQUEST,
    ROW,
    WORK,
    WORK_SIZE,
)
from pendpipe.dynamics.march import march
from pendpipe.dynamics.table import _interpolate
from pendpipe.effects.two_planes import planes

EXAMPLES = Path(__file__).parents[2] / "examples"
FILES = [str(EXAMPLES / f"{name}-pendulum.csv") for name in ("rod", "string")]
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
    """Return a folder with the engine's machine code, compiled if need be."""
    assert callable(march.machine_code)
    name = march.file_name()
    for path in (*(folder / name for folder in folders()), *shipped(name).values()):
        if path.exists():
            (tmp_path / name).write_bytes(path.read_bytes())
            return tmp_path
    pytest.skip("no folder to keep compiled code in")


FACTOR = 3.0


@kernel(inline=True)
def scaled(x: float) -> float:
    return FACTOR * math.sqrt(x)


@kernel()
def fill(values: FloatArray, table: Matrix, offset: float, row: int) -> int:
    for i in range(values.size):
        table[row, i] = scaled(values[i]) + offset
    return values.size


def test_a_kernel_computes_what_its_python_would(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "new folder"))
    table = np.zeros((3, 4))
    assert anew(fill)(np.arange(4.0), table, 0.5, 1) == 4
    np.testing.assert_array_equal(table[1], 3.0 * np.sqrt(np.arange(4.0)) + 0.5)
    np.testing.assert_array_equal(table[[0, 2]], 0.0)
    # The code that was kept, by a kernel that knows of no other.
    monkeypatch.setattr(Kernel, "_compiled", lambda *_: pytest.fail("compiled"))
    assert anew(fill)(np.full(4, 4.0), table, 0.0, 0) == 4
    np.testing.assert_array_equal(table[0], 6.0)


def anew(one: Kernel) -> Kernel:
    """Return a kernel as a new process finds it."""
    return Kernel(one.function, one.options)


@pytest.mark.parametrize(
    ("values", "table"),
    [
        (np.arange(4), np.zeros((3, 4))),
        (np.arange(8.0)[::2], np.zeros((3, 4))),
        (np.arange(4.0), np.zeros(4)),
    ],
    ids=["integers", "every second", "one axis for two"],
)
def test_an_array_of_another_kind_is_refused(values: np.ndarray, table: np.ndarray) -> None:
    with pytest.raises(TypeError, match=r"needs an array|not C contiguous"):
        fill(values, table, 0.0, 0)


def test_a_new_process_runs_the_kept_code_without_numba(kept: Path) -> None:
    assert first_call(kept) == ["11", "False", "False"]


@pytest.mark.slow
def test_numba_works_in_a_process_that_has_loaded_the_kept_code(kept: Path) -> None:
    """What the kept code is linked with is named for the whole process; Numba finds it sound."""
    assert first_call(kept, NUMBA_AFTERWARDS) == ["11", "False", "False", "3.0", "zero"]


def test_the_process_that_compiles_runs_what_it_keeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What Numba itself made rounds otherwise: a campaign's first run would differ from later."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    one = anew(fill)
    assert callable(one.machine_code)
    again = machine_code.load(tmp_path / fill.file_name())
    assert again is not None
    assert type(one._owner) is type(again[1])


def test_damaged_code_is_compiled_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert callable(anew(fill).machine_code)
    path = tmp_path / fill.file_name()
    code = path.read_bytes()
    assert machine_code.load(path) is not None
    path.write_bytes(code[:-1] + bytes([code[-1] ^ 1]))
    assert machine_code.load(path) is None
    assert anew(fill)(np.arange(4.0), np.zeros((3, 4)), 0.0, 0) == 4
    assert machine_code.load(path) is not None


def given_away(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a file or folder belong to another user."""
    if os.geteuid() == 0:
        os.chown(path, 12345, -1)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: 12345)


@pytest.mark.skipif(os.name == "nt", reason="the mode of a file tells nothing there")
@pytest.mark.parametrize("upwards", [0, 1, 2], ids=["file", "folder", "a folder above"])
@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o770, None], ids=str)
def test_code_that_others_can_write_is_not_run(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    upwards: int,
    mode: int | None,
) -> None:
    """Its digest stands in the same file. Nobody replaces a folder of ours in one like ``/tmp``."""
    folder = tmp_path / "above/code"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(folder))
    monkeypatch.setattr("pendpipe.dynamics.kernel.SHIPPED", tmp_path)
    assert callable(anew(fill).machine_code)
    path = folder / fill.file_name()
    place = (path, *path.parents)[upwards]
    if mode is None:
        given_away(place, monkeypatch)
    else:
        place.chmod(mode)
        os.chown(place, -1, os.getgid() if os.getgid() else 12345)
    sound = machine_code.load
    loaded: list[Path] = []
    monkeypatch.setattr(machine_code, "load", lambda path: loaded.append(path) or sound(path))
    _tell.cache_clear()
    assert anew(fill)(np.arange(4.0), np.zeros((3, 4)), 0.0, 0) == 4
    said = capsys.readouterr().err
    if mode == 0o1777 and upwards == 2:
        assert (path in loaded, said) == (True, "")
    else:
        assert path not in loaded
        assert said.count("\n") == 1
        assert f"compiled anew: {place} " in said


@pytest.mark.skipif(os.name == "nt", reason="the mode of a file tells nothing there")
def test_a_group_that_is_its_owners_alone_is_no_other(tmp_path: Path) -> None:
    """Where each user has a group of the same name, files can be written by it by default."""
    import grp
    import pwd

    owner, own = pwd.getpwuid(os.geteuid()), grp.getgrgid(os.getegid())
    tmp_path.chmod(0o770)
    alone = own.gr_name == owner.pw_name and not {*own.gr_mem} - {owner.pw_name}
    assert (machine_code.distrusted(tmp_path / "code") == "") == alone


def test_shipped_code_runs_on_processors_that_can_and_is_left_alone_by_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The faster code needs what not every processor can do; the other one runs on all of them."""
    if not machine_code.processors():
        pytest.skip("no code is shipped for this processor")
    monkeypatch.setattr("pendpipe.dynamics.kernel.SHIPPED", tmp_path)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "empty"))
    fill.ship()
    fast, plain = shipped(fill.file_name()).values()
    assert {*tmp_path.iterdir()} == {fast, plain}
    monkeypatch.setattr("pendpipe.dynamics.numba_side.compiled", lambda _: pytest.fail("compiled"))
    fill.ship()
    assert machine_code.load(fast) is not None
    features = machine_code.llvm.get_host_cpu_features()
    plainest = type(features)(dict.fromkeys(features, False))
    monkeypatch.setattr(machine_code.llvm, "get_host_cpu_features", lambda: plainest)
    assert machine_code.load(fast) is None
    table = np.zeros((1, 1))
    assert anew(fill)(np.array([4.0]), table, 0.0, 0) == 1
    assert table[0, 0] == pytest.approx(6.0, rel=1e-15)


@pytest.mark.parametrize(
    "content", [b"", b"{}", b"{}\n", b"\n\n", b"\xff\xfe\n", b'{"digest": 1}\nx']
)
def test_a_file_that_is_no_code_is_not_loaded(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "code").write_bytes(content)
    assert machine_code.load(tmp_path / "code") is None


def test_other_sources_and_constants_have_other_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = fill.file_name()
    assert fill.parts() == [fill, scaled]
    assert anew(fill).file_name() == before
    with monkeypatch.context() as other:
        other.setitem(globals(), "FACTOR", 4.0)
        assert fill.file_name() != before
    changed = tmp_path / "changed.py"
    changed.write_bytes(Path(__file__).read_bytes() + b"\n")
    code = scaled.function.__code__.replace(co_filename=str(changed))
    monkeypatch.setattr(scaled.function, "__code__", code)
    assert fill.file_name() != before


def test_the_engine_is_made_of_the_kernels_that_it_calls() -> None:
    """All of the engine's files but those that Python runs."""
    files = {Path(part.function.__code__.co_filename).name for part in march.parts()}
    assert {"half_cycle.py", "panel.py", "table.py"} <= files


@pytest.mark.parametrize("directions", [0, 4])
@pytest.mark.parametrize("samples", [0, 1, 1000])
@pytest.mark.parametrize("end_s", [5.0, 100.0], ids=["half cycle by half cycle", "by a table"])
def test_the_engine_writes_only_where_it_may(directions: int, samples: int, end_s: float) -> None:
    # The engine works on bare memory: everything it gets is embedded in guards here.
    guard, guarded = 100, []

    def room(*shape: int) -> np.ndarray:
        guarded.append(np.full(math.prod(shape) + 2 * guard, np.pi))
        return guarded[-1][guard:-guard].reshape(shape)

    model = Eq8(3.2, 0.4, 0.01, 0.02, 1e-4)
    sensitivities, columns = (directions + 1, directions + 4) if directions else (0, 0)
    polynomials = sensitivities + 1 if samples else 0
    head = HEAD + 2 * sensitivities
    per_panel = 1 + polynomials * NODE_COUNT if polynomials else 0
    work, rows = room(WORK_SIZE), room(ROW + 1, head + MOST_PANELS * per_panel)
    numbers = 3.2, 0.0, 0.0, 1.0, 1.0, 0.1, end_s
    counts = 2**60 if samples else 50, directions, sensitivities, polynomials, head, per_panel
    REQUEST.pack_into(work.data, 0, *model.shape(), *numbers, *counts)
    work.view(WORK)["rate"] = 0.1
    work.view(WORK)["directions"] = model.shape_derivatives()
    out = room(1 + columns, samples) if samples else room(2 + 2 * columns, 50)
    march(work, rows, np.linspace(0.0, end_s, samples), out)
    assert samples == 0 or not np.any(out[0] == np.pi)
    for array in guarded:
        np.testing.assert_array_equal(array[:guard], np.pi)
        np.testing.assert_array_equal(array[-guard:], np.pi)


@pytest.mark.slow
@pytest.mark.parametrize("hidden", ["numba llvmlite", "numba"])
def test_without_a_compiler_a_fit_prints_the_same_digits(hidden: str, tmp_path: Path) -> None:
    """The engine runs as plain Python where neither is, or where no code is kept for this one."""
    code = (
        f"import sys; sys.modules.update(dict.fromkeys({hidden.split()!r}))\n"
        "import pendpipe as pp; from pendpipe.dynamics import kernel\n"
        "kernel.SHIPPED = kernel.Path('none')\n"
        f"print(*map(pp.fit, {FILES!r}), sep='\\n')"
    )
    found = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout == "".join(f"{pp.fit(file)}\n" for file in FILES)
    assert list(tmp_path.iterdir()) == [], "nothing is compiled"


@pytest.mark.parametrize("amplitude_rad", [0.3, 2.9])
def test_arrays_in_place_of_machine_code_move_the_same_pendulum(
    monkeypatch: pytest.MonkeyPatch, amplitude_rad: float
) -> None:
    """Angles, derivatives, two planes: the sums' other order makes less than 1e-9."""
    law = Eq8(3.2, quadratic=1e-3, hysteretic=2e-3, viscous=1e-3, coulomb=2e-4, restoring="sine")
    release, time_s, found = Release(0.0, amplitude_rad), np.linspace(0.0, 80.0, 400), []
    square, angle = np.full_like(time_s, amplitude_rad**2), time_s.reshape(-1, 8) - 40.0
    moving, side = (angle, np.sin(angle)), np.ones((len(angle), 1))
    for way in (Kernel.__call__, Kernel._without_machine_code):
        monkeypatch.setattr(Kernel, "__call__", way)
        turned = planes(time_s, 3.2 * time_s * square, square, 0.1 + 0.3j, 0.04, 0.1)
        found.append((*sample_with_jacobian(law, release, time_s), *turned))
        found[-1] += (law.acceleration(*moving, side),)
    for ours, theirs in zip(*found, strict=True):
        assert np.all(abs(theirs - ours) <= 1e-9 * abs(ours).max(axis=0))
    expected = 3.2**2 * angle - law.torque(angle) + law.friction(*moving, side)
    np.testing.assert_allclose(found[0][-1], expected, atol=1e-9)


@pytest.mark.parametrize("points", [FEW_POINTS, MOST_POINTS])
@pytest.mark.parametrize(
    ("column", "size"), [(0, 1e-9), (1, 1e-8), (2, 1.0), (3, 1e-9), (7, 1.0), (8, 1.0)]
)
@pytest.mark.parametrize("before_last", [0, 1])
def test_arrays_refuse_the_table_that_loops_refuse(
    points: int, column: int, size: float, before_last: int
) -> None:
    """By the last two coefficients of the loss, of the excess, or of a low power of time."""
    nodes = np.cos(np.pi * (np.arange(points) + 0.5) / points)
    rows = np.zeros((MOST_POINTS + 1, 9))
    rows[:points] = 1.0 + nodes[:, None] * np.arange(9)
    found = list[bool]()
    for more in (0.0, size):
        rows[:points, column] += more * np.cos((points - 1 - before_last) * np.arccos(nodes))
        given = points, 9, rows, 2, 6, 0.0, np.zeros((MOST_POINTS, 9))
        found += [_interpolate.function(*given), _interpolate.arrays(*given)]
    assert found == [True, True, *[column in (2, 7, 8)] * 2]
