"""p-values: how often chance alone does worse."""

from __future__ import annotations

from math import isfinite, nan

import numpy as np

from pendpipe.analysis.distributions import beta_below, poisson_up_to, student_beyond


def chi_square_p_value(chi2: float, degrees_of_freedom: int) -> float:
    """Probability of a larger chi^2; NaN without degrees of freedom."""
    if degrees_of_freedom < 1 or not isfinite(chi2):
        return nan
    return float(poisson_up_to(0.5 * degrees_of_freedom - 1.0, 0.5 * max(chi2, 0.0)))


def variance_ratio_p_value(ratio: float, numerator: int, denominator: int) -> float:
    """Probability of a larger F; NaN without degrees of freedom."""
    if min(numerator, denominator) < 1 or not isfinite(ratio):
        return nan
    share = denominator / (denominator + numerator * max(ratio, 0.0))
    return float(beta_below(0.5 * denominator, 0.5 * numerator, share))


def student_quantile95(degrees_of_freedom: int) -> float:
    """How many standard deviations a 95 % interval reaches to each side.

    >>> round(student_quantile95(3), 4)
    3.1824
    """
    low, high = 1.9, 13.0  # of infinite freedom, and of one degree
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        beyond = float(student_beyond(np.array(degrees_of_freedom), np.array(middle)))
        low, high = (middle, high) if beyond > 0.05 else (low, middle)
    return 0.5 * (low + high)
