"""The colour of noise: its spectrum from the squares of its cosines, by Whittle's likelihood."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.minimise import Quadratic, minimise
from pendpipe.analysis.fit.quadratic import Bounds
from pendpipe.arrays import FloatArray

REFERENCE_HZ: Final = 0.05
"""Where the red part's strength is told, and below which it may end: what drifts (warmth,
draughts, electronics) is slower than that, and what is faster is mostly white."""
_WORTH: Final = (2.5, 12.0)
"""Gain in -2 ln L for which the spectrum is given a red part, and a memory. A red part that
is missed accuses drifts and slow tones of the noise; a needless one costs little."""
_FLATTEST: Final = 0.3
_STEEPEST: Final = 1.6
"""Slopes between which noise is red. Were it flat below the end, a few low cosines that are small
by chance would tell that the slowest of all must be an effect."""
_SETTLED: Final = 1e-2
"""Of -2 ln L: a step that promises less is the last."""
_MOST: Final = 25
"""Looks at the likelihood from one start."""
_OUTLIER: Final = 12.0
"""Power over the spectrum beyond which a cosine holds no noise but a line."""


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
        Above this the red part is nothing; inf where it goes on.
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
        Squares of the cosines that hold noise alone, and where they are, shape (n,).
    interval_s
        Between readings.
    red
        Whether the noise may be red.
    """
    # Glitches and tones are no noise: what is far above its neighbours is clipped.
    level = _clipped_mean(power, max(float(np.median(power)) / 0.4549, 1e-300))
    best, least = (
        Colour(level),
        float(np.sum(math.log(level) + np.minimum(power / level, _OUTLIER))),
    )
    for ends in (math.inf, REFERENCE_HZ) if red else ():
        found, cost = _red(power, frequency_hz, level, ends)
        if cost < least - (_WORTH[0] if not best.red else 0.0):
            best, least = found, cost
    found, cost = _low_pass(power, frequency_hz, interval_s, level)
    if cost < least - _WORTH[1]:
        best = found
    return best


def _whittle(power: FloatArray, spectrum: FloatArray, slopes: FloatArray) -> Quadratic:
    """-2 ln L, what is far above clipped, about a spectrum.

    Parameters
    ----------
    power, spectrum
        Shape (n,).
    slopes
        Derivatives of ln S by the values that are fitted, shape (values, n). What is expected
        of the second derivatives by ln S is 1.
    """
    ratio = power / spectrum
    total = float(np.sum(np.log(spectrum) + np.minimum(ratio, _OUTLIER)))
    pull = np.where(ratio < _OUTLIER, ratio, 0.0) - 1.0
    return Quadratic(total, 0.5 * slopes @ pull, 0.5 * slopes @ slopes.T)


def _with_white(found: Quadratic, power: FloatArray, white: float) -> Quadratic:
    """Add cosines of white noise alone, whose variance is the first value's exponential."""
    ratio = power / white
    inside = ratio < _OUTLIER
    total = len(power) * math.log(white) + float(np.sum(np.minimum(ratio, _OUTLIER)))
    gradient, normal = found.gradient.copy(), found.normal.copy()
    gradient[0] += 0.5 * (float(np.sum(ratio[inside])) - len(power))
    normal[0, 0] += 0.5 * len(power)
    return Quadratic(found.chi2 + total, gradient, normal)


def _red(
    power: FloatArray, frequency: FloatArray, level: float, ends: float
) -> tuple[Colour, float]:
    """The best red part that ends at a frequency, or goes on."""
    inside = frequency <= ends
    if np.count_nonzero(inside) < 3:
        return Colour(level), math.inf
    near, beyond = power[inside], power[~inside]
    logs = np.log(REFERENCE_HZ / np.maximum(frequency[inside], 1e-12))

    def cost(values: FloatArray) -> Quadratic:
        white = math.exp(values[0])
        rise = np.exp(values[1] + values[2] * logs)
        by_rise = rise / (1.0 + rise)
        slopes = np.stack([np.ones_like(rise), by_rise, by_rise * logs])
        found = _whittle(near, white * (1.0 + rise), slopes)
        return _with_white(found, beyond, white) if len(beyond) else found

    # Far below the powers all of them are clipped, and the cost would fall without end.
    middle = math.log(level)
    bounds = Bounds(
        np.array([middle - 8.0, -12.0, _FLATTEST]), np.array([middle + 4.0, 8.0, _STEEPEST])
    )
    # What is clipped makes several minima.
    starts = [
        np.array([middle, 0.0, 1.0]),
        np.array([middle, 0.0, _STEEPEST]),
        _red_throughout(near, logs, bounds),
    ]
    ends_at = [minimise(cost, start, bounds, tolerance=_SETTLED, most=_MOST) for start in starts]
    found = min(ends_at, key=lambda minimum: minimum.quadratic.chi2)
    white, red, slope = found.value.tolist()
    return Colour(math.exp(white), math.exp(red), slope, 0.0, ends), found.quadratic.chi2


def _red_throughout(power: FloatArray, logs: FloatArray, bounds: Bounds) -> FloatArray:
    """Start values of noise that is red at all frequencies: a line through ln P."""
    slope, height = np.polyfit(logs, np.log(np.maximum(power, 1e-300)), 1)
    # The logarithm of a squared normal number is -1.27 on average.
    height += 1.27
    white = bounds.lower[0] + 4.0
    return bounds.clip(np.array([white, height - white, slope]))


def _low_pass(
    power: FloatArray, frequency: FloatArray, interval: float, level: float
) -> tuple[Colour, float]:
    """The best first-order memory."""
    cosine = np.cos(2.0 * math.pi * frequency * interval)

    def cost(values: FloatArray) -> Quadratic:
        gain = 1.0 - 2.0 * values[1] * cosine + values[1] ** 2
        slopes = np.stack([np.ones_like(gain), 2.0 * (cosine - values[1]) / gain])
        return _whittle(power, math.exp(values[0]) / gain, slopes)

    middle = math.log(level)
    bounds = Bounds(np.array([middle - 8.0, -0.95]), np.array([middle + 4.0, 0.95]))
    found = minimise(cost, np.array([middle, 0.3]), bounds, tolerance=_SETTLED)
    return Colour(math.exp(found.value[0]), memory=float(found.value[1])), found.quadratic.chi2


def _clipped_mean(power: FloatArray, level: float) -> float:
    """Mean of chi^2_1 numbers, the far tail left out and made up for."""
    for _ in range(3):
        inside = power < _OUTLIER * level
        level = float(np.mean(power[inside])) / 0.9958
    return level
