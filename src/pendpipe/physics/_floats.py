"""The array types of the equations, and what turns arguments into them."""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeAlias

import numpy as np
import numpy.typing as npt

Arguments = ParamSpec("Arguments")

Numbers: TypeAlias = Any
"""A number or an array of numbers; several arguments broadcast against each other."""

FloatArray: TypeAlias = npt.NDArray[np.float64]


def equation(function: Callable[Arguments, FloatArray]) -> Callable[Arguments, FloatArray]:
    """Let a function of arrays take numbers too, and return a number where all are numbers."""

    @wraps(function)
    def of_numbers(*given: Arguments.args, **named: Arguments.kwargs) -> FloatArray:
        arrays = [np.asarray(value, dtype=np.float64) for value in given]
        others = {name: np.asarray(value, dtype=np.float64) for name, value in named.items()}
        return plain(function(*arrays, **others))  # type: ignore[arg-type]

    return of_numbers


def floats(*values: Numbers) -> tuple[FloatArray, ...]:
    """Return every argument as an array of doubles, not yet broadcast."""
    return tuple(np.asarray(value, dtype=np.float64) for value in values)


def plain(values: Any) -> FloatArray:
    """Return a number where all arguments were numbers, the array otherwise."""
    result: FloatArray = np.asarray(values, dtype=np.float64)[()]
    return result
