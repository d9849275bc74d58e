"""Score all effects at once: one inner product each, whitened and projected.

Every effect has a derivative of the readings by its size along the fitted motion. The part that
the model's own parameters can reproduce is projected out; the score is the inner product of the
rest, at unit length, with the whitened residual: the locally most powerful test. A scan over an
effect's shape is many such columns.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc, chdtrc

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.blocks import Blocks, blocks_of
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit, pulled
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.effects import Effect
from pendpipe.effects.curves import Curve
from pendpipe.effects.effect import Span
from pendpipe.effects.model import responses

_VISIBLE = 1e-4
"""Part of a derivative that must remain after the projection for the effect to be visible."""

_RESOLVED_SD = 4.0
"""Standard deviations at which a coefficient of a curve must be visible to be kept."""


_COLUMNS_AT_ONCE = 32
_NUMBERS_AT_ONCE = 1 << 22
_KNOWN = 1e-6
"""Variance of ln S below which it is known."""


class Candidate(NamedTuple):
    """An effect of one shape, and the position of its columns."""

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
        Orthonormal, of the model's tangent space, shape (m + 1, p).
    columns
        Shape (m + 1, k), float32: a candidate's columns are orthonormal among themselves.
    candidates
        The effects and shapes to which the columns belong.
    log_scale_variance
        Variance of the logarithm of the noise that each candidate meets, shape (candidates,).
    blocks
        Of the fit whose m whitened numbers are compared; None where they are given as such.
    """

    basis: FloatArray
    columns: NDArray[np.float32]
    candidates: tuple[Candidate, ...]
    log_scale_variance: FloatArray
    blocks: Blocks | None = None

    def compared(self, residual: FloatArray) -> FloatArray:
        """Return what is compared of a whitened residual, less what the model can reproduce."""
        numbers = residual if self.blocks is None else self.blocks.numbers_of(residual)
        return np.asarray(numbers - self.basis @ (self.basis.T @ numbers))

    def scores(self, residual: FloatArray) -> FloatArray:
        """Return the sum of squares of each candidate's inner products; shape (candidates, ...).

        A size that can't be negative (a friction) scores with a positive sign only.
        """
        products = self.columns.T @ residual.astype(np.float32)
        signed = [c.first for c in self.candidates if c.effect.one_sided]
        products[signed] = np.maximum(products[signed], 0.0)
        squares = products.astype(np.float64) ** 2
        starts = np.array([candidate.first for candidate in self.candidates], dtype=np.intp)
        return np.asarray(np.add.reduceat(squares, starts, axis=0))

    def p_values(self, scores: FloatArray) -> FloatArray:
        """Return the probability that chance alone does better, for each candidate by itself."""
        return local_p_values(scores, self.freedom, self.log_scale_variance)

    def rows(self) -> dict[str, list[int]]:
        """Return the indices of the candidates of each effect, by its key."""
        found: dict[str, list[int]] = {}
        for index, candidate in enumerate(self.candidates):
            found.setdefault(candidate.effect.key, []).append(index)
        return found

    @property
    def freedom(self) -> FloatArray:
        """Degrees of freedom of each candidate."""
        return np.array([candidate.width for candidate in self.candidates], dtype=np.float64)


def tangent_basis(fit: Fit) -> FloatArray:
    """Return an orthonormal basis of the derivatives by the fitted values.

    Values at a bound are included, unless the readings pull them far beyond it.
    """
    known = pulled(fit)
    return _span(fit.jacobian[:, [index for index in fit.free if index not in known]])


def _span(part: FloatArray) -> FloatArray:
    """Return an orthonormal basis of the space that columns span."""
    scale = np.linalg.norm(part, axis=0)
    scale[scale == 0.0] = 1.0
    left, small = np.linalg.qr(part / scale)
    mixing, sizes, _ = np.linalg.svd(small)
    return np.asarray(left @ mixing[:, sizes > 1e-9 * sizes[0]])


def build_bank(fit: Fit, noise: Noise, effects: Sequence[Effect]) -> Bank:
    """Compute the columns of all effects along a fitted motion.

    A few shapes at a time, stored in single precision, and of a long record in blocks.
    """
    blocks = blocks_of(fit, noise)
    fit, noise = blocks.fit, blocks.noise
    shapes = [_shapes(effect, fit.at.span) for effect in effects]
    most = sum(max(e.sizes, 1) * len(rows) for e, rows in zip(effects, shapes, strict=True))
    basis, filled = tangent_basis(fit), 0
    columns = np.empty((most, len(basis)), dtype=np.float32)
    candidates, unsure = [], [np.zeros(0)]
    at_once = max(min(_COLUMNS_AT_ONCE, _NUMBERS_AT_ONCE // len(basis)), 1)
    for effect, rows in zip(effects, shapes, strict=True):
        some = max(at_once // max(effect.sizes, 1), 1)
        if isinstance(effect, Curve):
            some = len(rows)
        for first in range(0, len(rows), some):
            part = rows[first : first + some]
            seen, own, units = _beside(basis, effect, part, whitened(fit, noise, effect, part))
            if not own:
                continue
            flat = units.reshape(-1, len(basis))
            columns[filled : filled + len(flat)] = flat
            each = noise.log_scale_variance(flat)
            unsure.append(each.reshape(units.shape[:2]).mean(axis=1))
            for shape in own:
                candidates.append(Candidate(seen, shape, filled, units.shape[1]))
                filled += units.shape[1]
    return Bank(basis, columns[:filled].T, tuple(candidates), np.concatenate(unsure), blocks)


def _beside(
    basis: FloatArray,
    effect: Effect,
    shapes: Sequence[tuple[float, ...]],
    columns: FloatArray,
) -> tuple[Effect, list[tuple[float, ...]], NDArray[Any]]:
    """Project out the model's tangent space, and return what is seen of each shape.

    Returns
    -------
    effect
        A curve with the combinations of its basis functions that the record resolves; else as it
        was.
    shapes, units
        Those of which something is seen, and their orthonormal columns, shape (shapes, width,
        n + 1).
    """
    least = _VISIBLE * np.linalg.norm(columns, axis=1)
    left = columns
    left -= (columns @ basis) @ basis.T
    if isinstance(effect, Curve):
        effect, left = _visible(effect, left)
        least = np.zeros(len(left))
    rows, lengths = _orthonormal(left.reshape(len(shapes), -1, len(basis)))
    seen = np.all(lengths > least.reshape(lengths.shape), axis=1) & (lengths.size > 0)
    return effect, [shapes[k] for k in np.flatnonzero(seen).tolist()], rows[seen]


def _orthonormal(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Make each shape's columns orthonormal in their order (Gram and Schmidt), in place.

    Returns
    -------
    units, lengths
        Shape (shapes, width, n + 1), and what of each column is left beside those before it,
        shape (shapes, width).
    """
    lengths = np.zeros(columns.shape[:2])
    for place in range(columns.shape[1]):
        own, before = columns[:, place], columns[:, :place]
        # Twice is enough (Kahan).
        for _ in range(2 if place else 0):
            own -= np.matmul(np.matmul(before, own[..., None])[:, None, :, 0], before)[:, 0]
        lengths[:, place] = np.linalg.norm(own, axis=1)
        own /= np.where(lengths[:, place] > 0.0, lengths[:, place], 1.0)[:, None]
    return columns, lengths


def _shapes(effect: Effect, span: Span) -> list[tuple[float, ...]]:
    if isinstance(effect, ReleasedParameter):
        return [()]
    return [tuple(float(number) for number in row) for row in effect.shapes(span)]


def whitened(
    fit: Fit, noise: Noise, effect: Effect, shapes: Sequence[Sequence[float]]
) -> FloatArray:
    """Derivatives of the whitened readings by each size of each shape, (columns, n + 1)."""
    if isinstance(effect, ReleasedParameter):
        return effect.sensitivity(fit)[None]
    small = effect.small(fit.at.span)
    changes = [_sizes(effect, shape, k, small) for shape in shapes for k in range(effect.sizes)]
    raw = responses(effect, changes, fit.at, fit.model.pendulum(fit.value))
    raw /= small
    raw[~np.isfinite(raw.sum(axis=1))] = 0.0
    rows = np.zeros((len(raw), len(fit.jacobian)))
    rows[:, :-1] = noise.whiten(raw.T).T
    return rows


def _sizes(
    effect: Effect, shape: Sequence[float], index: int, small: float
) -> tuple[FloatArray, FloatArray]:
    low = np.concatenate([np.zeros(effect.sizes), np.asarray(shape, dtype=np.float64)])
    high = low.copy()
    high[index] = small
    return low, high


def _visible(curve: Curve, part: FloatArray) -> tuple[Curve, FloatArray]:
    """Keep the combinations of a curve's basis functions that the record resolves."""
    mixtures, lengths, _ = np.linalg.svd(np.asarray(np.linalg.qr(part.T, mode="r")).T)
    mixing = mixtures[:, lengths > _RESOLVED_SD]
    return curve.reduced(mixing), mixing.T @ part


def local_p_values(
    scores: FloatArray, freedom: FloatArray, log_scale_variance: FloatArray | None = None
) -> FloatArray:
    """Return the probability that chance alone does better, for each candidate by itself.

    Where the variance of the noise is uncertain, by v in its logarithm, as if it were estimated
    from 2/v squares: by Fisher's distribution instead of chi^2.
    """
    found = np.asarray(chdtrc(freedom, np.maximum(scores, 0.0).T).T)
    if log_scale_variance is not None:
        unsure = log_scale_variance > _KNOWN
        squares = 2.0 / log_scale_variance[unsure]
        share = squares / (squares + scores[unsure])
        found[unsure] = betainc(0.5 * squares, 0.5 * freedom[unsure], share)
    return found


def finer_shape(
    base: Fit, noise: Noise, effect: Effect, shape: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the shape of highest score among those near a scan's best (`Effect.finer`).

    A fit alone would end beside it: the response to a knock, say, depends on its phase, so that
    chi^2 has a minimum in each half cycle, while the scan's shapes are farther apart.
    """
    shapes = [tuple(row) for row in effect.finer(base.at.span, shape)] if shape else []
    if not shapes:
        return shape
    shapes.append(shape)
    scores, _ = scores_and_lengths(base, noise, effect, shapes)
    return shapes[int(np.argmax(np.abs(scores)))]


def scores_and_lengths(
    base: Fit, noise: Noise, effect: Effect, shapes: Sequence[Sequence[float]]
) -> tuple[FloatArray, FloatArray]:
    """Score shapes of an effect's first size on a fit's residual.

    Returns
    -------
    scores, lengths
        Inner products of the residual with the derivative by the size, projected and of unit
        length, and the lengths of that (inf where nothing remains); shape (shapes,). The size is
        score/length, and lowers chi^2 by score^2.
    """
    columns = whitened(base, noise, effect, shapes)[:: effect.sizes]
    basis = tangent_basis(base)
    columns -= (columns @ basis) @ basis.T
    lengths = np.linalg.norm(columns, axis=1)
    lengths[lengths == 0.0] = np.inf
    return columns @ base.residual / lengths, lengths
