"""Cross-validation: how well a model predicts cycles that it was not fitted to."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit, refine
from pendpipe.dynamics.any_law import NoMotionError

_BLOCK_CYCLES: Final = 10
_FOLDS: Final = 2


@dataclass(frozen=True)
class HeldOut:
    """Log predictive densities, summed over all blocks.

    Parameters
    ----------
    before, after
        Of the baseline and of the extended model.
    gain_sd
        Standard deviation of after - before, from the scatter of the blocks.
    """

    before: float
    after: float
    gain_sd: float

    @property
    def gain(self) -> float:
        """Gain in log density of the extended model."""
        return self.after - self.before


def held_out(
    baseline: Fit,
    improved: Fit,
    data: Data,
    noise: Noise,
    held_before: Sequence[int],
    held_after: Sequence[int],
) -> HeldOut:
    """Predict every other block of about ten cycles from the rest, with both models."""
    block = _blocks(improved)
    before = _densities(baseline, data, noise, held_before, block)
    after = _densities(improved, data, noise, held_after, block)
    count = int(block.max()) + 1
    gains = np.bincount(block, weights=after - before, minlength=count)
    sd = math.sqrt(count) * float(np.std(gains, ddof=1)) if count > 1 else math.nan
    return HeldOut(float(before.sum()), float(after.sum()), sd)


def _blocks(fit: Fit) -> IntArray:
    """Return the number of each reading's block: ten cycles, or fewer in a short record."""
    turns = (fit.at.sampled.phase - fit.at.sampled.phase[0]) / (2.0 * math.pi)
    size = min(float(_BLOCK_CYCLES), max(float(turns[-1]) / 8.0, 0.5))
    return np.asarray(np.maximum(np.floor(turns / size), 0.0).astype(np.int64))


def _densities(
    fit: Fit, data: Data, noise: Noise, held: Sequence[int], block: IntArray
) -> FloatArray:
    """Return the log density of each reading, given the other half of the blocks."""
    variance = np.full(len(data), noise.rms**2) if noise.uniform else noise.variance
    found = np.zeros(len(data))
    for fold in range(_FOLDS):
        out = block % _FOLDS == fold
        known = data.masked(out | (data.weight == 0.0))
        part = replace(noise, weight=known.weight)
        try:
            value = refine(fit.model, known, part, fit.value, held=held, rounds=6).value
            predicted = fit.model.reading(value)
        except NoMotionError:
            predicted = fit.at.reading
        wanted = out & (data.weight > 0.0)
        # A curve may diverge where blocks are missing: limit the error to that of no prediction.
        largest = 2.0 * fit.at.span.first_amplitude
        off = np.clip(data.residual(predicted)[wanted], -largest, largest)
        found[wanted] = -0.5 * (
            off**2 / variance[wanted] + np.log(2.0 * math.pi * variance[wanted])
        )
    return found
