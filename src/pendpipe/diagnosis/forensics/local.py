"""Local residuals: the readings minus everything that varies smoothly from cycle to cycle.

The tests of the measurement run before the physics is complete. They use what no motion of the
pendulum can produce, however wrong its model: in windows of a few cycles an offset and both
quadratures of the fundamental with their slopes are fitted and subtracted (and the second and
third harmonic where these are significant).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.fft import dct, idct

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.diagnosis.unwrapped import unwrapped

if TYPE_CHECKING:
    from pendpipe.diagnosis.data import Data
    from pendpipe.diagnosis.noise import Noise
    from pendpipe.diagnosis.refine import Fit

_WINDOW_CYCLES: Final = 2
_WINDOW_READINGS: Final = 40
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


def residual_of(data: Data, fit: Fit) -> FloatArray:
    """Return readings minus model, along the motion if out of phase; 0 where masked."""
    return np.asarray(unwrapped(data, fit.at)[0] * (data.weight > 0.0))


def error_of(data: Data, fit: Fit) -> FloatArray:
    """Return readings minus the motion, rounding errors included; 0 where masked.

    The tests of codes and tails treat rounding errors themselves. Subtracting their mean first
    (`Data.residual`) would move a reading beyond a code's edge by a whole step, and the motion to
    the middle of the code.
    """
    return residual_of(replace(data, lattice=None), fit)


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
    window, far = _windows(phase), np.zeros(len(phase), dtype=bool)
    for harmonics in (1, 3):
        columns = _columns(phase, window, harmonics)
        local = _fitted(columns, window, values, part & ~far, used)
        again = np.abs(local.scaled) > _OUTLIER_SD
        if np.any(again != far):
            far, local = again, _fitted(columns, window, values, part & ~again, used)
        if harmonics > 1 or not _has_harmonics(phase, window, local, part & ~far):
            break
    return local


def _windows(phase: FloatArray) -> IntArray:
    """Return each reading's window: whole cycles, with enough readings."""
    turns = (phase[-1] - phase[0]) / (2.0 * math.pi)
    cycles = max(_WINDOW_CYCLES, math.ceil(_WINDOW_READINGS * turns / len(phase)))
    number = np.floor((phase - phase[0]) / (2.0 * math.pi * cycles)).astype(np.int64)
    # An incomplete window at the end joins the one before.
    last = max(int(turns / cycles + 0.25), 1) - 1
    return np.asarray(np.minimum(number, last))


def _columns(phase: FloatArray, window: IntArray, harmonics: int) -> FloatArray:
    """Return the smooth functions: offset, fundamental and its slope, harmonics; shape (p, n)."""
    starts = np.searchsorted(window, np.arange(int(window[-1]) + 1))
    ends = np.append(starts[1:], len(phase)) - 1
    middle = 0.5 * (phase[starts] + phase[ends])
    half = np.maximum(0.5 * (phase[ends] - phase[starts]), 1e-9)
    along = (phase - middle[window]) / half[window]
    cosine, sine = np.cos(phase), np.sin(phase)
    parts = [np.ones(len(phase)), cosine, sine, along * cosine, along * sine]
    for harmonic in range(2, harmonics + 1):
        parts += [np.cos(harmonic * phase), np.sin(harmonic * phase)]
    return np.stack(parts)


def _fitted(
    columns: FloatArray, window: IntArray, values: FloatArray, part: BoolArray, used: BoolArray
) -> Local:
    """Least squares in every window at once."""
    starts = np.searchsorted(window, np.arange(int(window[-1]) + 1))
    lengths = np.diff(starts, append=len(window))
    kept, size = columns * part, len(columns)
    matrix = np.empty((len(starts), size, size))
    # A pair of columns at a time: all products of all readings would take gigabytes.
    for i, j in combinations_with_replacement(range(size), 2):
        matrix[:, i, j] = matrix[:, j, i] = np.add.reduceat(kept[i] * columns[j], starts)
    # Regularised for windows with few readings.
    matrix += 1e-9 * np.eye(size) * np.maximum(matrix[:, :1, :1], 1.0)
    right = np.add.reduceat(kept * values, starts, axis=1).T
    inverse = np.linalg.inv(matrix)
    solved = (inverse @ right[..., None])[..., 0]
    left, hat = values.astype(np.float64), np.zeros(len(values))
    for i in range(size):
        left -= columns[i] * np.repeat(solved[:, i], lengths)
        turned = np.zeros(len(values))
        for j in range(size):
            turned += np.repeat(inverse[:, i, j], lengths) * columns[j]
        hat += turned * columns[i]
    left *= used
    leverage = np.where(part, -np.minimum(hat, 1.0), np.minimum(hat, 10.0))
    freedom = max(float(np.sum(1.0 + leverage[part])), 1.0)
    return Local(left, _rms(left[part], freedom), leverage, used)


def _rms(left: FloatArray, freedom: float) -> float:
    """Return the root mean square, with outliers clipped."""
    scale = math.sqrt(len(left) / freedom)
    rms = 1.4826 * float(np.median(np.abs(left))) * scale
    if rms == 0.0:
        rms = math.sqrt(float(left @ left) / freedom)
    for _ in range(2):
        near = np.minimum(np.abs(left), 4.0 * rms / scale)
        rms = math.sqrt(float(near @ near) / freedom)
    return max(rms, 1e-300)


def _has_harmonics(phase: FloatArray, window: IntArray, local: Local, part: BoolArray) -> bool:
    """Whether windows contain more of the second or third harmonic than noise would."""
    starts = np.searchsorted(window, np.arange(int(window[-1]) + 1))
    waves = [wave(order * phase) for order in (2, 3) for wave in (np.cos, np.sin)]
    kept = np.array(waves) * part
    norm = np.add.reduceat(kept * kept, starts, axis=1)
    size = np.add.reduceat(kept * local.left, starts, axis=1)
    power = np.minimum(size[norm > 4.0] ** 2 / norm[norm > 4.0] / local.rms**2, 50.0)
    chance = len(power) + _HARMONICS_SD * math.sqrt(2.0 * max(len(power), 1))
    return float(power.sum()) > chance
