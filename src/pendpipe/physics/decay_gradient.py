"""The derivatives of Eq. 14 with respect to its start and its three rates, in every regime.

Differentiating ``t = integral from y to y0 of dy'/g(y')``, g = a y^2 + b y + c, at fixed t
gives ``dy/dy0 = g(y)/g(y0)`` and ``dy/d(a, b, c) = -g(y) integral of y'^(2, 1, 0)/g^2 dy'``.
In the parts u, v of `pendpipe.physics.decay` (whose determinant is 1) this is

    dy/dy0 = 1/v^2,   dy/da = -int u^2 dt/v^2,   dy/db = -int u v dt/v^2,
    dy/dc = -int v^2 dt/v^2,

integrals of products of exponentials (or of cos and sin) from 0 to t.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pendpipe.physics._floats import FloatArray, Numbers, floats, plain
from pendpipe.physics.decay import (
    Fraction,
    exponential_fraction,
    quotient,
    root,
    saturation,
    smaller_half,
    tangent_fraction,
)

_SERIES_BELOW = 1.0
"""Where |x| is smaller, the functions below would cancel and are summed as series."""
_TERMS = 18


class _Moments(NamedTuple):
    """Integrals over the decay of the squares and the product of two basis functions."""

    first: FloatArray
    mixed: FloatArray
    second: FloatArray


def _series(x: FloatArray, coefficients: list[float]) -> FloatArray:
    """Sum a power series by Horner's rule."""
    total = np.full(x.shape, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        total = total * x + coefficient
    return total


_RAMP = [(-1.0) ** n / math.factorial(n + 2) for n in range(_TERMS)]
_HYPERBOLIC = [2.0 / math.factorial(2 * n + 3) for n in range(_TERMS // 2)]
_TRIGONOMETRIC = [(-1.0) ** n / math.factorial(2 * n + 3) for n in range(_TERMS // 2)]


def _exponential_moments(t: FloatArray, r: FloatArray) -> _Moments:
    """Integrals, times exp(-r t), in the basis exp(-r t/2), sinh(r t/2) 2/r.

    ``(1 - e^-x)/r``, ``(x - 1 + e^-x)/r^2`` and ``(2 sinh x - 2 x)/r^3`` with x = r t.
    """
    x = r * t
    fading = np.exp(-x)
    small = np.abs(x) < _SERIES_BELOW
    near, far = np.where(small, x, 0.0), np.where(small, 1.0, x)
    ramp = np.where(small, _series(near, _RAMP), (far - 1.0 + np.exp(-far)) / far**2)
    bulge = (1.0 - np.exp(-2.0 * far) - 2.0 * far * np.exp(-far)) / far**3
    bulge = np.where(small, fading * _series(near**2, _HYPERBOLIC), bulge)
    return _Moments(saturation(r, t) * fading, t**2 * ramp * fading, t**3 * bulge)


def _tangent_moments(t: FloatArray, s: FloatArray) -> _Moments:
    """Integrals of cos^2, of cos sin 2/s and of sin^2 (2/s)^2, all of s t/2."""
    x = s * t
    small = np.abs(x) < _SERIES_BELOW
    near, far = np.where(small, x, 0.0), np.where(small, 1.0, x)
    bulge = np.where(small, _series(near**2, _TRIGONOMETRIC), (far - np.sin(far)) / far**3)
    # numpy's sinc(z) is sin(pi z)/(pi z).
    squared = 0.5 * (1.0 + np.sinc(x / np.pi))
    mixed = 0.5 * np.sinc(0.5 * x / np.pi) ** 2
    return _Moments(t * squared, t**2 * mixed, 2.0 * t**3 * bulge)


def _derivatives(
    moments: _Moments, y0: FloatArray, loss: FloatArray, gain: FloatArray, square: FloatArray
) -> FloatArray:
    """Combine the moments for ``u = y0 A - loss B`` and ``v = A + gain B``; shape (3, ...)."""
    first, mixed, second = moments
    return (
        -np.stack(
            [
                y0**2 * first - 2.0 * y0 * loss * mixed + loss**2 * second,
                y0 * first + (y0 * gain - loss) * mixed - loss * gain * second,
                first + 2.0 * gain * mixed + gain**2 * second,
            ]
        )
        / square
    )


def amplitude_and_gradient(
    time_s: Numbers, amplitude0_rad: Numbers, a: Numbers, b: Numbers, c: Numbers
) -> tuple[FloatArray, FloatArray]:
    """Amplitude of Eq. 14 with its derivatives.

    Parameters
    ----------
    time_s, amplitude0_rad, a, b, c
        As in `pendpipe.physics.decay.amplitude`; broadcast to the shape ``s``.

    Returns
    -------
    amplitude : FloatArray
        y in rad, shape s.
    gradient : FloatArray
        dy/d(y0, a, b, c), shape s + (4,). Zero from the stopping time on, where it jumps
        (the last of it is what moves the stopping time).
    """
    t, y0, quadratic, linear, coulomb = floats(time_s, amplitude0_rad, a, b, c)
    r, sign = root(quadratic, linear, coulomb)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        parts, gradient = _exponential_branch(t, y0, quadratic, linear, coulomb, r)
        if np.any(sign < 0.0):
            other, turned = _tangent_branch(t, y0, quadratic, linear, coulomb, r)
            below = sign < 0.0
            parts = Fraction(*(np.where(below, *pair) for pair in zip(other, parts, strict=True)))
            gradient = np.where(below, turned, gradient)
        y = quotient(parts, y0)
    gradient = np.where((y > 0.0) & np.isfinite(y), gradient, np.where(y == 0.0, 0.0, np.nan))
    return plain(y), np.moveaxis(gradient, 0, -1)


def _exponential_branch(
    t: FloatArray, y0: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, r: FloatArray
) -> tuple[Fraction, FloatArray]:
    """Parts and gradient, shape (4, ...), for b^2 >= 4 a c."""
    parts = exponential_fraction(t, y0, a, b, c, r)
    half = smaller_half(a, b, c, r)
    square = parts.denominator**2
    rates = _derivatives(_exponential_moments(t, r), y0, c + half * y0, a * y0 + b - half, square)
    return parts, np.concatenate([(np.exp(-r * t) / square)[np.newaxis], rates])


def _tangent_branch(
    t: FloatArray, y0: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, s: FloatArray
) -> tuple[Fraction, FloatArray]:
    """Parts and gradient, shape (4, ...), for 4 a c > b^2."""
    parts = tangent_fraction(t, y0, a, b, c, s)
    square = parts.denominator**2
    moments = _tangent_moments(t, s)
    rates = _derivatives(moments, y0, 0.5 * b * y0 + c, a * y0 + 0.5 * b, square)
    return parts, np.concatenate([(1.0 / square)[np.newaxis], rates])
