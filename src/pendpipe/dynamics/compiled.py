"""The engine as a Python function, compiled by Numba once for an installation."""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

SOURCES = (
    "chebyshev.py", "comparison.py", "emission.py", "entry.py", "half_cycle.py", "layout.py",
    "march.py", "panel.py", "polynomials.py", "sensitivities.py", "table.py", "views.py",
    "workspace.py",
)  # fmt: skip
_POINTER, _INTEGER, _NUMBER = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_ENTRY = ctypes.CFUNCTYPE(
    _INTEGER,
    _POINTER, _INTEGER, _INTEGER, _NUMBER, _INTEGER, _INTEGER, _NUMBER,
    _POINTER, _INTEGER, _POINTER, _POINTER, _POINTER, _INTEGER, _POINTER, _INTEGER, _POINTER,
)  # fmt: skip


def file_name() -> str:
    """Return a name that changes with the engine's sources and with the machine."""
    return name_of("engine", [Path(__file__).parent / name for name in SOURCES])


def name_of(stem: str, paths: Iterable[Path]) -> str:
    """Return a name that changes with these sources and with the machine."""
    from pendpipe.dynamics import machine_code

    text = b"".join(path.read_bytes() for path in paths)
    sources = hashlib.blake2b(text, digest_size=8).hexdigest()
    machine = hashlib.blake2b(machine_code.platform().encode(), digest_size=8).hexdigest()
    return f"{stem}-{machine}-{sources}.bin"


def folders() -> Iterator[Path]:
    """Yield where the machine code may lie: as Numba's own cache, beside the source or at home."""
    if "NUMBA_CACHE_DIR" in os.environ:
        yield Path(os.environ["NUMBA_CACHE_DIR"])
        return
    yield Path(__file__).parent / "__pycache__"
    with contextlib.suppress(RuntimeError):  # there is no home
        home = Path.home() / ".cache"
        yield (
            Path(os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME") or home)
            / "pendpipe"
        )


def kept(name: str, compile_all: Callable[[], Sequence[Any]]) -> tuple[list[int], Any]:
    """Return the addresses of compiled functions, and what must stay alive with them.

    Parameters
    ----------
    name
        Of the file that keeps them, from `name_of`.
    compile_all
        Makes Numba's cfuncs, if the file is not there.
    """
    # It brings llvmlite, which who calls nothing compiled can do without.
    from pendpipe.dynamics import machine_code

    for folder in folders():
        loaded = machine_code.load(folder / name)
        if loaded is not None:
            return loaded
    entries = compile_all()
    parts = [(entry.inspect_llvm(), entry.native_name) for entry in entries]
    for folder in folders():
        try:
            machine_code.keep(folder / name, parts)
        except OSError:
            continue
        for old in folder.glob(f"{name.rpartition('-')[0]}-*.bin"):
            if old.name != name:
                old.unlink(missing_ok=True)
        break
    return [entry.address for entry in entries], entries


def _compile() -> list[Any]:
    """Compile the engine."""
    from pendpipe.dynamics.entry import compiled_entry

    return [compiled_entry()]


@cache
def engine() -> Callable[..., int]:
    """Return the engine's entry; see `entry.py` for its arguments.

    The first call in a new installation compiles for half a minute; those in later processes
    take about a tenth of a second.
    """
    (address,), owner = kept(file_name(), _compile)
    function = _ENTRY(address)
    function.owner = owner  # type: ignore[attr-defined]
    return function
