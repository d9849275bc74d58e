"""How a model's frequency differs from the readings' at the smallest amplitudes.

Sticking contacts and the elastic deflection of a bearing show only there, in a few cycles that
have little weight in chi^2. So these cycles are tested by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.cycles import between, cycles, span_ends
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.quantities import with_error

_FEWEST_SPANS: Final = 8
"""Spans of cycles needed to estimate their scatter."""
_SIGNIFICANT_SD: Final = 5.0
"""Standard deviations (reading error and scatter of the other spans) that are significant."""


@dataclass(frozen=True)
class SmallSwings:
    """Frequency of the readings over the model's, less 1, in the last span of cycles.

    Parameters
    ----------
    amplitude
        In the middle of that span, rad (or m).
    excess, excess_sd
        (f - f_model)/f_model, and its error from the readings and the scatter of the others.
    """

    amplitude: float
    excess: float
    excess_sd: float

    @property
    def significant(self) -> bool:
        """Whether it exceeds the scatter."""
        return abs(self.excess) > _SIGNIFICANT_SD * self.excess_sd

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
    return SmallSwings(float(one.amplitude[-1]), float(off[-1]), sd)
