"""The SI prefix that keeps an axis free of powers of ten."""

from __future__ import annotations

import math

from pendpipe.arrays import FloatArray

_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n", -12: "p", 3: "k", 6: "M"}


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit for an axis that reaches `largest`.

    >>> prefixed(0.068, "rad")
    (1000.0, 'mrad')
    """
    if not (math.isfinite(largest) and largest > 0.0):
        return 1.0, unit
    power = min(max(3 * math.floor(math.log10(largest) / 3.0), -12), 6)
    return 10.0**-power, _PREFIXES[power] + unit


def axis_unit(values: FloatArray, unit: str) -> tuple[float, str]:
    """Factor and unit for the axis of some values (NaN does not count)."""
    finite = [abs(float(value)) for value in values.ravel() if math.isfinite(value)]
    return prefixed(max(finite, default=0.0), unit)


def with_error(value: float, sd: float) -> str:
    """Value and standard deviation for a label inside a figure: two digits of the error.

    >>> with_error(3.85031, 0.00072)
    '3.85031 ± 0.00072'
    """
    if not (math.isfinite(sd) and sd > 0.0):
        return f"{value:.4g}"
    digits = max(1 - math.floor(math.log10(sd)), 0)
    return f"{value:.{digits}f} ± {sd:.{digits}f}".replace("-", "\N{MINUS SIGN}")
