"""The kernels for callers outside Numba: bare pointers and sizes, so that they can be kept as code.

Those of `compiled.py` say what the arguments are; matrices of k half cycles come as their
numbers one after the other.
"""

from __future__ import annotations

from typing import Any

from numba import cfunc, types

from pendpipe.analysis.turning_points import kernels, plain_entries, sums
from pendpipe.analysis.turning_points.shape import HARMONICS
from pendpipe.dynamics.views import matrix, vector

COEFFICIENTS = 4 + HARMONICS
_NUMBERS: Any = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
_INTEGERS: Any = types.CPointer(types.int64)  # type: ignore[no-untyped-call]
_KINDS = {"F": _NUMBERS, "I": _INTEGERS, "i": types.int64, "f": types.float64}


def _extremes(
    values: Any, size: int, stride: int, start: float, least: float,
    found: Any, room: int, work: Any,
) -> int:  # fmt: skip
    return kernels.extremes(
        vector(values, size), stride, start, least, vector(found, room), vector(work, 10)
    )


def _smooth_times(
    number: Any, time_s: Any, weight: Any, known: int, wanted: float, at: Any, size: int,
    centre: Any, slope: Any, work: Any,
) -> int:  # fmt: skip
    kernels.smooth_times(
        vector(number, known), vector(time_s, known), vector(weight, known), wanted,
        vector(at, size), vector(centre, size), vector(slope, size), vector(work, 15),
    )  # fmt: skip
    return 0


def _count_half_cycles(
    time_s: Any, sign: Any, gap_before: Any, size: int, period: float, number: Any
) -> int:
    return kernels.count_half_cycles(
        vector(time_s, size), vector(sign, size), vector(gap_before, size), period,
        vector(number, size),
    )  # fmt: skip


def _plain_sums(
    time_s: Any, values: Any, size: int, stride: int, edges: Any, centre_s: Any, rate: Any,
    count: int, level: float, shape: Any, gram: Any, right: Any, square: Any,
) -> int:  # fmt: skip
    sums.plain_sums(
        vector(time_s, size), vector(values, size), stride, vector(edges, 2 * count),
        vector(centre_s, count), vector(rate, count), level,
        matrix(vector(shape, COEFFICIENTS * count), count, COEFFICIENTS),
        matrix(vector(gram, 9 * count), 3 * count, 3), matrix(vector(right, 3 * count), count, 3),
        vector(square, count),
    )  # fmt: skip
    return 0


def _half_cycle_sums(
    time_s: Any, values: Any, size: int, stride: int, edges: Any, centre_s: Any, rate: Any,
    count: int, level: float, shape: Any, free: int,
    gram: Any, right: Any, square: Any, work: Any,
) -> int:  # fmt: skip
    terms = 3 + free
    sums.half_cycle_sums(
        vector(time_s, size), vector(values, size), stride, vector(edges, 2 * count),
        vector(centre_s, count), vector(rate, count), level,
        matrix(vector(shape, COEFFICIENTS * count), count, COEFFICIENTS), free,
        matrix(vector(gram, terms * terms * count), terms * count, terms),
        matrix(vector(right, terms * count), count, terms),
        vector(square, count), vector(work, terms),
    )  # fmt: skip
    return 0


def _solve_half_cycles(
    gram: Any, right: Any, prior: Any, count: int, terms: int,
    solution: Any, inverse: Any, work: Any,
) -> int:  # fmt: skip
    size = terms - 1
    sums.solve_half_cycles(
        matrix(vector(gram, terms * terms * count), terms * count, terms),
        matrix(vector(right, terms * count), count, terms), vector(prior, count),
        matrix(vector(solution, 2 * size * count), size * count, 2),
        matrix(vector(inverse, size * size * count), size * count, size),
        vector(work, size * size + size),
    )  # fmt: skip
    return 0


def compiled_entries(arguments: dict[str, str]) -> list[Any]:
    """Compile the entries whose arguments are given, a letter each (see `compiled.ARGUMENTS`)."""
    entries, here = [], globals() | vars(plain_entries)
    for name, letters in arguments.items():
        signature = types.int64(*(_KINDS[letter] for letter in letters))
        make = cfunc(signature, _nrt=False, error_model="numpy")  # type: ignore[call-arg]
        entries.append(make(here[f"_{name}"]))
    return entries
