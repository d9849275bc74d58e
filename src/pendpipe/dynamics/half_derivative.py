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
_ROWS_AT_ONCE: Final = 256
"""Half cycles whose integrands are held at once: 2 MB."""
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
    every = motion.clock.every
    if every > 1:
        # The release is not among the cycles that are there.
        first = 0
    found = np.zeros_like(motion.angle)
    here = found[first:]
    time = motion.time_s[first:] - motion.time_s[first:, :1]
    lasts, velocity = time[:, -1], motion.velocity[first:]
    whole = float(motion.time_s[-1, -1] - motion.time_s[first, 0])
    # Beyond the readings a half cycle need not be solved.
    shortest = np.min(lasts, where=lasts > 0.0, initial=whole)
    logs = np.arange(-math.log(whole) - 8.0, math.log(18.0 / shortest), _SPACING)
    rates, sizes = np.exp(logs), _SPACING / math.pi * np.exp(0.5 * logs)
    numbers = np.arange(len(time))
    # The half cycle before; of thinned cycles that of the same cycle, as much larger.
    before = numbers - 1 if every == 1 else numbers ^ 1
    velocity_before = velocity[before]
    if every > 1:
        size = motion.amplitude
        velocity_before[::2] *= (size[::2, 0] / size[1::2, -1])[:, None]
    gained = np.empty((len(time), len(rates)))
    for start in range(0, len(time), _ROWS_AT_ONCE):
        rows = slice(start, start + _ROWS_AT_ONCE)
        here[rows] = _recent(time[rows], velocity[rows], time[before[rows]], velocity_before[rows])
        gained[rows] = _gained(time[rows], velocity[rows], rates)
    if every == 1:
        here[0] = _within(time[:1], velocity[:1])
    memory = _carried(np.exp(-lasts[:, None] * rates), gained, every)
    for start in range(0, len(time), _ROWS_AT_ONCE):
        rows = slice(start, start + _ROWS_AT_ONCE)
        here[rows] += np.einsum(
            "npk,nk->np", np.exp(-time[rows][:, :, None] * rates), sizes * memory[rows]
        )
    return found


def _within(time: FloatArray, velocity: FloatArray) -> FloatArray:
    """What comes from the half cycle itself: u' = u (1 - s^2), du' = 2 u s ds."""
    order = time.shape[1] - 1
    u, weight = _gauss()
    nodes = 0.5 + 0.5 * lobatto_nodes(order)
    values, slopes = _between(order, "within")
    gap = time[:, 1:, None] - (time @ values).reshape(len(time), order, -1)
    change = (velocity @ slopes).reshape(gap.shape) * (2.0 * nodes[1:, None] * u * weight)
    found = np.zeros_like(time)
    found[:, 1:] = np.sum(change / np.sqrt(gap), axis=-1) / math.sqrt(math.pi)
    return found


def _recent(
    time: FloatArray, velocity: FloatArray, time_before: FloatArray, velocity_before: FloatArray
) -> FloatArray:
    """What comes from each half cycle and the one before it: there u' = 1 - s^2."""
    u, weight = _gauss()
    values, slopes = _between(time.shape[1] - 1, "before")
    to_go = (time_before[:, -1:] - time_before @ values)[:, None]
    change = (velocity_before @ slopes)[:, None] * (2.0 * u * weight)
    recent = np.sum(change / np.sqrt(time[:, :, None] + to_go), axis=-1)
    return np.asarray(_within(time, velocity) + recent / math.sqrt(math.pi))


def _gained(time: FloatArray, velocity: FloatArray, rates: FloatArray) -> FloatArray:
    """What each half cycle adds to the exponentials, at its end."""
    _, weight = _gauss()
    values, slopes = _between(time.shape[1] - 1, "even")
    to_go = time[:, -1:] - time @ values
    fading = np.exp(-to_go[:, :, None] * rates)
    return np.asarray(np.einsum("np,npk->nk", (velocity @ slopes) * weight, fading))


def _carried(fades: FloatArray, gained: FloatArray, every: int) -> FloatArray:
    """What the exponentials hold, as each half cycle begins, of all before the one before it."""
    memory = np.zeros_like(fades)
    if every == 1:
        for row in range(2, len(fades)):
            memory[row] = fades[row - 1] * (memory[row - 1] + gained[row - 2])
        return memory
    # From cycle to cycle m -> fade m + gain; k of them are a geometric series.
    fade = fades[::2] * fades[1::2]
    gain = fade * gained[1::2] + fades[1::2] * gained[::2]
    once = 1.0 / np.maximum(1.0 - fade, 1e-15)
    fewer = every // 2
    held = np.zeros(fades.shape[1])
    for cycle, (by, more, scale) in enumerate(zip(fade, gain, once, strict=True)):
        part, all_of = by**fewer, by**every
        now = part * held + more * scale * (1.0 - part)
        memory[2 * cycle] = now
        memory[2 * cycle + 1] = fades[2 * cycle] * (now + gained[2 * cycle + 1])
        held = all_of * held + more * scale * (1.0 - all_of)
    return memory


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
