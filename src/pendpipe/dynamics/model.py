"""What moves: the constants of Eq. 8, and the turning point from which it starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray

RATES = ("quadratic", "hysteretic", "viscous", "coulomb")
"""The losses of Eq. 8, in the order of Eq. 13: a, the two parts of b, c."""
JACOBIAN_COLUMNS = (*RATES, "angular_frequency", "angle", "time", "offset")
"""The columns of every Jacobian."""


@dataclass(frozen=True)
class Eq8:
    r"""The pendulum of Eq. 8, by the first-order rates of Eq. 13.

    .. math::

        \ddot x + [f_c + f_h \rho + f_q \rho^2]\,\mathrm{sgn}\,\dot x + 2 b_v \dot x
        + \omega^2 x = 0, \qquad \rho = \sqrt{\omega^2 x^2 + \dot x^2},

    with :math:`f_c = \pi\omega c/2`, :math:`f_h = \pi b_h/2`, :math:`f_q = \pi a/(2\omega)`.

    With ``restoring="sine"`` the torque is that of a pendulum of any amplitude below pi,

    .. math::

        \ddot x + [f_c + f_h \rho + f_q \rho^2]\,\mathrm{sgn}\,\dot x + 2 b_v \dot x
        + \omega^2 \sin x = 0, \qquad
        \rho = \sqrt{2 \omega^2 (1 - \cos x) + \dot x^2}:

    rho^2 is twice the energy in both, so that the losses keep the paper's energy form (Eq. 9a).
    Balancing the energy over half a swing gives the decay of the amplitude y to first order in
    the losses, with :math:`k = \sin(y/2)` and the complete elliptic integrals K and E of modulus k,

    .. math::

        \frac{dy}{dt} = -\frac{\pi y\,(c + 2 k\,b_h + 4 k^2 a)
        + 16\,b_v\,[E - (1 - k^2) K]}{2 K \sin y},

    and the angular frequency :math:`\pi\omega/(2 K)`. For small y this is Eq. 13,
    :math:`-(c + b y + a y^2)`, so that a, b and c mean the same.

    A drag that follows :math:`\dot x |\dot x|` has another cycle integral with the sine. If it has
    the same a at small amplitudes, it takes :math:`3 (\sin y - y \cos y)/[2 y (1 - \cos y)]` of
    what the energy form takes in half a swing: :math:`1 - y^2/60`, 0.98 at 1 rad, 0.87 at 2.5 rad.
    By so much the a of such a drag comes out too small where most of the loss is at y.

    At rest at an amplitude y the friction is that of the square bracket with
    :math:`\rho = \omega y` (sine: :math:`2 \omega \sin(y/2)`), whatever its terms; the pendulum
    moves only if :math:`\omega^2 y` (:math:`\omega^2 \sin y`) exceeds it. So hysteretic friction
    alone locks it for
    :math:`Q_h = \omega/(2 b_h) \le \pi/4`, and quadratic friction locks it beyond a largest
    amplitude; see `stop_rad`.

    Parameters
    ----------
    angular_frequency
        omega, rad/s.
    quadratic
        a, 1/(rad s); a = omega/(2 y0 Q_f0).
    hysteretic, viscous
        The two parts of b, 1/s; b_h = omega/(2 Q_h), b_v = omega/(2 Q_v).
    coulomb
        c, rad/s; c = omega y0/(2 Q_c0).
    restoring
        The torque: ``"linear"``, omega^2 x, or ``"sine"``, omega^2 sin x.

    Examples
    --------
    Released at 2 rad, a pendulum swings at three quarters of its frequency at small amplitudes.

    >>> from pendpipe.dynamics import Eq8, Release, turning_points
    >>> pendulum = Eq8(6.28, viscous=1e-6, restoring="sine")
    >>> points = turning_points(pendulum, Release(0.0, 2.0), count=3)
    >>> round(float(6.283185 / 6.28 / points.time_s[2]), 4)
    0.7525
    """

    angular_frequency: float
    quadratic: float = 0.0
    hysteretic: float = 0.0
    viscous: float = 0.0
    coulomb: float = 0.0
    restoring: Literal["linear", "sine"] = "linear"

    def __post_init__(self) -> None:
        if self.restoring not in ("linear", "sine"):
            message = f'restoring must be "linear" or "sine", not {self.restoring!r}'
            raise ValueError(message)
        if not 0.0 < self.angular_frequency < math.inf:
            message = f"angular_frequency must be positive and finite, not {self.angular_frequency}"
            raise ValueError(message)
        for name in RATES:
            if not 0.0 <= getattr(self, name) < math.inf:
                message = f"{name} must be finite and not negative, not {getattr(self, name)}"
                raise ValueError(message)

    def rates(self) -> tuple[float, float, float, float]:
        """Return the losses in the order of `RATES`."""
        return self.quadratic, self.hysteretic, self.viscous, self.coulomb

    @property
    def stop_rad(self) -> float:
        """The amplitude at and below which the pendulum, once at rest, stays; inf if locked.

        The smallest root m of delta + h m + q m^2 = m, with delta = pi c/(2 omega),
        h = pi b_h/(2 omega) and q = pi a/(2 omega): Coulomb friction alone stops it below
        delta, and the other terms add to that. For the sine delta + h s + q s^2 = sin m with
        s = 2 sin(m/2).
        """
        m = self._stop()
        return 2.0 * math.asin(0.5 * m) if self.restoring == "sine" and m < math.inf else m

    def _stop(self) -> float:
        """Return the m of `panel.py`."""
        half_turn = 0.5 * math.pi / self.angular_frequency
        h, free = half_turn * self.hysteretic, 1.0 - half_turn * self.hysteretic
        delta, q = half_turn * self.coulomb, half_turn * self.quadratic
        discriminant = free * free - 4.0 * q * delta
        if free <= 0.0 or discriminant < 0.0:
            return math.inf
        m = 2.0 * delta / (free + math.sqrt(discriminant))
        if self.restoring == "linear" or m == 0.0:
            return m
        # m C(m) is concave, so that Newton's method comes from below and passes no root.
        while m < 2.0:
            c = math.sqrt(1.0 - 0.25 * m * m)
            slope = (1.0 - 0.5 * m * m) / c - h - 2.0 * q * m
            if slope <= 0.0:
                return math.inf
            step = (delta + (h + q * m - c) * m) / slope
            m += step
            if step <= 4e-16 * m:
                return m
        return math.inf

    def shape(self) -> tuple[float, float, float, float, float]:
        """Return m, h, q, g, k: Eq. 8 with time in radians (see `panel.py`)."""
        half_turn = 0.5 * math.pi / self.angular_frequency
        return (
            self._stop(),
            half_turn * self.hysteretic,
            half_turn * self.quadratic,
            self.viscous / self.angular_frequency,
            1.0 if self.restoring == "sine" else 0.0,
        )

    def shape_derivatives(self) -> FloatArray:
        """Return the derivatives of m, h, q, g (columns) by a, b_h, b_v, c (rows)."""
        m, h, q, _, k = self.shape()
        half_turn = 0.5 * math.pi / self.angular_frequency
        stop = 0.0 if math.isinf(m) else m
        steepness = (1.0 - 0.5 * k * stop**2) / math.sqrt(1.0 - 0.25 * k * stop**2)
        by_delta = 0.0 if math.isinf(m) else 1.0 / (steepness - h - 2.0 * q * m)
        return np.array(
            [
                [half_turn * by_delta * stop * stop, 0.0, half_turn, 0.0],
                [half_turn * by_delta * stop, half_turn, 0.0, 0.0],
                [0.0, 0.0, 0.0, 1.0 / self.angular_frequency],
                [half_turn * by_delta, 0.0, 0.0, 0.0],
            ]
        )


@dataclass(frozen=True)
class Release:
    """The turning point from which the motion starts, at rest.

    Parameters
    ----------
    time_s
        When.
    angle_rad
        Where, about the equilibrium; its sign is the side.
    offset_rad
        What is added to every reading: the reading of the equilibrium.
    """

    time_s: float
    angle_rad: float
    offset_rad: float = 0.0

    def __post_init__(self) -> None:
        for name in ("time_s", "angle_rad", "offset_rad"):
            if not math.isfinite(getattr(self, name)):
                message = f"{name} must be finite, not {getattr(self, name)}"
                raise ValueError(message)
