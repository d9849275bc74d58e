"""The straight line that students draw: an exponential through the amplitudes, for contrast."""

from __future__ import annotations

import numpy as np

from pendpipe.arrays import FloatArray


def fit_exponential(
    time_s: FloatArray, amplitude_rad: FloatArray, sd_rad: FloatArray, *, rounds: int = 20
) -> tuple[float, float]:
    """Weighted least squares of ``y = y0 exp(-beta t)``.

    Eliminating y0 leaves one unknown, which Gauss-Newton finds from the slope of ln y.

    Parameters
    ----------
    time_s, amplitude_rad, sd_rad
        Times, amplitudes and their errors; shape (n,).
    rounds
        Steps of Gauss-Newton.

    Returns
    -------
    tuple of float
        y0 in rad and beta in 1/s.
    """
    weight = 1.0 / np.maximum(sd_rad, np.max(sd_rad) * 1e-6)
    seen = amplitude_rad > 0.1 * np.max(amplitude_rad)
    slope, level = np.polyfit(time_s[seen], np.log(amplitude_rad[seen]), 1)
    numbers = np.array([np.exp(level), -slope])
    for _ in range(rounds):
        shape = np.exp(-numbers[1] * time_s)
        jacobian = np.column_stack([shape, -numbers[0] * time_s * shape]) * weight[:, np.newaxis]
        residual = (amplitude_rad - numbers[0] * shape) * weight
        step = np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        # A step that would turn the decay into growth is halved until it does not.
        while numbers[1] + step[1] <= 0.0 and numbers[1] > 0.0:
            step = 0.5 * step
        numbers = numbers + step
        if np.all(np.abs(step) <= 1e-10 * np.abs(numbers)):
            break
    return float(numbers[0]), float(numbers[1])
