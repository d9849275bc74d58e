"""Coloured noise: a density near the pendulum's frequency that differs from the mean."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.finding import Finding, nothing
from pendpipe.diagnosis.forensics.local import residual_of
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Location
from pendpipe.estimate import Estimate

_HARMLESS_RATIO: Final = 1.5
"""Ratio of densities below which the colour changes no conclusion."""
_HARMONIC_HALF_WIDTH: Final = 0.15
"""Half width left out about each harmonic, over the frequency: a misfit may lie there."""
_HARMONICS: Final = 7
_LOWEST: Final = 0.1
"""Lowest frequency used, over the motion's: slower noise is a drift, allowed for elsewhere."""
_NEAR_BAND: Final = (0.3, 3.0)
_LINES_PER_HANN: Final = 35.0 / 18.0
"""Lines of a Hann window's spectrum per independent line."""


class Spectrum(NamedTuple):
    """Densities of the noise; shape (m,)."""

    frequency_hz: FloatArray
    power: FloatArray
    near: BoolArray


def find(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test whether the density near the pendulum's frequency differs from the mean by over 1.5.

    ln(S_near/S_mean) from a Hann-windowed spectrum, bands about the harmonics left out; its
    error is that of means of exponentially distributed lines. The null is composite: any
    ratio between 1/1.5 and 1.5. Noise that is red only below a tenth of the frequency is not
    reported.
    """
    if not data.uniform or data.time_noise or data.used < 200:
        return nothing("coloured-noise")
    frequency_hz = fit.at.sampled.motion.angular_frequency / (2.0 * math.pi)
    spectrum = _spectrum(data, residual_of(data, fit), frequency_hz)
    lines = np.count_nonzero(spectrum.near) / _LINES_PER_HANN
    others = np.count_nonzero(~spectrum.near) / _LINES_PER_HANN
    if lines < 10.0 or others < 10.0:
        return nothing("coloured-noise")
    near, rest = _mean(spectrum.power[spectrum.near]), _mean(spectrum.power[~spectrum.near])
    share = lines / (lines + others)
    whole = share * near + (1.0 - share) * rest
    log_ratio = math.log(near / whole)
    # The lines near the frequency are part of the mean, which reduces the error.
    part = 1.0 - share * near / whole
    sd = part * math.sqrt(1.0 / lines + 1.0 / others)
    score = (abs(log_ratio) - math.log(_HARMLESS_RATIO)) / max(sd, 1e-9)
    p_value = 0.5 * math.erfc(score / math.sqrt(2.0))
    ratio = math.exp(log_ratio)
    gain = 2.0 * (lines + others) * math.log(whole)
    gain -= 2.0 * (lines * math.log(near) + others * math.log(rest))
    slope, slope_sd = _slope(spectrum)
    word = "stronger" if ratio > 1.0 else "weaker"
    parameters = {
        "slope": Estimate(slope, slope_sd, ""),
        "density_ratio": Estimate(ratio, ratio * sd, ""),
    }
    return Finding(
        "coloured-noise",
        min(p_value, 1.0),
        max(gain, 0.0),
        parameters,
        Location(
            (float(data.time_s[0]), float(data.time_s[-1])),
            frequency_hz=(_NEAR_BAND[0] * frequency_hz, _NEAR_BAND[1] * frequency_hz),
        ),
        summary=f"the noise about the pendulum's frequency is {max(ratio, 1.0 / ratio):.2g} times"
        f" {word} in power than on average: it is coloured (power as f^{-slope:.2g} there)",
    )


def _spectrum(data: Data, residual: FloatArray, frequency_hz: float) -> Spectrum:
    count = len(residual)
    window = 0.5 - 0.5 * np.cos(2.0 * math.pi * (np.arange(count) + 0.5) / count)
    power = np.asarray(np.abs(np.fft.rfft(residual * window)) ** 2, dtype=np.float64)
    frequency: FloatArray = np.asarray(np.fft.rfftfreq(count, data.interval_s), dtype=np.float64)
    kept = (frequency > _LOWEST * frequency_hz) & (frequency > 0.05)
    kept &= np.arange(len(frequency)) < len(frequency) - 2
    for harmonic in range(1, _HARMONICS + 1):
        kept &= np.abs(frequency - harmonic * frequency_hz) > _HARMONIC_HALF_WIDTH * frequency_hz
    frequency, power = frequency[kept], power[kept]
    near = (frequency > _NEAR_BAND[0] * frequency_hz) & (frequency < _NEAR_BAND[1] * frequency_hz)
    return Spectrum(frequency, power, near)


def _mean(power: FloatArray) -> float:
    """Mean of exponentially distributed lines, clipped against tones."""
    mean = float(np.median(power)) / math.log(2.0)
    for _ in range(4):
        mean = float(np.mean(np.minimum(power, 8.0 * mean)))
    return max(mean, 1e-300)


def _slope(spectrum: Spectrum) -> tuple[float, float]:
    """Exponent s of S ~ 1/f^s near the frequency, from the logarithms of the lines."""
    x = np.log(spectrum.frequency_hz[spectrum.near])
    y = np.log(np.maximum(spectrum.power[spectrum.near], 1e-300))
    x = x - x.mean()
    size = float(x @ x)
    # ln of an exponential number has the variance pi^2/6.
    return -float(x @ y) / size, math.pi / math.sqrt(6.0 * size / _LINES_PER_HANN)
