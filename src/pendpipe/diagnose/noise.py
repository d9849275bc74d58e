"""The noise of the readings, with its colour, from where no misfit of the motion reaches."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnose.data import Data

_HARMONICS: Final = 7
_WIDTH: Final = 0.08
"""Of the frequency: the band about each harmonic that a misfit may fill."""
_FIRST: Final = 1
"""The lowest cosine that may be noise: the level itself is fitted."""
_WORTH: Final = (2.5, 12.0)
"""Gain in -2 ln L for which the spectrum is given a red part, and a memory. A red part that
is missed accuses drifts and slow tones of the noise; a needless one costs little."""
_STEEPEST: Final = 1.6
_OUTLIER: Final = 12.0
"""Power over the spectrum beyond which a cosine holds no noise but a line."""


@dataclass(frozen=True)
class Noise:
    """Variance of each cosine (DCT-II, orthonormal) of the readings.

    Parameters
    ----------
    variance
        Shape (n,): S_k; where readings are uneven, of each reading itself.
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
        tall = columns.ndim == 2
        weight = self.weight[:, None] if tall else self.weight
        if not self.uniform:
            return np.asarray(columns * weight * (scale[:, None] if tall else scale))
        from scipy.fft import dct

        spectrum = dct(columns * weight, axis=0, norm="ortho")
        return np.asarray(spectrum * (scale[:, None] if tall else scale))

    def adjoint(self, columns: FloatArray) -> FloatArray:
        """The transpose of `whiten`: from white numbers back to weights of readings."""
        scale = 1.0 / np.sqrt(self.variance)
        tall = columns.ndim == 2
        weight = self.weight[:, None] if tall else self.weight
        scaled = columns * (scale[:, None] if tall else scale)
        if not self.uniform:
            return np.asarray(scaled * weight)
        from scipy.fft import idct

        return np.asarray(idct(scaled, axis=0, norm="ortho") * weight)

    @property
    def rms(self) -> float:
        """Standard deviation of one reading, its colour included."""
        return math.sqrt(float(np.mean(self.variance)))


def white_noise(data: Data, rms: float, slope: FloatArray | None = None) -> Noise:
    """Noise that is the same for all readings (or follows the speed, for an encoder's counts).

    Parameters
    ----------
    data
        The readings.
    rms
        Standard deviation of one.
    slope
        Where the error is in the time: the readings' speed, to weigh them.
    """
    variance = np.full(len(data), rms * rms)
    if slope is not None:
        usual = math.sqrt(float(np.mean(slope**2)))
        variance = rms * rms * (0.25 + (slope / usual) ** 2)
    return Noise(variance, False if slope is not None else data.uniform, rms, data.weight)


def estimate_noise(
    data: Data, residual: FloatArray, frequency_hz: float, floor: float, *, red: bool = True
) -> Noise:
    """Estimate the noise from what a model leaves.

    Bands about the harmonics of the motion and the slowest cosines are left out, since a
    misfit lies there; the rest is described by white noise, with a red part and a
    first-order memory where the likelihood (Whittle's) is clearly better for them.

    Parameters
    ----------
    data, residual
        The readings and what is left of them, shape (n,).
    frequency_hz
        Of the motion.
    floor
        The rms below which no reading is believed.
    red
        Whether the noise may be red.
    """
    if not data.uniform:
        rms = max(_robust_rms(residual[data.weight > 0.0]), floor)
        return white_noise(data, rms)
    from scipy.fft import dct

    count = len(data)
    filled = count / max(data.used, 1)
    power = dct(residual * data.weight, norm="ortho") ** 2 * filled
    frequency = np.arange(count) / (2.0 * count * data.interval_s)
    quiet = _quiet(frequency, frequency_hz)
    if np.count_nonzero(quiet) < 40:
        quiet = np.arange(count) >= _FIRST
    shape = _best_shape(power[quiet], frequency[quiet], data.interval_s, red=red)
    variance = _spectrum(shape, frequency, data.interval_s)
    white = math.exp(0.5 * shape[0])
    low = floor * floor / variance.mean()
    if low > 1.0:
        variance, white = variance * low, white * math.sqrt(low)
    share = math.exp(shape[1]) if shape[1] > -50.0 else 0.0
    return Noise(variance, True, white, data.weight, share, float(shape[2]), float(shape[3]))


def _robust_rms(values: FloatArray) -> float:
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))


def _quiet(frequency: FloatArray, motion_hz: float) -> BoolArray:
    """Cosines in which there is noise alone."""
    quiet = np.arange(len(frequency)) >= _FIRST
    for harmonic in range(1, _HARMONICS):
        quiet &= np.abs(frequency - harmonic * motion_hz) > _WIDTH * motion_hz
    return np.asarray(quiet)


def _spectrum(shape: FloatArray, frequency: FloatArray, interval: float) -> FloatArray:
    """Variance of each cosine from ln of the white level, red part, slope, and memory."""
    white, red, slope, memory = shape
    safe = np.maximum(frequency, frequency[frequency > 0.0].min() if frequency.any() else 1.0)
    coloured = 1.0 + np.exp(red) * (0.05 / safe) ** slope
    if memory:
        turn = 2.0 * math.pi * frequency * interval
        coloured = coloured / (1.0 - 2.0 * memory * np.cos(turn) + memory * memory)
    return np.asarray(np.exp(white) * coloured)


def _best_shape(
    power: FloatArray, frequency: FloatArray, interval: float, *, red: bool
) -> FloatArray:
    """Maximise Whittle's likelihood, from white to coloured."""
    from scipy.optimize import minimize

    # Glitches and tones are no noise: what is far above its neighbours is clipped.
    level = max(float(np.median(power)) / 0.4549, 1e-300)

    def cost(shape: FloatArray) -> float:
        spectrum = _spectrum(shape, frequency, interval)
        ratio = power / spectrum
        return float(np.sum(np.log(spectrum) + np.minimum(ratio, _OUTLIER)))

    white = np.array([math.log(level), -60.0, 1.0, 0.0])
    white[0] = math.log(_clipped_mean(power, level))
    best, least = white, cost(white)
    # Far below the powers all of them are clipped, and the cost would fall without end.
    bounds = [(white[0] - 8.0, white[0] + 4.0), (-12.0, 8.0), (0.3, _STEEPEST), (-0.95, 0.95)]
    for start, frozen, worth in (
        (np.array([white[0], 0.0, 1.0, 0.0]), (3,), _WORTH[0]),
        (np.array([white[0], -60.0, 1.0, 0.3]), (1, 2), _WORTH[1]),
    ):
        limits = [(start[k], start[k]) if k in frozen else bounds[k] for k in range(4)]
        found = minimize(cost, start, method="L-BFGS-B", bounds=limits)
        if found.fun < least - worth and (red or 1 in frozen):
            best, least = found.x, float(found.fun)
    return np.asarray(best)


def _clipped_mean(power: FloatArray, level: float) -> float:
    """Mean of chi^2_1 numbers, the far tail left out and made up for."""
    for _ in range(3):
        inside = power < 12.0 * level
        level = float(np.mean(power[inside])) / 0.9958
    return level
