"""Derivatives of a panel of the phase clock, as plain quadratures.

Differentiating the phase clock's equation for s = ln r with respect to any parameter p gives a
linear equation for sigma = ds/dp at fixed phase, solved by its integrating factor,

    dsigma/dpsi = F_s sigma + F_p,        F = -nu sin(psi)/(1 - nu cos(psi)),

and then dtau/dp by one more integral (both taken over w, see `panel.py`). Turning points stay
at psi = 0 and pi whatever p is, so there is no jump in the friction to differentiate through.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pendpipe.dynamics.chebyshev import INTEGRATION_T
from pendpipe.dynamics.kernel import kernel
from pendpipe.dynamics.layout import DEGREE, NODE_COUNT
from pendpipe.dynamics.panel import (
    BEND,
    BY_CENTRE,
    BY_H,
    BY_Q,
    BY_RADIUS,
    COLUMN,
    COS,
    CURVATURE,
    FORCING,
    GROWTH,
    LAG,
    LEAN,
    LOSS,
    PULL,
    SCRATCH,
    SIN,
    SLIP,
    TILT,
    VISCOUS,
    WEIGHT,
    curve,
    multiply,
)

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.layout import Work


@kernel
def _differentiate(node: FloatArray, shape: FloatArray, radius: float) -> None:
    """Write the derivatives of nu by ln r, m, h and q (by g it is 2 sin(psi)/C), and their weights.

    PULL is the weight of nu in dln r/dw and LAG in dtau/dw, TILT that of s in dtau/dw.
    """
    m, h, q = shape[0], shape[1], shape[2]
    for j in range(NODE_COUNT):
        cos = node[COS + j]
        r = radius * (1.0 + node[LOSS + j])
        distance = math.sqrt(abs(r * r + m * (2.0 * r * cos + m)))
        inverse = 1.0 / (distance + m)
        # Where s and u vanish together R has no derivative; its direction is then of no weight.
        direction = 1.0 / distance if distance > 0.0 else 0.0
        lever = r + 2.0 * m * cos
        stiffness = h * inverse + q
        drop = lever * h * inverse * inverse
        bend, weight = node[BEND + j], node[WEIGHT + j] * node[SLIP + j] ** 2
        node[BY_RADIUS + j] = r * (stiffness - drop * (r + m * cos) * direction) * bend
        node[BY_CENTRE + j] = 2.0 * cos * stiffness - drop * (1.0 + (m + r * cos) * direction)
        node[BY_CENTRE + j] *= bend
        node[BY_H + j] = lever * inverse * bend
        node[BY_Q + j] = lever * bend
        node[PULL + j] = -weight * node[SIN + j]
        node[LAG + j] = weight * node[COS + j] * bend
        node[TILT + j] = 0.0
    if shape[CURVATURE] > 0.0:
        _differentiate_sine(node, shape, radius)


@kernel
def _differentiate_sine(node: FloatArray, shape: FloatArray, radius: float) -> None:
    """Add what comes of 1/C and of what the sine adds to C nu."""
    m, h, q, g = shape[0], shape[1], shape[2], shape[VISCOUS]
    centre = curve(shape, m)
    for j in range(NODE_COUNT):
        cos, bend = node[COS + j], node[BEND + j]
        r = radius * (1.0 + node[LOSS + j])
        s = m + r * cos
        distance = math.sqrt(abs(r * r + m * (2.0 * r * cos + m)))
        stiffness = (r + 2.0 * m * cos) * (h / (distance + m) + q)
        nu = (stiffness + 2.0 * g * node[SIN + j] + node[LEAN + j]) * bend
        # d ln(1/C)/ds, and the same of the sum C + C(m) in the denominator of LEAN
        steeper = 0.25 * s * bend * bend
        whole = 1.0 / (1.0 / bend + centre)
        by_s = 0.25 * s * bend * whole
        by_m = 0.25 * m / centre * whole
        scale = 0.25 * cos * whole * bend
        node[BY_RADIUS + j] += r * cos * (scale * m * (1.0 + (s + m) * by_s) + nu * steeper)
        node[BY_CENTRE + j] += scale * (s + m + m * (2.0 + (s + m) * (by_s + by_m))) + nu * steeper
        node[TILT + j] = node[WEIGHT + j] * node[SLIP + j] * bend * steeper


@kernel
def _grow(node: FloatArray, half_width: float) -> None:
    """Write the integrating factor exp(integral of F_s)."""
    for j in range(NODE_COUNT):
        node[SCRATCH + j] = node[PULL + j] * node[BY_RADIUS + j]
    multiply(INTEGRATION_T, node, SCRATCH, node, GROWTH)
    for j in range(NODE_COUNT):
        node[GROWTH + j] = math.exp(half_width * node[GROWTH + j])


@kernel
def sensitivities(work: Work, node: FloatArray, radius: float, half_width: float) -> None:
    """Differentiate a solved panel, at fixed time, by the amplitude and along the directions.

    `work.sigma` and `work.shift` hold d ln r/dp and dtau/dp at fixed phase at the start of the
    panel, and on return at its end; entry 0 is by the amplitude at the start of the half cycle,
    then come the directions. `work.columns` receives dx/dp at fixed time at the nodes, a row each.

    Parameters
    ----------
    work
        The engine's arrays.
    node, radius, half_width
        As in `panel.solve`, after it.
    """
    shape, directions = work.shape, work.directions
    sigma, shift, columns = work.sigma, work.shift, work.columns
    _differentiate(node, shape, radius)
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
                + 2.0 * dg * node[SIN + j] * node[BEND + j]
            )
            node[SCRATCH + j] = node[PULL + j] * node[FORCING + j] / node[GROWTH + j]
        multiply(INTEGRATION_T, node, SCRATCH, node, COLUMN)
        for j in range(NODE_COUNT):
            column[j] = node[GROWTH + j] * (sigma[c] + half_width * node[COLUMN + j])
            r = radius * (1.0 + node[LOSS + j])
            moved = dm + r * node[COS + j] * column[j]  # ds/dp at fixed phase
            node[SCRATCH + j] = (
                node[LAG + j] * (node[BY_RADIUS + j] * column[j] + node[FORCING + j])
                + node[TILT + j] * moved
            )
        multiply(INTEGRATION_T, node, SCRATCH, node, COLUMN)
        sigma_end = column[DEGREE]
        for j in range(NODE_COUNT):
            r = radius * (1.0 + node[LOSS + j])
            delay = shift[c] + half_width * node[COLUMN + j]
            moved = dm + r * node[COS + j] * column[j]
            column[j] = moved * node[BEND + j] + r * node[SIN + j] * delay
        sigma[c] = sigma_end
        shift[c] += half_width * node[COLUMN + DEGREE]
