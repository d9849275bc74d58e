"""The quality factor during a decay (Eq. 15), its parts (Eq. 17), and the energy (Eqs. 12, 13)."""

from __future__ import annotations

import numpy as np

from pendpipe.physics._floats import FloatArray, Numbers, equation, floats, plain


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
    """1/x, infinite (and silent) at zero."""
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
    first, second, third, scale = floats(c1, c2, c3, energy_per_squared_amplitude)
    root = np.sqrt(scale)
    return plain(0.5 * third * root), plain(0.5 * second), plain(0.5 * first / root)


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
