"""Tails of the noise: Student's distribution fitted to all but the largest errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.distributions import each, student_beyond
from pendpipe.arrays import FloatArray

_INVERSE_FREEDOM: Final = (
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
"""1/nu: from a normal distribution (but for 1 % of what is beyond 5 sigma) to tails as heavy
as any."""
_BINS: Final = 200
_COARSE_BINS: Final = 80
"""Of errors that a step's width smooths."""
_ROUNDS: Final = 8
_ROUNDED: Final = 1.0
"""Step of the readings, in errors' standard deviations, up to which its square root of a twelfth
is but a part of the scale."""
_NODES: Final = 9
"""Of the rounding error's distribution (Gauss and Legendre)."""
_LEAST: Final = 0.05
"""Part of the errors' variance that is the noise's before the rounding, at least, to begin with."""


@dataclass(frozen=True)
class Tail:
    """Distributions that the noise may have, with their weights.

    Parameters
    ----------
    freedom, scale, weight
        nu, the scale in the unit of the errors, and the posterior weight; shape (k,).
    step
        Of the readings, in the same unit: rounding adds an error that is even over it.
    """

    freedom: FloatArray
    scale: FloatArray
    weight: FloatArray
    step: float = 0.0

    def beyond(self, size: FloatArray) -> FloatArray:
        """Return how often chance gives |error| > size, above half a step; shape of `size`."""
        rounding, share = _rounding(self.step)
        ratio = (np.asarray(size)[..., None, None] - rounding[:, None]) / self.scale
        return np.asarray(share @ student_beyond(self.freedom, ratio) @ self.weight)

    @property
    def inverse_freedom(self) -> float:
        """Mean of 1/nu: 0 for normal noise."""
        return float(self.weight @ (1.0 / self.freedom))


def fit_tail(size: FloatArray, largest: int, *, foreign: bool = False, step: float = 0.0) -> Tail:
    """Fit Student's distribution, the `largest` errors counted but their sizes unknown.

    Where readings are coarse the rounding's error, even over a step, is added to it: it
    fills the bulk and leaves the tails, so that the bulk alone would promise thin ones.

    Parameters
    ----------
    size
        |errors|, sorted, shape (n,).
    largest
        How many may be something else.
    foreign
        Whether they are: then not even their number says anything of the noise.
    step
        Of the readings, in the unit of the errors.
    """
    bulk = size[: len(size) - largest]
    edge = float(bulk[-1])
    rounding, share = _rounding(step)
    bins = _BINS if len(share) == 1 else _COARSE_BINS
    counts, edges = np.histogram(bulk, bins=bins, range=(0.0, edge))
    middle = 0.5 * (edges[1:] + edges[:-1])
    freedom = 1.0 / np.array(_INVERSE_FREEDOM)[:, None]
    # A reading beyond the edge counts as one on it: far more is unlikely.
    number = np.append(counts, 0 if foreign else largest)[None, :]
    squares = (np.append(middle, edge)[:, None] - rounding) ** 2
    usual = (1.4826 * float(np.median(size))) ** 2
    first = math.sqrt(max(usual - float(share @ rounding**2), _LEAST * usual)) + 1e-300
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
    """The likeliest scale for each nu, shape (k, 1): expectation and maximisation.

    `squares` are those of the noise before each rounding, shape (bins, nodes).
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
    if step < _ROUNDED:
        return np.zeros(1), np.ones(1)
    node, share = np.polynomial.legendre.leggauss(_NODES)
    return 0.5 * step * node, 0.5 * share


def _log_density(freedom: FloatArray, scale: FloatArray) -> FloatArray:
    """Logarithm of Student's density at zero."""
    return np.asarray(
        each(math.lgamma, 0.5 * (freedom + 1.0))
        - each(math.lgamma, 0.5 * freedom)
        - 0.5 * np.log(math.pi * freedom)
        - np.log(scale)
    )


def _prior() -> FloatArray:
    """Nine tenths for normal noise, the rest evenly over 1/nu."""
    inverse = np.array(_INVERSE_FREEDOM)
    width = np.gradient(inverse)
    width[0] = 0.0
    return np.asarray(np.append(0.9, 0.1 * width[1:] / width[1:].sum()))
