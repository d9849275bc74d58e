"""Cross-validation: how well a model predicts cycles that it was not fitted to."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import CLEAN, Fit, refine
from pendpipe.dynamics.any_law import NoMotionError

_BLOCK_CYCLES: Final = 10
"""Cycles that are predicted at once: longer than noise remembers, shorter than a drift."""
_FOLDS: Final = 2
"""Fits for all predictions: every other block is left out of one of two."""
_PRECISE: Final = 1e-4
"""Relative error to which missing readings are filled in."""
_UNKNOWN: Final = 10.0
"""Loss of a block over the gain of all: of a size that is wrong by three times itself there."""
_MOST_STEPS: Final = 400
"""Of conjugate gradients at most, whatever they have reached."""


@dataclass(frozen=True)
class HeldOut:
    """Log predictive densities, summed over all blocks.

    Parameters
    ----------
    before, after
        Of the baseline and of the extended model.
    gain_sd
        Standard deviation of after - before, from the scatter of the blocks.
    rms_before, rms_after
        Of the errors of prediction, in the unit of the readings.
    blocks, better
        How many blocks were left out, and how many the extended model predicts better.
    worst
        The gain of the block that it predicts worst, or 0.
    """

    before: float
    after: float
    gain_sd: float
    rms_before: float = field(metadata={"json": "rms_before_rad"})
    rms_after: float = field(metadata={"json": "rms_after_rad"})
    blocks: int
    better: int = field(metadata={"json": "blocks_better"})
    worst: float = field(default=0.0, metadata={"json": "worst_block"})

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
    before, error_before = _predicted(baseline, data, noise, held_before, block)
    after, error_after = _predicted(improved, data, noise, held_after, block)
    count = int(block.max()) + 1
    gains = np.bincount(block, weights=after - before, minlength=count)
    sd = math.sqrt(count) * float(np.std(gains, ddof=1)) if count > 1 else math.nan
    used = data.weight > 0.0
    filled = np.bincount(block, weights=used, minlength=count) > 0.0
    return HeldOut(
        float(before.sum()),
        float(after.sum()),
        sd,
        float(np.sqrt(np.mean(error_before[used] ** 2))),
        float(np.sqrt(np.mean(error_after[used] ** 2))),
        int(np.count_nonzero(filled)),
        int(np.count_nonzero(gains > 0.0)),
        min(float(gains.min()), 0.0),
    )


def predicted_worse(
    before: Fit,
    after: Fit,
    data: Data,
    noise: Noise,
    held_before: Sequence[int],
    held_after: Sequence[int],
    *,
    drawn: bool,
) -> float:
    """Return twice the log density by which a model predicts cycles that are left out worse.

    What it has more than the other then describes the noise of the readings and no law. Its size
    may be unknown without one block, as a transient's without the first, which does not count if
    the others speak for it and noise is left. A curve (`drawn`) may diverge where its knots have no
    readings: that is a loss of one standard deviation of the sum, and two are allowed.
    """
    found = held_out(before, after, data, noise, held_before, held_after)
    unknown = -2.0 * found.worst < _UNKNOWN * (before.chi2 - after.chi2)
    unknown &= found.gain > found.worst and after.chi2 <= CLEAN * data.used
    allowed = -found.worst if unknown else 0.0
    if drawn and math.isfinite(found.gain_sd):
        allowed = 2.0 * found.gain_sd
    return 2.0 * max(-found.gain - allowed, 0.0)


def _blocks(fit: Fit) -> IntArray:
    """Return the number of each reading's block: ten cycles, or fewer in a short record."""
    turns = (fit.at.sampled.phase - fit.at.sampled.phase[0]) / (2.0 * math.pi)
    size = min(float(_BLOCK_CYCLES), max(float(turns[-1]) / 8.0, 0.5))
    return np.asarray(np.maximum(np.floor(turns / size), 0.0).astype(np.int64))


def _predicted(
    fit: Fit, data: Data, noise: Noise, held: Sequence[int], block: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return log density and error of each reading, predicted from the other half of the blocks."""
    used = data.weight > 0.0
    unmasked = replace(noise, weight=np.ones(len(data)))
    usual = -0.5 * float(np.mean(np.log(noise.variance))) - 0.5 * math.log(2.0 * math.pi)
    found = np.where(used, usual + np.log(unmasked.scale), 0.0)
    error, largest = np.zeros(len(data)), float(np.ptp(data.values))
    for fold in range(_FOLDS):
        out = block % _FOLDS == fold
        known = data.masked(out | ~used)
        part = replace(noise, weight=known.weight)
        try:
            predicted = refine(fit.model, known, part, fit.value, held=held, rounds=6).at.reading
        except (NoMotionError, np.linalg.LinAlgError):
            predicted = fit.at.reading
        # A curve may diverge where blocks are missing: limit the error to that of no prediction.
        off = np.clip(data.residual(predicted), -largest, largest)
        error[out] = off[out]
        found -= np.where(out, 0.5 * _squared_error(off, unmasked, out, used), 0.0)
    return np.where(used, found, 0.0), error


def _squared_error(
    residual: FloatArray, noise: Noise, out: BoolArray, used: BoolArray
) -> FloatArray:
    """Return each reading's share of the squared whitened error of prediction, shape (n,).

    Coloured noise is predicted too, from the readings that are known: its mean is what makes the
    sum of squares of the whole the smallest.
    """
    if not noise.coloured:
        return noise.whiten(residual) ** 2
    complete = residual if used.all() else completed(residual, noise, ~used)
    error = complete - completed(complete, noise, out | ~used)
    return np.asarray(error * noise.adjoint(noise.whiten(error)))


def completed(residual: FloatArray, noise: Noise, missing: BoolArray) -> FloatArray:
    """Replace missing numbers by their mean, given the others (by conjugate gradients)."""
    from scipy.sparse.linalg import LinearOperator, cg

    def weighted(column: FloatArray) -> FloatArray:
        return np.where(missing, noise.adjoint(noise.whiten(column)), 0.0)

    known, shape = np.where(missing, 0.0, residual), (len(residual), len(residual))
    operator = LinearOperator(shape, matvec=weighted, dtype=np.float64)
    filled, _ = cg(operator, -weighted(known), rtol=_PRECISE, maxiter=_MOST_STEPS)
    return np.asarray(known + filled)
