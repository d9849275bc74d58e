"""Amplitude and phase of the readings in each cycle, on a model's phase clock."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.sampling import Sampled

_FEWEST_READINGS: Final = 5
"""Fewest readings in a cycle for three fitted numbers."""
_NEIGHBOURS: Final = 9
"""Cycles over which the median number of readings is taken: an encoder that records its counts
gives fewer at small amplitudes."""


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
    number = np.floor(sampled.phase / (2.0 * math.pi)).astype(np.int64)
    first = int(number.min())
    count = int(number.max()) - first + 1
    carrier = sampled.motion.upwards * sampled.amplitude
    columns = [np.ones_like(readings), carrier * sampled.cosine, carrier * sampled.sine]

    def total(values: FloatArray) -> FloatArray:
        sums = np.bincount(number - first, weights=weight * values, minlength=count)
        return sums.astype(np.float64)

    size = total(columns[0])
    good = size >= np.maximum(float(_FEWEST_READINGS), part * _usual(size))
    normal = np.array([[total(one * other) for one in columns] for other in columns])[..., good]
    right = np.array([total(one * readings) for one in columns])[..., good]
    solved = np.linalg.solve(normal.transpose(2, 0, 1), right.T[..., None])[..., 0]
    return LockIn(
        np.flatnonzero(good) + first,
        size[good],
        solved[:, 1],
        solved[:, 2],
        normal[1, 1],
        total(sampled.phase)[good] / size[good],
    )


def _usual(size: FloatArray) -> FloatArray:
    """Return the median over each cycle and its neighbours, without empty cycles."""
    seen = np.flatnonzero(size > 0.0)
    width = min(_NEIGHBOURS, len(seen))
    if not width:
        return np.zeros(len(size))
    medians = np.median(np.lib.stride_tricks.sliding_window_view(size[seen], width), axis=1)
    middle = seen[width // 2 : width // 2 + len(medians)]
    return np.asarray(np.interp(np.arange(len(size)), middle, medians))
