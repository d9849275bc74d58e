"""Water at atmospheric pressure: viscosity and density against temperature."""

from __future__ import annotations

import numpy as np

from pendpipe.physics._floats import FloatArray, Numbers, equation

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
