"""Loops as machine code: ``@kernel()`` is all that a function needs.

Numba compiles a kernel with those that it calls when it is first called from Python. The machine
code is kept in a file and loaded by llvmlite alone in later processes: a job of the workflow is
short, and importing Numba would take most of it.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import math
import os
import sys
from collections.abc import Callable, Iterator
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any, Final, TypeAlias, TypeVar, cast

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.layout import KINDS, WORD, WORK, Kind

_F = TypeVar("_F", bound="Callable[..., Any]")

Matrix: TypeAlias = FloatArray
Stack: TypeAlias = FloatArray
IntMatrix: TypeAlias = IntArray

SHIPPED: Final = Path(__file__).parent / "shipped"
"""Machine code for many machines, made while the package is built (`setup.py`)."""


def kernel(
    *, any_order: bool = False, inline: bool = False, arrays: Callable[..., Any] | None = None
) -> Callable[[_F], _F]:
    """Declare a function of numbers and arrays that runs as machine code.

    It allocates nothing and raises nothing: what it fills is given to it. Other kernels may
    call it, and so may Python, if its annotations are among ``float``, ``int``, `FloatArray`
    (one axis), `Matrix` (two), `Stack` (three), `IntArray` and `IntMatrix`. Arrays must be
    contiguous.

    Parameters
    ----------
    any_order
        Its sums may be taken in any order; so the compiler can vectorise them.
    inline
        Compile it into its callers, where it is known what does not overlap.
    arrays
        The same in numpy, for where there is no machine code: Python counts too slowly for the
        innermost loops.
    """
    # Multiplications and additions may be fused.
    fastmath = {"contract", "reassoc", "nsz"} if any_order else {"contract"}
    options = {"fastmath": fastmath, "forceinline": inline}
    return cast("Callable[[_F], _F]", functools.partial(Kernel, options=options, arrays=arrays))


class Kernel:
    """A function that runs as machine code; made by `kernel`."""

    __name__: str

    def __init__(
        self, function: Callable[..., Any], options: dict[str, Any], arrays: Any = None
    ) -> None:
        self.function, self.options, self.arrays = function, options, arrays
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        """Run the machine code, or where none can be had the function as it stands."""
        if self.machine_code is None:
            return self._without_machine_code(*arguments)
        words: list[Any] = []
        for argument, (item, axes, own) in zip(arguments, self.kinds, strict=True):
            if item is None:
                words.append(argument)
            elif argument.dtype != item or argument.ndim != axes:
                raise TypeError(f"{self.__name__} needs an array of {item} with {axes} axes")
            elif len(own) == 1:
                words.append(address(argument))
            else:
                words += (0, 0, argument.size, item.itemsize, address(argument))
                words += (*argument.shape, *argument.strides)
        result, fault = self.returns.words[0](), WORD()
        self.machine_code(ctypes.byref(result), ctypes.byref(fault), *words)
        return result.value if self.returns is not KINDS["None"] else None

    @cached_property
    def kinds(self) -> list[Kind]:
        """The arguments' kinds."""
        noted = self.function.__annotations__
        return [KINDS[kind] for name, kind in noted.items() if name != "return"]

    def _without_machine_code(self, *arguments: Any) -> Any:
        """Run the plain function, the fields of a workspace as attributes."""
        record, given = None, arguments
        if "Work" in self.function.__annotations__.values():  # it comes first
            record = arguments[0].view(WORK)[0]
            fields = SimpleNamespace(**{name: record[name] for name in WORK.names or ()})
            given = fields, *arguments[1:]
        with np.errstate(all="ignore"):
            result = self.plain(*given)
        if record is not None:
            for name, value in vars(fields).items():  # of arrays these are views
                record[name] = value
        return result

    @cached_property
    def plain(self) -> Callable[..., Any]:
        """The function for Python, where log(-1) is nan as in machine code, and no fault."""
        function = self.function
        if self.arrays is not None:
            return self.arrays  # type: ignore[no-any-return]
        as_in_c = {name: getattr(np, name) for name in dir(math) if hasattr(np, name)}
        as_in_c |= {"floor": math.floor, "ceil": math.ceil}  # whole numbers
        own = function.__globals__ | {"math": SimpleNamespace(**as_in_c)}
        made = FunctionType(function.__code__, own, None, function.__defaults__)
        for name in function.__code__.co_names:
            if isinstance(called := own.get(name), Kernel):
                own[name] = made if called is self else called.plain
        return made

    @cached_property
    def returns(self) -> Kind:
        """The kind of what is returned."""
        return KINDS[self.function.__annotations__["return"]]

    @cached_property
    def dispatcher(self) -> Any:
        """Numba's own function, for the kernels that call this one."""
        from pendpipe.dynamics import numba_side

        return numba_side.dispatcher(self.function, self.options)

    @property
    def _numba_type_(self) -> Any:
        """What Numba takes this for where it stands in another kernel."""
        return self.dispatcher._numba_type_

    @cached_property
    def machine_code(self) -> Any:
        """The kept or newly compiled code, as a function of addresses and numbers.

        None without llvmlite, or without Numba where nothing is kept.
        """
        if find_spec("llvmlite") is None:
            return None
        # It brings llvmlite, which who calls nothing compiled can do without.
        from pendpipe.dynamics import machine_code

        words = [word for kind in self.kinds for word in kind.words]
        name = self.file_name()
        # What is shipped lies among our sources: who can write the one can write the other.
        for path in (*_trusted(name, there=True), *shipped(name).values()):
            loaded = machine_code.load(path)
            if loaded is not None:
                break
        else:
            if find_spec("numba") is None:
                return None
            loaded = self._compiled(name)
        found, self._owner = loaded
        return ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, *words)(found)

    def _compiled(self, name: str) -> tuple[int, Any]:
        """Compile, and keep the machine code."""
        from pendpipe.dynamics import machine_code, numba_side

        if sys.stderr.isatty():
            print(f"compiling, once: {self.__name__} (march: half a minute)", file=sys.stderr)
        library, entry = numba_side.compiled(self.function, self.options)
        own = library.get_pointer_to_function(entry), library
        for path in _trusted(name):
            try:
                machine_code.keep(path, library.get_llvm_str(), entry)
            except OSError:
                continue
            for old in path.parent.glob(f"{self.__name__}-*.bin"):
                if old.name != name:
                    # The code of other sources.
                    old.unlink(missing_ok=True)
            # What is kept runs now as later: that which Numba made rounds otherwise.
            return machine_code.load(path) or own
        return own

    def ship(self) -> None:
        """Make the code for many machines, unless it is there."""
        from pendpipe.dynamics import machine_code, numba_side

        paths = {cpu: path for cpu, path in shipped(self.file_name()).items() if not path.exists()}
        if not paths:
            return
        library, entry = numba_side.compiled(self.function, self.options)
        for processor, path in paths.items():
            machine_code.keep(path, library.get_llvm_str(), entry, processor)

    def file_name(self) -> str:
        """Return a name that changes with the sources, the constants and the machine."""
        from pendpipe.dynamics import machine_code

        paths = {Path(__file__).with_name(name) for name in ("layout.py", "numba_side.py")}
        constants = []
        for part in self.parts():
            code, values = part.function.__code__, part.function.__globals__
            paths.add(Path(code.co_filename))
            for name in code.co_names:
                if isinstance(values.get(name), int | float | tuple):
                    constants.append(f"{name} {values[name]!r}")
                elif isinstance(values.get(name), np.ndarray):
                    # Their last digits are the processor's.
                    rounded = np.round(1e6 * values[name]).astype(np.int64)
                    constants.append(f"{name} {rounded.tolist()}")
        text = b"".join(path.read_bytes() for path in sorted(paths))
        machine = _digest(machine_code.platform().encode())
        return f"{self.__name__}-{machine}-{_digest(text + ' '.join(constants).encode())}.bin"

    def parts(self) -> list[Kernel]:
        """Return this and all kernels that it calls."""
        found = [self]
        for part in found:
            called = (
                part.function.__globals__.get(name) for name in part.function.__code__.co_names
            )
            found += [each for each in called if isinstance(each, Kernel) and each not in found]
        return found


_address_of, _double_in = ctypes.addressof, ctypes.c_double.from_buffer


def address(array: FloatArray | IntArray) -> int:
    """Return where the numbers of a contiguous array are."""
    if array.size == 0:
        return 0
    if not array.flags.writeable and array.flags.c_contiguous:
        return array.ctypes.data
    # Twice as fast; it raises where the numbers are not contiguous.
    return _address_of(_double_in(array))  # type: ignore[arg-type]


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


def _trusted(name: str, *, there: bool = False) -> Iterator[Path]:
    """Yield where code of a name may be kept, or is: nobody else can write it there."""
    from pendpipe.dynamics import machine_code

    for path in (folder / name for folder in folders()):
        if there and not os.path.lexists(path):
            continue
        if why := machine_code.distrusted(path):
            _tell(why)
        else:
            yield path


@functools.cache
def _tell(why: str) -> None:
    """Say once why code is compiled anew."""
    remedy = "take that right from them (chmod go-w), or set NUMBA_CACHE_DIR to a folder of yours"
    print(f"pendpipe: machine code is compiled anew: {why}; {remedy}", file=sys.stderr)


def _digest(text: bytes) -> str:
    return hashlib.blake2b(text, digest_size=8).hexdigest()


def shipped(name: str) -> dict[str, Path]:
    """Return where the code for other machines lies that belongs to one for this machine."""
    from pendpipe.dynamics import machine_code

    stem, _, sources = name.rsplit("-", 2)
    return {cpu: SHIPPED / f"{stem}-{cpu}-{sources}" for cpu in machine_code.processors()}
