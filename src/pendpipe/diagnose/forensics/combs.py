"""Codes that fail at even distances: a faulty bit spares all others."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.distributions import poisson_from, poisson_up_to
from pendpipe.arrays import BoolArray, FloatArray, IntArray

_BITS: Final = 7
_LEAST: Final = 6.0
"""Readings expected of a residue, from which it is looked at."""


class Comb(NamedTuple):
    """Codes that are equal modulo `period`.

    Parameters
    ----------
    period, residue
        Which: code = residue (mod period).
    found, expected
        Readings that have them, and that should.
    p_value
        All periods and residues that were looked at counted.
    """

    period: int
    residue: int
    found: float
    expected: float
    p_value: float

    def holds(self, code: IntArray) -> BoolArray:
        """Which codes are in it."""
        return np.asarray(code % self.period == self.residue)

    @property
    def gain(self) -> float:
        """Twice the gain in log-likelihood (Poisson)."""
        likely = self.found * np.log(self.found / self.expected) if self.found else 0.0
        return float(2.0 * (likely - self.found + self.expected))


def worst_comb(code: IntArray, expected: FloatArray) -> Comb:
    """Pool the codes by their residues, and find the one that is the most improbable.

    A converter whose bit fails at one of its states loses every code of one residue modulo a
    power of two. Each alone may be due too seldom to be missed; together they are not.

    Parameters
    ----------
    code
        Of each reading.
    expected
        How often each code from ``code.min() - 1`` on is due, a row for each error that all
        angles may have in common; shape (errors, codes), the middle row without.
    """
    first, size = int(code.min()) - 1, expected.shape[1]
    codes = np.arange(first, first + size)
    best, tried = Comb(1, 0, 0.0, 0.0, 1.0), 0
    for bit in range(1, _BITS + 1):
        period = 2**bit
        if 2 * period > size - 2:
            break
        due = np.stack([np.bincount(codes % period, row, period) for row in expected])
        low, high = due.min(axis=0), due.max(axis=0)
        found = np.bincount(code % period, minlength=period).astype(np.float64)
        looked = low > _LEAST
        tried += int(np.count_nonzero(looked))
        # What is within two sigma is by no count of residues improbable.
        odd = looked & ((found < low - 2.0 * np.sqrt(low)) | (found > high + 2.0 * np.sqrt(high)))
        chance = np.ones(period)
        if odd.any():
            fewer, more = poisson_up_to(found[odd], low[odd]), poisson_from(found[odd], high[odd])
            chance[odd] = 2.0 * np.minimum(fewer, more)
        at = int(np.argmin(chance))
        if chance[at] < best.p_value:
            middle = float(due[len(expected) // 2, at])
            best = Comb(period, at, float(found[at]), middle, float(chance[at]))
    return best._replace(p_value=min(1.0, tried * best.p_value))
