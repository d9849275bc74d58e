"""Derivatives of a panel of the phase clock, as plain quadratures.

Differentiating the phase clock's equation for s = ln r with respect to any parameter p gives a
linear equation for sigma = ds/dp at fixed phase, solved by its integrating factor,

    dsigma/dpsi = F_s sigma + F_p,        F = -nu sin(psi)/(1 - nu cos(psi)),

and then dtau/dp by one more integral. Turning points stay at psi = 0 and pi whatever p is, so
there is no jump in the friction to differentiate through.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendpipe.dynamics.chebyshev import INTEGRATION_T
from pendpipe.dynamics.layout import DEGREE, NODE_COUNT
from pendpipe.dynamics.panel import (
    BY_CENTRE,
    BY_H,
    BY_Q,
    BY_RADIUS,
    COLUMN,
    COS,
    FORCING,
    GROWTH,
    LOSS,
    SCRATCH,
    SIN,
    SLIP,
    kernel,
    multiply,
)

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray


@kernel
def _differentiate_nu(node: FloatArray, shape: FloatArray, radius: float) -> None:
    """Write the derivatives of nu by ln r, m, h and q (by g it is 2 sin psi)."""
    m, h, q = shape[0], shape[1], shape[2]
    for j in range(NODE_COUNT):
        cos = node[COS + j]
        r = radius * (1.0 + node[LOSS + j])
        x = m + r * cos
        distance = math.sqrt(abs(r * r + m * (2.0 * r * cos + m)))
        inverse = 1.0 / (distance + m)
        # Where x and u vanish together R has no derivative; its direction is then of no weight.
        direction = 1.0 / distance if distance > 0.0 else 0.0
        lever = r + 2.0 * m * cos
        stiffness = h * inverse + q
        drop = lever * h * inverse * inverse
        node[BY_RADIUS + j] = r * (stiffness - drop * (r + m * cos) * direction)
        node[BY_CENTRE + j] = 2.0 * cos * stiffness - drop * (1.0 + x * direction)
        node[BY_H + j] = lever * inverse
        node[BY_Q + j] = lever


@kernel
def _grow(node: FloatArray, half_width: float) -> None:
    """Write the integrating factor exp(integral of F_s)."""
    for j in range(NODE_COUNT):
        node[SCRATCH + j] = -node[SIN + j] * node[SLIP + j] ** 2 * node[BY_RADIUS + j]
    multiply(INTEGRATION_T, node, SCRATCH, node, GROWTH)
    for j in range(NODE_COUNT):
        node[GROWTH + j] = math.exp(half_width * node[GROWTH + j])


@kernel
def sensitivities(
    node: FloatArray,
    shape: FloatArray,
    directions: FloatArray,
    radius: float,
    half_width: float,
    sigma: FloatArray,
    shift: FloatArray,
    columns: FloatArray,
) -> None:
    """Differentiate a solved panel, at fixed time, by the amplitude and along `directions`.

    Parameters
    ----------
    node, shape, radius, half_width
        As in `panel.solve`, after it.
    directions
        A row a parameter: the derivatives of m, h, q and g by it.
    sigma, shift
        d ln r/dp and dtau/dp at fixed phase, at the start of the panel; on return, at its end.
        Entry 0 is the amplitude at the start of the half cycle; then the directions.
    columns
        Receives dx/dp at fixed time at the nodes, one row a parameter.
    """
    _differentiate_nu(node, shape, radius)
    _grow(node, half_width)
    for c in range(sigma.size):
        dm, dh, dq, dg = 0.0, 0.0, 0.0, 0.0
        if c > 0:
            dm, dh = directions[c - 1, 0], directions[c - 1, 1]
            dq, dg = directions[c - 1, 2], directions[c - 1, 3]
        column = columns[c]
        for j in range(NODE_COUNT):
            node[FORCING + j] = (
                dm * node[BY_CENTRE + j]
                + dh * node[BY_H + j]
                + dq * node[BY_Q + j]
                + 2.0 * dg * node[SIN + j]
            )
            node[SCRATCH + j] = (
                -node[SIN + j] * node[SLIP + j] ** 2 * node[FORCING + j] / node[GROWTH + j]
            )
        multiply(INTEGRATION_T, node, SCRATCH, node, COLUMN)
        for j in range(NODE_COUNT):
            column[j] = node[GROWTH + j] * (sigma[c] + half_width * node[COLUMN + j])
            node[SCRATCH + j] = (
                node[COS + j]
                * node[SLIP + j] ** 2
                * (node[BY_RADIUS + j] * column[j] + node[FORCING + j])
            )
        multiply(INTEGRATION_T, node, SCRATCH, node, COLUMN)
        sigma_end = column[DEGREE]
        for j in range(NODE_COUNT):
            r = radius * (1.0 + node[LOSS + j])
            delay = shift[c] + half_width * node[COLUMN + j]
            column[j] = dm + r * (node[COS + j] * column[j] + node[SIN + j] * delay)
        sigma[c] = sigma_end
        shift[c] += half_width * node[COLUMN + DEGREE]
