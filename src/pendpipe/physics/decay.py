"""The amplitude of a free decay, Eq. 14, in every regime.

Eq. 13, ``y' = -(a y^2 + b y + c)``, is solved by a fraction ``y = u/v`` whose parts obey a
linear system: ``u' = -(b/2) u - c v``, ``v' = a u + (b/2) v``, u(0) = y0, v(0) = 1. With
``r^2 = b^2 - 4 a c``, ``C = cosh(r t/2)`` and ``S = 2 sinh(r t/2)/r``,

    u = y0 C - (b y0/2 + c) S,    v = C + (a y0 + b/2) S,

which is the paper's Eq. 14 without its division by a (1 - p): it holds for a = 0, b = 0,
c = 0 and r -> 0, and for 4 a c > b^2 with an imaginary r, whose cosh and sinh are cos and sin. Both
parts are taken times exp(-r t/2), so that nothing grows, and for real r every term but one is
added to others of its own sign; the one subtraction is the pendulum's coming to rest.

Its derivatives: differentiating ``t = integral from y to y0 of dy'/g(y')``, g = a y^2 + b y + c,
at fixed t gives ``dy/dy0 = g(y)/g(y0)`` and ``dy/d(a, b, c) = -g(y) integral of y'^(2, 1, 0)/g^2
dy'``. In the parts u, v (whose determinant is 1) this is

    dy/dy0 = 1/v^2,   dy/da = -int u^2 dt/v^2,   dy/db = -int u v dt/v^2,
    dy/dc = -int v^2 dt/v^2,

integrals of products of exponentials (or of cos and sin) from 0 to t.
"""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import AnyArray, FloatArray, Numbers, equation

_TINY = 1e-290
"""Where r t is smaller, (1 - exp(-r t))/r is t to the last digit (and r t has few left)."""


def root(a: FloatArray, b: FloatArray, c: FloatArray) -> AnyArray:
    """Return ``sqrt(b^2 - 4 a c)``: complex only if one of them must be."""
    return np.asarray(np.emath.sqrt(b * b - 4.0 * a * c))


def smaller_half(a: FloatArray, b: FloatArray, c: FloatArray, r: AnyArray) -> AnyArray:
    """Return ``(b - r)/2``; as ``2 a c/(b + r)`` where the difference would cancel."""
    total = b + r
    safe = np.where(total.real > 0.0, total, 1.0)
    return np.where(b > 0.0, 2.0 * a * c / safe, 0.5 * (b - r))


def saturation(r: AnyArray, t: FloatArray) -> AnyArray:
    """Return ``(1 - exp(-r t))/r``, which is t for r -> 0."""
    exponent = r * t
    usual = np.abs(exponent) > _TINY
    return np.where(usual, -np.expm1(-exponent) / np.where(usual, r, 1.0), t)


class Parts(NamedTuple):
    """Numerator and denominator of Eq. 14's solution, both times exp(-r t/2), and r itself.

    t is the time, held where u < 0 beyond a half turn of an imaginary r: the pendulum stops before.
    """

    u: AnyArray
    v: AnyArray
    r: AnyArray
    t: FloatArray

    def quotient(self, y0: FloatArray) -> FloatArray:
        """Divide; zero after the stop, infinite before the solution begins."""
        turned = np.exp(0.5j * self.r.imag * self.t) if np.iscomplexobj(self.r) else 1.0
        u, v = (self.u * turned).real, (self.v * turned).real
        y = np.divide(u, v, out=np.full(u.shape, np.inf), where=v > 0.0)
        return np.where((u > 0.0) & (y0 > 0.0), y, np.where(np.isnan(u), np.nan, 0.0))


def parts_of(t: FloatArray, y0: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> Parts:
    """Return u and v."""
    r = root(a, b, c)
    if np.iscomplexobj(r):
        end = np.pi / np.maximum(r.imag, _TINY)
        t = np.clip(t, -end, end)
    half, grown = smaller_half(a, b, c, r), saturation(r, t)
    u = y0 * np.exp(-r * t) - (c + half * y0) * grown
    return Parts(u, 1.0 + (a * y0 + half) * grown, r, t)


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
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return parts_of(time_s, amplitude0_rad, a, b, c).quotient(amplitude0_rad)


@equation
def time_at(
    amplitude_rad: Numbers, amplitude0_rad: Numbers, a: Numbers, b: Numbers, c: Numbers
) -> FloatArray:
    """Time at which a decay has come down to an amplitude: the inverse of Eq. 14.

    ``t = integral from y to y0 of dy'/(a y'^2 + b y' + c)``. With
    ``Z = (y0 - y)/[a y0 y + (b - r) y0/2 + (b + r) y/2 + c]`` it is ``ln(1 + r Z)/r``.

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
    y, y0, a, b, c = np.broadcast_arrays(amplitude_rad, amplitude0_rad, a, b, c)
    r = root(a, b, c)
    half = smaller_half(a, b, c, r)
    divisor = a * y0 * y + half * y0 + (b - half) * y + c
    with np.errstate(divide="ignore", invalid="ignore"):
        reduced = np.where(y == y0, 0.0, (y0 - y) / divisor)
        scaled = r * reduced
        straight = ~(np.abs(scaled) > _TINY)
        grown = np.where(straight, reduced, np.log1p(scaled) / np.where(straight, 1.0, r))
    return grown.real


def stopping_time(amplitude0_rad: Numbers, a: Numbers, b: Numbers, c: Numbers) -> FloatArray:
    """Time at which Coulomb friction has stopped the pendulum: `time_at` of amplitude 0.

    Infinite for c = 0. Parameters as in `time_at`; the result is in s.
    """
    return time_at(0.0, amplitude0_rad, a, b, c)


_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(32)
"""Of an integral over ln y: exact to rounding where y falls to a thousandth."""
_HALVINGS: Final = 60
"""Of an interval: to the last digit."""


def time_by_powers(
    amplitude_rad: Numbers, amplitude0_rad: Numbers, rates: Mapping[float, Numbers]
) -> FloatArray:
    """Time in which an amplitude falls to another, where the loss is a sum of any powers.

    ``-dy/dt = sum_p r_p y^p``: with p = 1 and 2 Bessel's arcs (Stokes 1850, Eq. 173), with 1, 3/2
    and 2 Newton's. ``t = integral of d(ln y)/sum_p r_p y^(p - 1)``; `time_at` is the closed form
    for p = 0, 1 and 2.

    Parameters
    ----------
    amplitude_rad, amplitude0_rad
        y at the end and at the beginning, positive; broadcast. Lengths of an arc do as well.
    rates
        r_p by power p, in 1/s times the amplitude's unit to the power 1 - p; broadcast.

    Returns
    -------
    FloatArray
        t in s; negative for an amplitude that is larger at the end.

    Examples
    --------
    >>> round(float(time_by_powers(1.0, 2.0, {1.0: 0.1, 2.0: 0.3})), 12)
    1.335313926245
    >>> round(float(time_at(1.0, 2.0, 0.3, 0.1, 0.0)), 12)
    1.335313926245
    """
    low, high, *values = np.broadcast_arrays(
        np.log(amplitude_rad), np.log(amplitude0_rad), *rates.values()
    )
    half = 0.5 * (high - low)
    points = _POINTS.reshape(-1, *(1 for _ in half.shape))
    y = np.exp(0.5 * (high + low) + points * half)
    loss = sum(rate * y ** (power - 1.0) for power, rate in zip(rates, values, strict=True))
    return np.asarray(half * np.tensordot(_WEIGHTS, 1.0 / loss, 1))


def amplitude_halfway(
    amplitude_rad: Numbers, amplitude0_rad: Numbers, rates: Mapping[float, Numbers]
) -> FloatArray:
    """Amplitude in the middle of the time in which it falls from `amplitude0_rad`.

    Of an exponential decay it is the geometric mean of both ends; a loss that grows faster than
    the amplitude makes it smaller, by which Bessel knew his arcs. Parameters as in
    `time_by_powers`.

    Examples
    --------
    >>> round(float(amplitude_halfway(1.0, 4.0, {1.0: 0.1})), 12)
    2.0
    >>> round(float(amplitude_halfway(1.0, 3.0, {2.0: 0.1})), 12)  # 1/y grows steadily
    1.5
    """
    low, high = np.log(amplitude_rad), np.log(amplitude0_rad)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        late = time_by_powers(np.exp(middle), amplitude0_rad, rates) > time_by_powers(
            amplitude_rad, np.exp(middle), rates
        )
        low, high = np.where(late, middle, low), np.where(late, high, middle)
    return np.asarray(np.exp(0.5 * (low + high)))


_SERIES_BELOW = 1.0
"""Where |x| is smaller, the functions below would cancel and are summed as series."""
_TERMS = 18


_RAMP = [(-1.0) ** n / math.factorial(n + 2) for n in reversed(range(_TERMS))]
_HYPERBOLIC = [2.0 / math.factorial(2 * n + 3) for n in reversed(range(_TERMS // 2))]


def _moments(t: FloatArray, r: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Integrals, times exp(-r t), of squares and product of exp(-r t/2) and sinh(r t/2) 2/r.

    ``(1 - e^-x)/r``, ``(x - 1 + e^-x)/r^2`` and ``(2 sinh x - 2 x)/r^3`` with x = r t: of the
    first, of both, and of the second.
    """
    x = r * t
    fading = np.exp(-x)
    small = np.abs(x) < _SERIES_BELOW
    near, far = np.where(small, x, 0.0), np.where(small, 1.0, x)
    ramp = np.where(small, np.polyval(_RAMP, near), (far - 1.0 + np.exp(-far)) / far**2)
    bulge = (1.0 - np.exp(-2.0 * far) - 2.0 * far * np.exp(-far)) / far**3
    bulge = np.where(small, fading * np.polyval(_HYPERBOLIC, near**2), bulge)
    return saturation(r, t) * fading, t**2 * ramp * fading, t**3 * bulge


@equation
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
    y0 = amplitude0_rad
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        parts = parts_of(time_s, y0, a, b, c)
        y, r, t = parts.quotient(y0), parts.r, parts.t
        half = smaller_half(a, b, c, r)
        loss, gain = c + half * y0, a * y0 + b - half
        first, mixed, second = _moments(t, r)
        # Of u = y0 A - loss B and v = A + gain B, with the moments of A and B.
        gradient = np.stack(
            [
                -np.exp(-r * t) + 0.0 * y,
                y0**2 * first - 2.0 * y0 * loss * mixed + loss**2 * second,
                y0 * first + (y0 * gain - loss) * mixed - loss * gain * second,
                first + 2.0 * gain * mixed + gain**2 * second,
            ]
        )
        gradient = -(gradient / parts.v**2).real
    gradient = np.where((y > 0.0) & np.isfinite(y), gradient, np.where(y == 0.0, 0.0, np.nan))
    return y, np.moveaxis(gradient, 0, -1)
