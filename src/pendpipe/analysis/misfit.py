"""The one error model: what a law's misfit does to errors, by the parts of the motion.

The noise is not here: `analysis.noise` and `diagnosis.noise` have it.

What a wrong law leaves is not noise, which is independent from reading to reading, but an unknown
function of time, described by a few numbers (its significant Fourier coefficients). In each part
of the motion (its offset, amplitude, phase, harmonics, and what lies between) it counts as random,
of the size that it has there. So a misfit of the phase widens the error of the frequency, one of
the amplitude those of the losses, and a sensor's harmonic neither.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.demodulation import by_cycle
from pendpipe.arrays import FloatArray

_HARMONICS: Final = 4
"""Of the motion that are told from what lies between them."""
_SIGNIFICANT_POWER: Final = 9.0
"""Squared normalised coefficient above which it is not noise."""
_FEWEST_NUMBERS: Final = 2.0
"""Numbers that describe a misfit: a wave has two, its cosine and its sine."""
_PARTS: Final = ("offset", "amplitude", "phase", "harmonics", "between")


class Misfit(NamedTuple):
    """What is left, by part of the motion."""

    numbers: float
    """Independent numbers that describe all of it."""
    shares: Mapping[str, float]
    """Of the excess over the noise, by part."""
    sizes: tuple[float, ...]
    """Mean square of the numbers of each part, in units of the noise's; 1 at least."""


def misfit_of(white: FloatArray, phase: FloatArray) -> Misfit:
    """Analyse a residual by cycle and harmonic, and by its change over cycles.

    Parameters
    ----------
    white
        In units of the noise, shape (n,); zero where a reading does not count.
    phase
        Of the motion, 0 at a turning point on the positive side, shape (n,).
    """
    from scipy.fft import dct

    parts = _in_parts(white, phase)
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
    named = dict(zip(_PARTS, shares.tolist(), strict=True))
    return Misfit(_numbers(np.concatenate(powers)), named, tuple(sizes))


def _numbers(power: FloatArray) -> float:
    """How many independent numbers have these squared coefficients.

    Squares of m normal numbers of one size have 3 (sum P)^2/sum P^2 = m.
    """
    loud = power[power > _SIGNIFICANT_POWER]
    found = 3.0 * float(loud.sum()) ** 2 / float(np.sum(loud**2)) if len(loud) else 1.0
    return max(found, _FEWEST_NUMBERS)


def beyond_noise(jacobian: FloatArray, phase: FloatArray, sizes: Sequence[float]) -> FloatArray:
    """What a misfit adds to the covariance of ``J'r``, which for noise alone is ``J'J``.

    The values ``J^+ r`` then have the covariance ``J^+ (sum of size P) J^+'``, where P projects on
    a part: that of the noise, C, and ``C B C`` of what is returned, B.

    Parameters
    ----------
    jacobian
        Of the readings in units of the noise, shape (n, size).
    phase, sizes
        Of the motion, shape (n,), and of the parts (`Misfit`).
    """
    found = np.zeros((jacobian.shape[1], jacobian.shape[1]))
    for size, part in zip(sizes, _in_parts(jacobian, phase), strict=True):
        columns = part.reshape(-1, part.shape[-1])
        found += (size - 1.0) * columns.T @ columns
    return found


def _in_parts(residual: FloatArray, phase: FloatArray) -> list[FloatArray]:
    """What lies in each of the parts of the motion, cycle by cycle, and between them."""
    found, rest = by_cycle(residual, phase, _HARMONICS)
    return [found[:, 0], found[:, 1], found[:, 2], found[:, 3:], rest]
