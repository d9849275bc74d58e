"""What is hysteretic and what is viscous in a measured quality factor: Eq. 17."""

from __future__ import annotations

import numpy as np

from pendpipe.physics._floats import FloatArray, Numbers, equation


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
