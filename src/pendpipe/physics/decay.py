"""The amplitude of a free decay, Eq. 14, in every regime.

Eq. 13, ``y' = -(a y^2 + b y + c)``, is solved by a fraction ``y = u/v`` whose parts obey a
linear system: ``u' = -(b/2) u - c v``, ``v' = a u + (b/2) v``, u(0) = y0, v(0) = 1. With
``r^2 = b^2 - 4 a c``, ``C = cosh(r t/2)`` and ``S = 2 sinh(r t/2)/r``,

    u = y0 C - (b y0/2 + c) S,    v = C + (a y0 + b/2) S,

which is the paper's Eq. 14 without its division by a (1 - p): it holds for a = 0, b = 0,
c = 0 and r -> 0, and with cos and sin in place of cosh and sinh for 4 a c > b^2. For real
r both parts are taken times exp(-r t/2), so that nothing grows and every term but one is
added to others of its own sign; the one subtraction is the pendulum's coming to rest.
"""

from __future__ import annotations

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
