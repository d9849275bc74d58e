"""The engine as a Python function, compiled by Numba once for an installation."""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

SOURCES = (
    "chebyshev.py",
    "comparison.py",
    "emission.py",
    "entry.py",
    "half_cycle.py",
    "layout.py",
    "march.py",
    "panel.py",
    "sensitivities.py",
    "table.py",
    "views.py",
)
SHIPPED = Path(__file__).parent / "shipped"
"""Machine code for many machines, made while the package is built (`setup.py`)."""
_FUNCTIONS = {"engine": 92, "turning": 33}
"""About how many functions the compiler has to do."""
_ENTRY = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)


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


def shipped_name(name: str) -> str:
    """Return the name of the code for many machines that belongs to one for this machine."""
    stem, _, sources = name.rsplit("-", 2)
    return f"{stem}-{sources}"


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

    kept_here = [folder / name for folder in folders()]
    for path in (*kept_here, SHIPPED / shipped_name(name)):
        loaded = machine_code.load(path)
        if loaded is not None:
            return loaded
    with _progress(name.partition("-")[0]):
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


def ship(name: str, compile_all: Callable[[], Sequence[Any]]) -> None:
    """Make the code of `kept` for many machines, unless it is there; older code goes."""
    from pendpipe.dynamics import machine_code

    path = SHIPPED / shipped_name(name)
    if path.exists() or not machine_code.can_be_portable():
        return
    for old in SHIPPED.glob(f"{name.rsplit('-', 2)[0]}-*.bin"):
        old.unlink()
    parts = [(entry.inspect_llvm(), entry.native_name) for entry in compile_all()]
    machine_code.keep(path, parts, portable=True)


@contextlib.contextmanager
def _progress(stem: str) -> Iterator[None]:
    """Show on a terminal how far the compiler is; elsewhere nothing."""
    if not sys.stderr.isatty():
        yield
        return
    from numba.core import event

    register: Any = event.register
    unregister: Any = event.unregister

    class Listener(event.Listener):
        done = 0

        def on_start(self, event: Any) -> None:
            pass

        def on_end(self, event: Any) -> None:  # noqa: ARG002
            self.done += 1
            part = min(self.done / _FUNCTIONS[stem], 1.0)
            bar = ("#" * round(20 * part)).ljust(20)
            print(f"\rcompiling, once: [{bar}] {stem}", end="", file=sys.stderr, flush=True)

    listener = Listener()
    register("numba:compile", listener)
    try:
        yield
    finally:
        unregister("numba:compile", listener)
        print("\r" + " " * 60 + "\r", end="", file=sys.stderr, flush=True)


def compile_engine() -> list[Any]:
    """Compile the engine."""
    from pendpipe.dynamics.entry import compiled_entry

    return [compiled_entry()]


@cache
def engine() -> Callable[..., int]:
    """Return the engine's entry; see `entry.py` for its arguments.

    Where the installation brought no machine code for this processor, the first call compiles
    for half a minute; else, and in later processes, it takes about a tenth of a second.
    """
    (address,), owner = kept(file_name(), compile_engine)
    function = _ENTRY(address)
    function.owner = owner  # type: ignore[attr-defined]
    return function
