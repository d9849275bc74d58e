"""A closer look about one row of a scan, where a fit alone would get stuck beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.detect import Lead
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.scores import tangent_basis
from pendpipe.effects import Effect
from pendpipe.effects.responses import responses


def finer_shape(base: Fit, noise: Noise, lead: Lead) -> tuple[float, ...]:
    """Return the shape of highest score among those about a lead's (`Effect.finer`).

    The effect of a knock, say, depends on the phase at which it comes: chi^2 has a minimum
    in each half cycle, and the scan's rows are farther apart.
    """
    effect, span = lead.effect, base.at.span
    shapes = [tuple(row) for row in effect.finer(span, lead.shape)] if lead.shape else []
    if not shapes:
        return lead.shape
    shapes.append(lead.shape)
    products, length = products_and_lengths(base, noise, effect, shapes)
    length[length == 0.0] = np.inf
    return shapes[int(np.argmax(np.abs(products) / length))]


def products_and_lengths(
    base: Fit, noise: Noise, effect: Effect, shapes: Sequence[Sequence[float]]
) -> tuple[FloatArray, FloatArray]:
    """Score shapes of an effect's first size on what a fit leaves.

    Returns
    -------
    products, lengths
        Inner products with the residual of what a unit of the size does beyond the model's own
        values, and the lengths of that; shape (shapes,). The size is product/length^2, and
        takes (product/length)^2 off chi^2.
    """
    span = base.at.span
    small = effect.small(span)
    sizes = np.zeros(effect.sizes)
    changed = sizes.copy()
    changed[0] = small
    changes = [(np.append(sizes, shape), np.append(changed, shape)) for shape in shapes]
    pendulum = base.model.pendulum(base.value)
    raw = responses(effect, changes, base.at, pendulum).T / small
    columns = np.zeros((len(raw) + 1, len(shapes)))
    columns[:-1] = noise.whiten(raw)
    basis = tangent_basis(base)
    columns -= basis @ (basis.T @ columns)
    return columns.T @ base.residual, np.linalg.norm(columns, axis=0)
