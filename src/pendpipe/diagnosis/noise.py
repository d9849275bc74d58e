"""The noise of the readings and its colour, from frequencies free of misfits of the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.colour import fit_colour
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.numerics import cosines, from_cosines

_HARMONICS: Final = 7
_HARMONIC_HALF_WIDTH: Final = 0.08
"""Half width of the band about each harmonic that a misfit may fill, over the frequency."""
_FIRST_COSINE: Final = 1
"""The lowest cosine that is noise: the offset itself is fitted."""


@dataclass(frozen=True)
class Noise:
    """The variance of each cosine (DCT-II, orthonormal) of the readings.

    Parameters
    ----------
    variance
        Shape (n,): S_k; for unevenly spaced readings, of each reading itself.
    uniform
        Whether `variance` is over cosines (evenly spaced readings) or over readings.
    white_rms
        Standard deviation of the white part of one reading.
    red, slope
        Variance of the red part at 0.05 Hz over the white part's, and its exponent:
        S = white (1 + red (0.05 Hz/f)^slope).
    memory
        Correlation of neighbouring readings by a first-order low-pass (0 for white noise).
    weight
        1 where a reading counts; shape (n,).
    """

    variance: FloatArray
    uniform: bool
    white_rms: float
    weight: FloatArray
    red: float = 0.0
    slope: float = 0.0
    memory: float = 0.0

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Turn readings (or columns of them) into numbers of unit variance, shape kept."""
        scale = 1.0 / np.sqrt(self.variance)
        if not self.coloured:
            return np.asarray((columns.T * (self.weight * scale)).T)
        # The transform is much faster on contiguous memory.
        rows = np.multiply(columns.T, self.weight, order="C")
        return np.asarray((cosines(rows) * scale).T)

    def adjoint(self, columns: FloatArray) -> FloatArray:
        """Apply the transpose of `whiten`: from white numbers back to weights of readings."""
        scale = 1.0 / np.sqrt(self.variance)
        if not self.coloured:
            return np.asarray((columns.T * (self.weight * scale)).T)
        rows = np.multiply(columns.T, scale, order="C")
        return np.asarray((from_cosines(rows) * self.weight).T)

    @property
    def coloured(self) -> bool:
        """Whether cosines differ in variance; else the readings are white too."""
        return self.uniform and bool(self.red or self.memory)

    @property
    def rms(self) -> float:
        """Standard deviation of one reading, its colour included."""
        return math.sqrt(float(np.mean(self.variance)))


def white_noise(data: Data, rms: float, slope: FloatArray | None = None) -> Noise:
    """Return white noise, the same for all readings (or proportional to speed, for counts).

    Parameters
    ----------
    data
        The readings.
    rms
        Standard deviation of one.
    slope
        If the error is in the time: the speed at each reading.
    """
    variance = np.full(len(data), rms * rms)
    if slope is not None:
        usual = math.sqrt(float(np.mean(slope**2)))
        variance = rms * rms * (0.25 + (slope / usual) ** 2)
    return Noise(variance, False if slope is not None else data.uniform, rms, data.weight)


def estimate_noise(
    data: Data, residual: FloatArray, frequency_hz: float, floor: float, *, red: bool = True
) -> Noise:
    """Estimate the noise from a residual.

    Bands about the harmonics of the motion and the slowest cosine are left out, since misfits lie
    there. The rest is described by white noise, with a red part or a first-order memory if the
    (Whittle) likelihood is clearly better with it.

    Parameters
    ----------
    data, residual
        The readings and their residual, shape (n,).
    frequency_hz
        Of the motion.
    floor
        The smallest rms that is plausible.
    red
        Whether the noise may be red.
    """
    if not data.uniform:
        rms = max(_robust_rms(residual[data.weight > 0.0]), floor)
        return white_noise(data, rms)
    count = len(data)
    filled = count / max(data.used, 1)
    power = cosines(residual * data.weight) ** 2 * filled
    frequency = np.arange(count) / (2.0 * count * data.interval_s)
    noise_only = _noise_only(frequency, frequency_hz)
    if np.count_nonzero(noise_only) < 40:
        noise_only = np.arange(count) >= _FIRST_COSINE
    colour = fit_colour(power[noise_only], frequency[noise_only], data.interval_s, red=red)
    variance = colour.spectrum(frequency, data.interval_s)
    white = math.sqrt(colour.white)
    low = floor * floor / variance.mean()
    if low > 1.0:
        variance, white = variance * low, white * math.sqrt(low)
    return Noise(variance, True, white, data.weight, colour.red, colour.slope, colour.memory)


def _robust_rms(values: FloatArray) -> float:
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _noise_only(frequency: FloatArray, motion_hz: float) -> BoolArray:
    """Return which cosines contain noise alone."""
    noise_only = np.arange(len(frequency)) >= _FIRST_COSINE
    for harmonic in range(1, _HARMONICS):
        noise_only &= np.abs(frequency - harmonic * motion_hz) > _HARMONIC_HALF_WIDTH * motion_hz
    return np.asarray(noise_only)
