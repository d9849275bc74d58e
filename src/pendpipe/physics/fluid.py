"""A body in a fluid: Eqs. 1, 2 and 16, quadratic drag, added mass, memory; and water itself.

Symbols of the paper: eta the viscosity, rho the fluid's density, a the sphere's radius,
L the distance from the axis to its centre, I the moment of inertia, delta the
penetration depth (not the logarithmic decrement of Eq. 5).
"""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pendpipe.arrays import FloatArray, Numbers, equation

# IAPWS SR6-08 (2011), after J. Patek et al., J. Phys. Chem. Ref. Data 38 (2009) 21:
# amplitudes in uPa s and exponents of T / 300 K; valid from -20 to 110 C, within 1 %.
_VISCOSITY_TERMS = ((280.68, -1.9), (511.45, -7.7), (61.131, -19.6), (0.45903, -40.0))

# M. Tanaka et al., Metrologia 38 (2001) 301: SMOW, free of air, 101325 Pa; 0 to 40 C.
_DENSITY_CONSTANTS = (-3.983035, 301.797, 522528.9, 69.34881, 999.974950)


@equation
def water_viscosity(temperature_c: Numbers) -> FloatArray:
    """Dynamic viscosity of water at 0.1 MPa.

    ``eta = sum_i a_i (T/300 K)^(b_i)`` uPa s with four terms: the IAPWS supplementary
    release SR6-08 (2011) on liquid water. It gives 1.0016 mPa s at 20 C, the paper's value.

    Parameters
    ----------
    temperature_c
        Temperature in degrees Celsius, any shape.

    Returns
    -------
    FloatArray
        Viscosity in Pa s; NaN outside the formula's range of -20 to 110 C.
    """
    reduced = (temperature_c + 273.15) / 300.0
    within = (temperature_c >= -20.0) & (temperature_c <= 110.0)
    reduced = np.where(within, reduced, np.nan)
    return 1e-6 * np.asarray(sum(factor * reduced**power for factor, power in _VISCOSITY_TERMS))


@equation
def water_density(temperature_c: Numbers) -> FloatArray:
    """Density of water at 101325 Pa.

    ``rho = a5 [1 - (t + a1)^2 (t + a2) / (a3 (t + a4))]``, Tanaka et al.,
    Metrologia 38 (2001) 301, for water free of air.

    Parameters
    ----------
    temperature_c
        Temperature in degrees Celsius, any shape.

    Returns
    -------
    FloatArray
        Density in kg/m^3; NaN outside the formula's range of 0 to 40 C.
    """
    t = np.where((temperature_c >= 0.0) & (temperature_c <= 40.0), temperature_c, np.nan)
    a1, a2, a3, a4, a5 = _DENSITY_CONSTANTS
    return a5 * (1.0 - (t + a1) ** 2 * (t + a2) / (a3 * (t + a4)))


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


_ROUNDS: Final = 50
"""Of a fixed point at most."""


@equation
def free_decay_root(
    inertia_kg_m2: Numbers,
    steady: Numbers,
    history: Numbers,
    torque_n_m_per_rad: Numbers,
    loss_torque: Numbers = 0.0,
    loss_exponent: Numbers = 0.0,
) -> npt.NDArray[np.complex128]:
    """Complex rate s of a free decay ``exp(s t)``, damped by Stokes' drag and by solid friction.

    The root with positive imaginary part of
    ``I s^2 + (D1 + kappa''/|s|) s + D2 s^(3/2) + K = 0``. A harmonic
    motion, s = i omega, would meet the drag of Eq. 2 and the added mass of
    `added_mass_coefficient`; a decay meets a little more drag: to first order
    ``-Re s = D/(2 (I_all - I_layer/4))`` with D the drag of Eq. 16 and ``kappa''/omega``, I_all
    the inertia with all added mass and I_layer that of the boundary layer, ``D2/sqrt(2 omega)``:
    the fluid remembers larger velocities, whatever makes the motion decay.

    Parameters
    ----------
    inertia_kg_m2
        I of the solid and of the potential flow, kg m^2.
    steady, history
        D1 in N m s, ``6 pi eta a L^2`` of a sphere, and D2 in N m s^(3/2),
        ``6 pi a^2 sqrt(rho eta) L^2``.
    torque_n_m_per_rad
        K, positive.
    loss_torque, loss_exponent
        ``kappa'' = loss_torque |s|^loss_exponent``, N m/rad with |s| in 1/s: the hysteretic
        torque for each radian, by default independent of the rate.

    Returns
    -------
    complex array
        s in 1/s: the decay rate b is -Re s, Eq. 8's angular frequency is abs(s).

    Examples
    --------
    >>> s = free_decay_root(1.0, 0.02, 0.0, 4.0)  # without memory: -D/(2 I), omega^2 = K/I
    >>> round(float(-s.real), 12), round(float(abs(s)), 12)
    (0.01, 2.0)
    """
    inertia, torque = inertia_kg_m2, torque_n_m_per_rad
    root = 1j * np.sqrt(torque / (inertia + 0.0 * (steady + history + loss_torque)))
    for _ in range(_ROUNDS):
        half = np.sqrt(root)
        drag = steady + loss_torque * np.abs(root) ** (loss_exponent - 1.0)
        value = inertia * root**2 + drag * root + history * root * half + torque
        step = value / (2.0 * inertia * root + drag + 1.5 * history * half)
        root = root - step
        if np.all(np.abs(step) <= 1e-15 * np.abs(root)):
            break
    return root


@equation
def rotation_of_sphere(radius_m: Numbers, distance_m: Numbers) -> FloatArray:
    """Drag of a sphere's own rotation over that of its path: ``(4/9) (a/L)^2``.

    A sphere fixed to the rod turns with it. Its thin boundary layer takes the torque
    ``(8 pi/3) eta a^4/delta`` for each rad/s (Landau and Lifshitz, section 24), beside
    ``6 pi eta a^2 L^2/delta`` of Eq. 2.

    Parameters
    ----------
    radius_m, distance_m
        a and L in m.

    Returns
    -------
    FloatArray
        A pure number, to be added to 1.
    """
    return 4.0 / 9.0 * (radius_m / distance_m) ** 2


@equation
def cylinder_drag(
    radius_m: Numbers,
    angular_frequency_per_s: Numbers,
    viscosity_pa_s: Numbers,
    density_kg_per_m3: Numbers,
) -> FloatArray:
    """Drag of a cylinder that oscillates across its axis, for each metre and each m/s.

    ``pi rho omega b^2 Re[-4 i K1(z)/(z K0(z))]``, z = (1 + i) b/delta with K the modified Bessel
    functions (Stokes 1850). For a thin layer it is ``4 pi eta (b/delta + 1/2)``.

    Parameters
    ----------
    radius_m, angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3
        b in m, omega in rad/s, eta in Pa s, rho in kg/m^3; broadcast.

    Returns
    -------
    FloatArray
        In N s/m^2, in phase with the velocity that it opposes.
    """
    force = _cylinder_force(radius_m, angular_frequency_per_s * density_kg_per_m3 / viscosity_pa_s)
    displaced = np.pi * density_kg_per_m3 * radius_m**2
    return displaced * angular_frequency_per_s * -np.imag(force)


@equation
def cylinder_added_mass_coefficient(
    radius_m: Numbers,
    angular_frequency_per_s: Numbers,
    viscosity_pa_s: Numbers,
    density_kg_per_m3: Numbers,
) -> FloatArray:
    """Fluid that swings with a rod across its axis, in units of the displaced fluid.

    ``Re[1 + 4 K1(z)/(z K0(z))]``, z = (1 + i) b/delta: Stokes's k of a cylinder (1850), 1 without
    viscosity; `cylinder_drag` has the other part of the same force.

    Parameters
    ----------
    radius_m, angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3
        b in m, omega in rad/s, eta in Pa s, rho in kg/m^3; broadcast.

    Returns
    -------
    FloatArray
        Added mass over the mass of the displaced fluid, a pure number.
    """
    return 1.0 + np.real(
        _cylinder_force(radius_m, angular_frequency_per_s * density_kg_per_m3 / viscosity_pa_s)
    )


@equation
def disc_drag(
    radius_m: Numbers,
    angular_frequency_per_s: Numbers,
    viscosity_pa_s: Numbers,
    density_kg_per_m3: Numbers,
) -> FloatArray:
    """Torque of the fluid on a thin disc that turns about its axis, for each rad/s.

    ``pi eta a^4/delta``: the shear ``eta omega r/delta`` over both faces. With a moment of inertia
    I arcs half a swing tau apart have the logarithmic ratio ``pi eta a^4 tau/(2 I delta)``, which
    is ``pi^(3/2)/(2 sqrt 2) rho a^4 sqrt(nu tau)/I`` (Stokes 1850, Eq. 163). The layers
    must be thin beside the disc; its rim is left out.

    Parameters
    ----------
    radius_m, angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3
        a in m, omega in rad/s, eta in Pa s, rho in kg/m^3; broadcast.

    Returns
    -------
    FloatArray
        In N m s, in phase with the velocity that it opposes; the fluid that turns along has the
        moment of inertia ``pi eta a^4/(delta omega)``.
    """
    depth = penetration_depth(angular_frequency_per_s, viscosity_pa_s, density_kg_per_m3)
    return np.pi * viscosity_pa_s * radius_m**4 / depth


def _cylinder_force(radius_m: Any, rate: Any) -> Any:
    """``4 K1(z)/(z K0(z))`` with z = b sqrt(i omega/nu)."""
    from scipy.special import kve

    argument = radius_m * np.sqrt(1j * rate)
    # Both times exp(z), which cancels in the ratio.
    return 4.0 * kve(1, argument) / kve(0, argument) / argument
