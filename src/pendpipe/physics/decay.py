"""The amplitude of a free decay, Eq. 14, in every regime.

Eq. 13, ``y' = -(a y^2 + b y + c)``, is solved by a fraction ``y = u/v`` whose parts obey a
linear system: ``u' = -(b/2) u - c v``, ``v' = a u + (b/2) v``, u(0) = y0, v(0) = 1. With
``r^2 = b^2 - 4 a c``, ``C = cosh(r t/2)`` and ``S = 2 sinh(r t/2)/r``,

    u = y0 C - (b y0/2 + c) S,    v = C + (a y0 + b/2) S,

which is the paper's Eq. 14 without its division by a (1 - p): it holds for a = 0, b = 0,
c = 0 and r -> 0, and with cos and sin in place of cosh and sinh for 4 a c > b^2. For real
r both parts are taken times exp(-r t/2), so that nothing grows and every term but one is
added to others of its own sign; the one subtraction is the pendulum's coming to rest.

Its derivatives: differentiating ``t = integral from y to y0 of dy'/g(y')``, g = a y^2 + b y + c,
at fixed t gives ``dy/dy0 = g(y)/g(y0)`` and ``dy/d(a, b, c) = -g(y) integral of y'^(2, 1, 0)/g^2
dy'``. In the parts u, v (whose determinant is 1) this is

    dy/dy0 = 1/v^2,   dy/da = -int u^2 dt/v^2,   dy/db = -int u v dt/v^2,
    dy/dc = -int v^2 dt/v^2,

integrals of products of exponentials (or of cos and sin) from 0 to t.
"""

import math
from typing import NamedTuple

import numpy as np

from pendpipe.physics._floats import FloatArray, Numbers, equation, floats, plain

_TINY = 1e-290
"""Where r t is smaller, (1 - exp(-r t))/r is t to the last digit (and r t has few left)."""


class Fraction(NamedTuple):
    """Numerator and denominator of Eq. 14's solution, up to a common factor."""

    numerator: FloatArray
    denominator: FloatArray


def root(a: FloatArray, b: FloatArray, c: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ``sqrt(|b^2 - 4 a c|)`` and the sign of ``b^2 - 4 a c`` (zero where equal)."""
    squared = b * b - 4.0 * a * c
    return np.sqrt(np.abs(squared)), np.sign(squared)


def smaller_half(a: FloatArray, b: FloatArray, c: FloatArray, r: FloatArray) -> FloatArray:
    """Return ``(b - r)/2`` for real r; as ``2 a c/(b + r)`` where the difference would cancel."""
    total = b + r
    safe = np.where(total > 0.0, total, 1.0)
    return np.where(b > 0.0, 2.0 * a * c / safe, 0.5 * (b - r))


def saturation(r: FloatArray, t: FloatArray) -> FloatArray:
    """Return ``(1 - exp(-r t))/r``, which is t for r -> 0."""
    exponent = r * t
    usual = np.abs(exponent) > _TINY
    return np.where(usual, -np.expm1(-exponent) / np.where(usual, r, 1.0), t)


def exponential_fraction(
    t: FloatArray, y0: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, r: FloatArray
) -> Fraction:
    """Return u and v for b^2 >= 4 a c, both times exp(-r t/2)."""
    half = smaller_half(a, b, c, r)
    grown = saturation(r, t)
    return Fraction(y0 * np.exp(-r * t) - (c + half * y0) * grown, 1.0 + (a * y0 + half) * grown)


def tangent_fraction(
    t: FloatArray, y0: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray, s: FloatArray
) -> Fraction:
    """Return u and v for 4 a c > b^2, with ``s = sqrt(4 a c - b^2)``.

    The pendulum stops before s t = pi; a phase beyond that is held there, where u < 0.
    """
    phase = np.clip(0.5 * s * t, -0.5 * np.pi, 0.5 * np.pi)
    cosine = np.cos(phase)
    sine = np.where(s > 0.0, 2.0 * np.sin(phase) / np.where(s > 0.0, s, 1.0), t)
    return Fraction(y0 * cosine - (0.5 * b * y0 + c) * sine, cosine + (a * y0 + 0.5 * b) * sine)


@equation
def amplitude(
    time_s: Numbers, amplitude0_rad: Numbers, a: Numbers, b: Numbers, c: Numbers
) -> FloatArray:
    """Amplitude of a free decay, Eq. 14: the solution of ``y' = -(a y^2 + b y + c)``.

    Parameters
    ----------
    time_s
        Time since the amplitude was `amplitude0_rad`, in s. Negative times go back along
        the same solution, as far as it reaches (infinite before that).
    amplitude0_rad
        y0 in rad, not negative.
    a, b, c
        Rates in 1/(rad s), 1/s and rad/s. None of them is negative in physics; the
        formula holds for either sign, but its accuracy is stated for a, b, c >= 0.

    Returns
    -------
    FloatArray
        y in rad, in the shape to which the arguments broadcast; 0 from the stopping time
        on (`stopping_time`).

    Notes
    -----
    Right to 1e-12 of y wherever that can be asked: close to the stop, y is known no better
    than the last digit of the time times the rate c.
    """
    # Not broadcast here: with scalar rates everything but the exponential is then cheap.
    r, sign = root(a, b, c)
    with np.errstate(over="ignore", invalid="ignore"):
        parts = exponential_fraction(time_s, amplitude0_rad, a, b, c, r)
        if np.any(sign < 0.0):
            other = tangent_fraction(time_s, amplitude0_rad, a, b, c, r)
            parts = Fraction(
                *(np.where(sign < 0.0, *pair) for pair in zip(other, parts, strict=True))
            )
        return quotient(parts, amplitude0_rad)


def quotient(parts: Fraction, y0: FloatArray) -> FloatArray:
    """Divide; zero after the stop, infinite before the solution begins."""
    u, v = parts
    moving = (u > 0.0) & (y0 > 0.0)
    y = np.divide(u, v, out=np.full(u.shape, np.inf), where=v > 0.0)
    return np.where(moving, y, np.where(np.isnan(u), np.nan, 0.0))


def time_at(
    amplitude_rad: Numbers, amplitude0_rad: Numbers, a: Numbers, b: Numbers, c: Numbers
) -> FloatArray:
    """Time at which a decay has come down to an amplitude: the inverse of Eq. 14.

    ``t = integral from y to y0 of dy'/(a y'^2 + b y' + c)``. With
    ``Z = (y0 - y)/[a y0 y + (b - r) y0/2 + (b + r) y/2 + c]`` it is ``ln(1 + r Z)/r``, and
    on the tangent branch ``(2/s) arctan(s T/2)`` with
    ``T = (y0 - y)/[a y0 y + b (y0 + y)/2 + c]``.

    Parameters
    ----------
    amplitude_rad, amplitude0_rad
        y and y0 in rad, not negative; broadcast.
    a, b, c
        Rates of Eq. 13 in 1/(rad s), 1/s and rad/s, not negative.

    Returns
    -------
    FloatArray
        t in s; infinite where the amplitude is never reached, negative for y > y0.
    """
    y, y0, quadratic, linear, coulomb = np.broadcast_arrays(
        *floats(amplitude_rad, amplitude0_rad, a, b, c)
    )
    r, sign = root(quadratic, linear, coulomb)
    real, s = np.where(sign < 0.0, 0.0, r), np.where(sign < 0.0, r, 0.0)
    half = np.where(sign < 0.0, 0.5 * linear, smaller_half(quadratic, linear, coulomb, real))
    divisor = quadratic * y0 * y + half * y0 + (linear - half) * y + coulomb
    with np.errstate(divide="ignore", invalid="ignore"):
        reduced = np.where(y == y0, 0.0, (y0 - y) / divisor)
        scaled = real * reduced
        straight = ~(np.abs(scaled) > _TINY)
        grown = np.where(straight, reduced, np.log1p(scaled) / np.where(straight, 1.0, real))
        turned = 2.0 * np.arctan(0.5 * s * reduced) / np.where(s > 0.0, s, 1.0)
    return plain(np.where(s > 0.0, turned, grown))


def stopping_time(amplitude0_rad: Numbers, a: Numbers, b: Numbers, c: Numbers) -> FloatArray:
    """Time at which Coulomb friction has stopped the pendulum: `time_at` of amplitude 0.

    Infinite for c = 0. Parameters as in `time_at`; the result is in s.
    """
    return time_at(0.0, amplitude0_rad, a, b, c)


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
