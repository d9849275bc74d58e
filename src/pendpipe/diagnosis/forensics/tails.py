"""Tails of the noise: Student's distribution, fitted to all but the largest errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import gammaln, stdtr

from pendpipe.arrays import FloatArray

_INVERSE_NU: Final = (
    1e-4,
    0.01,
    0.02,
    0.035,
    0.055,
    0.08,
    0.11,
    0.15,
    0.2,
    0.26,
    0.33,
    0.42,
    0.55,
)
"""1/nu: from a normal distribution (to 1 % at 5 sigma) to very heavy tails."""
_BINS: Final = 200
_COARSE_BINS: Final = 80
"""Bins for errors smoothed by coarse rounding."""
_ROUNDS: Final = 8
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
    freedom = 1.0 / np.array(_INVERSE_NU)[:, None]
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
    if foreign:
        likelihood -= len(bulk) * np.log1p(-beyond)
    else:
        likelihood += largest * np.log(beyond)
    weight = np.exp(likelihood - likelihood.max()) * _prior()
    return Tail(freedom[:, 0], scale[:, 0], weight / weight.sum(), step)


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
    return np.asarray(np.exp(_log_density(freedom, scale)[..., None] + exponent))


def _rounding(step: float) -> tuple[FloatArray, FloatArray]:
    """Rounding errors and their shares, shape (nodes,)."""
    if step < _COARSE_STEP:
        return np.zeros(1), np.ones(1)
    node, share = np.polynomial.legendre.leggauss(_NODES)
    return 0.5 * step * node, 0.5 * share


def _log_density(freedom: FloatArray, scale: FloatArray) -> FloatArray:
    """Logarithm of Student's density at zero."""
    return np.asarray(
        gammaln(0.5 * (freedom + 1.0))
        - gammaln(0.5 * freedom)
        - 0.5 * np.log(math.pi * freedom)
        - np.log(scale)
    )


def _prior() -> FloatArray:
    """Return the prior: nine tenths for normal noise, the rest uniform in 1/nu."""
    inverse = np.array(_INVERSE_NU)
    width = np.gradient(inverse)
    width[0] = 0.0
    return np.asarray(np.append(0.9, 0.1 * width[1:] / width[1:].sum()))
