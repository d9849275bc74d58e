"""All that is Numba's: how a kernel is compiled."""

from collections.abc import Callable
from typing import Any, cast

from numba import from_dtype, njit, types

from pendpipe.dynamics.layout import KINDS, WORK

_OPTIONS: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}
"""No reference counts (which forbids to allocate), and no exceptions of division."""
_NUMBERS: dict[str, Any] = {
    "float": types.float64,
    "int": types.int64,
    "None": types.void,
    "Work": from_dtype(WORK),
}


def dispatcher(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return a kernel as Numba's function, of which Python's entry is not made."""
    return cast("Any", njit)(**_OPTIONS, **options, no_cpython_wrapper=True, no_cfunc_wrapper=True)(
        function
    )


def compiled(function: Callable[..., Any], options: dict[str, Any]) -> tuple[Any, str]:
    """Compile a kernel for what its annotations say; return Numba's library, and its name there.

    Its arguments are a place for what it returns and one for exceptions, and then what
    stands for each (`layout.KINDS`).
    """
    noted = dict(function.__annotations__)
    returns = _kind(noted.pop("return"))
    made: Any = dispatcher(function, options)
    made.compile(returns(*map(_kind, noted.values())))
    (found,) = made.overloads.values()
    return found.library, found.fndesc.llvm_func_name


def _kind(annotation: str) -> Any:
    """Return Numba's type of what a kernel is given, or returns."""
    if annotation in _NUMBERS:
        return _NUMBERS[annotation]
    kind = KINDS[annotation]
    return cast("Any", types.Array)(from_dtype(cast("Any", kind.item)), kind.axes, "C")
