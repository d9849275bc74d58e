"""Scans for tones of any frequency, steady or decaying, in a residual."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise

_OVERSAMPLING: Final = 2
"""Frequencies in an interval of 1/duration."""
_VISIBLE: Final = 0.02
"""Part of a tone's power that must remain after the projection."""


class Band(NamedTuple):
    """The scanned frequencies: above one, and not near another."""

    above_hz: float
    not_hz: float = 0.0
    width_hz: float = 0.0


@dataclass(frozen=True)
class ToneScan:
    """A scan over frequency with one envelope.

    Parameters
    ----------
    envelope
        What multiplies the tone, shape (n,).
    frequency_hz
        Shape (m,).
    inverse
        Of the 2x2 Gram matrices of projected cosine and sine, shape (m, 3): entries 11, 12, 22;
        zero where nothing remains.
    """

    envelope: FloatArray
    frequency_hz: FloatArray
    inverse: FloatArray
    size: int

    def scores(self, weights: FloatArray) -> FloatArray:
        """Return chi^2 (two degrees of freedom) of a tone at each frequency; shape (m, ...).

        `weights` is `Noise.adjoint` of the whitened and projected residual, shape (n, ...).
        """
        rows = np.multiply(weights.T, self.envelope, order="C")
        lines = np.fft.rfft(rows, n=self.size)[..., 1 : len(self.inverse) + 1]
        real, imaginary = lines.real, lines.imag
        first, mixed, second = self.inverse.T
        found = first * real**2 - 2.0 * mixed * real * imaginary + second * imaginary**2
        return np.asarray(found.T)


@dataclass(frozen=True)
class ToneScans:
    """Scans with several envelopes and the same noise."""

    noise: Noise
    scans: tuple[ToneScan, ...] = ()

    def scores(self, residual: FloatArray) -> list[FloatArray]:
        """Return each scan's chi^2 of a whitened, projected residual (with the prior's entry)."""
        if not self.scans:
            return []
        weights = self.noise.adjoint(residual[:-1])
        return [scan.scores(weights) for scan in self.scans]


def tone_scan(
    data: Data, noise: Noise, basis: FloatArray, envelope: FloatArray, band: Band
) -> ToneScan:
    """Prepare a scan: project the model's tangent space out of a tone at each frequency."""
    count = len(data)
    size = int(2 ** np.ceil(np.log2(_OVERSAMPLING * count)))
    frequency = np.asarray(np.fft.rfftfreq(size, data.interval_s)[1:], dtype=np.float64)
    keep = slice(1, len(frequency) + 1)
    variance = _variance_at(noise, frequency, data)
    # Products of tones follow from the Fourier transform of the squared envelope.
    square = noise.weight * envelope**2
    double = np.fft.rfft(square, n=size)
    total = float(np.sum(square))
    index = 2 * np.arange(1, len(frequency) + 1)
    folded = np.where(index <= size // 2, index, size - index)
    lines = np.where(index <= size // 2, double[folded], np.conj(double[folded]))
    g11 = 0.5 * (total + lines.real) / variance
    g22 = 0.5 * (total - lines.real) / variance
    g12 = -0.5 * lines.imag / variance
    rows = np.multiply(noise.adjoint(basis[:-1]).T, envelope, order="C")
    known = np.fft.rfft(rows, n=size).T[keep]
    real, imaginary = known.real, -known.imag
    h11 = g11 - np.sum(real**2, axis=1)
    h22 = g22 - np.sum(imaginary**2, axis=1)
    h12 = g12 - np.sum(real * imaginary, axis=1)
    determinant = h11 * h22 - h12**2
    seen = (
        (determinant > (_VISIBLE * 0.25 * (g11 + g22) ** 2))
        & (frequency > band.above_hz)
        & (np.abs(frequency - band.not_hz) > band.width_hz)
        & (frequency < 0.98 * frequency[-1])
    )
    safe = np.where(seen, determinant, 1.0)
    inverse = np.stack([h22 / safe, -h12 / safe, h11 / safe], axis=1) * seen[:, None]
    return ToneScan(envelope, frequency, inverse, size)


def _variance_at(noise: Noise, frequency: FloatArray, data: Data) -> FloatArray:
    cosines = np.arange(len(data)) / (2.0 * len(data) * data.interval_s)
    return np.interp(frequency, cosines, noise.variance)
