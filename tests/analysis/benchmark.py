"""The benchmark in air, where a test gives its k."""

from __future__ import annotations

from pendpipe.analysis.separate import Benchmark
from pendpipe.estimate import Estimate


def known_benchmark(coefficient_s2: float, sd_s2: float) -> Benchmark:
    """K without a record in air."""
    inverse = 1.0 / coefficient_s2
    nan = float("nan")
    return Benchmark(
        coefficient=Estimate(coefficient_s2, sd_s2, "s^2"),
        inverse=inverse,
        inverse_sd=sd_s2 * inverse**2,
        chi2=0.0,
        degrees_of_freedom=0,
        p_value=nan,
        free_exponent=Estimate(nan, nan, ""),
        exponent_p_value=nan,
        records=(),
    )
