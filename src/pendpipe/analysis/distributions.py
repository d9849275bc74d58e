"""Probabilities of the distributions that the tests ask for.

They stand here since scipy.special takes a quarter of a second to import: on most records more
than all that is worked out with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray

_ROUNDS: Final = 2000
_EXACT: Final = 1e-14
_TINY: Final = 1e-300
_FAR: Final = -20.0
"""Where the normal distribution's tail is taken from its asymptotic series."""


def each(function: Callable[[float], float], values: Any) -> FloatArray:
    """Return a function of one number for each of an array's; shape as `values`."""
    array = np.asarray(values, dtype=np.float64)
    found = np.fromiter(map(function, array.ravel().tolist()), np.float64, array.size)
    return found.reshape(array.shape)


def normal_below(value: Any) -> FloatArray:
    """Return P(z < value) for a normal number z; shape as `value`."""
    return 0.5 * each(math.erfc, np.asarray(value) * -math.sqrt(0.5))


def log_normal_below(value: Any) -> FloatArray:
    """Return ln P(z < value); good to 1e-6 in its far tail."""
    array = np.asarray(value, dtype=np.float64)
    far = array < _FAR
    near = np.log1p(-normal_below(-np.maximum(array, 0.0)))
    left = np.log(np.maximum(normal_below(np.minimum(array, 0.0)), _TINY))
    size = np.where(far, -array, 1.0)
    tail = -0.5 * size**2 - np.log(size * math.sqrt(2.0 * math.pi)) - 1.0 / size**2
    return np.asarray(np.where(far, tail, np.where(array > 0.0, near, left)))


def chi2_beyond(score: Any, freedom: int) -> FloatArray:
    """Return P(chi^2 > score) of whole degrees of freedom, by its finite sum.

    Q(a + 1, x) = Q(a, x) + x^a e^-x/Gamma(a + 1), from Q(1, x) = e^-x or
    Q(1/2, x) = erfc(sqrt x) on. Shape as `score`.
    """
    half = 0.5 * np.maximum(np.asarray(score, dtype=np.float64), 0.0)
    odd = freedom % 2
    if freedom <= 0:
        return np.zeros_like(half)
    total = each(math.erfc, np.sqrt(half)) if odd else np.exp(-half)
    order = 0.5 if odd else 1.0
    term = np.exp(-half) * half**order / math.gamma(order + 1.0)
    while order < 0.5 * freedom - 0.25:
        total = total + term
        order += 1.0
        term = term * half / order
    return np.asarray(np.minimum(total, 1.0))


def chi2_of_one(p_value: float) -> float:
    """Return the chi^2 of one degree of freedom beyond which chance goes with `p_value` > 0."""
    from statistics import NormalDist

    return 0.0 if p_value >= 1.0 else NormalDist().inv_cdf(max(0.5 * p_value, 1e-307)) ** 2


def poisson_up_to(count: Any, mean: Any) -> FloatArray:
    """Return P(N <= count) of Poisson's distribution: Q(count + 1, mean), for any count > -1."""
    return _gamma(np.asarray(count, dtype=np.float64) + 1.0, mean)[1]


def poisson_from(count: Any, mean: Any) -> FloatArray:
    """Return P(N >= count) of Poisson's distribution, P(count, mean); 1 for no count."""
    order = np.asarray(count, dtype=np.float64)
    return np.where(order > 0.0, _gamma(np.maximum(order, 1.0), mean)[0], 1.0)


def _gamma(order: FloatArray, mean: Any) -> tuple[FloatArray, FloatArray]:
    """The regularised incomplete gamma functions P and Q, each good where it is small."""
    order, at = np.broadcast_arrays(order, mean)
    at = np.maximum(at, _TINY)
    front = np.exp(order * np.log(at) - at - each(math.lgamma, order))
    small = at < order + 1.0
    below = front * _gamma_series(order, np.where(small, at, 0.0))
    beyond = front * _gamma_fraction(order, np.where(small, order + 1.0, at))
    return np.where(small, below, 1.0 - beyond), np.where(small, 1.0 - below, beyond)


def _gamma_series(order: FloatArray, at: FloatArray) -> FloatArray:
    """Sum of x^n/(a (a + 1) ... (a + n)) (DLMF 8.7.1)."""
    term = 1.0 / order
    total = term
    for number in range(1, _ROUNDS):
        term = term * at / (order + number)
        total = total + term
        if np.all(term <= _EXACT * total):
            break
    return np.asarray(total)


def _gamma_fraction(order: FloatArray, at: FloatArray) -> FloatArray:
    """The continued fraction of Gamma(a, x) e^x x^-a (DLMF 8.9.2), by Lentz's method."""
    below = at + 1.0 - order
    up, down = np.full_like(below, 1.0 / _TINY), 1.0 / below
    total = down
    for number in range(1, _ROUNDS):
        part = -number * (number - order)
        below = below + 2.0
        down = 1.0 / _kept(below + part * down)
        up = _kept(below + part / up)
        total = total * down * up
        if np.all(np.abs(down * up - 1.0) < _EXACT):
            break
    return np.asarray(total)


def beta_below(first: Any, second: Any, share: Any) -> FloatArray:
    """Return I_x(a, b), the regularised incomplete beta function (DLMF 8.17)."""
    a, b, x = np.broadcast_arrays(
        *(np.asarray(number, dtype=np.float64) for number in (first, second, share))
    )
    turned = x > (a + 1.0) / (a + b + 2.0)
    low, high = np.where(turned, b, a), np.where(turned, a, b)
    at = np.where(turned, 1.0 - x, x)
    logs = each(math.lgamma, a + b) - each(math.lgamma, a) - each(math.lgamma, b)
    front = np.exp(
        logs + low * np.log(np.maximum(at, _TINY)) + high * np.log1p(-np.minimum(at, 1 - 1e-16))
    )
    found = front * _beta_fraction(low, high, at) / low
    return np.asarray(np.where(turned, 1.0 - found, found))


def _beta_fraction(a: FloatArray, b: FloatArray, x: FloatArray) -> FloatArray:
    """The continued fraction of I_x(a, b) (DLMF 8.17.22), by Lentz's method."""
    up = np.ones_like(x)
    down = 1.0 / _kept(1.0 - (a + b) * x / (a + 1.0))
    total = down
    for number in range(1, _ROUNDS):
        twice = a + 2.0 * number
        even = number * (b - number) * x / ((twice - 1.0) * twice)
        odd = -(a + number) * (a + b + number) * x / (twice * (twice + 1.0))
        for part in (even, odd):
            down = 1.0 / _kept(1.0 + part * down)
            up = _kept(1.0 + part / up)
            total = total * down * up
        if np.all(np.abs(down * up - 1.0) < _EXACT):
            break
    return np.asarray(total)


def _kept(value: FloatArray) -> FloatArray:
    """The same, but never quite zero."""
    return np.asarray(np.where(np.abs(value) < _TINY, _TINY, value))


def student_beyond(freedom: FloatArray, value: FloatArray) -> FloatArray:
    """Return P(|t| > value) of Student's distribution; shapes are broadcast."""
    square = np.asarray(value) ** 2
    return beta_below(0.5 * np.asarray(freedom), 0.5, freedom / (freedom + square))


def binomial_at_least(count: int, number: int, chance: float) -> float:
    """Return the probability of `count` or more successes in `number` trials."""
    if count <= 0:
        return 1.0
    return float(beta_below(float(count), number - count + 1.0, chance))


def chi_square_p_value(chi2: float, degrees_of_freedom: int) -> float:
    """Probability of a larger chi^2; NaN without degrees of freedom."""
    if degrees_of_freedom < 1 or not math.isfinite(chi2):
        return math.nan
    return float(poisson_up_to(0.5 * degrees_of_freedom - 1.0, 0.5 * max(chi2, 0.0)))


def variance_ratio_p_value(ratio: float, numerator: int, denominator: int) -> float:
    """Probability of a larger F; NaN without degrees of freedom."""
    if min(numerator, denominator) < 1 or not math.isfinite(ratio):
        return math.nan
    share = denominator / (denominator + numerator * max(ratio, 0.0))
    return float(beta_below(0.5 * denominator, 0.5 * numerator, share))


def student_quantile95(degrees_of_freedom: int) -> float:
    """How many standard deviations a 95 % interval reaches to each side.

    >>> round(student_quantile95(3), 4)
    3.1824
    """
    low, high = 1.9, 13.0  # of infinite freedom, and of one degree
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        beyond = float(student_beyond(np.array(degrees_of_freedom), np.array(middle)))
        low, high = (middle, high) if beyond > 0.05 else (low, middle)
    return 0.5 * (low + high)
