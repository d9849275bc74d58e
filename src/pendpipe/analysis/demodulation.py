"""Readings demodulated: least squares in each cycle, or window of cycles, on the motion's phase."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.measure import cosine_sine, product
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.any_law import Sampled
from pendpipe.dynamics.kernel import Matrix, Stack, kernel

_FEWEST_READINGS: Final = 5
"""Fewest readings in a cycle for three fitted numbers."""
_NEIGHBOURS: Final = 9
"""Cycles over which the median number of readings is taken: an encoder that records its counts
gives fewer at small amplitudes."""
_RIDGE: Final = 1e-12
"""Of the level's square: below the rounding of the sums, and more than an idle window has."""


def harmonic_columns(phase: FloatArray, harmonics: int) -> FloatArray:
    """Return 1, cos psi, sin psi, cos 2 psi, ...; shape (1 + 2 harmonics, n)."""
    waves = np.empty((1 + 2 * harmonics, len(phase)))
    _fill_waves(np.ascontiguousarray(phase), waves)
    return waves


@kernel(any_order=True)
def _fill_waves(phase: FloatArray, waves: Matrix) -> None:
    """Fill in what `harmonic_columns` returns, right to 1e-12."""
    for i in range(phase.size):
        turns = math.floor(phase[i] / math.pi + 0.5)
        cosine, sine = cosine_sine(phase[i] - math.pi * turns)
        side = 1.0 - 2.0 * (turns - 2.0 * math.floor(0.5 * turns))
        waves[0, i], waves[1, i], waves[2, i] = 1.0, side * cosine, side * sine
    for m in range(3, waves.shape[0]):
        # cos(n + 1) = 2 cos(1) cos(n) - cos(n - 1), and so the sine; the one at 0 is none
        share = 0.0 if m == 4 else 1.0
        for i in range(phase.size):
            twice = 2.0 * waves[1, i] * waves[m - 2, i]
            waves[m, i] = twice - share * waves[max(m - 4, 0), i]


def _numbered(phase: FloatArray) -> IntArray:
    """Return the number of each reading's cycle.

    A phase that falls back, where a clock steps back or a trial motion is hardly resolved, begins
    no cycle again.
    """
    return np.maximum.accumulate(np.floor(phase / (2.0 * math.pi))).astype(np.int64)


def cycle_starts(phase: FloatArray, cycles: int = 1) -> IntArray:
    """Return the first reading of each so many cycles, from the first reading's phase on."""
    number = _numbered((phase - phase[0]) / cycles)
    return np.searchsorted(number, np.arange(number[-1] + 1))


def normal_equations(
    columns: FloatArray, values: FloatArray, starts: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Sum products of columns with each other, and with values, over each window.

    Parameters
    ----------
    columns
        Shape (p, n); zero where a reading does not count.
    values
        Shape (n, ...).
    starts
        First reading of each window, shape (k,).

    Returns
    -------
    gram, right
        Shapes (k, p, p) and (k, p, ...); zero of windows without readings.
    """
    size, table = len(columns), values.reshape(len(values), -1)
    gram = np.empty((len(starts), size, size))
    right = np.empty((len(starts), size, table.shape[1]))
    ends = np.append(starts, len(values))
    _sum_up(np.ascontiguousarray(columns), np.ascontiguousarray(table.T), ends, gram, right)
    return gram, right.reshape(*right.shape[:2], *values.shape[1:])


@kernel(any_order=True)
def _sum_up(columns: Matrix, values: Matrix, ends: IntArray, gram: Stack, right: Stack) -> None:
    """Fill both; each window ends where the next one starts."""
    for k in range(ends.size - 1):
        first, count = ends[k], ends[k + 1] - ends[k]
        for i in range(columns.shape[0]):
            column = columns[i, first:]
            for j in range(i + 1):
                gram[k, i, j] = gram[k, j, i] = product(column, columns[j, first:], count)
            for j in range(values.shape[0]):
                right[k, i, j] = product(column, values[j, first:], count)


def by_cycle(
    residual: FloatArray, phase: FloatArray, harmonics: int
) -> tuple[FloatArray, FloatArray]:
    """Return coefficients of offset, cosine, sine and harmonics in each cycle, and the rest.

    Shape (cycles, 1 + 2 harmonics, ...) for a residual of shape (n, ...). Within a cycle the
    functions are orthonormal, so that noise gives each coefficient the variance 1; of few readings
    there are half as many.
    """
    starts, columns = cycle_starts(phase), harmonic_columns(phase, harmonics)
    lengths = np.diff(starts, append=len(phase))
    gram, right = normal_equations(columns, residual.reshape(len(phase), -1), starts)
    idle = np.arange(len(columns)) >= lengths[:, None] // 2
    unit = np.eye(len(columns))
    gram = np.where(idle[:, None] | idle[:, :, None], unit, gram + _RIDGE * gram[:, :1, :1] * unit)
    right[idle] = 0.0
    root = np.linalg.cholesky(gram)
    found = np.linalg.solve(root, right)
    sizes = np.linalg.solve(root.swapaxes(1, 2), found)
    rest = residual.copy()
    for k, column in enumerate(columns):
        taken = column[:, None] * np.repeat(sizes[:, k], lengths, axis=0)
        rest -= taken.reshape(residual.shape)
    return found.reshape(*found.shape[:2], *residual.shape[1:]), rest


@dataclass(frozen=True)
class LockIn:
    """Fits of ``offset + r (cosine cos psi + sine sin psi)`` to each cycle; all of shape (k,).

    Parameters
    ----------
    number
        Number of the cycle: psi from 2 pi number on.
    readings
        Number of readings that count.
    cosine, sine
        1 and 0 where readings and model agree.
    strength
        Sum of (r cos psi)^2: the inverse variance of `cosine` for readings of unit variance.
    middle
        Mean psi of the readings.
    """

    number: IntArray
    readings: FloatArray
    cosine: FloatArray
    sine: FloatArray
    strength: FloatArray
    middle: FloatArray

    @property
    def phase(self) -> FloatArray:
        """Phase by which the readings are ahead of the model, unwrapped."""
        return np.unwrap(np.arctan2(-self.sine, self.cosine))


def lock_in(readings: FloatArray, weight: FloatArray, sampled: Sampled, part: float) -> LockIn:
    """Fit each cycle.

    Parameters
    ----------
    readings, weight
        Readings (an offset is fitted), and whether each counts, shape (n,).
    sampled
        The model's motion at the readings. On its clock ``x = r cos psi`` is exact, so that
        a restoring torque that is not linear makes no harmonics here.
    part
        Part of the median number of readings that a cycle must have.
    """
    number = _numbered(sampled.phase)
    numbers = np.arange(number[0], number[-1] + 1)
    starts = np.searchsorted(number, numbers)
    carrier = sampled.motion.upwards * sampled.amplitude
    waves = np.stack([np.ones_like(readings), carrier * sampled.cosine, carrier * sampled.sine])
    values = np.stack([readings, sampled.phase], axis=1)
    gram, right = normal_equations(waves * weight, values, starts)
    size = gram[:, 0, 0]
    good = size >= np.maximum(float(_FEWEST_READINGS), part * _usual(size))
    gram, right, size = gram[good], right[good], size[good]
    solved = np.asarray(np.linalg.solve(gram, right[..., :1])[..., 0], dtype=np.float64)
    middle = right[:, 0, 1] / size
    return LockIn(numbers[good], size, solved[:, 1], solved[:, 2], gram[:, 1, 1], middle)


def _usual(size: FloatArray) -> FloatArray:
    """Return the median over each cycle and its neighbours, without empty cycles."""
    seen = np.flatnonzero(size > 0.0)
    width = min(_NEIGHBOURS, len(seen))
    if not width:
        return np.zeros(len(size))
    medians = np.median(np.lib.stride_tricks.sliding_window_view(size[seen], width), axis=1)
    middle = seen[width // 2 : width // 2 + len(medians)]
    return np.asarray(np.interp(np.arange(len(size)), middle, medians))
