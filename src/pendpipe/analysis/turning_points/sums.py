"""The sums over the readings of every half cycle, and the small systems they make.

Compiled to be kept, as `kernels.py`. Matrices of all half cycles stand one below the other:
row p of half cycle k is row ``k * size + p``.
"""

from __future__ import annotations

import math

from numba import njit

from pendpipe.analysis.turning_points.kernels import kernel, solve_in_place
from pendpipe.analysis.turning_points.shape import HARMONICS
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.views import matrix


@njit(inline="always", _nrt=False)  # type: ignore[call-overload]
def cosine_sine(phase: float) -> tuple[float, float]:
    """Cosine and sine for |phase| < 2, to 1e-9: fast, since no range is reduced."""
    square = phase * phase
    cosine = 1.0 / 20922789888000.0
    cosine = cosine * square - 1.0 / 87178291200.0
    cosine = cosine * square + 1.0 / 479001600.0
    cosine = cosine * square - 1.0 / 3628800.0
    cosine = cosine * square + 1.0 / 40320.0
    cosine = cosine * square - 1.0 / 720.0
    cosine = cosine * square + 1.0 / 24.0
    cosine = cosine * square - 0.5
    cosine = cosine * square + 1.0
    sine = 1.0 / 1307674368000.0
    sine = -sine * square + 1.0 / 6227020800.0
    sine = sine * square - 1.0 / 39916800.0
    sine = sine * square + 1.0 / 362880.0
    sine = sine * square - 1.0 / 5040.0
    sine = sine * square + 1.0 / 120.0
    sine = sine * square - 1.0 / 6.0
    sine = (sine * square + 1.0) * phase
    return cosine, sine


def _plain_sums(
    time_s: FloatArray,
    values: FloatArray,
    stride: int,
    edges: IntArray,
    centre_s: FloatArray,
    rate: FloatArray,
    level: float,
    shape: FloatArray,
    gram: FloatArray,
    right: FloatArray,
    square: FloatArray,
) -> None:
    """As `half_cycle_sums` without harmonics: a loop that compilers turn into vectors."""
    for k in range(len(centre_s)):
        friction, viscous, friction2, viscous2 = shape[k, 0], shape[k, 1], shape[k, 2], shape[k, 3]
        w, centre = rate[k], centre_s[k]
        n, f1, s1, ff, fs, ss = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        x0, xf, xs, xx = 0.0, 0.0, 0.0, 0.0
        for i in range(edges[2 * k], edges[2 * k + 1], stride):
            phase = w * (time_s[i] - centre)
            cosine, sine = cosine_sine(phase)
            lack = 1.0 - cosine
            side = 1.0 if phase > 0.0 else -1.0
            form = (
                cosine
                + (side * friction - friction2) * lack
                + viscous * (sine - phase * cosine)
                + viscous2 * phase * (0.5 * phase * cosine - sine)
            )
            x = values[i] - level
            n += 1.0
            f1 += form
            s1 += sine
            ff += form * form
            fs += form * sine
            ss += sine * sine
            x0 += x
            xf += x * form
            xs += x * sine
            xx += x * x
        j = 3 * k
        gram[j, 0], gram[j + 1, 1], gram[j + 2, 2] = n, ff, ss
        gram[j, 1] = gram[j + 1, 0] = f1
        gram[j, 2] = gram[j + 2, 0] = s1
        gram[j + 1, 2] = gram[j + 2, 1] = fs
        right[k, 0], right[k, 1], right[k, 2] = x0, xf, xs
        square[k] = xx


plain_sums = kernel(_plain_sums, fastmath=True)


@kernel
def half_cycle_sums(
    time_s: FloatArray,
    values: FloatArray,
    stride: int,
    edges: IntArray,
    centre_s: FloatArray,
    rate: FloatArray,
    level: float,
    shape: FloatArray,
    free: int,
    gram: FloatArray,
    right: FloatArray,
    square: FloatArray,
    basis: FloatArray,
) -> None:
    """Normal equations of every half cycle: level, amplitude, sine, free odd harmonics.

    Parameters
    ----------
    time_s, values, stride, edges, centre_s, rate, level, shape, free
        See `compiled.half_cycle_sums`; the edges one after the other.
    gram, right, square
        To be added to: sums of products, with the readings, and of the readings' squares.
    basis
        Room for 3 + `free` numbers.
    """
    number, size = len(centre_s), 3 + free
    for k in range(number):
        friction, viscous, friction2, viscous2 = shape[k, 0], shape[k, 1], shape[k, 2], shape[k, 3]
        for i in range(edges[2 * k], edges[2 * k + 1], stride):
            phase = rate[k] * (time_s[i] - centre_s[k])
            cosine, sine = cosine_sine(phase)
            lack = 1.0 - cosine
            form = cosine - friction2 * lack + viscous * (sine - phase * cosine)
            form += math.copysign(friction, phase) * lack
            form += viscous2 * phase * (0.5 * phase * cosine - sine)
            before, now = cosine, cosine
            twice = 2.0 * (2.0 * cosine * cosine - 1.0)
            for m in range(HARMONICS):
                before, now = now, twice * now - before
                form += shape[k, 4 + m] * now
                if m < free:
                    basis[3 + m] = now
            basis[0] = 1.0
            basis[1] = form
            basis[2] = sine
            x = values[i] - level
            square[k] += x * x
            for p in range(size):
                right[k, p] += basis[p] * x
                for q in range(p + 1):
                    gram[k * size + p, q] += basis[p] * basis[q]
        for p in range(size):
            for q in range(p):
                gram[k * size + q, p] = gram[k * size + p, q]


@kernel
def solve_half_cycles(
    gram: FloatArray, right: FloatArray, prior: FloatArray,
    solution: FloatArray, inverse: FloatArray, work: FloatArray,
) -> None:  # fmt: skip
    """Solve each half cycle for amplitude, sine and harmonics at a given level.

    Parameters
    ----------
    gram, right, prior
        See `compiled.solve_half_cycles`.
    solution, inverse
        To be filled, but for half cycles without samples.
    work
        Room for a matrix and a column.
    """
    size = right.shape[1] - 1
    system, column = matrix(work, size, size), work[size * size : size * size + size]
    for k in range(len(prior)):
        first = k * (size + 1)
        if gram[first, 0] == 0.0:
            continue
        for job in range(size + 2):
            for p in range(size):
                for q in range(size):
                    system[p, q] = gram[first + 1 + p, 1 + q]
                if job == 0:
                    column[p] = right[k, 1 + p]
                elif job == 1:
                    column[p] = gram[first + 1 + p, 0]
                else:
                    column[p] = 1.0 if p == job - 2 else 0.0
                # A hair of regularisation: few samples can't tell harmonics apart.
                system[p, p] *= 1.0 + 1e-9
            system[1, 1] += prior[k] + 1e-12
            solve_in_place(system, column)
            for p in range(size):
                if job < 2:
                    solution[k * size + p, job] = column[p]
                else:
                    inverse[k * size + p, job - 2] = column[p]
