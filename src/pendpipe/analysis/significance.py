"""p-values: how often chance alone does worse."""

from __future__ import annotations

from math import isfinite, nan


def chi_square_p_value(chi2: float, degrees_of_freedom: int) -> float:
    """Probability of a larger chi^2; NaN without degrees of freedom."""
    if degrees_of_freedom < 1 or not isfinite(chi2):
        return nan
    # scipy.special alone; scipy.stats would cost every job half a second.
    from scipy.special import chdtrc

    return float(chdtrc(degrees_of_freedom, max(chi2, 0.0)))


def variance_ratio_p_value(ratio: float, numerator: int, denominator: int) -> float:
    """Probability of a larger F; NaN without degrees of freedom."""
    if min(numerator, denominator) < 1 or not isfinite(ratio):
        return nan
    from scipy.special import fdtrc

    return float(fdtrc(numerator, denominator, max(ratio, 0.0)))


def student_quantile95(degrees_of_freedom: int) -> float:
    """How many standard deviations a 95 % interval reaches to each side."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees_of_freedom, 0.975))
