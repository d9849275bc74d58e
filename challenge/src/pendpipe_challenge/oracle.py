"""The oracle: it knows nuisances, noise and laws, and pays the same look-elsewhere.

All is linear about the truth. Each effect of the catalogue has as many signatures as its law is
drawn anew, those of what was hidden are known exactly, and its score is that of the best. Its
detection level is that of the largest score of noise alone over all of them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray as Array
from pendpipe_challenge.causes import CATALOGUE
from pendpipe_challenge.world import Bench, Cause, Rng

LEVEL: Final = 0.01
CLASS: Final = 6.0
"""Difference of Delta chi^2 within which two names cannot be told apart: exp(-3)."""
DRAWS: Final = 500
SHAPES: Final = 5
PLACES: Final = 40
"""How often a law is drawn, and one that is local in time or in frequency."""
SMALL: Final = 0.01
"""Of a law's first size: small enough to be linear."""


class Oracle:
    """The signatures of all effects in one recording.

    Parameters
    ----------
    bench
        The truth.
    fits
        Effects that the apparatus can have.
    """

    def __init__(self, bench: Bench, fits: list[str], rng: Rng) -> None:
        self.bench = bench
        self.names = [cause.name for cause in bench.causes]
        columns = list(bench.columns.T)
        for law in (law for effect in fits for law in CATALOGUE[effect]):
            if not law.own or law.chance:
                continue
            # What is local may stand anywhere, and where the hidden one does.
            places = [bench.scene.place, *(rng.uniform(size=PLACES) if law.local else ())]
            for place in places if law.local else places * SHAPES:
                draw = law.draw(rng, replace(bench.scene, place=float(place)))
                cause = Cause(law.effect, draw, SMALL * law.size)
                columns.append(bench.change([*bench.causes, cause]))
                self.names.append(law.effect)
        found = np.column_stack(columns)
        norms = np.linalg.norm(found, axis=0)
        norms[norms < 1e-9] = np.inf
        self.columns = found / norms

    def scores(self, residuals: Array) -> dict[str, Array]:
        """Best score of every effect for each of several residuals, (readings, residuals)."""
        found: dict[str, Array] = {}
        for name, power in zip(self.names, (self.columns.T @ residuals) ** 2, strict=True):
            found[name] = np.maximum(found[name], power) if name in found else power
        # A tone may have any frequency, and a wild reading any place.
        count, scene = len(residuals), self.bench.scene
        hertz = np.fft.rfftfreq(2 * count, scene.tick_s)
        away = np.abs(hertz - scene.frequency_hz) > 2.5 / scene.duration_s
        away &= (hertz > 1.5 / scene.duration_s) & (hertz < 0.49 / scene.tick_s)
        tones = np.abs(np.fft.rfft(residuals, 2 * count, axis=0)[away]) ** 2 * 2 / count
        loudest = tones.max(axis=0)
        for name, power in (
            ("tone-pickup", loudest),
            ("periodic-drive", loudest),
            ("glitches", (residuals**2).max(axis=0)),
        ):
            found[name] = np.maximum(found.get(name, 0.0), power)
        return found

    def judge(self, noise: Array, rng: Rng) -> dict[str, Any]:
        """Detect and name what is hidden, in this noise (rad)."""
        bench = self.bench
        drawn = bench.off(rng.standard_normal((len(noise), DRAWS)))
        level = float(np.quantile(np.max(list(self.scores(drawn).values()), axis=0), 1 - LEVEL))
        residual = bench.left(noise[:, None]) + bench.columns.sum(axis=1)[:, None]
        scores = {name: float(power[0]) for name, power in self.scores(residual).items()}
        ranked = sorted(scores, key=lambda name: -scores[name])
        best = scores[ranked[0]]
        return {
            "threshold": level,
            "detected": best > level,
            "named": ranked[0],
            "top3": ranked[:3],
            "class": [name for name in ranked if best - scores[name] <= CLASS],
            "scores": {name: scores[name] for name in ranked[:10]},
        }

    def left_by_catalogue(self) -> tuple[float, str]:
        """Delta chi^2 of what is hidden that no other effect takes up, and which takes most."""
        column, (hidden,) = self.bench.columns[:, 0], self.bench.causes
        scores = self.scores(column[:, None])
        best = max(scores.keys() - {hidden.name}, key=lambda name: float(scores[name][0]))
        return float(column @ column) - float(scores[best][0]), best
