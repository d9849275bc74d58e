"""The misfit that remains beyond the noise: how large, where, and its effect on errors.

If chi^2 stays far above the noise, the model is still wrong. The rest is then not noise, which is
independent from reading to reading, but an unknown function of time, described by a few numbers
(its significant Fourier coefficients). Names and errors are compared with that function, not with
the noise: a misfit of the phase widens the error of the frequency, one of the amplitude those of
the losses.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from scipy.fft import dct

from pendpipe.analysis.demodulation import by_cycle
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import CLEAN, Fit
from pendpipe.files import fields_of

INCOMPLETE: Final = math.sqrt(CLEAN)
"""Residual over noise above which a model is incomplete."""
_HARMONICS: Final = 4
"""Of the motion that are told from what lies between them."""
_SIGNIFICANT_POWER: Final = 9.0
"""Squared normalised coefficient above which it is not noise."""
_FEWEST_NUMBERS: Final = 2.0
"""Numbers that describe a misfit: a wave has two, its cosine and its sine."""
_PARTS: Final = ("offset", "amplitude", "phase", "harmonics", "between")


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
    parts = _in_parts(in_sds, fit.at.sampled.phase)
    powers = [np.asarray(dct(part, axis=0, norm="ortho") ** 2).ravel() for part in parts]
    by_noise = [power.size for power in powers[:-1]]
    by_noise.append(max(int(np.count_nonzero(parts[-1])) - sum(by_noise), 1))
    sums = [float(power.sum()) for power in powers]
    beyond = np.maximum(np.subtract(sums, by_noise), 0.0)
    shares = beyond / max(float(beyond.sum()), 1e-300)
    sizes = [
        max(more / _numbers(power), whole / number, 1.0)
        for more, power, whole, number in zip(beyond, powers, sums, by_noise, strict=True)
    ]
    return Remainder(
        excess,
        over,
        min(_numbers(np.concatenate(powers)), float(freedom)),
        dict(zip(_PARTS, shares.tolist(), strict=True)),
        tuple(sizes),
    )


def _numbers(power: FloatArray) -> float:
    """How many independent numbers have these squared coefficients.

    Squares of m normal numbers of one size have 3 (sum P)^2/sum P^2 = m.
    """
    loud = power[power > _SIGNIFICANT_POWER]
    found = 3.0 * float(loud.sum()) ** 2 / float(np.sum(loud**2)) if len(loud) else 1.0
    return max(found, _FEWEST_NUMBERS)


def with_errors(fit: Fit, data: Data, noise: Noise) -> Fit:
    """Return a fit with errors that allow for what it leaves beyond the noise.

    What is left of each part of the motion (`Remainder`) counts as random, of the size that it
    has: the values J^+ r then have the covariance J^+ (sum of size P) J^+', where P projects on
    a part.
    """
    left = remainder_of(fit, data, noise)
    if not left.systematic:
        return replace(fit, error_scale=1.0, scatter=None)
    parts = _in_parts(fit.jacobian[:-1], fit.at.sampled.phase)
    scatter = fit.jacobian.T @ fit.jacobian
    for size, part in zip(left.sizes, parts, strict=True):
        columns = part.reshape(-1, part.shape[-1])
        scatter += (size - 1.0) * columns.T @ columns
    return replace(fit, error_scale=left.error_scale, scatter=scatter)


def _in_parts(residual: FloatArray, phase: FloatArray) -> list[FloatArray]:
    """Return what lies in each of the parts of the motion, cycle by cycle, and between them."""
    found, rest = by_cycle(residual, phase, _HARMONICS)
    return [found[:, 0], found[:, 1], found[:, 2], found[:, 3:], rest]
