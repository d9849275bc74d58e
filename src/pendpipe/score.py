"""The score test, for readings of a record and for records of a campaign, and its look elsewhere.

The part of a derivative that the unknowns of a model can follow is projected out; the score is
the inner product of the rest, at unit length, with the whitened residual: the locally most powerful
test (docs/score.md).
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray

CLASS: Final = 6.0
"""A rival whose likelihood is within exp(-3) of the best one's is in its class (chi^2)."""


CHOICE: Final = 7.4
"""Price of a name or curve beside a remaining misfit, in chi^2: it is one of forty (2 ln 40)."""
FURTHER: Final = 22.0
"""Price of each further name: a choice, in data that need two at once, which is as rare
again as two choices."""
NEAR: Final = 16.0
"""Twice the log-likelihood by which a lead may be behind the best and still win in the end."""
REACH: Final = 0.3
"""Part of the best score that a refit may catch up."""


def within_reach(scores: FloatArray, part: float = REACH) -> BoolArray:
    """Return which leads may win once they are refitted; scores count as chi^2."""
    best = float(np.max(scores))
    return np.asarray(scores > best - NEAR - part * best)


def shares(logs: FloatArray) -> FloatArray:
    """Return probabilities, of which one is true, from their logarithms, shape kept."""
    weights = np.exp(logs - np.max(logs))
    return np.asarray(weights / weights.sum())


def price_of_another(names: int) -> float:
    """Return the price of a name beside others."""
    return FURTHER if names else CHOICE


def unit_rows(
    rows: FloatArray, basis: FloatArray, visible: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Return what orthonormal columns do not follow of each row, at unit length.

    Parameters
    ----------
    rows
        Derivatives of the whitened residual, shape (k, n); they are overwritten.
    basis
        Of the derivatives by a model's own unknowns, shape (n, p).
    visible
        The part of a row that must remain for anything to be seen of it.

    Returns
    -------
    units, lengths
        Shapes (k, n) and (k,); a length is inf, and the row 0, where nothing is seen.
    """
    least = visible * np.linalg.norm(rows, axis=1)
    rows -= (rows @ basis) @ basis.T
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths <= least] = np.inf
    return rows / lengths[:, None], lengths


TAIL_SHARE: Final = 0.4
"""Part of the draws, those of the smallest p-values, that determines the number of trials."""
_TRIALS_EXPONENT: Final = 0.5
"""Exponent of ln p in the number of trials: a scan over one continuous shape has trials
proportional to the root of the threshold in chi^2 (Rice's formula), about -2 ln p."""


@dataclass(frozen=True)
class Trials:
    """The effective number of independent trials of a scan.

    P(smallest local p-value < p) = 1 - (1 - p)^m(p), with m = first (ln p/ln usual)^growth
    for p below usual: the rarer the event, the more trials a scan over continuous shapes has.
    """

    first: float
    growth: float
    usual: float = 0.05
    """The p-value at which the trials were counted."""

    def number_at(self, log_local: float) -> float:
        """Return the number of trials at a local p-value of exp(`log_local`)."""
        rarer = max(log_local / math.log(self.usual), 1.0)
        return float(max(self.first * rarer**self.growth, 1.0))

    def global_p_value(self, local: float) -> float:
        """Return the probability that chance gives such a local p-value anywhere in the scan."""
        if local <= 0.0:
            return 0.0
        trials = self.number_at(math.log(local))
        return float(-math.expm1(trials * math.log1p(-min(local, 1.0 - 1e-15))))


def trials_of(smallest: FloatArray, growth: float = _TRIALS_EXPONENT) -> Trials:
    """Estimate the number of trials from the smallest p-values of many draws: 1 - F = (1 - p)^m."""
    ordered = np.sort(smallest)
    draws = len(ordered)
    rank = (np.arange(1, draws + 1) - 0.3) / (draws + 0.4)
    trials = np.log1p(-rank) / np.log1p(-np.minimum(ordered, 1.0 - 1e-12))
    part = slice(max(2, draws // 50), int(TAIL_SHARE * draws))
    middle = float(np.exp(np.mean(np.log(trials[part]))))
    at = float(np.exp(np.mean(np.log(ordered[part]))))
    return Trials(max(middle, 1.0), growth, min(at, 0.5))
