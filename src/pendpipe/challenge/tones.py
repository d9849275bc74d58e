"""Tones, steady or ringing, looked for at every frequency at once."""

from __future__ import annotations

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.challenge.bench import Bench


def smooth_length(count: int) -> int:
    """The next number with no factors above 5, which Fourier transforms like."""
    while True:
        rest = count
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return count
        count += 1


class Tones:
    """Scores of the subspaces {cos, sin} at all frequencies, for many residuals at once.

    Whitened noise is white, so a frequency's score is its periodogram, whatever the colour.
    """

    def __init__(self, bench: Bench) -> None:
        self.length = smooth_length(2 * bench.count)
        interval = bench.scenario.interval_s
        hertz = np.fft.rfftfreq(self.length, interval)
        line, span = bench.scenario.omega / 2 / np.pi, bench.count * interval
        time = interval * np.arange(bench.count)
        clear = (np.abs(hertz - line) > 2.5 / span) & (hertz > 1.5 / span)
        clear &= hertz < 0.49 / interval
        ringing = clear & (hertz > 1.8 * line)
        self.windows: list[tuple[str, FloatArray, BoolArray]] = [
            ("tone-pickup", np.ones(bench.count), clear)
        ]
        for cycles in (8.0, 25.0):
            self.windows.append(("second-mode", np.exp(-time * line / cycles), ringing))

    def scores(self, residuals: FloatArray) -> dict[str, FloatArray]:
        """Largest score of each effect; `residuals` (kept, draws), whitened and projected."""
        found: dict[str, FloatArray] = {}
        for effect, window, allowed in self.windows:
            spectrum = np.fft.rfft(residuals.T * window, self.length, axis=1)[:, allowed]
            power = np.abs(spectrum) ** 2 / (0.5 * float(np.sum(window**2)))
            best = power.max(axis=1) if power.size else np.zeros(residuals.shape[1])
            found[effect] = np.maximum(found.get(effect, 0.0), best)
        # A drive's response is a tone and a free swing, which the baseline absorbs.
        found["periodic-drive"] = found["tone-pickup"]
        return found
