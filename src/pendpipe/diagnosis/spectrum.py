"""Scans for tones of any frequency, steady or decaying, in a residual."""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from scipy.fft import next_fast_len
from scipy.ndimage import uniform_filter1d

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.estimate import Z95

_OVERSAMPLING: Final = 2
"""Frequencies in an interval of 1/duration."""
_BESIDE: Final = 12.0
_LINE: Final = 2.0
"""Frequencies beside a line, in 1/duration: how far they reach, and how far the line does."""
OFF_HARMONIC: Final = 0.1
"""Distance of a separate line from the nearest harmonic, over the motion's frequency."""
_VISIBLE: Final = 0.02
"""Part of a tone's power that must remain after the projection."""


class Band(NamedTuple):
    """The scanned frequencies: above one, and not near the motion's own."""

    above_hz: float
    own_hz: float
    width_hz: float = 0.0


@dataclass(frozen=True)
class ToneScan:
    """A scan over frequency with one envelope.

    Parameters
    ----------
    decay_s
        Decay time of the tone; inf where it is steady.
    envelope
        What multiplies it, shape (n,).
    frequency_hz
        Shape (m,).
    inverse
        Of the 2x2 Gram matrices of projected cosine and sine, shape (m, 3): entries 11, 12, 22;
        zero where nothing remains.
    log_scale_variance
        Variance of the logarithm of the noise at each frequency, shape (m,).
    size
        Of the Fourier transform.
    wider
        By how much a tone is wider than a steady one.
    as_steady
        Where what lies beside a steady tone is taken, shape (m,): near the motion's harmonics,
        whose misfits fade too, or everywhere if beside a wider one lies the next harmonic.
    lines
        Independent frequencies in the scanned band (Baluev 2008): sqrt(4 pi) times its width and
        the standard deviation of the time, weighted with the squared envelope.
    """

    decay_s: float
    envelope: FloatArray
    frequency_hz: FloatArray
    inverse: FloatArray
    log_scale_variance: FloatArray
    size: int
    wider: float
    as_steady: BoolArray
    lines: float

    def trials(self, height: FloatArray) -> FloatArray:
        """Return the number of trials at half a chi^2, to a tenth.

        By Rice's formula they grow with the root of the height, up to all frequencies.
        """
        crossings, most = self.lines * np.sqrt(height), np.count_nonzero(self.inverse[:, 0])
        return np.asarray(crossings * most / np.maximum(np.hypot(crossings, most), 1.0))

    def p_values(self, scores: FloatArray) -> FloatArray:
        """Return the probability that chance alone does better at each frequency by itself.

        It is that of `scores.local_p_values` for two degrees of freedom. Where the frequencies
        beside one are louder than the noise should be, it is compared with them. They tell the
        noise too where its spectrum is hardly known, as beside a strong line.
        """
        level, beside = self._beside(scores)
        least = np.where(level > 1.0, 1.0 / beside, self.log_scale_variance)
        half = np.maximum(0.5 * np.minimum(least, 1.0 / beside), 1e-12)
        return np.asarray(np.exp(-0.5 / half * np.log1p(half * scores / level)))

    def _beside(self, scores: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the level of the frequencies beside each one, over the noise, and their number.

        A spectrum that is smooth over many cosines misses the resonance of a stand. A level is 1
        where chance explains it. A tone that fades is wider.
        """
        steady = self.size / len(self.envelope)
        found = [self._about(scores, resolved) for resolved in (steady, steady * self.wider)]
        level, beside = (np.where(self.as_steady, *each) for each in zip(*found, strict=True))
        return np.where(level > 1.0 + Z95 / np.sqrt(beside), level, 1.0), beside

    def _about(self, scores: FloatArray, resolved: float) -> tuple[FloatArray, FloatArray]:
        """Return the mean of the frequencies about each one, and their number.

        `resolved` is by how many entries independent frequencies lie apart.
        """
        seen = self.inverse.any(axis=1)

        def sums(cosines: float) -> FloatArray:
            width = 2 * round(cosines * resolved) + 1
            pair = np.stack([0.5 * scores * seen, seen.astype(np.float64)])
            return np.asarray(width * uniform_filter1d(pair, width, mode="constant"))

        total, number = sums(_BESIDE) - sums(_LINE)
        return total / np.maximum(number, 1.0), np.maximum(number / resolved, 1.0)

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


def tone_scan(data: Data, noise: Noise, basis: FloatArray, decay_s: float, band: Band) -> ToneScan:
    """Prepare a scan: project the model's tangent space out of a tone at each frequency."""
    count, envelope = len(data), np.exp((data.time_s[0] - data.time_s) / decay_s)
    size = _OVERSAMPLING * next_fast_len(count, real=True)
    frequency = np.asarray(np.fft.rfftfreq(size, data.interval_s)[1:], dtype=np.float64)
    keep = slice(1, len(frequency) + 1)
    cosine = 2.0 * count * data.interval_s * frequency
    # Products of tones follow from the Fourier transform of the squared envelope, and their
    # power from its autocorrelation: a tone leaks to where the noise may be far less.
    swell = noise.scale * envelope
    double = np.fft.rfft(swell**2, n=size) / float(swell @ swell)
    together = np.fft.irfft(np.abs(np.fft.rfft(swell, n=size)) ** 2, n=size)
    heard = np.fft.irfft(1.0 / np.append(noise.variance, noise.variance[-1]))[:count]
    together[:count] *= heard
    together[count : size - count + 1] = 0.0
    together[size - count + 1 :] *= heard[:0:-1]
    power = 0.5 * np.maximum(np.fft.rfft(together).real[keep], 0.0)
    index = 2 * np.arange(1, len(frequency) + 1)
    folded = np.where(index <= size // 2, index, size - index)
    lines = np.where(index <= size // 2, double[folded], np.conj(double[folded]))
    g11 = power * (1.0 + lines.real)
    g22 = power * (1.0 - lines.real)
    g12 = -power * lines.imag
    h11, h22, h12 = g11.copy(), g22.copy(), g12
    for row in basis[:-1].T:
        known = np.fft.rfft(noise.adjoint(row) * envelope, n=size)[keep]
        h11 -= known.real**2
        h22 -= known.imag**2
        h12 += known.real * known.imag
    determinant = h11 * h22 - h12**2
    seen = (
        (determinant > (_VISIBLE * 0.25 * (g11 + g22) ** 2))
        & (frequency > band.above_hz)
        & (np.abs(frequency - band.own_hz) > band.width_hz)
        & (frequency < 0.98 * frequency[-1])
    )
    safe = np.where(seen, determinant, 1.0)
    inverse = np.empty((len(frequency), 3))
    for entry, own in enumerate((h22, -h12, h11)):
        inverse[:, entry] = own / safe * seen
    order, fade = frequency / band.own_hz, envelope**2
    wider = float(count * (fade @ fade) / fade.sum() ** 2)
    beyond = _BESIDE * wider / (count * data.interval_s) > band.own_hz
    as_steady = beyond | (np.abs(order - np.rint(order)) < OFF_HARMONIC)
    unsure = noise.log_variance_at(cosine)
    since = data.time_s - data.time_s[0]
    since = since - float(fade @ since) / float(fade.sum())
    spread_s = math.sqrt(float(fade @ since**2) / float(fade.sum()))
    width_hz = np.count_nonzero(seen) / (size * data.interval_s)
    own = float(math.sqrt(4.0 * math.pi) * spread_s * width_hz)
    return ToneScan(decay_s, envelope, frequency, inverse, unsure, size, wider, as_steady, own)
