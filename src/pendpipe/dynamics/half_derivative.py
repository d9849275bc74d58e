"""The half derivative of a velocity, which a fluid's memory of the motion asks for."""

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.polynomial import chebyshev

from pendpipe.arrays import FloatArray
from pendpipe.dynamics.any_law import Motion
from pendpipe.dynamics.chebyshev import analysis, lobatto_nodes

_POINTS: Final = 24
"""Of each Gauss quadrature over a half cycle; all integrands are smooth."""
_SPACING: Final = 0.7
"""Of the logarithms of the rates: 1/sqrt(t) as a sum of exponentials is right to 2e-6."""


def half_derivative(motion: Motion, first: int = 0) -> FloatArray:
    r"""Return the half derivative of the velocity since a turning point.

    .. math:: D^{1/2} v(t) = \frac{1}{\sqrt\pi} \int_0^t \frac{v'(s)}{\sqrt{t - s}}\, ds

    Within a half cycle and over the one before it, the root is taken out by a change of
    variable. What lies further back enters through exponentials of the time, which add up
    to 1/sqrt(t) and pass from one half cycle to the next.

    Parameters
    ----------
    motion
        From rest at the turning point that begins half cycle `first`.
    first
        Number of that half cycle; the velocity counts as zero before.

    Returns
    -------
    FloatArray
        At the nodes, rad/s^(3/2), shape (half cycles, order + 1).
    """
    order = motion.clock.order
    time = motion.time_s[first:] - motion.time_s[first:, :1]
    velocity = motion.velocity[first:]
    u, weight = _gauss()
    nodes = 0.5 + 0.5 * lobatto_nodes(order)
    found = np.zeros_like(motion.angle)
    here = found[first:]

    # Within: u' = u (1 - s^2), du' = 2 u s ds.
    values, slopes = _between(order, "within")
    gap = time[:, 1:, None] - (time @ values).reshape(len(time), order, -1)
    change = (velocity @ slopes).reshape(gap.shape) * (2.0 * nodes[1:, None] * u * weight)
    here[:, 1:] = np.sum(change / np.sqrt(gap), axis=-1)

    # The half cycle before: u' = 1 - s^2.
    values, slopes = _between(order, "before")
    to_go = (time[:, -1:] - time @ values)[:-1, None]
    change = (velocity @ slopes)[:-1, None] * (2.0 * u * weight)
    here[1:] += np.sum(change / np.sqrt(time[1:, :, None] + to_go), axis=-1)
    here /= math.sqrt(math.pi)

    # All before that.
    lasts = time[:, -1]
    whole = float(motion.time_s[-1, -1] - motion.time_s[first, 0])
    # Beyond the readings a half cycle need not be solved.
    shortest = np.min(lasts, where=lasts > 0.0, initial=whole)
    logs = np.arange(-math.log(whole) - 8.0, math.log(18.0 / shortest), _SPACING)
    rates, sizes = np.exp(logs), _SPACING / math.pi * np.exp(0.5 * logs)
    values, slopes = _between(order, "even")
    to_go = lasts[:, None] - time @ values
    gained = np.einsum(
        "np,npk->nk", (velocity @ slopes) * weight, np.exp(-to_go[:, :, None] * rates)
    )
    fades = np.exp(-lasts[:, None] * rates)
    memory = np.zeros_like(rates)
    for row in range(2, len(time)):
        memory = fades[row - 1] * (memory + gained[row - 2])
        here[row] += np.exp(-time[row][:, None] * rates) @ (sizes * memory)
    return found


@lru_cache
def _gauss() -> tuple[FloatArray, FloatArray]:
    """Points and weights on [0, 1]."""
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    return np.asarray(0.5 + 0.5 * points), np.asarray(0.5 * weights)


@lru_cache
def _between(order: int, where: str) -> tuple[FloatArray, FloatArray]:
    """Matrices that turn values at the nodes into values and slopes by u at the quadrature's."""
    u, _ = _gauss()
    ends = lobatto_nodes(order)
    nodes = 0.5 + 0.5 * ends
    at = {
        "within": (nodes[1:, None] * (1.0 - u * u)).ravel(),
        "before": 1.0 - u * u,
        "even": u,
    }[where]
    coefficients = analysis(ends)
    slopes = chebyshev.chebder(coefficients, axis=0)
    z = 2.0 * at - 1.0
    return (
        np.asarray(chebyshev.chebvander(z, order) @ coefficients).T,
        2.0 * np.asarray(chebyshev.chebvander(z, order - 1) @ slopes).T,
    )
