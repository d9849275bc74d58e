"""Readings against samples: chi^2, its gradient and its normal matrix, panel by panel.

A fit needs the Jacobian J only in J'r and J'J. Every column of J is a polynomial in the place
within the panel, so that J'r follows from the residuals' moments there, and J itself is never
written. J'J, which varies slowly, is summed over some of the readings.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pendpipe.dynamics.layout import MOMENTS, NODE_COUNT
from pendpipe.dynamics.panel import adder, part
from pendpipe.dynamics.polynomials import horner

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.workspace import Work


@adder
def subtract(readings: FloatArray, angle_rad: FloatArray) -> None:
    """Put readings less angles in the place of the angles."""
    for i in range(angle_rad.size):
        angle_rad[i] = readings[i] - angle_rad[i]


@adder
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
            second = value * z * z
            fourth = second * z * z
            m0 += value
            m1 += value * z
            m2 += second
            m3 += second * z
            m4 += fourth
            m5 += fourth * z
            power[i] = fourth * z * z
        moments[k], moments[k + 1], moments[k + 2] = m0, m1, m2
        moments[k + 3], moments[k + 4], moments[k + 5] = m3, m4, m5
    return square


@adder
def product(first: FloatArray, second: FloatArray) -> float:
    """Return the sum of products."""
    total = 0.0
    for i in range(first.size):
        total += first[i] * second[i]
    return total


@part
def compare(work: Work, residual: FloatArray, first: int, start: float, duration: float) -> None:
    """Add what a block of one panel says to `work.sums`.

    Parameters
    ----------
    residual
        Readings less samples of the block, whose places are in `work.theta`.
    first
        The number of its first reading.
    start, duration
        Of the panel, in radians since the release.
    """
    columns, directions = work.some.shape[0], work.rates.size
    theta = work.theta[: residual.size]
    if columns == 0:
        work.sums[0] += product(residual, residual)
        return
    work.sums[0] += take_moments(residual, theta, work.power, work.moments)
    gradient, moments = work.sums[1 : 1 + columns], work.moments
    omega = work.motion[0]
    middle, half = start + 0.5 * duration, 0.5 * duration
    speed = product(work.total[1], moments[:NODE_COUNT])
    moving = middle * speed + half * product(work.total[1], moments[1 : NODE_COUNT + 1])
    for c in range(directions):
        by_rate = product(work.total[3 + c], moments[:NODE_COUNT])
        gradient[c] += by_rate
        moving -= work.rates[c] * by_rate
    gradient[directions] += moving / omega
    gradient[directions + 1] += product(work.total[2], moments[:NODE_COUNT])
    gradient[directions + 2] -= omega * speed
    gradient[directions + 3] += moments[0]
    _add_products(work, theta, first, middle, half)


@part
def _add_products(work: Work, theta: FloatArray, first: int, middle: float, half: float) -> None:
    """Add the products of the Jacobian's columns at some of the readings."""
    columns, directions = work.some.shape[0], work.rates.size
    omega, every = work.motion[0], int(work.every[0])
    count = 0
    for i in range((every - first % every) % every, theta.size, every):
        work.power[count] = theta[i]
        count += 1
    place = work.power[:count]
    by_omega, by_time = work.some[directions, :count], work.some[directions + 2, :count]
    offset = work.some[directions + 3, :count]
    horner(work.total[1], place, by_time)
    horner(work.total[2], place, work.some[directions + 1, :count])
    for i in range(count):
        by_omega[i] = (middle + half * place[i]) * by_time[i] / omega
        by_time[i] *= -omega
        offset[i] = 1.0
    for c in range(directions):
        column, rate = work.some[c, :count], work.rates[c] / omega
        horner(work.total[3 + c], place, column)
        for i in range(count):
            by_omega[i] -= rate * column[i]
    for p in range(columns):
        for q in range(p + 1):
            work.sums[1 + columns + p * columns + q] += product(
                work.some[p, :count], work.some[q, :count]
            )


@part
def compare_rest(work: Work, residual: FloatArray, first: int) -> None:
    """Add what the readings after the stop say; the columns there are in `work.some[:, 0]`."""
    columns = work.some.shape[0]
    work.sums[0] += product(residual, residual)
    total = 0.0
    for i in range(residual.size):
        total += residual[i]
    every = int(work.every[0])
    left = residual.size - (every - first % every) % every
    count = max(0, (left + every - 1) // every)
    for p in range(columns):
        work.sums[1 + p] += total * work.some[p, 0]
        for q in range(p + 1):
            work.sums[1 + columns + p * columns + q] += count * work.some[p, 0] * work.some[q, 0]
