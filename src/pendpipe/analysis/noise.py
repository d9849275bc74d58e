"""The noise of a recording, from what no slow motion can touch."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.dynamics.kernel import kernel

_ORDER: Final = 4
"""Differences that a smooth motion does not survive: (2 sin(pi/20))^4, 1 %, is left of a swing of
twenty readings."""
_GAIN: Final = float(math.comb(2 * _ORDER, _ORDER))
"""Sum of the squared weights of the fourth difference: what white noise is multiplied by."""
_BLOCK: Final = 64
"""Readings of one estimate: fast motion, or a glitch, spoils few of them."""
_BLOCKS: Final = 256
"""Estimates whose median counts: it is known to 1 %."""

TOLD: Final = 8
"""Degrees of freedom from which a scatter is known to a quarter, 1/sqrt(16), and is asked."""


def quantisation_rms(step: float | None) -> float:
    """Rms of the rounding to a step: ``step/sqrt(12)``; zero where no step is known."""
    return 0.0 if step is None else step / math.sqrt(12.0)


def scatter(square: float, freedom: float, step: float | None = None, least: float = 0.0) -> float:
    """Rms of one reading about what was fitted: ``sqrt(square/freedom)``.

    It is never below step/sqrt(12): a fit may follow the rounding of few readings.

    Parameters
    ----------
    square
        Sum of squares of what is left.
    freedom
        Readings less the numbers that were fitted to them; one at least is taken.
    step
        The step of the readings, where known.
    least
        Noise that can't be less for another reason.

    Examples
    --------
    >>> scatter(8.0, 2.0), scatter(0.0, 5.0, step=12.0**0.5)
    (2.0, 1.0)
    """
    return max(math.sqrt(max(square, 0.0) / max(freedom, 1.0)), quantisation_rms(step), least)


def before_rounding(rms: float, step: float) -> float:
    """The noise of readings before they were rounded: of their `scatter` step^2/12 is the rounding.

    Of a motion that passes many steps the rounding errors are independent of the noise, so that
    variances add (Widrow). No less than step/25 is told by two thousand readings: the variance of a
    rounding error, from n of them, is right to step^2/sqrt(180 n).

    Examples
    --------
    >>> round(before_rounding(0.3, 1.0), 6)
    0.08165
    """
    return max(math.sqrt(max(rms**2 - step**2 / 12.0, 0.0)), 0.04 * step)


def noise_rms(values: FloatArray, step: float | None = None, *, quieter: float = 0.5) -> float:
    """The `scatter` of evenly spaced readings about cubics through their neighbours.

    Fourth differences are what such cubics leave: a motion with n samples in a half cycle leaks
    into them by (pi/n)^4 of its amplitude, white noise keeps its size. The median over blocks
    leaves glitches out; the quietest tenth also what shakes the sensor for most of the time. Where
    the readings rest on one step the differences vanish, so the rounding error bounds the
    estimate from below.

    Parameters
    ----------
    values
        Readings, shape (n,), or what a fitted model leaves of them.
    step
        The step between neighbouring readings, where known.
    quieter
        The share of blocks that are quieter than the estimate.

    Returns
    -------
    float
        Standard deviation of one reading, in the unit of `values`.
    """
    if len(values) < 2 * _ORDER:
        return quantisation_rms(step)
    short = len(values) // (4 if quieter < 0.5 else 1)
    length = _BLOCK + _ORDER if len(values) >= 4 * _BLOCK else max(short, 4 * _ORDER)
    length = min(length, len(values))
    number = min(_BLOCKS, len(values) // length)
    starts = (len(values) - length) * np.arange(number) // max(number - 1, 1)
    squares = np.sort(_fourth_differences(values, starts, length)).tolist()
    place, share = divmod(quieter * (number - 1), 1.0)
    low, high = squares[int(place)], squares[min(int(place) + 1, number - 1)]
    return scatter(low + share * (high - low), _GAIN, step)


def white_rms(residual: FloatArray) -> float:
    """Rms of the white part of a residual, from all its fourth differences.

    More precise than `noise_rms` (no median), for residuals that hold no glitches.
    """
    if len(residual) < 2 * _ORDER:
        return scatter(float(residual @ residual), len(residual))
    square = _fourth_differences(residual, np.zeros(1, dtype=np.int64), len(residual))
    return scatter(float(square[0]), _GAIN)


def _fourth_differences(values: FloatArray, starts: IntArray, length: int) -> FloatArray:
    """Mean square of the differences, four times, in blocks of a length; shape (blocks,)."""
    squares = np.empty(len(starts))
    _mean_squares(np.ascontiguousarray(values, dtype=np.float64), starts, length, squares)
    return squares


@kernel(any_order=True)
def _mean_squares(values: FloatArray, starts: IntArray, length: int, squares: FloatArray) -> None:
    """Fill in what `_fourth_differences` returns."""
    for k in range(starts.size):
        total, block = 0.0, values[starts[k] : starts[k] + length]
        for i in range(length - 4):
            outer, inner = block[i] + block[i + 4], block[i + 1] + block[i + 3]
            fourth = outer - 4.0 * inner + 6.0 * block[i + 2]
            total += fourth * fourth
        squares[k] = total / (length - 4)


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
