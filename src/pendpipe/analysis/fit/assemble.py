"""From a fit's numbers to its result: intervals, quality factors, warnings."""

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

from pendpipe.analysis.fit.least_squares import CHI2_95, Bounds, intervals95
from pendpipe.analysis.fit.result import PARAMETERS, FitResult, units
from pendpipe.analysis.separate import quality_of_rate
from pendpipe.arrays import FloatArray
from pendpipe.estimate import Estimate

_LOUD: Final = 5.0
"""Standard deviations of chi^2 by which a misfit is told from chance."""
_UNDETERMINED: Final = 0.01
"""Part of the loss at the start by which a y0 may be uncertain before the record is a tail."""


class Numbers(NamedTuple):
    """The seven parameters in the order of `PARAMETERS`, and what is known of them."""

    value: FloatArray
    covariance: FloatArray
    interval: Mapping[str, tuple[float, float]]
    """Of those whose interval is not symmetric."""
    at_bound: Sequence[str]


class Bounded(NamedTuple):
    """A fit at its bounded optimum: its own parameters, a, b, c first."""

    value: FloatArray
    normal: FloatArray
    gradient: FloatArray
    held: Sequence[int]
    matrix: FloatArray
    """The covariance, without regard to the bounds."""


def estimates(numbers: Numbers, unit: str) -> dict[str, Estimate]:
    """Dress the seven numbers with units and intervals."""
    dress = units(unit)
    result = {}
    for index, name in enumerate(PARAMETERS):
        sd = math.sqrt(max(float(numbers.covariance[index, index]), 0.0))
        half = math.sqrt(CHI2_95) * sd
        value = float(numbers.value[index])
        interval = numbers.interval.get(name, (value - half, value + half))
        result[name] = Estimate(value, sd, dress[name], interval, name in numbers.at_bound)
    return result


def quality_factor(rate: Estimate, frequency: float) -> Estimate | None:
    """Q = pi f/b of a rate b; None for b = 0."""
    return quality_of_rate(frequency, rate) if rate.value > 0.0 else None


def with_intervals(value: FloatArray, covariance: FloatArray, fit: Bounded, at: Bounds) -> Numbers:
    """Add to the seven numbers the intervals of a, b, c, and which of these lie at 0."""
    ends = intervals95(fit.value, fit.normal, fit.gradient, at, range(3), fit.held, fit.matrix)
    at_bound = [name for k, name in enumerate("abc") if k not in fit.held and fit.value[k] <= 0.0]
    return Numbers(value, covariance, dict(zip("abc", ends, strict=True)), at_bound)


def misfit(chi2_per_dof: float, dof: float) -> float:
    """By what the variances are multiplied: chi^2 per dof where chance can't explain it."""
    if chi2_per_dof > 1.0 + _LOUD * math.sqrt(2.0 / max(dof, 1.0)):
        return chi2_per_dof
    return 1.0


def warn(result: FitResult, stretched: float) -> list[str]:
    """What the reader of these numbers should know, a clause each."""
    said = []
    for name, estimate in result.parameters.items():
        if estimate.at_bound:
            said.append(f"{name} lies at its bound 0; its interval is one-sided")
    if result.quality_factor_limit is None:
        said.append("quality_factor_limit has no finite value, since b = 0")
    if stretched > 1.0:
        seen = (
            "chi^2 of the readings is"
            if result.chi2_per_dof > 0.9 * stretched
            else ("the half cycles scatter, in the square,")
        )
        said.append(
            f"{seen} {stretched:.3g} times what the noise explains: the standard deviations are"
            " enlarged by its root; see pendpipe diagnose"
        )
    a, b, c = (result.parameters[name] for name in ("a", "b", "c"))
    y0 = result.parameters["amplitude"].value
    rate = a.value * y0 + b.value + c.value / y0
    if result.baseline == "eq8" and a.sd * y0 > _UNDETERMINED * rate:
        said.append(
            "a can't be told from b here: the record holds too little of large amplitudes (a tail);"
            " a, b, c of a tail depend on where it begins"
        )
    return said
