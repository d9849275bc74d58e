"""Derivatives of whitened readings by the sizes of effects, and their projection.

The part that a model's own parameters can reproduce is projected out; the score is the inner
product of the rest, at unit length, with the whitened residual: the locally most powerful test.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc, chdtrc

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.refine import Fit, pulled, span_of
from pendpipe.diagnosis.released_parameters import ReleasedParameter
from pendpipe.effects import Effect
from pendpipe.effects.model import responses

if TYPE_CHECKING:
    from pendpipe.diagnosis.noise import Noise

_KNOWN: Final = 1e-6
"""Variance of ln S below which it is known."""


def tangent_basis(fit: Fit) -> FloatArray:
    """Return an orthonormal basis of the derivatives by the fitted values.

    Values at a bound are included, unless the readings pull them far beyond it.
    """
    known = pulled(fit)
    return span_of(fit.jacobian[:, [index for index in fit.free if index not in known]])


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


def local_p_values(
    scores: FloatArray, freedom: NDArray[Any], log_scale_variance: FloatArray | None = None
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
