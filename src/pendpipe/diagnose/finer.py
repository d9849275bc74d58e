"""A closer look about one row of a scan, where a fit alone would get stuck beside it."""

from __future__ import annotations

import numpy as np

from pendpipe.diagnose.detect import Lead
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.scores import tangent_basis
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
    small = effect.small(span)
    changes = [(np.array([0.0, *shape]), np.array([small, *shape])) for shape in shapes]
    pendulum = base.model.pendulum(base.value)
    raw = responses(effect, changes, base.at, pendulum).T / small
    columns = np.zeros((len(raw) + 1, len(shapes)))
    columns[:-1] = noise.whiten(raw)
    basis = tangent_basis(base)
    columns -= basis @ (basis.T @ columns)
    length = np.linalg.norm(columns, axis=0)
    length[length == 0.0] = np.inf
    return shapes[int(np.argmax(np.abs(columns.T @ base.residual) / length))]
