"""Quality factors and losses: Eqs. 3-13, 15 and 17.

The paper names the four losses of Eq. 8 by quality factors at the starting amplitude y0; the
rest of the program by the first-order rates of Eq. 13, which need no y0:

    a = omega/(2 y0 Q_f0),  b = (omega/2)(1/Q_h + 1/Q_v),  c = omega y0/(2 Q_c0).
"""

from typing import NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray, Numbers, equation


@equation
def viscous_acceleration(
    displacement: Numbers,
    velocity: Numbers,
    angular_frequency_per_s: Numbers,
    quality_factor: Numbers,
) -> FloatArray:
    """Acceleration of the linear oscillator, Eq. 3: ``x'' = -(omega/Q) x' - omega^2 x``.

    Parameters
    ----------
    displacement, velocity
        x and x' in rad and rad/s (or m and m/s); broadcast.
    angular_frequency_per_s, quality_factor
        omega of the undamped motion in rad/s and Q.

    Returns
    -------
    FloatArray
        x'' in rad/s^2 (or m/s^2).
    """
    return (
        -angular_frequency_per_s / quality_factor * velocity
        - angular_frequency_per_s**2 * displacement
    )


@equation
def damping_coefficient(angular_frequency_per_s: Numbers, quality_factor: Numbers) -> FloatArray:
    """The rate beta of the amplitude's decay in 1/s, Eq. 4: ``2 beta = omega/Q``."""
    return angular_frequency_per_s / (2.0 * quality_factor)


@equation
def logarithmic_decrement(quality_factor: Numbers) -> FloatArray:
    """Logarithm of the ratio of amplitudes one period apart, Eq. 5: ``beta T = pi/Q``."""
    return np.pi / quality_factor


@equation
def viscous_frequency_shift(quality_factor: Numbers) -> FloatArray:
    """Relative frequency shift of viscous damping to leading order, Eq. 6: ``-1/(8 Q^2)``."""
    return -1.0 / (8.0 * quality_factor**2)


@equation
def hysteretic_frequency_shift(quality_factor: Numbers) -> FloatArray:
    """Relative frequency shift of Eq. 8's hysteretic term to leading order: ``-pi^2/(32 Q_h^2)``.

    According to the paper there is none; Eq. 8 itself has one, 2.5 times that of Eq. 6.
    """
    return -(np.pi**2) / (32.0 * quality_factor**2)


@equation
def driven_pendulum_acceleration(
    angle_rad: Numbers,
    angular_velocity_rad_per_s: Numbers,
    time_s: Numbers,
    *,
    moment_of_inertia_kg_m2: Numbers,
    restoring_moment_n_m: Numbers,
    quality_factor: Numbers,
    angular_frequency_per_s: Numbers,
    drive_torque_n_m: Numbers = 0.0,
    drive_angular_frequency_per_s: Numbers = 0.0,
) -> FloatArray:
    """Angular acceleration of the driven pendulum of any amplitude, Eq. 7.

    ``I x'' + (omega I/Q) x' + M g Delta sin x = tau_d sin(omega_d t)``

    Parameters
    ----------
    angle_rad, angular_velocity_rad_per_s, time_s
        x in rad, x' in rad/s, t in s; broadcast.
    moment_of_inertia_kg_m2, restoring_moment_n_m
        I in kg m^2 and M g Delta in N m.
    quality_factor, angular_frequency_per_s
        Q and the omega in rad/s that it belongs to.
    drive_torque_n_m, drive_angular_frequency_per_s
        tau_d in N m, omega_d in rad/s.

    Returns
    -------
    FloatArray
        x'' in rad/s^2.
    """
    driven = drive_torque_n_m * np.sin(drive_angular_frequency_per_s * time_s)
    driven = driven - restoring_moment_n_m * np.sin(angle_rad)
    loss_rate = angular_frequency_per_s / quality_factor
    return driven / moment_of_inertia_kg_m2 - loss_rate * angular_velocity_rad_per_s


@equation
def hysteretic_quality_factor(
    frequency_hz: Numbers, hysteretic_coefficient_s2: Numbers
) -> FloatArray:
    """The benchmark's line of Fig. 4: ``Q_hys = k f^2``.

    Parameters
    ----------
    frequency_hz, hysteretic_coefficient_s2
        f in Hz and k in s^2 (3940 in the paper); broadcast.

    Returns
    -------
    FloatArray
        Q_hys, a pure number.
    """
    return hysteretic_coefficient_s2 * frequency_hz**2


@equation
def hysteretic_loss_torque(
    hysteretic_coefficient_s2: Numbers,
    torque_n_m_per_rad: Numbers,
    reference_inertia_kg_m2: Numbers,
    inertia_exponent: Numbers = 0.0,
) -> FloatArray:
    """Loss torque of ``Q_h = k f^2 (I/I_0)^(1 - p)``, as `free_decay_root` takes it.

    ``kappa'' = I omega^2/Q_h = (4 pi^2 I_0/k) (I/I_0)^p``. With ``I = K/omega^2`` that is this
    number times ``omega^(-2 p)``.

    Parameters
    ----------
    hysteretic_coefficient_s2, torque_n_m_per_rad
        k in s^2 and K in N m/rad; all broadcast.
    reference_inertia_kg_m2, inertia_exponent
        I_0 in kg m^2, to which k belongs, and p: 0 for a torque of the material, 1 for
        ``Q_h = k f^2`` whatever the moment of inertia.

    Returns
    -------
    FloatArray
        N m/rad times s^(-2 p).
    """
    inertia = reference_inertia_kg_m2
    torque = 4.0 * np.pi**2 * inertia / hysteretic_coefficient_s2
    return torque * (torque_n_m_per_rad / inertia) ** inertia_exponent


@equation
def without_hysteresis(
    quality_factor_measured: Numbers, quality_factor_hysteretic: Numbers
) -> FloatArray:
    """The viscous part of a measured quality factor, Eq. 17.

    ``1/Q_v,exp = 1/Q_meas - 1/Q_hys``; infinite where the two are equal, negative where
    hysteresis alone would already damp more than was measured.

    Parameters
    ----------
    quality_factor_measured, quality_factor_hysteretic
        Q_meas, the limit pi f/b of Eq. 15, and Q_hys; broadcast.

    Returns
    -------
    FloatArray
        Q_v,exp, a pure number.
    """
    return inverse(1.0 / quality_factor_measured - 1.0 / quality_factor_hysteretic)


@equation
def inverse(rate: Numbers) -> FloatArray:
    """1/x, infinite (without a warning) at zero."""
    with np.errstate(divide="ignore"):
        return 1.0 / rate


@equation
def amplitude_rate(amplitude_rad: Numbers, a: Numbers, b: Numbers, c: Numbers) -> FloatArray:
    """Rate of the amplitude, Eq. 13: ``y' = -(a y^2 + b y + c)``.

    Parameters
    ----------
    amplitude_rad
        y in rad.
    a, b, c
        Rates in 1/(rad s), 1/s and rad/s; broadcast.

    Returns
    -------
    FloatArray
        y' in rad/s; zero where y = 0 (the pendulum rests).
    """
    return np.where(amplitude_rad > 0.0, -((a * amplitude_rad + b) * amplitude_rad + c), 0.0)


@equation
def rates_from_energy_constants(
    c1: Numbers, c2: Numbers, c3: Numbers, energy_per_squared_amplitude: Numbers
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Turn the constants of Eq. 12 into those of Eq. 13.

    With ``E = s y^2``, ``E' = -(c1 + c2 sqrt E + c3 E) sqrt E`` becomes
    ``y' = -(a y^2 + b y + c)`` with ``a = c3 sqrt(s)/2, b = c2/2, c = c1/(2 sqrt(s))``.

    Parameters
    ----------
    c1, c2, c3
        In J^(1/2)/s, 1/s and J^(-1/2)/s; broadcast.
    energy_per_squared_amplitude
        s in J/rad^2; I omega^2/2 for a pendulum.

    Returns
    -------
    tuple of FloatArray
        a in 1/(rad s), b in 1/s, c in rad/s.
    """
    root = np.sqrt(energy_per_squared_amplitude)
    return 0.5 * c3 * root, 0.5 * c2, 0.5 * c1 / root


@equation
def quality_factor(
    amplitude_rad: Numbers, frequency_hz: Numbers, a: Numbers, b: Numbers, c: Numbers
) -> FloatArray:
    """Quality factor at amplitude y, Eq. 15: ``Q = pi f / (a y + b + c/y)``.

    Parameters
    ----------
    amplitude_rad, frequency_hz
        y in rad, f in Hz; broadcast.
    a, b, c
        Rates of Eq. 13 in 1/(rad s), 1/s and rad/s.

    Returns
    -------
    FloatArray
        Q; zero at y = 0 with c > 0, infinite where nothing is lost.
    """
    # Where the pendulum rests, c/y is infinite, unless there is no c.
    coulomb_loss = c * inverse(np.where(c == 0.0, 1.0, amplitude_rad))
    return np.pi * frequency_hz * inverse(a * amplitude_rad + b + coulomb_loss)


def quality_factor_limit(frequency_hz: Numbers, b: Numbers) -> FloatArray:
    """What Q would be with exponential losses only, Eq. 15 with a = c = 0: ``pi f/b``."""
    return quality_factor(1.0, frequency_hz, 0.0, b, 0.0)


@equation
def largest_quality_factor(frequency_hz: Numbers, a: Numbers, b: Numbers, c: Numbers) -> FloatArray:
    """Return the maximum of Eq. 15 over all amplitudes: ``pi f/(b + 2 sqrt(a c))``."""
    return quality_factor_limit(frequency_hz, b + 2.0 * np.sqrt(a * c))


@equation
def amplitude_of_largest_quality_factor(a: Numbers, c: Numbers) -> FloatArray:
    """Return the amplitude in rad at which Eq. 15 is largest: ``y = sqrt(c/a)``.

    Infinite for a = 0 with c > 0 (Q then rises with the amplitude throughout), and NaN for
    a = c = 0, where Q depends on no amplitude.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.sqrt(c / a)


class QualityFactors(NamedTuple):
    """The four quality factors of Eq. 8, at the starting amplitude; infinite where no loss."""

    coulomb: FloatArray
    hysteretic: FloatArray
    fluid: FloatArray
    viscous: FloatArray


@equation
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
    coulomb, hysteretic, fluid, viscous = quality_factors
    y0, half = amplitude0_rad, 0.5 * angular_frequency_per_s
    return half / (y0 * fluid), half / hysteretic, half / viscous, half * y0 / coulomb


@equation
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
    half = 0.5 * angular_frequency_per_s
    return QualityFactors(
        half * amplitude0_rad * inverse(c),
        half * inverse(hysteretic_share * b),
        half / amplitude0_rad * inverse(a),
        half * inverse((1.0 - hysteretic_share) * b),
    )


@equation
def universal_acceleration(
    angle_rad: Numbers,
    angular_velocity_rad_per_s: Numbers,
    angular_frequency_per_s: Numbers,
    quality_factors: QualityFactors | tuple[Numbers, Numbers, Numbers, Numbers],
    amplitude0_rad: Numbers,
) -> FloatArray:
    """Acceleration of the free decay with every loss, Eq. 8 (its misprints corrected).

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
    coulomb, hysteretic, fluid, viscous = quality_factors
    x, v, omega = angle_rad, angular_velocity_rad_per_s, angular_frequency_per_s
    speed = np.hypot(omega * x, v)
    bracket = (np.pi / 4.0) * (
        omega**2 * amplitude0_rad / coulomb
        + omega * speed / hysteretic
        + speed**2 / (amplitude0_rad * fluid)
    )
    return -bracket * np.sign(v) - omega / viscous * v - omega**2 * x


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


@equation
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
    coulomb, hysteretic, fluid, viscous = quality_factors
    relative = amplitude_rad / amplitude0_rad
    loss = 1.0 / (relative * coulomb) + 1.0 / hysteretic + relative / fluid + 1.0 / viscous
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
