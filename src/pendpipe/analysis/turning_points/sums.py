"""The sums over the readings of every half cycle."""

from __future__ import annotations

import math

from pendpipe.analysis.turning_points.shape import HARMONICS
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.kernel import IntMatrix, Matrix, Stack, kernel

BLOCK = 256
"""Readings that are worked on at a time."""
ROWS = 5 + HARMONICS
"""Of a block: 1, the shape, the sine, the odd harmonics; the cosine; and the readings."""
_COSINE, _READING = ROWS - 2, ROWS - 1


@kernel(inline=True)
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


@kernel(any_order=True)
def _fill(
    time_s: FloatArray,
    values: FloatArray,
    stride: int,
    rate: float,
    centre_s: float,
    level: float,
    shape: FloatArray,
    harmonics: int,
    block: Matrix,
) -> int:
    """Fill the rows of a block of readings; return how many there are."""
    friction, viscous, friction2, viscous2 = shape[0], shape[1], shape[2], shape[3]
    forms, sines, cosines, last = block[1], block[2], block[_COSINE], block[_READING]
    count: int = min((time_s.size + stride - 1) // stride, block.shape[1])
    # In loops of few rows each: compilers vectorise no loop of many that might overlap.
    for i in range(count):
        last[i] = rate * (time_s[i * stride] - centre_s)
    for i in range(count):
        phase = last[i]
        cosine, sine = cosine_sine(phase)
        lack = 1.0 - cosine
        sines[i], cosines[i] = sine, cosine
        forms[i] = (
            cosine
            + (math.copysign(friction, phase) - friction2) * lack
            + viscous * (sine - phase * cosine)
            + viscous2 * phase * (0.5 * phase * cosine - sine)
        )
    for i in range(count):
        last[i] = values[i * stride] - level
    for m in range(harmonics):
        # cos(n + 2) = 2 cos(2) cos(n) - cos(n - 2), n times the phase
        before, now = block[1 + m if m > 1 else _COSINE], block[2 + m if m > 0 else _COSINE]
        new, share = block[3 + m], shape[4 + m]
        for i in range(count):
            new[i] = (4.0 * cosines[i] * cosines[i] - 2.0) * now[i] - before[i]
            forms[i] += share * new[i]
    return count


@kernel(any_order=True)
def _product(one: FloatArray, other: FloatArray, count: int) -> float:
    """Return the sum of products of the first `count`."""
    total = 0.0
    for i in range(count):
        total += one[i] * other[i]
    return total


@kernel
def half_cycle_sums(
    time_s: FloatArray,
    values: FloatArray,
    stride: int,
    edges: IntMatrix,
    centre_s: FloatArray,
    rate: FloatArray,
    level: float,
    shape: Matrix,
    harmonics: int,
    gram: Stack,
    right: Matrix,
    square: FloatArray,
    block: Matrix,
) -> None:
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
    harmonics
        How many odd harmonics the shape has; the first of them are fitted besides, where `gram`
        has room for more than three terms.
    gram, right, square
        To be added to: sums of products, shape (k, terms, terms), with the readings, (k, terms),
        and of the readings' squares, (k,).
    block
        Room, shape (ROWS, BLOCK), its first row ones.
    """
    terms = right.shape[1]
    for k in range(centre_s.size):
        first, last = edges[k, 0], edges[k, 1]
        while first < last:
            count = _fill(
                time_s[first:last],
                values[first:last],
                stride,
                rate[k],
                centre_s[k],
                level,
                shape[k],
                harmonics,
                block,
            )
            readings = block[_READING]
            for p in range(terms):
                right[k, p] += _product(block[p], readings, count)
                for q in range(p + 1):
                    gram[k, p, q] += _product(block[p], block[q], count)
            square[k] += _product(readings, readings, count)
            first += count * stride
        for p in range(terms):
            for q in range(p):
                gram[k, q, p] = gram[k, p, q]
