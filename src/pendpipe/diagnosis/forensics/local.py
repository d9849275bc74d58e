"""Local residuals: the readings minus everything that varies smoothly from cycle to cycle.

The tests of the measurement run before the physics is complete. They use what no motion of the
pendulum can produce, however wrong its model: in windows of a few cycles an offset and both
quadratures of the fundamental with their slopes are fitted and subtracted (and the second and
third harmonic where these are significant).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.fft import dct, idct

from pendpipe.analysis.demodulation import cycle_starts, harmonic_columns, normal_equations
from pendpipe.analysis.noise import scatter
from pendpipe.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from pendpipe.diagnosis.noise import Noise

_WINDOW_CYCLES: Final = 2
"""Cycles of a window: in one the level is mixed with the harmonics."""
_WINDOW_READINGS: Final = 40
"""Readings of a window: its nine numbers at most take a quarter of them."""
_OUTLIER_SD: Final = 5.0
"""Standard deviations beyond which a reading is left out of its window's fit."""
_CHANCE_CORRELATION: Final = 0.1
"""Correlation of neighbouring errors that noise may have by chance."""
_HARMONICS_SD: Final = 5.0
"""Standard deviations at which the harmonics are significant."""


@dataclass(frozen=True)
class Local:
    """Readings minus their smooth part.

    Parameters
    ----------
    left
        The difference, shape (n,); 0 where a reading is masked.
    rms
        Standard deviation of one reading's noise, in the unit of `left`.
    leverage
        ``left`` has the variance rms^2 (1 + leverage); negative where the reading took part in
        the fit. Shape (n,).
    used
        Which readings count; shape (n,).
    """

    left: FloatArray
    rms: float
    leverage: FloatArray
    used: BoolArray

    @property
    def spread(self) -> FloatArray:
        """Standard deviation of `left`, shape (n,)."""
        return np.asarray(self.rms * np.sqrt(np.maximum(1.0 + self.leverage, 0.05)))

    def smooth(self, memory: float = 0.0) -> bool:
        """Return whether it is smoother than the noise, and so contains a misfit.

        `memory` is the correlation of neighbouring errors that the noise is known to have.
        """
        fitted = self.used & (self.leverage < 0.0)
        scaled = np.where(fitted, np.clip(self.scaled, -4.0, 4.0), 0.0)
        size = float(scaled @ scaled)
        correlation = float(scaled[1:] @ scaled[:-1]) / max(size, 1e-300)
        return correlation > 1.2 * max(memory, 0.0) + _CHANCE_CORRELATION + 4.0 / math.sqrt(
            max(int(np.count_nonzero(self.used)), 1)
        )

    @property
    def scaled(self) -> FloatArray:
        """`left` in its own standard deviations, shape (n,)."""
        return self.left / self.spread


def whitened_in_time(residual: FloatArray, noise: Noise) -> FloatArray:
    """Return S^-1 r in units of its standard deviation, for noise of any colour.

    This compares each reading with its best prediction from all others (unit variance). White
    noise is simply divided by its standard deviation.
    """
    residual = residual if noise.level is None else residual / noise.level
    if not noise.coloured:
        return residual / math.sqrt(float(noise.variance[0]))
    count = len(residual)
    inverse = 1.0 / noise.variance
    filtered = idct(dct(residual, norm="ortho") * inverse, norm="ortho")
    # (S^-1)_jj = (2/n) sum of cos^2(pi k (2 j + 1)/(2 n))/S_k, from a sum of cosines.
    doubled = np.fft.rfft(inverse, n=2 * count).real
    odd = 2 * np.arange(count) + 1
    diagonal = inverse.sum() - inverse[0] + doubled[np.where(odd <= count, odd, 2 * count - odd)]
    return np.asarray(filtered / np.sqrt(diagonal / count))


def whitened_series(residual: FloatArray, noise: Noise) -> tuple[FloatArray, float]:
    """Return the residual as a series of independent numbers, its level kept.

    Returns
    -------
    series
        Shape (n,).
    unit
        The white noise that has the variance 1 there.
    """
    inverse = 1.0 / noise.variance
    unit = 1.0 / math.sqrt(float(np.mean(inverse)))
    if not noise.coloured:
        return residual / unit, unit
    return idct(dct(residual, norm="ortho") * np.sqrt(inverse), norm="ortho"), unit


def local_residual(
    phase: FloatArray, values: FloatArray, used: BoolArray, *, leave_out: BoolArray | None = None
) -> Local:
    """Subtract the smooth part of a residual.

    Parameters
    ----------
    phase
        Of the motion, rising, rad, shape (n,): it divides the record into windows.
    values
        The residual, shape (n,), of any scale.
    used
        Which readings count; shape (n,).
    leave_out
        Readings that may not take part in the fits, shape (n,).
    """
    part = used if leave_out is None else used & ~leave_out
    starts, far = _window_starts(phase), np.zeros(len(phase), dtype=bool)
    for harmonics in (1, 3):
        columns = _columns(phase, starts, harmonics)
        local = _fitted(columns, starts, values, part & ~far, used)
        again = np.abs(local.scaled) > _OUTLIER_SD
        if np.any(again != far):
            far, local = again, _fitted(columns, starts, values, part & ~again, used)
        if harmonics > 1 or not _has_harmonics(phase, starts, local, part & ~far):
            break
    return local


def _window_starts(phase: FloatArray) -> IntArray:
    """Return the first reading of each window: whole cycles, with enough readings."""
    turns = (phase[-1] - phase[0]) / (2.0 * math.pi)
    cycles = max(_WINDOW_CYCLES, math.ceil(_WINDOW_READINGS * turns / len(phase)))
    # An incomplete window at the end joins the one before.
    return cycle_starts(phase, cycles)[: max(int(turns / cycles + 0.25), 1)]


def _columns(phase: FloatArray, starts: IntArray, harmonics: int) -> FloatArray:
    """Return the smooth functions: offset, harmonics, the fundamental's slope; shape (p, n)."""
    lengths = np.diff(starts, append=len(phase))
    first, last = phase[starts], phase[starts + lengths - 1]
    half = np.maximum(0.5 * (last - first), 1e-9)
    along = (phase - np.repeat(0.5 * (first + last), lengths)) / np.repeat(half, lengths)
    waves = harmonic_columns(phase, harmonics)
    return np.concatenate([waves, along * waves[1:3]])


def _fitted(
    columns: FloatArray, starts: IntArray, values: FloatArray, part: BoolArray, used: BoolArray
) -> Local:
    """Least squares in every window at once."""
    lengths = np.diff(starts, append=len(values))
    gram, right = normal_equations(columns * part, values, starts)
    # Regularised for windows with few readings.
    gram += 1e-9 * np.eye(len(columns)) * np.maximum(gram[:, :1, :1], 1.0)
    inverse = np.linalg.inv(gram)
    solved = (inverse @ right[..., None])[..., 0]
    left, hat = values.astype(np.float64), np.zeros(len(values))
    for i, column in enumerate(columns):
        left -= column * np.repeat(solved[:, i], lengths)
        turned = np.repeat(inverse[:, i], lengths, axis=0)
        hat += column * np.einsum("np,pn->n", turned, columns)
    left *= used
    leverage = np.where(part, -np.minimum(hat, 1.0), np.minimum(hat, 10.0))
    freedom = max(float(np.sum(1.0 + leverage[part])), 1.0)
    return Local(left, _rms(left[part], freedom), leverage, used)


def _rms(left: FloatArray, freedom: float) -> float:
    """Return the scatter, with outliers clipped."""
    scale = math.sqrt(len(left) / freedom)
    rms = 1.4826 * float(np.median(np.abs(left))) * scale or scatter(float(left @ left), freedom)
    for _ in range(2):
        near = np.minimum(np.abs(left), 4.0 * rms / scale)
        rms = scatter(float(near @ near), freedom)
    return max(rms, 1e-300)


def _has_harmonics(phase: FloatArray, starts: IntArray, local: Local, part: BoolArray) -> bool:
    """Whether windows contain more of the second or third harmonic than noise would."""
    gram, right = normal_equations(harmonic_columns(phase, 3)[3:] * part, local.left, starts)
    norm = np.einsum("kpp->kp", gram)
    power = np.minimum(right[norm > 4.0] ** 2 / norm[norm > 4.0] / local.rms**2, 50.0)
    chance = len(power) + _HARMONICS_SD * math.sqrt(2.0 * max(len(power), 1))
    return float(power.sum()) > chance
