"""What moves: the constants of Eq. 8, and the turning point from which it starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray

JACOBIAN_COLUMNS = (
    "quadratic", "hysteretic", "viscous", "coulomb", "angular_frequency", "angle", "time", "offset",
)  # fmt: skip
"""The columns of every Jacobian, in this order, with b in its two parts."""

JOINT_JACOBIAN_COLUMNS = (
    "quadratic", "linear", "coulomb", "angular_frequency", "angle", "time", "offset",
)  # fmt: skip
"""The columns with b as one, its hysteretic share given."""


@dataclass(frozen=True)
class Eq8:
    r"""The pendulum of Eq. 8, by the first-order rates of Eq. 13.

    .. math::

        \ddot x + [f_c + f_h \rho + f_q \rho^2]\,\mathrm{sgn}\,\dot x + 2 b_v \dot x
        + \omega^2 x = 0, \qquad \rho = \sqrt{\omega^2 x^2 + \dot x^2},

    with :math:`f_c = \pi\omega c/2`, :math:`f_h = \pi b_h/2`, :math:`f_q = \pi a/(2\omega)`.

    At rest at an amplitude y the friction is that of the square bracket with
    :math:`\rho = \omega y`, whatever its terms; the pendulum moves only if
    :math:`\omega^2 y` exceeds it. So hysteretic friction alone locks it for
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
    """

    angular_frequency: float
    quadratic: float = 0.0
    hysteretic: float = 0.0
    viscous: float = 0.0
    coulomb: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.angular_frequency < math.inf:
            message = f"angular_frequency must be positive and finite, not {self.angular_frequency}"
            raise ValueError(message)
        for name in ("quadratic", "hysteretic", "viscous", "coulomb"):
            if not 0.0 <= getattr(self, name) < math.inf:
                message = f"{name} must be finite and not negative, not {getattr(self, name)}"
                raise ValueError(message)

    @property
    def stop_rad(self) -> float:
        """The amplitude at and below which the pendulum, once at rest, stays; inf if locked.

        The smaller root m of delta + h m + q m^2 = m, with delta = pi c/(2 omega),
        h = pi b_h/(2 omega) and q = pi a/(2 omega): Coulomb friction alone stops it below
        delta, and the other terms add to that.
        """
        half_turn = 0.5 * math.pi / self.angular_frequency
        free = 1.0 - half_turn * self.hysteretic
        delta, q = half_turn * self.coulomb, half_turn * self.quadratic
        discriminant = free * free - 4.0 * q * delta
        if free <= 0.0 or discriminant < 0.0:
            return math.inf
        return 2.0 * delta / (free + math.sqrt(discriminant))

    def shape(self) -> tuple[float, float, float, float]:
        """Return m, h, q, g: Eq. 8 with time in radians (see `panel.py`)."""
        half_turn = 0.5 * math.pi / self.angular_frequency
        return (
            self.stop_rad,
            half_turn * self.hysteretic,
            half_turn * self.quadratic,
            self.viscous / self.angular_frequency,
        )

    def shape_derivatives(self) -> FloatArray:
        """Return the derivatives of m, h, q, g (columns) by a, b_h, b_v, c (rows)."""
        m, h, q, _ = self.shape()
        half_turn = 0.5 * math.pi / self.angular_frequency
        by_delta = 0.0 if math.isinf(m) else 1.0 / (1.0 - h - 2.0 * q * m)
        stop = 0.0 if math.isinf(m) else m
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
        Where, about the equilibrium; the sign says on which side.
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
