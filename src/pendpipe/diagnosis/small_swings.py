"""How a model's frequency differs from the readings' at the smallest amplitudes.

Sticking contacts and the elastic deflection of a bearing show only there, in a few cycles that
have little weight in chi^2. So these cycles are tested by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.special import stdtr

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.cycles import between, cycles, span_ends
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.quantities import with_error

_FEWEST_SPANS: Final = 8
"""Spans of cycles needed to estimate their scatter."""
_SIGNIFICANT: Final = 0.001
"""Probability by chance (Student's, for the scatter of the other spans) that is significant."""


@dataclass(frozen=True)
class SmallSwings:
    """Frequency of the readings over the model's, less 1, in the last span of cycles.

    Parameters
    ----------
    amplitude
        In the middle of that span, rad (or m).
    excess, excess_sd
        (f - f_model)/f_model, and its error from the readings and the scatter of the others.
    others
        The number of other spans.
    """

    amplitude: float
    excess: float
    excess_sd: float
    others: int

    @property
    def significant(self) -> bool:
        """Whether it exceeds the scatter."""
        by_chance = 2.0 * stdtr(self.others, -abs(self.excess) / self.excess_sd)
        return bool(by_chance < _SIGNIFICANT)

    def as_json(self) -> dict[str, Any]:
        """Return its part of ``diagnosis.json``."""
        return {
            "amplitude_rad": self.amplitude,
            "frequency_excess": self.excess,
            "frequency_excess_sd": self.excess_sd,
        }

    def sentence(self, unit: str) -> str:
        """Return it as a sentence."""
        way, torque = ("above", "stiffer") if self.excess > 0.0 else ("below", "softer")
        return (
            f"At the smallest amplitudes ({self.amplitude:.3g} {unit}) the frequency is"
            f" {with_error(100.0 * abs(self.excess), 100.0 * self.excess_sd, '%')} {way} the"
            f" model's: the restoring torque is {torque} there."
        )


def small_swings(fit: Fit, data: Data, noise: Noise) -> SmallSwings | None:
    """Compare the last span of cycles with a model; None where there are too few."""
    measured = cycles(data.values, data.weight, fit.at, noise.white_rms)
    if len(measured.time_s) < _FEWEST_SPANS:
        return None
    ends = span_ends(measured)
    if len(ends) <= _FEWEST_SPANS:
        return None
    own = cycles(fit.at.reading, data.weight, fit.at, 0.0).at(measured.time_s)
    one, other = between(measured, ends), between(own, ends)
    off: FloatArray = one.frequency_hz / other.frequency_hz - 1.0
    scatter = float(np.sqrt(np.mean(off[:-1] ** 2)))
    sd = float(np.hypot(one.frequency_sd_hz[-1] / other.frequency_hz[-1], scatter))
    return SmallSwings(float(one.amplitude[-1]), float(off[-1]), sd, len(off) - 1)
