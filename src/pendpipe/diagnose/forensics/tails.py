"""Tails of the noise: Student's distribution fitted to all but the largest errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.distributions import each, student_beyond
from pendpipe.arrays import FloatArray

_INVERSE_FREEDOM: Final = (
    1e-4, 0.01, 0.02, 0.035, 0.055, 0.08, 0.11, 0.15, 0.2, 0.26, 0.33, 0.42, 0.55,
)  # fmt: skip
"""1/nu: from a normal distribution (but for 1 % of what is beyond 5 sigma) to tails as heavy
as any."""
_BINS: Final = 200
_ROUNDS: Final = 8


@dataclass(frozen=True)
class Tail:
    """Distributions that the noise may have, with their weights.

    Parameters
    ----------
    freedom, scale, weight
        nu, the scale in the unit of the errors, and the posterior weight; shape (k,).
    """

    freedom: FloatArray
    scale: FloatArray
    weight: FloatArray

    def beyond(self, size: FloatArray) -> FloatArray:
        """Return how often chance gives |error| > size; shape of `size`."""
        ratio = np.asarray(size)[..., None] / self.scale
        return np.asarray(student_beyond(self.freedom, ratio) @ self.weight)

    @property
    def inverse_freedom(self) -> float:
        """Mean of 1/nu: 0 for normal noise."""
        return float(self.weight @ (1.0 / self.freedom))


def fit_tail(size: FloatArray, largest: int, *, foreign: bool = False) -> Tail:
    """Fit Student's distribution, the `largest` errors counted but their sizes unknown.

    Parameters
    ----------
    size
        |errors|, sorted, shape (n,).
    largest
        How many may be something else.
    foreign
        Whether they are: then not even their number says anything of the noise.
    """
    bulk = size[: len(size) - largest]
    edge = float(bulk[-1])
    counts, edges = np.histogram(bulk, bins=_BINS, range=(0.0, edge))
    middle = 0.5 * (edges[1:] + edges[:-1])
    freedom = 1.0 / np.array(_INVERSE_FREEDOM)[:, None]
    scale = np.full((len(freedom), 1), 1.4826 * float(np.median(size)) + 1e-300)
    # A reading beyond the edge counts as one on it: far more is unlikely.
    squares = np.append(middle, edge)[None, :] ** 2
    number = np.append(counts, 0 if foreign else largest)[None, :]
    for _ in range(_ROUNDS):
        pull = (freedom + 1.0) / (freedom + squares / scale**2)
        scale = np.sqrt(np.sum(number * pull * squares, axis=1, keepdims=True) / number.sum())
    ratio = middle**2 / scale**2
    density = _log_density(freedom, scale) - 0.5 * (freedom + 1.0) * np.log1p(ratio / freedom)
    likelihood = np.sum(counts * density, axis=1)
    beyond = student_beyond(freedom, edge / scale)[:, 0]
    if foreign:
        likelihood -= len(bulk) * np.log1p(-beyond)
    else:
        likelihood += largest * np.log(beyond)
    weight = np.exp(likelihood - likelihood.max()) * _prior()
    return Tail(freedom[:, 0], scale[:, 0], weight / weight.sum())


def _log_density(freedom: FloatArray, scale: FloatArray) -> FloatArray:
    """Logarithm of Student's density at zero."""
    return np.asarray(
        each(math.lgamma, 0.5 * (freedom + 1.0)) - each(math.lgamma, 0.5 * freedom)
        - 0.5 * np.log(math.pi * freedom) - np.log(scale)
    )  # fmt: skip


def _prior() -> FloatArray:
    """Nine tenths for normal noise, the rest evenly over 1/nu."""
    inverse = np.array(_INVERSE_FREEDOM)
    width = np.gradient(inverse)
    width[0] = 0.0
    return np.asarray(np.append(0.9, 0.1 * width[1:] / width[1:].sum()))
