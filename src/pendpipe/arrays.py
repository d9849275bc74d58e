"""The array types that signatures are written in, and what turns numbers into them."""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
ByteArray: TypeAlias = npt.NDArray[np.uint8]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
AnyArray: TypeAlias = npt.NDArray[Any]
Numbers: TypeAlias = Any
"""A number or an array of numbers; several arguments broadcast against each other."""
_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


def equation(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Let a function of arrays take numbers too, and return a number where all are numbers.

    The same holds for each entry of a tuple, given or returned.
    """

    @wraps(function)
    def of_numbers(*given: _Arguments.args, **named: _Arguments.kwargs) -> _Result:
        others = {name: _arrays(value) for name, value in named.items()}
        found: Any = function(*map(_arrays, given), **others)
        return _plain(found)  # type: ignore[no-any-return]

    return of_numbers


def _arrays(value: Numbers) -> Any:
    if isinstance(value, tuple):
        return tuple(map(_arrays, value))
    return np.asarray(value, dtype=np.float64)


def _plain(values: Any) -> Any:
    if isinstance(values, tuple):
        return getattr(values, "_make", tuple)(map(_plain, values))
    return np.asarray(values)[()]
