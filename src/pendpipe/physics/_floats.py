"""The array types of the equations, and what turns arguments into them."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Numbers: TypeAlias = npt.ArrayLike
"""A number or an array of numbers; several arguments broadcast against each other."""

FloatArray: TypeAlias = npt.NDArray[np.float64]


def floats(*values: Numbers) -> tuple[FloatArray, ...]:
    """Return every argument as an array of doubles, not yet broadcast."""
    return tuple(np.asarray(value, dtype=np.float64) for value in values)


def plain(values: Any) -> FloatArray:
    """Return a number where all arguments were numbers, the array otherwise."""
    result: FloatArray = np.asarray(values, dtype=np.float64)[()]
    return result
