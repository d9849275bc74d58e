"""How often chance alone would do as well somewhere in the whole catalogue."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.scores import Bank, local_p_values
from pendpipe.diagnose.spectrum import ToneScans

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
"""They tell the number of trials to a fifth: enough where chance is plainly enough."""
_AT_ONCE: Final = 32
"""Draws that are worked on together: few enough to stay in the processor's cache."""
_TAIL: Final = 0.4
"""Part of the draws from whose smallest p-values the number of trials is read."""
_GROWTH: Final = 0.5
"""A scan over one continuous shape has trials in proportion to the root of the threshold in
chi^2 (Rice's formula), which is -2 ln p but for slower terms."""


@dataclass(frozen=True)
class Trials:
    """The number of independent trials that a scan amounts to.

    P(smallest local p-value < p) = 1 - (1 - p)^m(p), with m = first (ln p/ln usual)^growth
    where p is smaller than usual: scans over continuous shapes have the more trials the rarer
    the event.
    """

    first: float
    growth: float
    usual: float = 0.05
    """The p-value at which the trials were counted."""

    def number_at(self, log_local: float) -> float:
        """How many trials there are where the local p-value is exp(`log_local`)."""
        rarer = max(log_local / math.log(self.usual), 1.0)
        return float(max(self.first * rarer**self.growth, 1.0))

    def global_p_value(self, local: float) -> float:
        """The probability that chance finds a local p-value as small anywhere."""
        if local <= 0.0:
            return 0.0
        trials = self.number_at(math.log(local))
        return float(-math.expm1(trials * math.log1p(-min(local, 1.0 - 1e-15))))


@dataclass(frozen=True)
class Chance:
    """What scans of white residuals find.

    Parameters
    ----------
    everywhere
        Trials of the whole catalogue.
    own
        Trials of each effect by itself, by identifier.
    draws
        From how many these were counted.
    """

    everywhere: Trials
    own: dict[str, Trials]
    draws: int = DRAWS


def draw_chance(bank: Bank, tones: ToneScans | None, seed: int, draws: int = DRAWS) -> Chance:
    """Draw white residuals, project them as the fit does, and see what the scans make of them.

    The tail of the smallest p-value is extrapolated with a slowly growing number of trials,
    as Gross and Vitells do for continuous scans.
    """
    generator = np.random.default_rng(seed)
    rows = bank.rows()
    # All shapes of one effect have the same degrees of freedom.
    freedom = {name: bank.freedom[indices[:1]] for name, indices in rows.items()}
    largest: dict[str, list[FloatArray]] = {name: [] for name in rows}
    loudest: list[FloatArray] = []
    for _ in range(math.ceil(draws / _AT_ONCE)):
        white = generator.standard_normal((_AT_ONCE, len(bank.basis))).T
        white -= bank.basis @ (bank.basis.T @ white)
        scores = bank.scores(white) if rows else np.zeros((0, _AT_ONCE))
        for name, indices in rows.items():
            largest[name].append(scores[indices].max(axis=0))
        tone = np.zeros(_AT_ONCE)
        for scores in tones.scores(white) if tones else []:
            tone = np.maximum(tone, scores.max(axis=0))
        loudest.append(tone)
    found = {
        name: local_p_values(np.concatenate(parts)[None], freedom[name])[0]
        for name, parts in largest.items()
    }
    own = {
        name: Trials(1.0, 0.0) if len(rows[name]) == 1 else _trials(local, _GROWTH)
        for name, local in found.items()
    }
    smallest = np.min([np.exp(-0.5 * np.concatenate(loudest)), *found.values()], axis=0)
    return Chance(_trials(smallest, _GROWTH), own, draws)


def _trials(smallest: FloatArray, growth: float) -> Trials:
    """Read the number of trials off the smallest p-values of many draws: 1 - F = (1 - p)^m."""
    ordered = np.sort(smallest)
    draws = len(ordered)
    rank = (np.arange(1, draws + 1) - 0.3) / (draws + 0.4)
    trials = np.log1p(-rank) / np.log1p(-np.minimum(ordered, 1.0 - 1e-12))
    part = slice(max(2, draws // 50), int(_TAIL * draws))
    middle = float(np.exp(np.mean(np.log(trials[part]))))
    at = float(np.exp(np.mean(np.log(ordered[part]))))
    return Trials(max(middle, 1.0), growth, min(at, 0.5))


def printed(p_value: float) -> str:
    """Return a p-value as it is printed: below 1e-12 it would rest on untested tails.

    >>> printed(0.0312), printed(0.0)
    ('p = 0.031', 'p < 1e-12')
    """
    return f"p = {p_value:.2g}" if p_value >= SMALLEST else f"p < {SMALLEST:.0e}"
