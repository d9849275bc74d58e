"""Noise with a known covariance: white (perhaps heavy-tailed) plus red below a corner.

The red part is a sum of slow cosines and sines with Gaussian amplitudes, so that the
covariance is sigma^2 I + L L^T exactly, and whitening is exact as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pendpipe.arrays import FloatArray

CORNER_HZ = 0.05


@dataclass(frozen=True)
class Noise:
    """One-sided density S(f) = 2 sd^2 dt [1 + (corner/f)^alpha below the corner].

    Parameters
    ----------
    white_sd
        Of one sample, rad.
    alpha
        Steepness below the corner; 0 leaves the white part alone.
    corner_hz
        Where the red part ends.
    freedom
        Degrees of freedom of Student's t (scaled to `white_sd`); 0 for Gaussian noise.
    """

    white_sd: float
    alpha: float = 0.0
    corner_hz: float = CORNER_HZ
    freedom: float = 0.0

    def slow(self, time_s: FloatArray) -> FloatArray:
        """L, shape (samples, 2 frequencies): columns times unit Gaussians are the red part."""
        span = time_s[-1] - time_s[0] + (time_s[1] - time_s[0])
        count = int(self.corner_hz * 2.0 * span)
        if self.alpha <= 0.0 or count < 1:
            return np.empty((len(time_s), 0))
        width = 0.5 / span
        frequency = width * (np.arange(count) + 1.0)
        density = 2.0 * self.white_sd**2 * (time_s[1] - time_s[0])
        density = density * (self.corner_hz / frequency) ** self.alpha
        angle = 2.0 * np.pi * np.outer(time_s, frequency)
        weight = np.sqrt(np.tile(density * width, 2))
        return np.asarray(np.hstack([np.cos(angle), np.sin(angle)]) * weight)

    def draw(self, time_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """One realisation, rad."""
        slow = self.slow(time_s)
        if self.freedom > 2.0:
            unit = random.standard_t(self.freedom, len(time_s))
            unit = unit * np.sqrt((self.freedom - 2.0) / self.freedom)
        else:
            unit = random.standard_normal(len(time_s))
        return self.white_sd * unit + slow @ random.standard_normal(slow.shape[1])


class Whitening:
    """The symmetric C^(-1/2) for C = sd^2 I + L L^T, applied and never formed."""

    def __init__(self, white_sd: float, slow: FloatArray) -> None:
        self.white_sd = white_sd
        if slow.shape[1] == 0:
            self.basis, self.shrink = slow, np.empty(0)
            return
        values, vectors = np.linalg.eigh(slow.T @ slow)
        kept = values > 1e-10 * values[-1]
        self.basis = slow @ (vectors[:, kept] / np.sqrt(values[kept]))
        self.shrink = 1.0 - 1.0 / np.sqrt(1.0 + values[kept] / white_sd**2)

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Whiten a series, or each column of several."""
        slow = self.basis @ ((self.shrink * (self.basis.T @ columns).T).T)
        return np.asarray((columns - slow) / self.white_sd)
