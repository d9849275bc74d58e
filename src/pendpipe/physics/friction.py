"""Eq. 8, the friction that depends on the energy (Eqs. 9, 10), and the two ways to name it.

The paper names the four losses by quality factors at the starting amplitude y0; the rest
of the program by the first-order rates of Eq. 13, which need no y0:

    a = omega/(2 y0 Q_f0),  b = (omega/2)(1/Q_h + 1/Q_v),  c = omega y0/(2 Q_c0).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pendpipe.physics._floats import FloatArray, Numbers, equation, floats, plain
from pendpipe.physics.quality import inverse


class QualityFactors(NamedTuple):
    """The four quality factors of Eq. 8, at the starting amplitude; infinite where no loss."""

    coulomb: FloatArray
    hysteretic: FloatArray
    fluid: FloatArray
    viscous: FloatArray


def decay_rates(
    quality_factors: QualityFactors | tuple[Numbers, Numbers, Numbers, Numbers],
    amplitude0_rad: Numbers,
    angular_frequency_per_s: Numbers,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Turn (Q_c0, Q_h, Q_f0, Q_v) at y0 into the rates of Eq. 13, to first order.

    Parameters
    ----------
    quality_factors
        Q_c0, Q_h, Q_f0, Q_v in this order; infinite for a loss that is absent.
    amplitude0_rad, angular_frequency_per_s
        y0 in rad, omega in rad/s; broadcast.

    Returns
    -------
    tuple of FloatArray
        a in 1/(rad s), the hysteretic and the viscous part of b in 1/s, and c in rad/s: the order
        of `pendpipe.Eq8`.
    """
    coulomb, hysteretic, fluid, viscous = floats(*quality_factors)
    y0, omega = floats(amplitude0_rad, angular_frequency_per_s)
    half = 0.5 * omega
    return (
        plain(half / (y0 * fluid)),
        plain(half / hysteretic),
        plain(half / viscous),
        plain(half * y0 / coulomb),
    )


def quality_factors(
    a: Numbers,
    b: Numbers,
    c: Numbers,
    amplitude0_rad: Numbers,
    angular_frequency_per_s: Numbers,
    hysteretic_share: Numbers,
) -> QualityFactors:
    """Turn (a, b, c) into (Q_c0, Q_h, Q_f0, Q_v) at y0; inverse of `decay_rates`.

    The decay of the turning points knows b only; how much of it is hysteretic must come
    from elsewhere (Eq. 17).

    Parameters
    ----------
    a, b, c
        The rates of Eq. 13 in 1/(rad s), 1/s and rad/s; broadcast.
    amplitude0_rad, angular_frequency_per_s
        y0 in rad, omega in rad/s.
    hysteretic_share
        The hysteretic part of b, between 0 and 1.
    """
    quadratic, linear, coulomb, y0, omega, share = floats(
        a, b, c, amplitude0_rad, angular_frequency_per_s, hysteretic_share
    )
    half = 0.5 * omega
    return QualityFactors(
        plain(half * y0 * inverse(coulomb)),
        plain(half * inverse(share * linear)),
        plain(half / y0 * inverse(quadratic)),
        plain(half * inverse((1.0 - share) * linear)),
    )


def universal_acceleration(
    angle_rad: Numbers,
    angular_velocity_rad_per_s: Numbers,
    angular_frequency_per_s: Numbers,
    quality_factors: QualityFactors | tuple[Numbers, Numbers, Numbers, Numbers],
    amplitude0_rad: Numbers,
) -> FloatArray:
    """Acceleration of the free decay with every loss, Eq. 8 (its misprints mended).

    ``x'' = -[pi omega^2 y0/(4 Q_c0) + (pi omega/(4 Q_h)) w + (pi/(4 y0 Q_f0)) w^2] sgn(x')
    - (omega/Q_v) x' - omega^2 x`` with ``w = sqrt(omega^2 x^2 + x'^2)``.

    Parameters
    ----------
    angle_rad, angular_velocity_rad_per_s
        x in rad and x' in rad/s; broadcast.
    angular_frequency_per_s
        omega in rad/s.
    quality_factors
        Q_c0, Q_h, Q_f0, Q_v in this order; infinite for a loss that is absent.
    amplitude0_rad
        y0 in rad, the amplitude at which Q_c0 and Q_f0 hold.

    Returns
    -------
    FloatArray
        x'' in rad/s^2. At rest (x' = 0) the bracket is left out: whether Coulomb
        friction then holds the pendulum is for the integrator to decide.
    """
    coulomb, hysteretic, fluid, viscous = floats(*quality_factors)
    x, v, omega, y0 = floats(
        angle_rad, angular_velocity_rad_per_s, angular_frequency_per_s, amplitude0_rad
    )
    speed = np.hypot(omega * x, v)
    bracket = (np.pi / 4.0) * (
        omega**2 * y0 / coulomb + omega * speed / hysteretic + speed**2 / (y0 * fluid)
    )
    return plain(-bracket * np.sign(v) - omega / viscous * v - omega**2 * x)


@equation
def energy_power_friction(
    amplitude_rad: Numbers, coefficient: Numbers, exponent: Numbers
) -> FloatArray:
    """Friction per mass (or torque per inertia) as a power of the energy, Eq. 9a.

    ``f/m = c (2E/(m omega^2))^lambda = c y^(2 lambda)``: lambda = 0 is Coulomb's friction,
    1/2 hysteretic, 1 fluid.

    Parameters
    ----------
    amplitude_rad, coefficient, exponent
        y in rad, c in rad^(1 - 2 lambda)/s^2, lambda; broadcast.

    Returns
    -------
    FloatArray
        f/m in rad/s^2.
    """
    return coefficient * amplitude_rad ** (2.0 * exponent)


@equation
def energy_power_quality_factor(
    amplitude_rad: Numbers,
    coefficient: Numbers,
    exponent: Numbers,
    angular_frequency_per_s: Numbers,
) -> FloatArray:
    """Quality factor of Eq. 9a's friction at amplitude y.

    The square wave of the friction has the fundamental (4/pi) f/m, which Eq. 9a equates
    with omega v/Q: ``Q = (pi/4) omega^2 y^(1 - 2 lambda) / c``.
    """
    friction = energy_power_friction(amplitude_rad, coefficient, exponent)
    return (np.pi / 4.0) * angular_frequency_per_s**2 * amplitude_rad / friction


def net_quality_factor(
    quality_factors: QualityFactors | tuple[Numbers, Numbers, Numbers, Numbers],
    amplitude_rad: Numbers,
    amplitude0_rad: Numbers,
) -> FloatArray:
    """Quality factor at amplitude y with every loss active, Eq. 9b.

    ``1/Q = y0/(y Q_c0) + 1/Q_h + y/(y0 Q_f0) + 1/Q_v``

    Parameters
    ----------
    quality_factors
        Q_c0, Q_h, Q_f0, Q_v in this order, Q_c0 and Q_f0 at y0.
    amplitude_rad, amplitude0_rad
        y and y0 in rad; broadcast.
    """
    coulomb, hysteretic, fluid, viscous = floats(*quality_factors)
    y, y0 = floats(amplitude_rad, amplitude0_rad)
    loss = y0 / (y * coulomb) + 1.0 / hysteretic + y / (y0 * fluid) + 1.0 / viscous
    return inverse(loss)


@equation
def structural_quality_factor(
    moment_of_inertia_kg_m2: Numbers,
    angular_frequency_per_s: Numbers,
    loss_torque_n_m_per_rad: Numbers,
) -> FloatArray:
    """Quality factor of a loss torque that is proportional to the angle, Eq. 10.

    ``Q_h = I omega^2 / kappa''``: proportional to omega^2 as long as neither I nor the
    loss torque per angle kappa'' changes.

    Parameters
    ----------
    moment_of_inertia_kg_m2, angular_frequency_per_s, loss_torque_n_m_per_rad
        I in kg m^2, omega in rad/s, kappa'' in N m/rad; broadcast.
    """
    return moment_of_inertia_kg_m2 * angular_frequency_per_s**2 / loss_torque_n_m_per_rad
