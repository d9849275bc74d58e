"""Tails: of the noise (Student's distribution), and of weighted sums of squares."""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import gammaln, ndtr, stdtr

from pendpipe.arrays import FloatArray

_INVERSE_NU: Final = np.array(
    [1e-4, 0.01, 0.02, 0.035, 0.055, 0.08, 0.11, 0.15, 0.2, 0.26, 0.33, 0.42, 0.55]
)
"""1/nu: from a normal distribution (to 1 % at 5 sigma) to very heavy tails."""
_BINS: Final = 200
"""Bins of the errors: a bin is 1/40 of a standard deviation, less than any tail changes in."""
_COARSE_BINS: Final = 80
"""Bins for errors smoothed by coarse rounding."""
_ROUNDS: Final = 8
"""Steps of the EM algorithm, from the scale of the median on."""
_COARSE_STEP: Final = 1.0
"""Step of the readings, in standard deviations of the errors, up to which rounding only widens
the distribution."""
_NODES: Final = 9
"""Gauss-Legendre nodes for the rounding error."""
_LEAST_NOISE: Final = 0.05
"""Least part of the variance that the noise before rounding has at the start."""


@dataclass(frozen=True)
class Tail:
    """Possible distributions of the noise, with posterior weights.

    Parameters
    ----------
    freedom, scale, weight
        nu, the scale in the unit of the errors, and the posterior weight; shape (k,).
    step
        Of the readings, in the same unit: rounding errors are uniform over it.
    """

    freedom: FloatArray
    scale: FloatArray
    weight: FloatArray
    step: float = 0.0

    def beyond(self, size: FloatArray) -> FloatArray:
        """Return P(|error| > size), for sizes above half a step; shape of `size`."""
        rounding, share = _rounding(self.step)
        ratio = (np.asarray(size)[..., None, None] - rounding[:, None]) / self.scale
        return np.asarray(2.0 * share @ stdtr(self.freedom, -np.abs(ratio)) @ self.weight)

    @property
    def inverse_freedom(self) -> float:
        """Mean of 1/nu: 0 for normal noise."""
        return float(self.weight @ (1.0 / self.freedom))


def fit_tail(size: FloatArray, largest: int, *, foreign: bool = False, step: float = 0.0) -> Tail:
    """Fit Student's distribution with the `largest` errors censored.

    For coarse readings the rounding error, uniform over a step, is added: it widens the bulk but
    not the tails, so that the bulk alone would suggest thin tails.

    Parameters
    ----------
    size
        |errors|, sorted, shape (n,).
    largest
        How many may be glitches.
    foreign
        Whether they are glitches: then even their number contains no information on the noise.
    step
        Of the readings, in the unit of the errors.
    """
    bulk = size[: len(size) - largest]
    edge = float(bulk[-1])
    rounding, share = _rounding(step)
    bins = _BINS if len(share) == 1 else _COARSE_BINS
    counts, edges = np.histogram(bulk, bins=bins, range=(0.0, edge))
    middle = 0.5 * (edges[1:] + edges[:-1])
    freedom = 1.0 / _INVERSE_NU[:, None]
    # A reading beyond the edge counts as one at the edge.
    number = np.append(counts, 0 if foreign else largest)[None, :]
    squares = (np.append(middle, edge)[:, None] - rounding) ** 2
    usual = (1.4826 * float(np.median(size))) ** 2
    first = math.sqrt(max(usual - float(share @ rounding**2), _LEAST_NOISE * usual)) + 1e-300
    scale = _scale(freedom, number, squares, share, first)
    density = np.log(np.maximum(_density(freedom, scale, squares[:-1]) @ share, 1e-300))
    likelihood = np.sum(counts * density, axis=1)
    tail = Tail(freedom[:, 0], scale[:, 0], np.eye(len(freedom)), step)
    beyond = np.minimum(tail.beyond(np.array(edge)), 1.0 - 1e-12)
    likelihood += -len(bulk) * np.log1p(-beyond) if foreign else largest * np.log(beyond)
    # Beforehand nine tenths for normal noise, the rest uniform in 1/nu.
    prior = np.gradient(_INVERSE_NU)
    prior[1:] *= 0.1 / prior[1:].sum()
    prior[0] = 0.9
    weight = np.exp(likelihood - likelihood.max()) * prior
    return replace(tail, weight=weight / weight.sum())


def _scale(
    freedom: FloatArray, number: FloatArray, squares: FloatArray, share: FloatArray, first: float
) -> FloatArray:
    """Return the maximum-likelihood scale for each nu, shape (k, 1), by the EM algorithm.

    `squares` are those of the noise before each rounding error, shape (bins, nodes).
    """
    scale = np.full((len(freedom), 1), first)
    for _ in range(_ROUNDS):
        pull = (freedom[..., None] + 1.0) / (freedom[..., None] + squares / scale[..., None] ** 2)
        if len(share) > 1:
            density = _density(freedom, scale, squares) * share
            pull = pull * density / np.maximum(density.sum(axis=2, keepdims=True), 1e-300)
        pulled = np.sum(pull * squares, axis=2)
        scale = np.sqrt(np.sum(number * pulled, axis=1, keepdims=True) / number.sum())
    return scale


def _density(freedom: FloatArray, scale: FloatArray, squares: FloatArray) -> FloatArray:
    """Student's density where its argument has these squares, shape (k, bins, nodes)."""
    ratio = squares / (scale**2 * freedom)[..., None]
    exponent = -0.5 * (freedom[..., None] + 1.0) * np.log1p(ratio)
    at_zero = gammaln(0.5 * (freedom + 1.0)) - gammaln(0.5 * freedom)
    at_zero = at_zero - 0.5 * np.log(math.pi * freedom) - np.log(scale)
    return np.asarray(np.exp(at_zero[..., None] + exponent))


def _rounding(step: float) -> tuple[FloatArray, FloatArray]:
    """Rounding errors and their shares, shape (nodes,)."""
    if step < _COARSE_STEP:
        return np.zeros(1), np.ones(1)
    node, share = np.polynomial.legendre.leggauss(_NODES)
    return 0.5 * step * node, 0.5 * share


def tail_of_squares(total: float, weight: FloatArray) -> float:
    """Return P(sum of w_i z_i^2 > total), z_i independent and normal; scipy has no function.

    The saddlepoint approximation of Lugannani and Rice (Kuonen, Biometrika 86 (1999) 929),
    accurate to a few per cent of the probability, however small.

    Parameters
    ----------
    total
        The observed sum.
    weight
        w_i, of either sign, shape (n,).
    """
    weight = weight[weight != 0.0]
    if len(weight) == 0:
        return 1.0
    mean = float(weight.sum())
    spread = math.sqrt(2.0 * float(np.sum(weight**2)))
    if abs(total - mean) < 1e-3 * spread:
        # At the mean itself the formula is 0/0; its limit contains the skewness.
        skew = 8.0 * float(np.sum(weight**3)) / spread**3
        return 0.5 - skew / (6.0 * math.sqrt(2.0 * math.pi))
    if float(weight.min()) > 0.0 and total <= 0.0:
        return 1.0
    if float(weight.max()) < 0.0 and total >= 0.0:
        return 0.0
    tilt = _saddlepoint(total, weight)
    left = 1.0 - 2.0 * tilt * weight
    cumulant = -0.5 * float(np.sum(np.log(left)))
    curvature = 2.0 * float(np.sum((weight / left) ** 2))
    w = math.copysign(math.sqrt(max(2.0 * (tilt * total - cumulant), 0.0)), tilt)
    v = tilt * math.sqrt(curvature)
    return float(ndtr(-w - math.log(v / w) / w))


def _saddlepoint(total: float, weight: FloatArray) -> float:
    """Find the saddlepoint: there the cumulant generating function has the derivative `total`."""
    from scipy.optimize import brentq

    # The derivative, which rises, is infinite at both ends where there are weights of that sign;
    # else it falls to zero at least as 1/tilt.
    size = abs(total) + float(np.abs(weight).sum())
    most, least = float(weight.max()), float(weight.min())
    high = 0.5 / most - 0.25 / size if most > 0.0 else -0.5 * len(weight) / total
    low = 0.5 / least + 0.25 / size if least < 0.0 else -0.5 * len(weight) / total
    return float(
        brentq(
            lambda tilt: float(np.sum(weight / (1.0 - 2.0 * tilt * weight))) - total,
            low,
            high,
            xtol=1e-13 * (high - low),
        )
    )
