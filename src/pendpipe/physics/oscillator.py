"""The damped oscillator of the textbooks, and what damping does to its frequency: Eqs. 3-7."""

from __future__ import annotations

import numpy as np

from pendpipe.physics._floats import FloatArray, Numbers, equation


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
def viscous_frequency_ratio(quality_factor: Numbers) -> FloatArray:
    """Frequency of Eq. 3's free decay over the undamped one: ``sqrt(1 - 1/(4 Q^2))``.

    NaN for Q below 1/2, where there is no oscillation.
    """
    squared = 1.0 - 0.25 / quality_factor**2
    return np.sqrt(np.where(squared >= 0.0, squared, np.nan))


@equation
def hysteretic_frequency_shift(quality_factor: Numbers) -> FloatArray:
    """Relative frequency shift of Eq. 8's hysteretic term to leading order: ``-pi^2/(32 Q_h^2)``.

    According to the paper there is none; Eq. 8 itself has one, 2.5 times that of Eq. 6.
    """
    return -(np.pi**2) / (32.0 * quality_factor**2)


@equation
def hysteretic_frequency_ratio(quality_factor: Numbers) -> FloatArray:
    """Frequency of Eq. 8's hysteretic decay over omega/(2 pi): ``sqrt(1 - (pi/(4 Q_h))^2)``.

    In polar coordinates ``omega x = R cos(phi)``, ``x' = -R sin(phi)`` a half cycle of
    ``x'' + h R sgn(x') + omega^2 x = 0``, with h = pi omega/(4 Q_h), is
    ``phi' = omega - h cos(phi)``, so it takes ``pi/sqrt(omega^2 - h^2)``.
    NaN for Q_h below pi/4, where there is no oscillation.
    """
    squared = 1.0 - (np.pi / (4.0 * quality_factor)) ** 2
    return np.sqrt(np.where(squared >= 0.0, squared, np.nan))


@equation
def hysteretic_decrement_quality(quality_factor: Numbers) -> FloatArray:
    """Q from the decrement of a half cycle of Eq. 8's hysteretic term.

    ``Q = pi / (4 artanh(pi/(4 Q_h)))``, exactly: in the coordinates of
    `hysteretic_frequency_ratio`, ``R' = -h R sin(phi)``, so R falls by
    ``(omega - h)/(omega + h)``, and a half cycle's logarithmic decrement is pi/(2 Q).

    Parameters
    ----------
    quality_factor
        Q_h of Eq. 8, above pi/4.

    Returns
    -------
    FloatArray
        The quality factor that the turning points show, below Q_h by pi^2/(48 Q_h^2)
        of it to leading order (0.2 % at Q_h = 10).
    """
    return np.pi / (4.0 * np.arctanh(np.pi / (4.0 * quality_factor)))


@equation
def hysteretic_quality_of_decrement(decrement_quality: Numbers) -> FloatArray:
    """Q_h of Eq. 8 whose half cycles show the given Q: ``Q_h = pi/(4 tanh(pi/(4 Q)))``."""
    return np.pi / (4.0 * np.tanh(np.pi / (4.0 * decrement_quality)))


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
