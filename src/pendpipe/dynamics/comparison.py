"""Readings against samples: chi^2, its gradient and its normal matrix, panel by panel.

A fit needs the Jacobian J only in J'r and J'J. Every column of J is a polynomial in the place
within the panel, so that J'r follows from the residuals' moments there, and J itself is never
written. J'J is the number of readings times the mean over the part of the panel that they
cover, by Gauss's rule: as exact as the readings are evenly spread within it. The places of some
panels are collected first, and multiplied in one go.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pendpipe.dynamics.kernel import kernel
from pendpipe.dynamics.layout import MOMENTS, NODE_COUNT, PLACES
from pendpipe.dynamics.panel import horner_few

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.layout import Work

_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(PLACES)


@kernel(any_order=True)
def subtract(readings: FloatArray, angle_rad: FloatArray) -> None:
    """Put readings less angles in the place of the angles."""
    for i in range(angle_rad.size):
        angle_rad[i] = readings[i] - angle_rad[i]


@kernel(any_order=True)
def take_moments(
    residual: FloatArray, theta: FloatArray, power: FloatArray, moments: FloatArray
) -> float:
    """Write the sums of residual x theta^k; return that of the residual's square."""
    square = 0.0
    for i in range(residual.size):
        power[i] = residual[i]
        square += residual[i] * residual[i]
    # Six in a pass, to spare the memory.
    for k in range(0, MOMENTS, 6):
        m0, m1, m2, m3, m4, m5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(residual.size):
            z, value = theta[i], power[i]
            both = z * z
            second = value * both
            fourth = second * both
            m0 += value
            m1 += value * z
            m2 += second
            m3 += second * z
            m4 += fourth
            m5 += fourth * z
            power[i] = fourth * both
        moments[k], moments[k + 1], moments[k + 2] = m0, m1, m2
        moments[k + 3], moments[k + 4], moments[k + 5] = m3, m4, m5
    return square


@kernel(any_order=True)
def product(first: FloatArray, second: FloatArray) -> float:
    """Return the sum of products."""
    total = 0.0
    for i in range(first.size):
        total += first[i] * second[i]
    return total


@kernel
def compare(work: Work, residual: FloatArray, start: float, duration: float) -> None:
    """Add a block of one panel's residuals to `work.sums`.

    Parameters
    ----------
    residual
        Readings less samples of the block, whose places are in `work.theta`.
    start, duration
        Of the panel, in radians since the release.
    """
    columns, directions = work.parameters, work.rates
    theta = work.theta[: residual.size]
    work.sums[0] += take_moments(residual, theta, work.power, work.moments)
    gradient, moments = work.sums[1 : 1 + columns], work.moments
    omega = work.motion[0]
    middle, half = start + 0.5 * duration, 0.5 * duration
    speed = product(work.total[1], moments[:NODE_COUNT])
    moving = middle * speed + half * product(work.total[1], moments[1 : NODE_COUNT + 1])
    for c in range(directions):
        by_rate = product(work.total[3 + c], moments[:NODE_COUNT])
        gradient[c] += by_rate
        moving -= work.rate[c] * by_rate
    gradient[directions] += moving / omega
    gradient[directions + 1] += product(work.total[2], moments[:NODE_COUNT])
    gradient[directions + 2] -= omega * speed
    gradient[directions + 3] += moments[0]
    _take_places(work, theta, middle, half)


@kernel(any_order=True)
def add_scaled(
    columns: FloatArray, weights: FloatArray, scaled: FloatArray, normal: FloatArray
) -> None:
    """Add the columns' weighted products; `scaled` is room for one of them."""
    for p in range(columns.shape[0]):
        for i in range(weights.size):
            scaled[i] = columns[p, i] * weights[i]
        for q in range(p + 1):
            normal[p * columns.shape[0] + q] += product(scaled, columns[q])


@kernel
def add_batch(work: Work) -> None:
    """Add the products of the Jacobian's columns at the places that wait for it."""
    taken = int(work.wanted[2])
    normal = work.sums[1 + work.parameters :]
    add_scaled(work.some, work.weights[:taken], work.power[:taken], normal)
    work.wanted[2] = 0.0


@kernel
def _take_places(work: Work, theta: FloatArray, middle: float, half: float) -> None:
    """Write the Jacobian's columns at Gauss's places among the readings of the panel."""
    if work.wanted[2] + PLACES > work.weights.size:
        add_batch(work)
    directions, omega = work.rates, work.motion[0]
    taken = int(work.wanted[2])
    here = slice(taken, taken + PLACES)
    place, weights, readings = work.power[here], work.weights[here], float(theta.size)
    by_omega, by_time = work.some[directions, here], work.some[directions + 2, here]
    by_offset = work.some[directions + 3, here]
    centre = 0.5 * (theta[0] + theta[theta.size - 1])
    # Each reading stands for the time around it, half of that outside the first and the last.
    reach = 0.5 * (theta[theta.size - 1] - theta[0]) * readings / max(readings - 1.0, 1.0)
    for i in range(PLACES):
        place[i] = centre + reach * _PLACES[i]
        weights[i] = 0.5 * readings * _WEIGHTS[i]
    horner_few(work.total[1], place, by_time)
    horner_few(work.total[2], place, work.some[directions + 1, here])
    for i in range(place.size):
        by_omega[i] = (middle + half * place[i]) * by_time[i] / omega
        by_time[i] *= -omega
        by_offset[i] = 1.0
    for c in range(directions):
        column, rate = work.some[c, here], work.rate[c] / omega
        horner_few(work.total[3 + c], place, column)
        for i in range(place.size):
            by_omega[i] -= rate * column[i]
    work.wanted[2] += PLACES


@kernel
def compare_rest(work: Work, level: float, first: int) -> None:
    """Add the residuals after the stop; the columns there are in `work.some[:, 0]`."""
    columns, count = work.parameters, float(work.compared - first)
    total, square = 0.0, 0.0
    for i in range(first, work.compared):
        residual = work.readings[i] - level
        total += residual
        square += residual * residual
    work.sums[0] += square
    for p in range(columns):
        work.sums[1 + p] += total * work.some[p, 0]
        for q in range(p + 1):
            work.sums[1 + columns + p * columns + q] += count * work.some[p, 0] * work.some[q, 0]
