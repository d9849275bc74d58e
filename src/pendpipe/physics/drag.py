"""A sphere that moves in a fluid: Eqs. 1, 2 and 16, quadratic drag, added mass.

Symbols of the paper: eta the viscosity, rho the fluid's density, a the sphere's radius,
L the distance from the axis to its centre, I the moment of inertia, delta the
penetration depth (not the logarithmic decrement of Eq. 5).
"""

from __future__ import annotations

import numpy as np

from pendpipe.physics._floats import FloatArray, Numbers, equation


@equation
def stokes_drag(
    velocity_m_per_s: Numbers, radius_m: Numbers, viscosity_pa_s: Numbers
) -> FloatArray:
    """Drag on a sphere in steady flow, Eq. 1: ``f = 6 pi eta a v``.

    Parameters
    ----------
    velocity_m_per_s, radius_m, viscosity_pa_s
        Velocity in m/s, radius in m, dynamic viscosity in Pa s; any shapes that broadcast.

    Returns
    -------
    FloatArray
        The force in N, in the direction of the velocity that it opposes.
    """
    return 6.0 * np.pi * viscosity_pa_s * radius_m * velocity_m_per_s


@equation
def penetration_depth(
    angular_frequency_per_s: Numbers, viscosity_pa_s: Numbers, density_kg_per_m3: Numbers
) -> FloatArray:
    """How far an oscillating surface drags the fluid along: ``delta = sqrt(2 eta/(omega rho))``.

    Parameters
    ----------
    angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3
        omega in rad/s, eta in Pa s, rho in kg/m^3; any shapes that broadcast.

    Returns
    -------
    FloatArray
        The penetration depth of Eqs. 2 and 16 in m.
    """
    return np.sqrt(2.0 * viscosity_pa_s / (angular_frequency_per_s * density_kg_per_m3))


@equation
def harmonic_drag(
    velocity_m_per_s: Numbers,
    radius_m: Numbers,
    angular_frequency_per_s: Numbers,
    viscosity_pa_s: Numbers,
    density_kg_per_m3: Numbers,
    history_coefficient: Numbers = 1.0,
) -> FloatArray:
    """Drag on an oscillating sphere in phase with its velocity, Eq. 2.

    ``f = 6 pi eta a (1 + C_H a/delta) v``. C_H = 1 is the limit of small velocity, and
    C_H = 0 leaves Eq. 1.

    Parameters
    ----------
    velocity_m_per_s, radius_m, angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3
        v in m/s, a in m, omega in rad/s, eta in Pa s, rho in kg/m^3; broadcast.
    history_coefficient
        C_H, a pure number.

    Returns
    -------
    FloatArray
        The force in N, in the direction of the velocity that it opposes.
    """
    depth = penetration_depth(angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3)
    steady = stokes_drag(velocity_m_per_s, radius_m, viscosity_pa_s)
    return steady * (1.0 + history_coefficient * radius_m / depth)


@equation
def viscous_quality_factor(
    moment_of_inertia_kg_m2: Numbers,
    angular_frequency_per_s: Numbers,
    radius_m: Numbers,
    distance_m: Numbers,
    viscosity_pa_s: Numbers,
    density_kg_per_m3: Numbers,
    history_coefficient: Numbers = 1.0,
) -> FloatArray:
    """Quality factor of a pendulum damped by Eq. 2 alone, Eq. 16.

    ``Q_v = I omega / [6 pi eta a (1 + C_H a/delta) L^2]``

    Parameters
    ----------
    moment_of_inertia_kg_m2
        I about the axis in kg m^2. The fluid that swings along belongs to it (added mass).
    angular_frequency_per_s, radius_m, distance_m, viscosity_pa_s, density_kg_per_m3
        omega in rad/s, a and L in m, eta in Pa s, rho in kg/m^3; broadcast.
    history_coefficient
        C_H: 1 in Eq. 16, 0 for the steady Stokes law.

    Returns
    -------
    FloatArray
        Q_v, a pure number.
    """
    drag_per_velocity = harmonic_drag(
        1.0,
        radius_m,
        angular_frequency_per_s,
        viscosity_pa_s,
        density_kg_per_m3,
        history_coefficient,
    )
    return moment_of_inertia_kg_m2 * angular_frequency_per_s / (drag_per_velocity * distance_m**2)


@equation
def quadratic_drag_rate(
    drag_coefficient: Numbers,
    moment_of_inertia_kg_m2: Numbers,
    angular_frequency_per_s: Numbers,
    radius_m: Numbers,
    distance_m: Numbers,
    density_kg_per_m3: Numbers,
) -> FloatArray:
    """Eq. 13's a of a sphere whose drag is ``C_d rho pi R^2 v^2 / 2``.

    ``a = (4/(3 pi)) omega rho C_d pi R^2 L^3 / (2 I)``, from the energy lost in a cycle of
    harmonic motion (the mean of |cos|^3 is 4/(3 pi)).

    Parameters
    ----------
    drag_coefficient
        C_d, a pure number.
    moment_of_inertia_kg_m2, angular_frequency_per_s, radius_m, distance_m, density_kg_per_m3
        I in kg m^2, omega in rad/s, R and L in m, rho in kg/m^3; broadcast.

    Returns
    -------
    FloatArray
        a in 1/(rad s).
    """
    torque = 0.5 * density_kg_per_m3 * drag_coefficient * np.pi * radius_m**2 * distance_m**3
    return 4.0 / (3.0 * np.pi) * angular_frequency_per_s * torque / moment_of_inertia_kg_m2


@equation
def added_mass_coefficient(
    radius_m: Numbers,
    angular_frequency_per_s: Numbers,
    viscosity_pa_s: Numbers,
    density_kg_per_m3: Numbers,
) -> FloatArray:
    """Fluid that swings with a sphere, in units of the displaced fluid: ``1/2 + 9 delta/(4 a)``.

    1/2 is the potential flow's; the rest is the part of the same Stokes solution whose
    other part is Eq. 2's history term (Stokes 1850; Landau and Lifshitz, section 24).

    Parameters
    ----------
    radius_m, angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3
        a in m, omega in rad/s, eta in Pa s, rho in kg/m^3; broadcast.

    Returns
    -------
    FloatArray
        Added mass over the mass of the displaced fluid, a pure number.
    """
    depth = penetration_depth(angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3)
    return 0.5 + 2.25 * depth / radius_m


POTENTIAL_FLOW_ADDED_MASS = 0.5
"""The plain form of the added-mass coefficient: a sphere in a fluid without viscosity."""
