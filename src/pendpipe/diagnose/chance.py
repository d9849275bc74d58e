"""How often chance alone would do as well somewhere in the whole catalogue."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.scores import Bank, local_p_values
from pendpipe.diagnose.spectrum import ToneScan

_DRAWS: Final = 256
_TAIL: Final = 0.4
"""Part of the draws from whose smallest p-values the number of trials is read."""


@dataclass(frozen=True)
class Trials:
    """The number of independent trials that a scan amounts to.

    P(smallest local p-value < p) = 1 - (1 - p)^m(p), with m = first p^(-growth): scans over
    continuous shapes have the more trials the rarer the event.
    """

    first: float
    growth: float

    def global_p_value(self, local: float) -> float:
        """The probability that chance finds a local p-value as small anywhere."""
        if local <= 0.0:
            return 0.0
        trials = self.first * local ** (-self.growth)
        return float(-math.expm1(trials * math.log1p(-min(local, 1.0 - 1e-15))))


def smallest_p_values(
    bank: Bank, scans: list[ToneScan], residual: FloatArray
) -> FloatArray:
    """Return the smallest local p-value of each projected residual, shape (draws,)."""
    smallest = np.ones(residual.shape[1])
    if bank.candidates:
        local = local_p_values(bank.scores(residual), bank.freedom)
        smallest = np.minimum(smallest, local.min(axis=0))
    for scan in scans:
        best = scan.scores(residual).max(axis=0)
        smallest = np.minimum(smallest, np.exp(-0.5 * best))
    return smallest


def count_trials(
    bank: Bank, scans: list[ToneScan], seed: int, draws: int = _DRAWS
) -> Trials:
    """Draw white residuals, project them as the fit does, and see what the scans make of them.

    The tail of the smallest p-value is extrapolated with a slowly growing number of trials,
    as Gross and Vitells do for continuous scans.
    """
    generator = np.random.default_rng(seed)
    white = generator.standard_normal((len(bank.basis), draws))
    white -= bank.basis @ (bank.basis.T @ white)
    smallest = np.sort(smallest_p_values(bank, scans, white))
    # 1 - F = (1 - p)^m: m from each order statistic, then a line in the logarithms.
    rank = (np.arange(1, draws + 1) - 0.3) / (draws + 0.4)
    trials = np.log1p(-rank) / np.log1p(-smallest)
    part = slice(max(2, draws // 50), int(_TAIL * draws))
    middle = float(np.exp(np.mean(np.log(trials[part]))))
    at = float(np.exp(np.mean(np.log(smallest[part]))))
    growth = 0.04 if len(bank.candidates) > 50 or scans else 0.0
    return Trials(middle * at**growth, growth)
