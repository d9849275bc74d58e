"""What a campaign knows of each record's losses: measured, and after Eq. 17."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, nan, pi

from pendpipe.estimate import Estimate


@dataclass(frozen=True)
class MeasuredRecord:
    """One record's decay, as the fit has left it.

    Parameters
    ----------
    record, fluid, branch
        Its name, what it swung in, and which configuration it belongs to.
    frequency
        f of Eq. 8 in Hz.
    quadratic, linear, coulomb
        a, b, c of Eq. 13: the first-order combinations of Eq. 8's losses, whatever the
        method of the fit. (A b that comes from the decrement of turning points is below
        the hysteretic one by pi^2/(96 Q^2) of it: 0.03 % at Q = 17.5, 0.1 % at 10.)
    moment_of_inertia
        I in kg m^2 with the added mass, where it is known.
    """

    record: str
    fluid: str
    branch: str
    frequency: Estimate
    quadratic: Estimate
    linear: Estimate
    coulomb: Estimate
    moment_of_inertia: Estimate | None = None


@dataclass(frozen=True)
class SeparatedRecord:
    """A record with its linear loss split by Eq. 17.

    Parameters
    ----------
    measured
        What went in.
    quadratic, coulomb
        a and c with the sensor's calibration in their errors.
    quality_factor_limit
        pi f/b.
    quality_factor_hysteretic
        k f^2; its error is that of k.
    viscous_rate
        b - pi/(k f) in 1/s, total error.
    viscous_rate_sd_own
        The part of that error that no other record shares.
    viscous_rate_per_inverse_k
        Change of `viscous_rate` with 1/k, -pi/f: how the error of k enters it.
    quality_factor_viscous
        pi f over the viscous rate; NaN where that is not positive.
    """

    measured: MeasuredRecord
    quadratic: Estimate
    coulomb: Estimate
    quality_factor_limit: Estimate
    quality_factor_hysteretic: Estimate
    viscous_rate: Estimate
    viscous_rate_sd_own: float
    viscous_rate_per_inverse_k: float
    quality_factor_viscous: Estimate


def quality_of_rate(frequency_hz: float, rate: Estimate) -> Estimate:
    """Quality factor ``pi f/rate`` with the interval that the rate's interval gives.

    The rate's errors are the symmetric ones; its inverse's are not, and where the rate
    may be zero the quality factor has no upper bound.
    """
    if not rate.value > 0.0:
        return Estimate(nan, nan, "", (nan, nan))
    value = pi * frequency_hz / rate.value
    low, high = rate.bounds95
    return Estimate(
        value,
        value * rate.sd / rate.value,
        "",
        (
            pi * frequency_hz / high if isfinite(high) else 0.0,
            pi * frequency_hz / low if low > 0 else inf,
        ),
    )
