"""Odd harmonics of large swings: the shape of a half cycle that is no cosine.

A pendulum of 1 rad carries 0.5 % of third harmonic, one of 2.6 rad 7 %. Fitted half
cycle by half cycle each harmonic would cost precision; so where their share is a smooth
function of the amplitude, that function is found first and put into the shape.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from pendpipe.analysis.noise import white_rms
from pendpipe.analysis.turning_points import kernels
from pendpipe.analysis.turning_points.measure import Measured, Places, edges, measure
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray

_CLEARLY: Final = 0.02
_SIGNIFICANT: Final = 30.0


def odd_harmonics(
    samples: Samples, places: Places, level: float, shape: FloatArray, measured: Measured
) -> tuple[FloatArray, Measured]:
    """Add odd harmonics to the shape where the readings ask for them.

    Returns
    -------
    shape, measured
        As given, where a cosine with its losses is enough.
    """
    noise = _white(samples, places)
    before = _misfit(measured)
    if before < (1.0 + _CLEARLY) * noise**2:
        return shape, measured
    for free in range(1, kernels.HARMONICS + 1):
        tried = measure(
            samples, places, level, shape, free=free, amplitude=measured.amplitude
        )
        after = _misfit(tried)
        gain = (before - after) * float(np.nansum(measured.count)) / max(after, noise**2)
        if gain < _SIGNIFICANT + 4.0 * np.count_nonzero(np.isfinite(measured.amplitude)) ** 0.5:
            break
        shape = shape.copy()
        shape[:, 4 : 4 + free] = _shares(places, tried, free)
        measured = measure(samples, places, level, shape, amplitude=measured.amplitude)
        before = _misfit(measured)
        if before < (1.0 + _CLEARLY) * noise**2:
            break
    return shape, measured


def _white(samples: Samples, places: Places) -> float:
    """White noise of the readings of the last quarter of the half cycles, by differences."""
    where = edges(samples, places)
    start = where[3 * len(where) // 4, 0]
    part = samples.values[start : where[-1, 1]][: 1 << 20]
    return max(white_rms(part) if len(part) > 16 else 0.0, samples.noise_rms)


def _misfit(measured: Measured) -> float:
    """Mean square of the readings about the fitted half cycles, each at its own level."""
    known = np.isfinite(measured.amplitude) & (measured.count > 8)
    shift = measured.score**2 / np.maximum(measured.information, 1e-300)
    square = (measured.residual_square - shift)[known]
    freedom = (measured.count - measured.harmonics.shape[1] - 3)[known]
    return float(np.sum(square) / max(float(np.sum(freedom)), 1.0))


def _shares(places: Places, measured: Measured, free: int) -> FloatArray:
    """Share of each harmonic as a polynomial in the squared amplitude, fitted to all."""
    amplitude = measured.amplitude
    known = np.isfinite(amplitude) & (amplitude > 0.0)
    square = (np.nan_to_num(amplitude) / float(np.nanmax(amplitude))) ** 2
    shares = np.zeros((len(places.number), free))
    terms = 1 if known.sum() < 12 else 3
    columns = np.stack([square**power for power in range(1, terms + 1)], axis=1)
    weight = np.where(known, np.nan_to_num(amplitude) ** 2, 0.0)
    for m in range(free):
        share = np.where(known, measured.harmonics[:, m] / np.where(known, amplitude, 1.0), 0.0)
        # Weighted by the amplitude: a harmonic is as well known as the readings are.
        root = np.sqrt(weight)
        solved, *_ = np.linalg.lstsq(columns * root[:, None], share * root, rcond=1e-9)
        shares[:, m] = columns @ solved
    return shares
