"""The end of a decay: the motion has died away into the noise."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.arrays import AnyArray

_WINDOW_S: Final = 20.0
"""Seconds that are judged at a time: a few swings of the slowest pendulum on a bench."""
_LARGE: Final = 10.0
"""So many times the noise must the motion have been before its end can be seen."""
_REACHED: Final = 2.0
_WINDOWS: Final = 2
"""In so many windows, one after the other, must it be small."""
_FEWEST: Final = 32


class NoiseWatch:
    """Tell from a stream of readings that the amplitude has reached the noise.

    Parameters
    ----------
    rate_hz
        Readings a second.

    Notes
    -----
    In a window of 20 s the noise is the root mean square of the third differences over
    sqrt(20) (a motion slow against the readings has next to none; white noise of standard
    deviation s has sqrt(20) s), or what rounding leaves, 1/sqrt(12) of a count, if that is
    more. The amplitude is sqrt(2) times the standard deviation about a straight line, the
    noise taken off in squares. The end is reached when it was below twice the noise in two
    windows, after it had been above ten times: a pendulum not yet released has not decayed.
    """

    def __init__(self, rate_hz: float) -> None:
        self._size = max(_FEWEST, round(_WINDOW_S * rate_hz))
        self._kept: list[AnyArray] = []
        self._count = self._small = 0
        self._large = False
        self.amplitude = math.nan
        """In counts, of the last window."""

    def feed(self, counts: AnyArray) -> bool:
        """Take further readings, shape (n,); return whether the end is reached."""
        self._kept.append(counts)
        self._count += len(counts)
        if self._count < self._size:
            return False
        joined = np.concatenate(self._kept).astype(np.float64)
        while len(joined) >= self._size:
            self._judge(joined[: self._size])
            joined = joined[self._size :]
        self._kept, self._count = [joined], len(joined)
        return self._small >= _WINDOWS

    def _judge(self, window: AnyArray) -> None:
        differences = np.diff(window, 3)
        noise = math.sqrt(max(float(np.mean(differences**2)) / 20.0, 1.0 / 12.0))
        place = np.linspace(-1.0, 1.0, len(window))
        slope = float(np.sum(place * window) / np.sum(place**2))
        left = window - np.mean(window) - slope * place
        self.amplitude = math.sqrt(2.0 * max(0.0, float(np.mean(left**2)) - noise**2))
        self._large = self._large or self.amplitude > _LARGE * noise
        small = self._large and self.amplitude < _REACHED * noise
        self._small = self._small + 1 if small else 0
