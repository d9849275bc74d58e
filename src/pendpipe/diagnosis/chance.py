"""How often chance alone does as well anywhere in the catalogue (look-elsewhere effect)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.scores import Bank, local_p_values
from pendpipe.diagnosis.spectrum import ToneScans

CATALOGUE_SHARE: Final = 0.5
"""Part of the significance level for the scan of the catalogue."""
RED_NOISE_SHARE: Final = 0.2
"""Part of it for the test whether red noise is an effect."""
TESTS_SHARE: Final = 1.0 - CATALOGUE_SHARE - RED_NOISE_SHARE
"""Part of it that the tests of the measurement share."""
SMALLEST: Final = 1e-12
"""Smaller p-values rest on tails of the noise that nobody has tested."""
DRAWS: Final = 256
FEW_DRAWS: Final = 64
"""Draws for a first look: they determine the number of trials to 20 %."""
_DRAWS_AT_ONCE: Final = 32
"""Draws computed together: few enough for the processor's cache."""
_TAIL_SHARE: Final = 0.4
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


@dataclass(frozen=True)
class Chance:
    """Trials of the scans, counted on white residuals.

    Parameters
    ----------
    everywhere
        Trials of the whole catalogue.
    own
        Trials of each effect by itself, by identifier.
    draws
        Number of draws.
    """

    everywhere: Trials
    own: dict[str, Trials]
    draws: int = DRAWS


def draw_chance(bank: Bank, tones: ToneScans | None, seed: int, draws: int = DRAWS) -> Chance:
    """Count trials: draw white residuals, project them as the fit does, and scan them.

    The tail of the smallest p-value is extrapolated with a slowly growing number of trials, as
    by Gross and Vitells for continuous scans.

    Parameters
    ----------
    bank, tones
        The effects' derivatives, and the scans for tones.
    seed, draws
        Of the generator; the number of draws.
    """
    generator = np.random.default_rng(seed)
    rows = bank.rows()
    # All shapes of one effect have the same degrees of freedom.
    freedom = {name: bank.freedom[indices[:1]] for name, indices in rows.items()}
    largest: dict[str, list[FloatArray]] = {name: [] for name in rows}
    loudest: list[FloatArray] = []
    for _ in range(math.ceil(draws / _DRAWS_AT_ONCE)):
        white = generator.standard_normal((_DRAWS_AT_ONCE, len(bank.basis))).T
        white -= bank.basis @ (bank.basis.T @ white)
        scores = bank.scores(white) if rows else np.zeros((0, _DRAWS_AT_ONCE))
        for name, indices in rows.items():
            largest[name].append(scores[indices].max(axis=0))
        tone = np.zeros(_DRAWS_AT_ONCE)
        for scores in tones.scores(white) if tones else []:
            tone = np.maximum(tone, scores.max(axis=0))
        loudest.append(tone)
    found = {
        name: local_p_values(np.concatenate(parts)[None], freedom[name])[0]
        for name, parts in largest.items()
    }
    own = {
        name: Trials(1.0, 0.0) if len(rows[name]) == 1 else _trials(local)
        for name, local in found.items()
    }
    smallest = np.min([np.exp(-0.5 * np.concatenate(loudest)), *found.values()], axis=0)
    return Chance(_trials(smallest), own, draws)


def _trials(smallest: FloatArray) -> Trials:
    """Estimate the number of trials from the smallest p-values of many draws: 1 - F = (1 - p)^m."""
    ordered = np.sort(smallest)
    draws = len(ordered)
    rank = (np.arange(1, draws + 1) - 0.3) / (draws + 0.4)
    trials = np.log1p(-rank) / np.log1p(-np.minimum(ordered, 1.0 - 1e-12))
    part = slice(max(2, draws // 50), int(_TAIL_SHARE * draws))
    middle = float(np.exp(np.mean(np.log(trials[part]))))
    at = float(np.exp(np.mean(np.log(ordered[part]))))
    return Trials(max(middle, 1.0), _TRIALS_EXPONENT, min(at, 0.5))


def printed(p_value: float) -> str:
    """Return a p-value as it is printed: below 1e-12 it would rest on untested tails.

    >>> printed(0.0312), printed(0.0)
    ('p = 0.031', 'p < 1e-12')
    """
    return f"p = {p_value:.2g}" if p_value >= SMALLEST else f"p < {SMALLEST:.0e}"
