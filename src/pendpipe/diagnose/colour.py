"""The colour of noise: its spectrum from the squares of its cosines, by Whittle's likelihood."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray

REFERENCE_HZ: Final = 0.05
"""Where the red part's strength is told, and below which it may end: what drifts (warmth,
draughts, electronics) is slower than that, and what is faster is mostly white."""
_WORTH: Final = (2.5, 12.0)
"""Gain in -2 ln L for which the spectrum is given a red part, and a memory. A red part that
is missed accuses drifts and slow tones of the noise; a needless one costs little."""
_STEEPEST: Final = 1.6
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
    best, least = Colour(level), _whittle(power, np.full(len(power), level))[0]
    for ends in (math.inf, REFERENCE_HZ) if red else ():
        found, cost = _red(power, frequency_hz, level, ends)
        if cost < least - (_WORTH[0] if not best.red else 0.0):
            best, least = found, cost
    found, cost = _low_pass(power, frequency_hz, interval_s, level)
    if cost < least - _WORTH[1]:
        best = found
    return best


def _whittle(power: FloatArray, spectrum: FloatArray) -> tuple[float, FloatArray]:
    """-2 ln L, what is far above clipped; and its derivatives by ln S."""
    ratio = power / spectrum
    total = float(np.sum(np.log(spectrum) + np.minimum(ratio, _OUTLIER)))
    return total, np.where(ratio < _OUTLIER, 1.0 - ratio, 1.0)


def _red(
    power: FloatArray, frequency: FloatArray, level: float, ends: float
) -> tuple[Colour, float]:
    """The best red part that ends at a frequency, or goes on."""
    from scipy.optimize import minimize

    inside = frequency <= ends
    if np.count_nonzero(inside) < 3:
        return Colour(level), math.inf
    # Above its end there is white noise alone.
    near, beyond = power[inside], power[~inside]
    logs = np.log(REFERENCE_HZ / np.maximum(frequency[inside], 1e-12))

    def cost(values: FloatArray) -> tuple[float, FloatArray]:
        white = math.exp(values[0])
        rise = np.exp(values[1] + values[2] * logs)
        total, by_log = _whittle(near, white * (1.0 + rise))
        far, by_far = _whittle(beyond, np.full(len(beyond), white))
        by_rise = by_log * rise / (1.0 + rise)
        slopes = [by_log.sum() + by_far.sum(), by_rise.sum(), by_rise @ logs]
        return total + far, np.array(slopes)

    # Far below the powers all of them are clipped, and the cost would fall without end.
    middle = math.log(level)
    bounds = [
        (middle - 8.0, middle + 4.0),
        (-12.0, 8.0),
        (0.0 if ends < math.inf else 0.3, _STEEPEST),
    ]
    found = minimize(cost, np.array([middle, 0.0, 1.0]), jac=True, bounds=bounds)
    white, red, slope = found.x
    return Colour(math.exp(white), math.exp(red), float(slope), 0.0, ends), float(found.fun)


def _low_pass(
    power: FloatArray, frequency: FloatArray, interval: float, level: float
) -> tuple[Colour, float]:
    """The best first-order memory."""
    from scipy.optimize import minimize

    cosine = np.cos(2.0 * math.pi * frequency * interval)

    def cost(values: FloatArray) -> tuple[float, FloatArray]:
        gain = 1.0 - 2.0 * values[1] * cosine + values[1] ** 2
        total, by_log = _whittle(power, math.exp(values[0]) / gain)
        by_memory = by_log @ (2.0 * (cosine - values[1]) / gain)
        return total, np.array([by_log.sum(), by_memory])

    middle = math.log(level)
    bounds = [(middle - 8.0, middle + 4.0), (-0.95, 0.95)]
    found = minimize(cost, np.array([middle, 0.3]), jac=True, bounds=bounds)
    return Colour(math.exp(found.x[0]), memory=float(found.x[1])), float(found.fun)


def _clipped_mean(power: FloatArray, level: float) -> float:
    """Mean of chi^2_1 numbers, the far tail left out and made up for."""
    for _ in range(3):
        inside = power < _OUTLIER * level
        level = float(np.mean(power[inside])) / 0.9958
    return level
