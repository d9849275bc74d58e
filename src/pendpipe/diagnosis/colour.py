"""The spectrum of noise from the squares of its cosines, by Whittle's likelihood."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.minimise import Quadratic, minimise
from pendpipe.analysis.fit.quadratic import Bounds
from pendpipe.arrays import FloatArray

REFERENCE_HZ: Final = 0.05
"""Frequency at which the strength of the red part is given, and above which it may end: drifts
(temperature, draughts, electronics) are slower, and faster noise is mostly white."""
_NEEDED_GAIN: Final = (2.5, 12.0)
"""Gain in -2 ln L from which the spectrum gets a red part, and a memory. A missed red part causes
false drifts and slow tones; a superfluous one costs little sensitivity."""
_FLATTEST: Final = 0.3
_STEEPEST: Final = 1.6
"""Limits of the slope of red noise. With a flat spectrum, a few low cosines that are small by
chance would turn the slowest one into an effect."""
_CONVERGED: Final = 1e-2
"""Expected fall of -2 ln L below which a step is the last."""
_MOST_EVALUATIONS: Final = 25
"""Largest number of evaluations from one start."""
_OUTLIER_RATIO: Final = 12.0
"""Power over the spectrum above which a cosine is a line and not noise."""


class Colour(NamedTuple):
    """S(f) = white [1 + red (0.05 Hz/f)^slope] / |1 - memory e^(-2 pi i f dt)|^2.

    Parameters
    ----------
    white
        Variance of a cosine far above the red part.
    red, slope
        The red part's strength at 0.05 Hz, and its exponent.
    memory
        Correlation of neighbouring readings by a first-order low-pass.
    ends_hz
        The red part is zero above this; inf if it does not end.
    """

    white: float
    red: float = 0.0
    slope: float = 0.0
    memory: float = 0.0
    ends_hz: float = math.inf

    def spectrum(self, frequency_hz: FloatArray, interval_s: float) -> FloatArray:
        """Variance of each cosine, shape (n,)."""
        found = self.white * (1.0 + self.red * self._rise(frequency_hz))
        if self.memory:
            turn = 2.0 * math.pi * frequency_hz * interval_s
            found = found / (1.0 - 2.0 * self.memory * np.cos(turn) + self.memory**2)
        return np.asarray(found)

    def _rise(self, frequency_hz: FloatArray) -> FloatArray:
        if not self.red:
            return np.zeros_like(frequency_hz)
        lowest = frequency_hz[frequency_hz > 0.0].min(initial=math.inf)
        rise = (REFERENCE_HZ / np.maximum(frequency_hz, min(lowest, 1e3))) ** self.slope
        return np.asarray(rise * (frequency_hz <= self.ends_hz))


def fit_colour(
    power: FloatArray, frequency_hz: FloatArray, interval_s: float, *, red: bool = True
) -> Colour:
    """Maximise Whittle's likelihood, from white to coloured.

    Parameters
    ----------
    power, frequency_hz
        Squares of the cosines that contain noise alone, and their frequencies, shape (n,).
    interval_s
        Between readings.
    red
        Whether the noise may be red.
    """
    # Glitches and tones are not noise: clip what is far above its neighbours.
    variance = _clipped_mean(power, max(float(np.median(power)) / 0.4549, 1e-300))
    best, least = (
        Colour(variance),
        float(np.sum(math.log(variance) + np.minimum(power / variance, _OUTLIER_RATIO))),
    )
    for ends in (math.inf, REFERENCE_HZ) if red else ():
        found, cost = _red(power, frequency_hz, variance, ends)
        if cost < least - (_NEEDED_GAIN[0] if not best.red else 0.0):
            best, least = found, cost
    found, cost = _low_pass(power, frequency_hz, interval_s, variance)
    if cost < least - _NEEDED_GAIN[1]:
        best = found
    return best


def _whittle(power: FloatArray, spectrum: FloatArray, slopes: FloatArray) -> Quadratic:
    """Return -2 ln L, with outliers clipped, expanded about a spectrum.

    Parameters
    ----------
    power, spectrum
        Shape (n,).
    slopes
        Derivatives of ln S by the fitted values, shape (values, n). The expected second
        derivative by ln S is 1.
    """
    ratio = power / spectrum
    total = float(np.sum(np.log(spectrum) + np.minimum(ratio, _OUTLIER_RATIO)))
    pull = np.where(ratio < _OUTLIER_RATIO, ratio, 0.0) - 1.0
    return Quadratic(total, 0.5 * slopes @ pull, 0.5 * slopes @ slopes.T)


def _with_white(found: Quadratic, power: FloatArray, white: float) -> Quadratic:
    """Add cosines of white noise alone, with the exponential of the first value as variance."""
    ratio = power / white
    inside = ratio < _OUTLIER_RATIO
    total = len(power) * math.log(white) + float(np.sum(np.minimum(ratio, _OUTLIER_RATIO)))
    gradient, normal = found.gradient.copy(), found.normal.copy()
    gradient[0] += 0.5 * (float(np.sum(ratio[inside])) - len(power))
    normal[0, 0] += 0.5 * len(power)
    return Quadratic(found.chi2 + total, gradient, normal)


def _red(
    power: FloatArray, frequency: FloatArray, variance: float, ends: float
) -> tuple[Colour, float]:
    """Fit a red part that ends at a frequency, or does not end."""
    inside = frequency <= ends
    if np.count_nonzero(inside) < 3:
        return Colour(variance), math.inf
    near, beyond = power[inside], power[~inside]
    logs = np.log(REFERENCE_HZ / np.maximum(frequency[inside], 1e-12))

    def cost(values: FloatArray) -> Quadratic:
        white = math.exp(values[0])
        rise = np.exp(values[1] + values[2] * logs)
        by_rise = rise / (1.0 + rise)
        slopes = np.stack([np.ones_like(rise), by_rise, by_rise * logs])
        found = _whittle(near, white * (1.0 + rise), slopes)
        return _with_white(found, beyond, white) if len(beyond) else found

    # Far below the powers all of them are clipped, and the cost would fall without limit.
    middle = math.log(variance)
    bounds = Bounds(
        np.array([middle - 8.0, -12.0, _FLATTEST]), np.array([middle + 4.0, 8.0, _STEEPEST])
    )
    # Clipping causes several minima.
    starts = [
        np.array([middle, 0.0, 1.0]),
        np.array([middle, 0.0, _STEEPEST]),
        _red_throughout(near, logs, bounds),
    ]
    ends_at = [
        minimise(cost, start, bounds, tolerance=_CONVERGED, most=_MOST_EVALUATIONS)
        for start in starts
    ]
    found = min(ends_at, key=lambda minimum: minimum.quadratic.chi2)
    white, red, slope = found.value.tolist()
    return Colour(math.exp(white), math.exp(red), slope, 0.0, ends), found.quadratic.chi2


def _red_throughout(power: FloatArray, logs: FloatArray, bounds: Bounds) -> FloatArray:
    """Return start values for noise that is red at all frequencies: a line through ln P."""
    slope, height = np.polyfit(logs, np.log(np.maximum(power, 1e-300)), 1)
    # The logarithm of a squared normal number is -1.27 on average.
    height += 1.27
    white = bounds.lower[0] + 4.0
    return bounds.clip(np.array([white, height - white, slope]))


def _low_pass(
    power: FloatArray, frequency: FloatArray, interval: float, variance: float
) -> tuple[Colour, float]:
    """Fit a first-order memory."""
    cosine = np.cos(2.0 * math.pi * frequency * interval)

    def cost(values: FloatArray) -> Quadratic:
        gain = 1.0 - 2.0 * values[1] * cosine + values[1] ** 2
        slopes = np.stack([np.ones_like(gain), 2.0 * (cosine - values[1]) / gain])
        return _whittle(power, math.exp(values[0]) / gain, slopes)

    middle = math.log(variance)
    bounds = Bounds(np.array([middle - 8.0, -0.95]), np.array([middle + 4.0, 0.95]))
    found = minimise(cost, np.array([middle, 0.3]), bounds, tolerance=_CONVERGED)
    return Colour(math.exp(found.value[0]), memory=float(found.value[1])), found.quadratic.chi2


def _clipped_mean(power: FloatArray, variance: float) -> float:
    """Return the mean of chi^2_1 numbers without the far tail, corrected for it."""
    for _ in range(3):
        inside = power < _OUTLIER_RATIO * variance
        variance = float(np.mean(power[inside])) / 0.9958
    return variance
