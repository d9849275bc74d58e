"""The sums over the readings of every half cycle, and the small systems they make."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pendpipe.analysis.turning_points.kernels import solve_in_place
from pendpipe.analysis.turning_points.shape import HARMONICS
from pendpipe.arrays import FloatArray, IntArray


@njit(cache=True, inline="always")
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


@njit(cache=True, fastmath=True)
def plain_sums(
    time_s: FloatArray,
    values: FloatArray,
    stride: int,
    edges: IntArray,
    centre_s: FloatArray,
    rate: FloatArray,
    level: float,
    shape: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """As `half_cycle_sums` without harmonics: a loop that compilers turn into vectors."""
    number = len(centre_s)
    gram = np.zeros((number, 3, 3))
    right = np.zeros((number, 3))
    square = np.zeros(number)
    for k in range(number):
        friction, viscous, friction2, viscous2 = shape[k, 0], shape[k, 1], shape[k, 2], shape[k, 3]
        w, centre = rate[k], centre_s[k]
        n, f1, s1, ff, fs, ss = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        x0, xf, xs, xx = 0.0, 0.0, 0.0, 0.0
        for i in range(edges[k, 0], edges[k, 1], stride):
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
        gram[k, 0, 0], gram[k, 1, 1], gram[k, 2, 2] = n, ff, ss
        gram[k, 0, 1] = gram[k, 1, 0] = f1
        gram[k, 0, 2] = gram[k, 2, 0] = s1
        gram[k, 1, 2] = gram[k, 2, 1] = fs
        right[k, 0], right[k, 1], right[k, 2] = x0, xf, xs
        square[k] = xx
    return gram, right, square


@njit(cache=True)
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
) -> tuple[FloatArray, FloatArray, FloatArray]:
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
    number, size = len(centre_s), 3 + free
    gram = np.zeros((number, size, size))
    right = np.zeros((number, size))
    square = np.zeros(number)
    basis = np.empty(size)
    harmonic = free > 0 or np.any(shape[:, 4:] != 0.0)
    for k in range(number):
        friction, viscous, friction2, viscous2 = shape[k, 0], shape[k, 1], shape[k, 2], shape[k, 3]
        for i in range(edges[k, 0], edges[k, 1], stride):
            phase = rate[k] * (time_s[i] - centre_s[k])
            cosine, sine = cosine_sine(phase)
            lack = 1.0 - cosine
            form = cosine - friction2 * lack + viscous * (sine - phase * cosine)
            form += math.copysign(friction, phase) * lack
            form += viscous2 * phase * (0.5 * phase * cosine - sine)
            before, now = cosine, cosine
            if harmonic:
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
                    gram[k, p, q] += basis[p] * basis[q]
        for p in range(size):
            for q in range(p):
                gram[k, q, p] = gram[k, p, q]
    return gram, right, square


@njit(cache=True)
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
    number, size = right.shape[0], right.shape[1] - 1
    solution = np.full((number, size, 2), np.nan)
    inverse = np.full((number, size, size), np.nan)
    matrix = np.empty((size, size))
    column = np.empty(size)
    for k in range(number):
        if gram[k, 0, 0] == 0.0:
            continue
        for job in range(size + 2):
            for p in range(size):
                for q in range(size):
                    matrix[p, q] = gram[k, 1 + p, 1 + q]
                if job == 0:
                    column[p] = right[k, 1 + p]
                elif job == 1:
                    column[p] = gram[k, 1 + p, 0]
                else:
                    column[p] = 1.0 if p == job - 2 else 0.0
                # A hair of regularisation: few samples can't tell harmonics apart.
                matrix[p, p] *= 1.0 + 1e-9
            matrix[1, 1] += prior[k] + 1e-12
            solve_in_place(matrix, column)
            for p in range(size):
                if job < 2:
                    solution[k, p, job] = column[p]
                else:
                    inverse[k, p, job - 2] = column[p]
    return solution, inverse
