"""The noise of the readings: its spectrum and its level in time, by which they are weighed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
from scipy.fft import dct, idct

from pendpipe.arrays import BoolArray, FloatArray, IntArray

if TYPE_CHECKING:
    from pendpipe.diagnosis.data import Data

TAPS: Final = 32
"""Readings over which a filter may reach; a running mean of m has coefficients to some 3 m."""
_ORDER: Final = 4
"""Of the differences that measure fast noise, as in `analysis.noise`."""


@dataclass(frozen=True)
class Noise:
    """The variance of each cosine (DCT-II, orthonormal) of the readings over their level.

    Parameters
    ----------
    variance
        Shape (n,): S_k.
    weight
        1 where a reading counts; shape (n,).
    level
        The relative standard deviation of each reading, shape (n,); None where it is constant.
    starts, uncertainty
        The first cosine of each bin, and the covariance of ln S in the bins; empty where S is
        exactly known.
    charge
        By how much -2 ln of the cosines' probability density is larger since S was estimated.
    harmonics
        The cosines about the harmonics, from which S was not estimated, shape (n,).
    """

    known: ClassVar[bool] = False
    """Whether it is not to be estimated again."""
    variance: FloatArray
    weight: FloatArray
    level: FloatArray | None = None
    starts: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    uncertainty: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    charge: float = 0.0
    harmonics: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def whiten(self, columns: FloatArray) -> FloatArray:
        """Turn readings (or columns of them) into numbers of unit variance, shape kept."""
        scale = 1.0 / np.sqrt(self.variance)
        if not self.coloured:
            return np.asarray((columns.T * (self.scale * scale)).T)
        # The transform is much faster on contiguous memory.
        rows = np.multiply(columns.T, self.scale, order="C")
        return np.asarray((dct(rows, norm="ortho") * scale).T)

    def adjoint(self, columns: FloatArray) -> FloatArray:
        """Apply the transpose of `whiten`: from white numbers back to weights of readings."""
        scale = 1.0 / np.sqrt(self.variance)
        if not self.coloured:
            return np.asarray((columns.T * (self.scale * scale)).T)
        rows = np.multiply(columns.T, scale, order="C")
        return np.asarray((idct(rows, norm="ortho") * self.scale).T)

    def numbers_of(self, residual: FloatArray) -> FloatArray:
        """Return what columns are compared with, of a whitened residual: here the residual."""
        return residual

    @property
    def scale(self) -> FloatArray:
        """What each reading is multiplied by before its cosines are taken, shape (n,)."""
        return self.weight if self.level is None else self.weight / self.level

    @property
    def coloured(self) -> bool:
        """Whether cosines differ in variance; else the readings are white."""
        return bool(np.any(self.variance != self.variance[0]))

    def white(self, data: Data) -> Noise:
        """Return white noise as large as this, of other readings."""
        return white_noise(data, self.white_rms)

    @property
    def cost(self) -> float:
        """-2 ln of its probability density, less chi^2 and constants."""
        logs = float(np.mean(np.log(self.variance))) * float(np.count_nonzero(self.weight))
        if self.level is not None:
            logs += 2.0 * float(np.sum(np.log(self.level[self.weight > 0.0])))
        return logs + self.charge

    @property
    def memory(self) -> float:
        """Correlation of neighbouring readings."""
        turn = np.cos(math.pi * np.arange(len(self.variance)) / len(self.variance))
        return float(turn @ self.variance / self.variance.sum())

    @property
    def rms(self) -> float:
        """Standard deviation of one reading, its colour included."""
        level = 1.0 if self.level is None else float(np.mean(self.level**2))
        return math.sqrt(float(np.mean(self.variance)) * level)

    @property
    def white_rms(self) -> float:
        """Standard deviation of the white noise whose differences are as large.

        It is what `analysis.noise.noise_rms` measures, which no slow motion can touch.
        """
        passed = np.sin(0.5 * math.pi * np.arange(len(self.variance)) / len(self.variance))
        passed = passed ** (2 * _ORDER)
        level = 1.0 if self.level is None else float(np.mean(self.level**2))
        return math.sqrt(float(passed @ self.variance / passed.sum()) * level)

    def rms_at(self, frequency: float) -> float:
        """Standard deviation of white noise with the density at a frequency in cycles a reading."""
        cosine = min(int(2.0 * len(self.variance) * frequency), len(self.variance) - 1)
        return self.rms * math.sqrt(float(self.variance[cosine] / np.mean(self.variance)))

    @property
    def sd(self) -> FloatArray:
        """Standard deviation of each reading, shape (n,)."""
        mean = math.sqrt(float(np.mean(self.variance)))
        return np.full(len(self.variance), mean) if self.level is None else mean * self.level

    def log_scale_variance(self, rows: FloatArray) -> FloatArray:
        """Return the variance of the logarithm of the noise that unit columns meet.

        Parameters
        ----------
        rows
            Whitened columns of unit length, shape (k, n or more).
        """
        if not len(self.starts):
            return np.zeros(len(rows))
        energy = self.energy_in_bins(rows)
        return np.asarray(np.einsum("km,mn,kn->k", energy, self.uncertainty, energy, optimize=True))

    def energy_in_bins(self, rows: FloatArray) -> FloatArray:
        """Return the squares of unit columns in each bin of S, shape (k, bins)."""
        rows = rows[:, : len(self.variance)]
        rows = rows if self.coloured else dct(rows, norm="ortho")
        return np.asarray(np.add.reduceat(rows**2, self.starts, axis=1))

    def misfit(self, residual: FloatArray) -> float:
        """Return the mean square about the harmonics of a whitened residual: 1 for noise alone."""
        white = residual[: len(self.variance)]
        white = white if self.coloured else dct(white, norm="ortho")
        return float(np.mean(white[self.harmonics] ** 2)) if self.harmonics.any() else 1.0

    def log_variance_at(self, cosine: FloatArray) -> FloatArray:
        """Return the variance of ln S at each (not whole) number of a cosine."""
        if not len(self.starts):
            return np.zeros(len(cosine))
        return np.asarray(np.interp(cosine, self.starts, np.diag(self.uncertainty)))

    def first(self, count: int, weight: FloatArray) -> Noise:
        """Return the noise of the first `count` readings."""
        whole = np.arange(len(self.variance)) / len(self.variance)
        variance = np.interp(np.arange(count) / count, whole, self.variance)
        level = None if self.level is None else self.level[:count]
        return Noise(variance, weight, level)


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
    return Noise(variance, data.weight, None if slope is None else level_of_counts(slope))


def level_of_counts(slope: FloatArray) -> FloatArray:
    """Return the level of readings that err in time: in proportion to the speed, half at rest."""
    usual = math.sqrt(float(np.mean(slope**2)))
    return np.sqrt(0.25 + (slope / usual) ** 2)
