"""The loops of `quick.py`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pendpipe.analysis.turning_points.kernels import extremes, solve_in_place
from pendpipe.analysis.turning_points.tracking import track
from pendpipe.arrays import FloatArray

_SLACK = 0.02
"""Of a half period, by which a turning point may lie outside the readings."""


@njit(cache=True)
def first_places(
    values: FloatArray, least: float, noise: float
) -> tuple[bool, float, float, float, float]:
    """Find the first half cycles by their extremes.

    Returns
    -------
    found
        Whether there are ten extremes.
    at, half_period
        The first whole half cycle's turning point, and the half period, in readings.
    side, level
        +1 if it is above the level; and the level.
    """
    start = 0.15 * (values.max() - values.min())
    index, first = extremes(values, 1, start, least)
    if len(index) < 10:
        return False, 0.0, 0.0, 0.0, 0.0
    # The last may still grow. A line through the places; the slope from halves of them.
    count = min(len(index) - 1, 24) // 2 * 2
    half = count // 2
    late, early = index[half:count].mean(), index[:half].mean()
    half_period = (late - early) / half
    level = 0.0
    for k in range(1, count - 1):
        level += 0.25 * (values[index[k - 1]] + 2.0 * values[index[k]] + values[index[k + 1]])
    level /= count - 2
    at = early - 0.5 * (half - 1) * half_period
    side = float(first)
    while at < 0.5 * half_period:
        at, side = at + half_period, -side
    # The loop itself knows them better.
    columns = np.empty((5, count))
    rates = np.zeros(3)
    known, _, _ = track(values, 0.0, 1.0, at, half_period, side, level, rates, noise, columns)
    if known < 8:
        return False, 0.0, 0.0, 0.0, 0.0
    half = known // 2
    late, early = columns[0, half : 2 * half].mean(), columns[0, :half].mean()
    half_period = (late - early) / half
    at = 0.5 * (late + early) - (half - 0.5) * half_period
    return True, at, half_period, side, columns[4, 0]


@njit(cache=True)
def _rates(time_s: FloatArray, y: FloatArray, sd: float) -> FloatArray:
    """Solve Eq. 13's integral, y0 - y = a S y^2 + b S y + c t, for a, b, c >= 0 and y0.

    The integrals are trapezoids with the end correction h^2/12 f'.
    """
    number = len(time_s)
    normal, right = np.zeros((4, 4)), np.zeros(4)
    column = np.zeros(4)
    column[3] = 1.0
    weight = 1.0 / (sd * sd + (3e-4 * y[0]) ** 2)
    slope = (y[1] - y[0]) / (time_s[1] - time_s[0])
    for k in range(number):
        if k > 0:
            step = time_s[k] - time_s[k - 1]
            last = min(k + 1, number - 1)
            next_slope = (y[last] - y[k - 1]) / (time_s[last] - time_s[k - 1])
            squares = y[k] ** 2 + y[k - 1] ** 2
            bent = 2.0 * (y[k - 1] * slope - y[k] * next_slope)
            column[0] -= 0.5 * step * squares + step * step / 12.0 * bent
            column[1] -= 0.5 * step * (y[k] + y[k - 1]) + step * step / 12.0 * (slope - next_slope)
            column[2] -= step
            slope = next_slope
        for p in range(4):
            right[p] += weight * column[p] * y[k]
            for q in range(4):
                normal[p, q] += weight * column[p] * column[q]
    rates = np.zeros(4)
    for attempt in range(4):
        # All free; without c; without a; without both.
        without_c, without_a = attempt in (1, 3), attempt >= 2
        matrix, solution = normal.copy(), right.copy()
        for j in range(4):
            matrix[j, j] *= 1.0 + 1e-13
        for j in (0, 2):
            if (j == 0 and without_a) or (j == 2 and without_c):
                matrix[j, :] = 0.0
                matrix[:, j] = 0.0
                matrix[j, j] = 1.0
                solution[j] = 0.0
        solve_in_place(matrix, solution)
        rates[:] = solution
        if rates[:3].min() >= 0.0:
            break
    rates[:3] = np.maximum(rates[:3], 0.0)
    return rates


@njit(cache=True)
def _excess(y: float, omega: float, a: float, b: float, c: float) -> float:
    """Relative lengthening of a half period (`period.period_excess`), half of b hysteretic."""
    slope = 2.0 * a * y + 0.5 * b
    friction = a * y + 0.5 * b + c / y
    total = 0.125 * b * b + 2.0 / 3.0 * b * slope + math.pi**2 / 8.0 * slope * friction
    return total / omega**2


@njit(cache=True)
def _line(time_s: FloatArray, y: FloatArray, rates: FloatArray, omega: float) -> FloatArray:
    """Fit a half period and a first time to times, the losses' lengthening allowed for."""
    a, b, c = rates[0], rates[1], rates[2]
    at, before = 0.0, _excess(y[0], omega, a, b, c)
    sums = np.zeros(5)
    reference = time_s[0]
    for k in range(len(time_s)):
        if k > 0:
            excess = _excess(y[k], omega, a, b, c)
            at += 1.0 + 0.5 * (excess + before)
            before = excess
        # What the losses shift the fitted cosine by, against the turning point.
        t = time_s[k] - reference - (a * y[k] + 0.75 * b + c / y[k]) / omega**2
        weight = y[k] * y[k]
        sums += weight * np.array([1.0, at, at * at, t, at * t])
    w, wn, wnn, wt, wnt = sums
    half_period = (w * wnt - wn * wt) / (w * wnn - wn * wn)
    return np.array([half_period, reference + (wt - wn * half_period) / w])


@njit(cache=True)
def rates_and_release(
    columns: FloatArray, start_s: float, stop_s: float
) -> tuple[FloatArray, FloatArray]:
    """Turn measured half cycles into the waveform's parameters.

    Parameters
    ----------
    columns
        From `track`, shape (5, k).
    start_s, stop_s
        Times of the first and the last reading.

    Returns
    -------
    numbers
        a, b, c, omega, angle and time of the release, offset, share; and the half cycles from
        the release to the first turning point among the readings.
    table
        Times and signed angles of all turning points among the readings, shape (2, n): those
        whose half cycles are not whole are added.
    """
    time_s, y = columns[0], np.abs(columns[2])
    rates = _rates(time_s, y, columns[3, 0])
    a, b, c = rates[0], rates[1], rates[2]
    omega = math.pi * (len(time_s) - 1) / (time_s[-1] - time_s[0])
    half_period, first_s = _line(time_s, y, rates, omega)
    omega = math.pi / half_period
    front = max(0, math.floor((first_s - start_s) / half_period + _SLACK))
    back = max(0, math.floor((stop_s - time_s[-1]) / half_period + _SLACK))
    table = np.empty((2, front + len(time_s) + back))
    table[0, front : front + len(time_s)] = time_s
    table[1, front : front + len(time_s)] = columns[2]
    for k in range(back):
        last = front + len(time_s) + k
        table[0, last] = table[0, last - 1] + half_period
        table[1, last] = -table[1, last - 1] * y[-1] / y[-2]
    # Back to a turning point before the readings, step by step.
    before = max(1, math.ceil((first_s - start_s) / half_period + 0.05))
    angle, when, side = rates[3], first_s, math.copysign(1.0, columns[2, 0])
    for k in range(before):
        earlier = angle
        for _ in range(4):
            middle = 0.5 * (angle + earlier)
            earlier = angle + half_period * ((a * middle + b) * middle + c)
        when -= half_period * (1.0 + _excess(0.5 * (angle + earlier), omega, a, b, c))
        angle, side = earlier, -side
        if k < front:
            table[0, front - 1 - k], table[1, front - 1 - k] = when, side * angle
    numbers = np.array(
        [a, b, c, omega, side * angle, when, columns[4].mean(), 0.5, float(before - front)]
    )
    return numbers, table
