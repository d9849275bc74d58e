"""A number with its uncertainty, as it stands in every result file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Estimate:
    """An estimated quantity.

    Parameters
    ----------
    value
        The estimate, in `unit`; ``nan`` where there is none (null in JSON).
    sd
        Its standard deviation, in `unit`.
    unit
        SI, radians; ``""`` for a pure number.
    interval95
        The 95 % interval; it need not be symmetric, and is one-sided at a bound.
        ``value -+ 1.96 sd`` where none is given.
    at_bound
        Whether the estimate lies on the edge of what is possible (a, b, c = 0).

    Examples
    --------
    >>> period = Estimate(2.006, 0.002, "s")
    >>> period.bounds95
    (2.00208007203..., 2.00991992796...)
    """

    value: float
    sd: float
    unit: str
    interval95: tuple[float, float] | None = None
    at_bound: bool = False

    @property
    def bounds95(self) -> tuple[float, float]:
        """The ends of the 95 % interval: `interval95`, else value -+ 1.96 sd."""
        half = 1.959963984540054 * self.sd
        return self.interval95 or (self.value - half, self.value + half)

    def as_json(self, *, full: bool = True) -> dict[str, Any]:
        """Return the form of fit.json; with ``full=False`` that of campaign.json."""
        if not full:
            return {"value": self.value, "sd": self.sd, "unit": self.unit}
        low, high = self.bounds95
        return {
            "value": self.value,
            "sd": self.sd,
            "interval95": [low, high],
            "at_bound": self.at_bound,
            "unit": self.unit,
        }

    def __str__(self) -> str:
        return rounded(self.value, self.sd, self.unit)


def rounded(value: float, sd: float | None = None, unit: str = "") -> str:
    """Return a value and its standard deviation, rounded to two digits of the latter.

    Parameters
    ----------
    value, sd
        In `unit`. Without a standard deviation (None, 0 or NaN) four digits are given.
    unit
        Printed behind the numbers.

    Examples
    --------
    >>> rounded(1.7573525e-05, 1.4961e-05, "1/s")
    '1.8e-05 +- 1.5e-05 1/s'
    >>> rounded(0.4978623, 0.0000131, "Hz")
    '0.497862 +- 0.000013 Hz'
    >>> rounded(6412.7, 310.2), rounded(9.80665)
    ('6410 +- 310', '9.807')
    """
    behind = f" {unit}" if unit else ""
    if sd is None or not (math.isfinite(sd) and sd > 0.0) or not math.isfinite(value):
        return f"{value:.4g}{behind}"
    last = math.floor(math.log10(float(f"{sd:.1e}"))) - 1
    size = max(abs(value), sd)
    if 1e-4 <= size < 1e6:
        places = max(-last, 0)
        return f"{round(value, -last):.{places}f} +- {round(sd, -last):.{places}f}{behind}"
    digits = max(math.floor(math.log10(size)) - last, 0)
    number = f"{value:.{digits}e}" if abs(value) >= 0.5 * 10.0**last else "0"
    return f"{number} +- {sd:.1e}{behind}"
