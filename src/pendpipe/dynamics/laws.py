"""Pendulums beyond Eq. 8: any restoring torque and any friction of angle and velocity.

A law is declared by small objects that work on arrays. Everything is per moment of inertia, so
that torques are angular accelerations (rad/s^2); the motion is

    x'' = -restoring(x) - sgn(x') sum of friction(x, |x'|).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pendpipe.dynamics.model import Eq8

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendpipe.arrays import FloatArray


class Restoring(Protocol):
    """What pulls the pendulum to its equilibrium at x = 0."""

    @property
    def angular_frequency(self) -> float:
        """Omega of small oscillations, rad/s."""

    def torque(self, angle_rad: FloatArray) -> FloatArray:
        """Return the restoring torque, rad/s^2; it has the sign of the angle."""

    def potential(self, angle_rad: FloatArray) -> FloatArray:
        """Return the integral of the torque from 0, rad^2/s^2."""


class Friction(Protocol):
    """What opposes the motion."""

    def __call__(self, angle_rad: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the size of the friction, rad/s^2, at an angle and a speed (rad/s) >= 0."""


@dataclass(frozen=True)
class Gravity:
    """The plain pendulum: omega^2 sin(x)."""

    angular_frequency: float

    def torque(self, angle_rad: FloatArray) -> FloatArray:
        """Return omega^2 sin(x)."""
        return self.angular_frequency**2 * np.sin(angle_rad)

    def potential(self, angle_rad: FloatArray) -> FloatArray:
        """Return omega^2 (1 - cos x), without cancellation."""
        return 2.0 * (self.angular_frequency * np.sin(0.5 * angle_rad)) ** 2


@dataclass(frozen=True)
class PolynomialTorque:
    """A restoring torque c_1 x + c_2 x^2 + ...; `coefficients` begins with c_1 = omega^2."""

    coefficients: tuple[float, ...]

    @property
    def angular_frequency(self) -> float:
        """The square root of c_1."""
        return math.sqrt(self.coefficients[0])

    def torque(self, angle_rad: FloatArray) -> FloatArray:
        """Return c_1 x + c_2 x^2 + ..."""
        return np.asarray(
            np.polynomial.polynomial.polyval(angle_rad, (0.0, *self.coefficients)), dtype=np.float64
        )

    def potential(self, angle_rad: FloatArray) -> FloatArray:
        """Return c_1 x^2/2 + c_2 x^3/3 + ..."""
        integrated = (c / (k + 2) for k, c in enumerate(self.coefficients))
        value = np.polynomial.polynomial.polyval(angle_rad, (0.0, 0.0, *integrated))
        return np.asarray(value, dtype=np.float64)


def linear(angular_frequency: float) -> PolynomialTorque:
    """Return the torque omega^2 x of Eq. 8."""
    return PolynomialTorque((angular_frequency**2,))


@dataclass(frozen=True)
class Eq8Friction:
    """The friction of Eq. 8 (all four terms), for any restoring torque."""

    model: Eq8

    def __call__(self, angle_rad: FloatArray, speed: FloatArray) -> FloatArray:
        """Return f_c + f_h rho + f_q rho^2 + 2 b_v |v|, rho^2 = omega^2 x^2 + v^2."""
        m = self.model
        square = (m.angular_frequency * angle_rad) ** 2 + speed**2
        return (
            0.5 * math.pi * m.angular_frequency * m.coulomb
            + 0.5 * math.pi * m.hysteretic * np.sqrt(square)
            + 0.5 * math.pi * m.quadratic / m.angular_frequency * square
            + 2.0 * m.viscous * speed
        )


@dataclass(frozen=True)
class EnergyFriction:
    """Equation 9a: c (2 E/(m omega^2))^lambda, with the paper's c.

    lambda = 0 is Coulomb friction, 1/2 hysteretic, 1 fluid; for a linear torque
    2 E/(m omega^2) is x^2 + v^2/omega^2.
    """

    coefficient: float
    exponent: float
    restoring: Restoring

    def __call__(self, angle_rad: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the friction; it depends on the energy alone."""
        twice_energy = 2.0 * self.restoring.potential(angle_rad) + speed**2
        scaled = np.maximum(twice_energy, 0.0) / self.restoring.angular_frequency**2
        return self.coefficient * scaled**self.exponent


@dataclass(frozen=True)
class PowerFriction:
    """c |v|^n: n = 1 viscous, 2 turbulent, 0 Coulomb."""

    coefficient: float
    exponent: float

    def __call__(self, angle_rad: FloatArray, speed: FloatArray) -> FloatArray:
        """Return c |v|^n."""
        return self.coefficient * speed**self.exponent + 0.0 * angle_rad


@dataclass(frozen=True)
class StribeckFriction:
    """Coulomb friction that grows from `sliding` to `static` as the speed falls below `speed`."""

    sliding: float
    static: float
    speed: float

    def __call__(self, angle_rad: FloatArray, speed: FloatArray) -> FloatArray:
        """Return sliding + (static - sliding) exp(-(v/v_s)^2)."""
        extra = (self.static - self.sliding) * np.exp(-((speed / self.speed) ** 2))
        return self.sliding + extra + 0.0 * angle_rad


@dataclass(frozen=True)
class FrictionOf:
    """Friction by any function of angle and speed that works on arrays."""

    function: Callable[[FloatArray, FloatArray], FloatArray]

    def __call__(self, angle_rad: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the function's value."""
        return self.function(angle_rad, speed)


@dataclass(frozen=True)
class Autonomous:
    """A pendulum whose torques depend on its angle and velocity alone.

    Parameters
    ----------
    restoring
        The restoring torque.
    frictions
        What opposes the motion; they add up.
    """

    restoring: Restoring
    frictions: tuple[Friction, ...] = ()

    def friction(self, angle_rad: FloatArray, speed: FloatArray) -> FloatArray:
        """Return the whole friction's size, rad/s^2."""
        total = np.zeros_like(angle_rad)
        for friction in self.frictions:
            total = total + friction(angle_rad, speed)
        return total

    def acceleration(self, angle_rad: FloatArray, velocity: FloatArray, side: float) -> FloatArray:
        """Return x'' while the motion is towards `side` (+1 or -1), turning points included."""
        return -self.restoring.torque(angle_rad) - side * self.friction(angle_rad, np.abs(velocity))

    def sticks(self, angle_rad: float) -> bool:
        """Say whether friction holds the pendulum at rest at this angle."""
        angle = np.array([angle_rad])
        pull = np.abs(self.restoring.torque(angle))
        return bool((self.friction(angle, np.zeros(1)) >= pull)[0])

    def slides_to(self, side: float, reach: float) -> float:
        """Return where a slow motion towards `side` would come to rest, within `reach` of 0.

        There the restoring torque balances the friction: before the equilibrium, since the
        friction points back. At the equilibrium itself if nothing resists a slow motion.
        """
        inner, outer = 0.0, -side * reach
        if not (self.friction(np.zeros(1), np.zeros(1)) > 0.0)[0]:
            return 0.0
        for _ in range(200):
            middle = 0.5 * (inner + outer)
            if middle in (inner, outer):
                break
            if self.sticks(middle):
                inner = middle
            else:
                outer = middle
        return outer
