"""The clock of any motion: its phase, with the nodes at which laws are asked and integrated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.chebyshev import lobatto_integration, lobatto_nodes


@dataclass(frozen=True)
class Clock:
    """The nodes of the phase: Chebyshev-Lobatto in each half cycle, ends included.

    Parameters
    ----------
    count
        How many half cycles.
    order
        Intervals between the nodes of one half cycle.
    """

    count: int
    order: int = 16

    @property
    def psi(self) -> FloatArray:
        """Phase of each node, shape (count, order + 1)."""
        return _phases(self.count, self.order)[0]

    @property
    def cosine(self) -> FloatArray:
        """cos(psi), shape (count, order + 1)."""
        return _phases(self.count, self.order)[1]

    @property
    def sine(self) -> FloatArray:
        """sin(psi), shape (count, order + 1); exactly zero at the turning points."""
        return _phases(self.count, self.order)[2]

    @property
    def side(self) -> FloatArray:
        """+1 and -1 in turn: the side of the turning point that begins each half cycle."""
        return _phases(self.count, self.order)[3]

    def integral(self, rate: FloatArray) -> FloatArray:
        """Integrate over the phase from psi = 0; shape (..., count, order + 1) as `rate`."""
        parts = rate @ _integration(self.order).T
        parts[..., 1:, :] += np.cumsum(parts[..., :-1, -1], axis=-1)[..., None]
        return np.asarray(parts)


@lru_cache(maxsize=8)
def _phases(count: int, order: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Phase, cosine and sine of each node, and the sign of each half cycle; not to be written."""
    sign = np.asarray(1.0 - 2.0 * (np.arange(count) % 2)[:, None], dtype=np.float64)
    psi: FloatArray = math.pi * (np.arange(count)[:, None] + _nodes(order))
    cosine: FloatArray = sign * np.cos(math.pi * _nodes(order))
    sine = np.sin(math.pi * _nodes(order))
    sine[[0, -1]] = 0.0
    sine = np.asarray(sign * sine)
    for each in (psi, cosine, sine, sign):
        each.flags.writeable = False
    return psi, cosine, sine, sign


@lru_cache
def _nodes(order: int) -> FloatArray:
    """Chebyshev-Lobatto points on [0, 1]."""
    return np.asarray(0.5 + 0.5 * lobatto_nodes(order))


@lru_cache
def _integration(order: int) -> FloatArray:
    """The matrix that integrates from the first node to each, over a half turn."""
    return np.asarray(0.5 * math.pi * lobatto_integration(order))
