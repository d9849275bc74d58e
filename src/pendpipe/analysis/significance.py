"""p-values: how often chance alone does worse."""

from __future__ import annotations

from math import isfinite, nan

from pendpipe.analysis.distributions import beta_below, poisson_up_to


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
    """How many standard deviations a 95 % interval reaches to each side."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees_of_freedom, 0.975))
