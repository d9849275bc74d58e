"""The step and the noise of a recording, from what no slow motion can touch."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray

_ORDER: Final = 4
_BLOCK: Final = 64
_BLOCKS: Final = 256
_LATTICE: Final = 2048


def quantisation_rms(step: float | None) -> float:
    """Rms of the rounding to a step: ``step/sqrt(12)``; zero where no step is known."""
    return 0.0 if step is None else step / math.sqrt(12.0)


def find_step(values: FloatArray) -> float | None:
    """Find the step between the readings of a digital instrument.

    The readings of a converter, an encoder or a file with few digits lie on a lattice:
    every difference is a whole multiple of the smallest.

    Parameters
    ----------
    values
        Finite readings, shape (n,); a long recording is judged by its beginning, where
        the motion crosses the most steps.

    Returns
    -------
    float or None
        The step in the unit of `values`; None when the readings lie on no lattice.
    """
    levels = np.unique(values[:_LATTICE])
    if levels.size < 3:
        return None
    span = levels[-1] - levels[0]
    gaps = np.diff(levels)
    # Readings that differ by a rounding error of the file are one level.
    gaps = gaps[gaps > 1e-7 * span]
    if gaps.size < 2:
        return None
    smallest = float(gaps.min())
    step = float(np.median(gaps[gaps < 1.5 * smallest]))
    ratio = gaps / step
    near = ratio < 50.0
    if np.max(np.abs(ratio[near] - np.round(ratio[near]))) > 0.1:
        return None
    return step


def noise_rms(values: FloatArray, step: float | None = None) -> float:
    """Estimate the noise of evenly spaced readings, never below step/sqrt(12).

    Fourth differences: a motion with n samples in a half cycle leaks into them by
    (pi/n)^4 of its amplitude, white noise keeps its size. The median over blocks leaves
    glitches out. Where the readings rest on one step the differences vanish, so the
    rounding error bounds the estimate from below.

    Parameters
    ----------
    values
        Readings, shape (n,), or what a fitted model leaves of them.
    step
        The step between neighbouring readings, where known.

    Returns
    -------
    float
        Standard deviation of one reading, in the unit of `values`.
    """
    floor = quantisation_rms(step)
    if len(values) < 2 * _ORDER:
        return floor
    if len(values) < 4 * _BLOCK:
        return max(floor, _block_rms(values[None, :]))
    length = _BLOCK + _ORDER
    number = min(_BLOCKS, len(values) // length)
    starts = np.linspace(0, len(values) - length, number).astype(np.int64)
    blocks = values[starts[:, None] + np.arange(length)]
    return max(floor, _block_rms(blocks))


def white_rms(residual: FloatArray) -> float:
    """Rms of the white part of a residual, from all its fourth differences.

    More precise than `noise_rms` (no median), for residuals that hold no glitches.
    """
    if len(residual) < 2 * _ORDER:
        return float(np.sqrt(np.mean(residual**2)))
    difference = _fourth(residual)
    return math.sqrt(float(difference @ difference) / (len(difference) * _gain()))


def _fourth(values: FloatArray) -> FloatArray:
    """Fourth differences along the last axis."""
    return (
        values[..., :-4]
        - 4.0 * values[..., 1:-3]
        + 6.0 * values[..., 2:-2]
        - 4.0 * values[..., 3:-1]
        + values[..., 4:]
    )


def _gain() -> float:
    """Sum of the squared binomial weights: what white noise is multiplied by."""
    return float(math.comb(2 * _ORDER, _ORDER))


def _block_rms(blocks: FloatArray) -> float:
    squares = np.mean(_fourth(blocks) ** 2, axis=-1)
    return math.sqrt(float(np.median(squares)) / _gain())


def undithered_rms(amplitude: FloatArray, step: float | None, noise: float) -> FloatArray:
    """Error of a sine's amplitude by rounding that too little noise dithers.

    The fundamental of a rounded sine of amplitude A is A plus
    ``(2 step/pi) J1(2 pi A/step)`` and higher terms, which noise of rms s takes down by
    exp(-2 pi^2 s^2/step^2): 45 % are left at s = step/5, 0.7 % at step/2. Its rms over A is
    given; however many readings there are, it stays.

    Parameters
    ----------
    amplitude
        A, shape (k,).
    step
        The step of the readings, where known.
    noise
        Rms of one reading, the rounding's step/sqrt(12) included.
    """
    if step is None:
        return np.zeros_like(amplitude)
    dither = max(noise**2 - step**2 / 12.0, 0.0)
    left = math.exp(-2.0 * math.pi**2 * dither / step**2)
    size = np.maximum(np.abs(amplitude), 0.5 * step)
    return np.asarray(2.0 * step / math.pi * left * np.sqrt(step / (2.0 * math.pi**2 * size)))
