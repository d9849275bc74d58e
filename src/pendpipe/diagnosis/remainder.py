"""The misfit that remains beyond the noise: how large, where, and its effect on errors.

If chi^2 stays far above the noise, the model is still wrong. Names and errors are then compared
with the unknown function that is left (`analysis.misfit`), not with the noise.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from pendpipe.analysis.misfit import beyond_noise, misfit_of
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import CLEAN, Fit
from pendpipe.files import fields_of

INCOMPLETE: Final = math.sqrt(CLEAN)
"""Residual over noise above which a model is incomplete."""


@dataclass(frozen=True)
class Remainder:
    """The misfit that remains.

    Parameters
    ----------
    excess
        chi^2 beyond the degrees of freedom; never negative.
    over_noise
        Square root of chi^2 per degree of freedom.
    numbers
        Number of independent numbers that describe it.
    shares
        Parts of `excess` in the offset, the amplitude and the phase of the motion, its higher
        harmonics, and between them.
    sizes
        Mean square of the numbers of each of these parts, in units of the noise's; 1 at least.
    """

    excess: float
    over_noise: float
    numbers: float = field(metadata={"json": "independent_numbers"})
    shares: Mapping[str, float] = field(default_factory=dict)
    sizes: tuple[float, ...] = ()

    @property
    def systematic(self) -> bool:
        """Whether the model is incomplete."""
        return self.over_noise > INCOMPLETE

    @property
    def error_scale(self) -> float:
        """Factor on standard deviations: 1 if only noise is left."""
        if not self.systematic:
            return 1.0
        return math.sqrt(max(self.excess / self.numbers, self.over_noise**2, 1.0))

    def as_json(self) -> dict[str, Any]:
        """Return its part of ``diagnosis.json``."""
        more = {"error_factor": self.error_scale, "systematic": self.systematic}
        return {**fields_of(self), **more}


def remainder_of(fit: Fit, data: Data, noise: Noise) -> Remainder:
    """Analyse a fit's residual by cycle and harmonic, and by its change over cycles."""
    freedom = max(data.used - len(fit.free), 1)
    excess = max(fit.chi2 - freedom, 0.0)
    over = math.sqrt(fit.chi2 / freedom)
    if over <= INCOMPLETE:
        return Remainder(excess, over, float(freedom))
    in_sds = data.residual(fit.at.reading) * data.weight / noise.sd
    left = misfit_of(in_sds, fit.at.sampled.phase)
    return Remainder(excess, over, min(left.numbers, float(freedom)), left.shares, left.sizes)


def with_errors(fit: Fit, data: Data, noise: Noise) -> Fit:
    """Return a fit with errors that allow for what it leaves beyond the noise (`misfit`)."""
    left = remainder_of(fit, data, noise)
    if not left.systematic:
        return replace(fit, error_scale=1.0, scatter=None)
    beyond = beyond_noise(fit.jacobian[:-1], fit.at.sampled.phase, left.sizes)
    scatter = fit.jacobian.T @ fit.jacobian + beyond
    return replace(fit, error_scale=left.error_scale, scatter=scatter)
