"""The estimates as a user would make them with other libraries: the peers of `estimators.py`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics import Eq8


def eq_14(t: FloatArray, y0: float, a: float, b: float, c: float) -> FloatArray:
    """The paper's Eq. 14 as printed, complex root included."""
    r = np.sqrt(complex(b * b - 4.0 * a * c))
    p = (2.0 * a * y0 + b - r) / (2.0 * a * y0 + b + r) * np.exp(-r * t)
    return np.real((b * (p - 1.0) + r * (p + 1.0)) / (2.0 * a * (1.0 - p)))


def law_through(
    time_s: FloatArray, amplitude: FloatArray, sd: float
) -> tuple[FloatArray, FloatArray]:
    """y0, a, b, c of Eq. 14 and their standard deviations, from good starting values."""
    from scipy.optimize import curve_fit

    start, sigma = [amplitude[0], 0.4, 0.01, 1e-6], np.full(len(amplitude), sd)
    value, covariance = curve_fit(
        eq_14, time_s - time_s[0], amplitude, start, sigma=sigma, absolute_sigma=True
    )
    return np.asarray(value), np.sqrt(np.diag(covariance))


def prominent_peaks(
    time_s: FloatArray, values: FloatArray, noise: float
) -> tuple[FloatArray, FloatArray]:
    """find_peaks told of the noise (a prominence of five of it), and curve_fit."""
    from scipy.signal import find_peaks

    size = np.abs(values - np.median(values))
    index, _ = find_peaks(size, prominence=5.0 * noise)
    return law_through(time_s[index], size[index], noise)


def spaced_peaks(
    time_s: FloatArray, values: FloatArray, noise: float, half_period: float, *, quartic: bool
) -> tuple[FloatArray, FloatArray]:
    """find_peaks told of the half period (in readings) and the noise, and curve_fit.

    With `quartic` the amplitude is that of a quartic through each peak.
    """
    from scipy.signal import find_peaks

    size = np.abs(values - np.median(values))
    index, _ = find_peaks(size, distance=int(0.8 * half_period))
    if not quartic:
        return law_through(time_s[index], size[index], noise)
    reach = int(0.25 * half_period)
    u = np.arange(-reach, reach + 1) / reach
    polynomial = np.linalg.pinv(np.vander(u, 5, increasing=True))
    index = index[(index > reach) & (index < len(size) - reach)]
    fitted = size[index[:, None] + np.arange(-reach, reach + 1)] @ polynomial.T
    amplitude = fitted[:, 0] - fitted[:, 1] ** 2 / (4.0 * fitted[:, 2])
    return law_through(time_s[index], amplitude, noise * float(np.linalg.norm(polynomial[0])))


def lmfit_waveform(
    model: Eq8, angle_rad: float, start_s: float, time_s: FloatArray, values: FloatArray
) -> FloatArray:
    """a, b, c by lmfit over solve_ivp (DOP853, rtol 1e-8), finite differences with tuned steps."""
    import lmfit
    from scipy.integrate import solve_ivp

    scale = np.array([1e-2, 1e-4, 1e-6, 1e-4, 1e-3, 1e-2, 1e-3])
    guess = np.array([model.quadratic, model.hysteretic + model.viscous, model.coulomb,
                      model.angular_frequency, angle_rad, start_s, 0.0])  # fmt: skip

    def curve(values_of: FloatArray) -> FloatArray:
        a, b, c, omega, angle, begin, offset = values_of

        def rates(_t: float, z: FloatArray) -> tuple[float, float]:
            square = omega**2 * z[0] ** 2 + z[1] ** 2
            friction = (
                0.5 * math.pi * (omega * c + 0.5 * b * math.sqrt(square) + a / omega * square)
            )
            return z[1], -friction * np.sign(z[1]) - b * z[1] - omega**2 * z[0]

        run = solve_ivp(
            rates, (begin, time_s[-1] + 1e-9), (angle, -1e-12), method="DOP853", t_eval=time_s,
            rtol=1e-8, atol=1e-12,
        )  # fmt: skip
        return np.asarray(run.y[0] + offset)

    def residual(parameters: lmfit.Parameters) -> FloatArray:
        steps = np.array([parameters[f"p{k}"].value for k in range(7)])
        return values - curve(guess + (steps - 1.0) * scale)

    parameters = lmfit.Parameters()
    for k in range(7):
        # From 1, so that lmfit's relative steps of 1e-3 are steps of 1e-3 of the scale.
        parameters.add(f"p{k}", value=1.0)
    fitted = lmfit.minimize(residual, parameters, epsfcn=1e-6)
    return np.array([guess[k] + scale[k] * (fitted.params[f"p{k}"].value - 1.0) for k in range(3)])
