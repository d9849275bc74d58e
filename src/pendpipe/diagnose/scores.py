"""All effects' scores at once: one inner product each, projected and whitened.

Along the fitted motion every effect has a sensitivity: what a little of it would do to the
readings. What the model's own parameters could do as well is projected off; the score is the
inner product of the rest, at unit length, with the whitened residual: locally the most
powerful test there is. Scans over an effect's shape are many such columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.freed import FreedParameter
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit, pulled
from pendpipe.effects import Effect
from pendpipe.effects.curves import Curve
from pendpipe.effects.responses import responses

_SEEN = 1e-4
"""Part of a sensitivity that must be left by the projection for it to be told at all."""

_STANDS_OUT = 4.0
"""Standard deviations by which a mixture of a curve's hats must be seen to be kept."""


Piece = tuple[Effect, tuple[float, ...], FloatArray]
"""An effect, a shape of it, and what its sizes do to the readings, shape (sizes, n)."""
_AT_ONCE = 32


class Candidate(NamedTuple):
    """An effect of one shape, and where its columns stand."""

    effect: Effect
    shape: tuple[float, ...]
    first: int
    width: int


@dataclass(frozen=True)
class Bank:
    """Unit columns of all candidates, orthogonal to the model's tangent space.

    Parameters
    ----------
    basis
        Orthonormal, of the model's tangent space, shape (n + 1, p).
    columns
        Shape (n + 1, k), float32: a candidate's columns are orthonormal among themselves.
    candidates
        Whose they are.
    lengths
        Length of each candidate's first column for a unit of its size: how its size is read
        off its score, shape (candidates,).
    """

    basis: FloatArray
    columns: NDArray[np.float32]
    candidates: tuple[Candidate, ...]
    lengths: FloatArray

    def scores(self, residual: FloatArray) -> FloatArray:
        """Sum of squares of each candidate's inner products; shape (candidates, ...).

        A size that can't be negative (a friction's) scores with its own sign only.
        """
        products = self.columns.T @ residual.astype(np.float32)
        signed = [c.first for c in self.candidates if c.effect.one_sided]
        products[signed] = np.maximum(products[signed], 0.0)
        squares = products.astype(np.float64) ** 2
        starts = [candidate.first for candidate in self.candidates]
        return np.asarray(np.add.reduceat(squares, starts, axis=0))

    def rows(self) -> dict[str, list[int]]:
        """Indices of the candidates of each effect, by its key."""
        found: dict[str, list[int]] = {}
        for index, candidate in enumerate(self.candidates):
            found.setdefault(candidate.effect.key, []).append(index)
        return found

    @property
    def freedom(self) -> FloatArray:
        """Degrees of freedom of each candidate."""
        return np.array([candidate.width for candidate in self.candidates], dtype=np.float64)


def tangent_basis(fit: Fit) -> FloatArray:
    """Orthonormal basis of what the fitted values can do.

    Those at a bound are included, unless the readings pull them far beyond it: then they
    are known.
    """
    known = pulled(fit)
    part = fit.jacobian[:, [index for index in fit.free if index not in known]]
    scale = np.linalg.norm(part, axis=0)
    scale[scale == 0.0] = 1.0
    left, sizes, _ = np.linalg.svd(part / scale, full_matrices=False)
    return np.asarray(left[:, sizes > 1e-9 * sizes[0]])


def build_bank(fit: Fit, noise: Noise, effects: Sequence[Effect]) -> Bank:
    """Work out the columns of all effects along a fitted motion."""
    basis = tangent_basis(fit)
    pieces: list[Piece] = []
    pendulum = fit.model.pendulum(fit.value)
    for effect in effects:
        if isinstance(effect, FreedParameter):
            continue
        small = effect.small(fit.at.span)
        shapes = effect.shapes(fit.at.span)
        changes = [_sizes(effect, shape, k, small) for shape in shapes for k in range(effect.sizes)]
        columns = responses(effect, changes, fit.at, pendulum) / small
        columns[~np.all(np.isfinite(columns), axis=1)] = 0.0
        for row, shape in enumerate(shapes):
            own = columns[row * effect.sizes : (row + 1) * effect.sizes]
            pieces.append((effect, tuple(float(number) for number in shape), own))
    count = sum(len(columns) for _, _, columns in pieces)
    known = [effect for effect in effects if isinstance(effect, FreedParameter)]
    # Columns that stand together in memory: transforms and products are far quicker so.
    tall = np.zeros((len(fit.jacobian), count + len(known)), order="F")
    before = np.zeros(tall.shape[1])
    place = 0
    for _, _, columns in pieces:
        part = slice(place, place + len(columns))
        tall[:-1, part] = noise.whiten(columns.T)
        before[part] = np.linalg.norm(tall[:, part], axis=0)
        place = part.stop
    for effect in known:
        tall[:, place] = fit.jacobian[:, effect.index]
        before[place] = np.linalg.norm(tall[:, place])
        pieces.append((effect, (), tall[:, [place]].T))
        place += 1
    for first in range(0, place, _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        for _ in range(2):
            tall[:, part] -= basis @ (basis.T @ tall[:, part])
    return _gathered(pieces, tall, before, basis)


def _sizes(
    effect: Effect, shape: Sequence[float], index: int, small: float
) -> tuple[FloatArray, FloatArray]:
    low = np.concatenate([np.zeros(effect.sizes), np.asarray(shape, dtype=np.float64)])
    high = low.copy()
    high[index] = small
    return low, high


def _gathered(
    pieces: list[Piece], tall: FloatArray, before: FloatArray, basis: FloatArray,
) -> Bank:  # fmt: skip
    """Keep what can be told, at unit length."""
    stacked = np.zeros(tall.shape, dtype=np.float32, order="F")
    candidates, lengths, place, found = [], [], 0, 0
    for effect, shape, columns in pieces:
        part = tall[:, place : place + len(columns)]
        whole = before[place : place + len(columns)]
        place += len(columns)
        if isinstance(effect, Curve):
            effect, part = _visible(effect, part)
            if not part.shape[1]:
                continue
            whole = np.zeros(part.shape[1])
        length = np.linalg.norm(part, axis=0)
        if not np.all(length > _SEEN * np.maximum(whole, 1e-300)) or not np.all(length > 0.0):
            continue
        unit = np.linalg.qr(part)[0] if part.shape[1] > 1 else part / length
        stacked[:, found : found + unit.shape[1]] = unit
        candidates.append(Candidate(effect, shape, found, unit.shape[1]))
        lengths.append(float(length[0]))
        found += unit.shape[1]
    return Bank(basis, stacked[:, :found], tuple(candidates), np.array(lengths))


def _visible(curve: Curve, part: FloatArray) -> tuple[Curve, FloatArray]:
    """Keep the mixtures of a curve's hats that would stand out if they were of reasonable size."""
    _, lengths, mixtures = np.linalg.svd(part, full_matrices=False)
    mixing = mixtures[lengths > _STANDS_OUT].T
    return curve.reduced(mixing), part @ mixing


def local_p_values(scores: FloatArray, freedom: FloatArray) -> FloatArray:
    """How often chance alone does better, of each candidate by itself."""
    from scipy.special import gammaincc

    shaped = freedom.reshape(-1, *([1] * (scores.ndim - 1)))
    return np.asarray(gammaincc(0.5 * shaped, 0.5 * scores))
