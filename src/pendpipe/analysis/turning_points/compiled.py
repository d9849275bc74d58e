"""The loops of `kernels.py` and `sums.py` as functions of arrays, without Numba at run time.

Their machine code is kept beside the engine's (`dynamics/compiled.py`), since importing
Numba would take most of the time of a job that measures one record.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.analysis.turning_points.shape import HARMONICS
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.compiled import kept, name_of

SOURCES: Final = (
    "entries.py", "kernels.py", "plain_entries.py", "plain_loops.py", "shape.py", "sums.py",
    "tracking.py", "../../dynamics/views.py",
)  # fmt: skip
# The kinds of each entry's arguments: arrays of numbers (F) or integers (I), a number, an integer.
ARGUMENTS: Final = {
    "extremes": "FiiffIiF",
    "smooth_times": "FFFifFiFFF",
    "count_half_cycles": "FIIifI",
    "plain_sums": "FFiiIFFifFFFF",
    "half_cycle_sums": "FFiiIFFifFiFFFF",
    "solve_half_cycles": "FFFiiFFF",
    "fourth_square": "FiF",
    "block_squares": "FiiFi",
    "extent": "FiF",
    "stays": "FifF",
    "half_cycle_scatter": "FiFFiF",
    "track": "FiFFiiiFFi",
}


class _Array(ctypes.c_void_p):
    """An array's numbers as an argument; numpy's own `ndpointer` takes some 2 us for each."""

    kind: Any

    @classmethod
    def from_param(cls, array: Any) -> Any:
        """Take the address of a whole array of the right kind."""
        if array.dtype != cls.kind or not array.flags.c_contiguous:
            message = f"a contiguous array of {cls.kind} is needed, not of {array.dtype}"
            raise TypeError(message)
        if array.size == 0 or not array.flags.writeable:
            return ctypes.c_void_p(array.ctypes.data)
        return ctypes.byref(ctypes.c_double.from_buffer(array))


class _Numbers(_Array):
    kind = np.dtype(np.float64)


class _Integers(_Array):
    kind = np.dtype(np.int64)


_KINDS: Final[dict[str, Any]] = {
    "F": _Numbers, "I": _Integers, "i": ctypes.c_int64, "f": ctypes.c_double,
}  # fmt: skip


def file_name() -> str:
    """Return the name of the file with the machine code, which changes with the sources."""
    return name_of("turning-points", [Path(__file__).parent / name for name in SOURCES])


def compile_loops() -> list[Any]:
    """Compile the loops."""
    from pendpipe.analysis.turning_points.entries import compiled_entries

    return compiled_entries(ARGUMENTS)


@cache
def entries() -> dict[str, Any]:
    """Return the compiled loops by name, as functions of arrays, integers and numbers."""
    addresses, owner = kept(file_name(), compile_loops)
    found: dict[str, Any] = {"owner": owner}
    for (name, letters), address in zip(ARGUMENTS.items(), addresses, strict=True):
        prototype = ctypes.CFUNCTYPE(ctypes.c_int64, *(_KINDS[letter] for letter in letters))
        found[name] = prototype(address)
    return found


def numbers(values: Any) -> FloatArray:
    """Return numbers as the loops need them."""
    return np.ascontiguousarray(values, dtype=np.float64)


def _integers(values: Any) -> IntArray:
    return np.ascontiguousarray(values, dtype=np.int64)


def extremes(values: FloatArray, stride: int, start: float, least: float) -> tuple[IntArray, int]:
    """Find alternating extremes: each is followed by a return of at least a threshold.

    Parameters
    ----------
    values, stride
        Readings, of which every `stride`-th is looked at; nothing need be known of level
        or period.
    start
        The first threshold; later it is a quarter of the median of the last five swings.
    least
        Threshold that is never undercut (a multiple of the noise).

    Returns
    -------
    index, first
        Positions of the extremes; `first` is +1 if the first one is a maximum.
    """
    found = np.empty(len(values) // (2 * stride) + 2, dtype=np.int64)
    count = entries()["extremes"](
        numbers(values), len(values), stride, start, least, found, len(found), np.empty(10)
    )
    return found[: abs(count)].copy(), (count > 0) - (count < 0)


def smooth_times(
    number: FloatArray, time_s: FloatArray, weight: FloatArray, wanted: float, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Smooth the times of turning points over as many neighbours as it takes.

    A weighted local parabola in the number of the half cycle; the window grows until the
    weights sum to `wanted` (the inverse variance that is good enough), between 2 and 40
    neighbours to each side.

    Returns
    -------
    centre_s, half_period_s
        Smoothed time and slope at each number in `at`.
    """
    centre, slope = np.empty(len(at)), np.empty(len(at))
    entries()["smooth_times"](
        numbers(number), numbers(time_s), numbers(weight), len(number), wanted,
        numbers(at), len(at), centre, slope, np.empty(15),
    )  # fmt: skip
    return centre, slope


def count_half_cycles(
    time_s: FloatArray, sign: IntArray, gap_before: IntArray
) -> tuple[IntArray, int]:
    """Number the extremes, counting those that a gap in the data has swallowed.

    Parameters
    ----------
    time_s, sign
        Of each extreme; `sign` is +1 for a maximum.
    gap_before
        1 where samples are missing between an extreme and the one before it.

    Returns
    -------
    number, good
        Number of each half cycle from 0; and how many extremes from the start hang
        together (an interval of three half cycles without a gap ends the motion).
    """
    number = np.zeros(len(time_s), dtype=np.int64)
    if len(time_s) < 2:
        return number, len(time_s)
    good = entries()["count_half_cycles"](
        numbers(time_s), _integers(sign), _integers(gap_before), len(time_s),
        float(np.median(np.diff(time_s[:6]))), number,
    )  # fmt: skip
    return number, good


def half_cycle_sums(
    time_s: FloatArray, values: FloatArray, stride: int, edges: IntArray, centre_s: FloatArray,
    rate: FloatArray, level: float, shape: FloatArray, free: int,
) -> tuple[FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """Normal equations of every half cycle: level, amplitude, sine, free odd harmonics.

    Parameters
    ----------
    time_s, values, stride
        Readings, shape (n,), of which every `stride`-th is used.
    edges
        First sample and the one after the last of each half cycle, shape (k, 2).
    centre_s, rate
        Time of the turning point and phase per second, shape (k,).
    level
        What is taken off the readings first.
    shape
        Coefficients of the half cycle's shape (see `shape.py`), shape (k, 4 + HARMONICS).
    free
        How many odd harmonics are fitted besides, 0 to HARMONICS.

    Returns
    -------
    gram, right, square
        Sums of products, shape (k, 3 + free, 3 + free), with the readings,
        (k, 3 + free), and of the readings' squares, (k,).
    """
    count, terms = len(centre_s), 3 + free
    assert edges.shape == (count, 2)
    assert shape.shape == (count, 4 + HARMONICS)
    gram, right = np.zeros((count, terms, terms)), np.zeros((count, terms))
    square = np.zeros(count)
    arguments = (
        numbers(time_s), numbers(values), len(values), stride, _integers(edges),
        numbers(centre_s), numbers(rate), count, level, numbers(shape),
    )  # fmt: skip
    if free or shape[:, 4:].any():
        work = np.empty(terms)
        entries()["half_cycle_sums"](*arguments, free, gram, right, square, work)
    else:
        entries()["plain_sums"](*arguments, gram, right, square)
    return gram, right, square


def solve_half_cycles(
    gram: FloatArray, right: FloatArray, prior: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Solve each half cycle for amplitude, sine and harmonics at a given level.

    Parameters
    ----------
    gram, right
        From `half_cycle_sums`; row 0 is the level.
    prior
        Added to the sine's diagonal (an inverse variance about zero, over the noise's).

    Returns
    -------
    solution, inverse
        Shape (k, size - 1, 2): for a level that is right, and minus the change per unit
        of level; and the inverse of the reduced Gram matrix, (k, size - 1, size - 1). A
        half cycle without samples gives NaN.
    """
    count, terms = right.shape
    size = terms - 1
    solution, inverse = np.full((count, size, 2), np.nan), np.full((count, size, size), np.nan)
    entries()["solve_half_cycles"](
        numbers(gram), numbers(right), numbers(prior), count, terms, solution, inverse,
        np.empty(size * size + size),
    )  # fmt: skip
    return solution, inverse
