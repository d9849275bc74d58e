"""A number with its uncertainty, as it stands in every result file."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import erf, inf, isfinite, nan, pi, sqrt
from typing import Any, Final, Self

Z95: Final = 1.959963984540054
"""Half the width of a 95 % interval, in standard deviations of a normal distribution."""


def number(value: float | None) -> float:
    """A number of a result file; NaN where it holds null."""
    return nan if value is None else float(value)


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
    >>> print(period)
    (2.0060 ± 0.0020) s
    """

    value: float
    sd: float
    unit: str
    interval95: tuple[float, float] | None = None
    at_bound: bool = False

    @property
    def bounds95(self) -> tuple[float, float]:
        """The ends of the 95 % interval: `interval95`, else value -+ 1.96 sd."""
        half = Z95 * self.sd
        return self.interval95 or (self.value - half, self.value + half)

    def as_json(self) -> dict[str, Any]:
        """Return the form of fit.json."""
        return {
            "value": self.value,
            "sd": self.sd,
            "interval95": list(self.bounds95),
            "at_bound": self.at_bound,
            "unit": self.unit,
        }

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> Self:
        """Read what `as_json` (or `dataclasses.asdict`) has made; null stands for NaN."""
        interval = entry.get("interval95")
        ends = None if interval is None else (number(interval[0]), number(interval[1]))
        sizes = number(entry["value"]), number(entry["sd"])
        return cls(*sizes, entry["unit"], ends, bool(entry["at_bound"]))

    def __str__(self) -> str:
        from pendpipe.quantities import with_error

        return with_error(self.value, self.sd, self.unit)

    @property
    def is_limit(self) -> bool:
        """Whether it is no larger than its error and may be zero: then its upper limit is known."""
        return self.at_bound or (self.bounds95[0] <= 0.0 and self.value < self.sd)

    def or_limit(self, *, short: bool = True) -> str:
        """Print it, or its upper limit where it `is_limit`.

        >>> Estimate(0.0, 0.001, "1/s", (0.0, 0.002), at_bound=True).or_limit()
        '< 0.002 s⁻¹'
        """
        from pendpipe.quantities import with_error

        if self.is_limit:
            return f"< {with_error(float(f'{self.bounds95[1]:.2g}'), None, self.unit)}"
        return with_error(self.value, self.sd, self.unit, short=short)


def chi_square_p_value(chi2: float, degrees_of_freedom: int) -> float:
    """Probability of a larger chi^2; NaN without degrees of freedom.

    >>> round(chi_square_p_value(3.84, 1), 3)
    0.05
    """
    from scipy.special import chdtrc

    return float(chdtrc(degrees_of_freedom, chi2)) if degrees_of_freedom > 0 else nan


def quality_of_rate(frequency_hz: float, rate: Estimate) -> Estimate:
    """Quality factor ``pi f/rate`` with the interval that the rate's interval gives.

    The rate's errors are the symmetric ones; its inverse's are not, and where the rate
    may be zero the quality factor has no upper bound.
    """
    if not rate.value > 0.0:
        return Estimate(nan, nan, "", (nan, nan))
    return over(pi * frequency_hz, rate)


def over(number: float, estimate: Estimate, unit: str = "") -> Estimate:
    """Divide a number by a positive estimate, with the interval that the estimate's gives."""
    value = number / estimate.value
    low, high = estimate.bounds95
    ends = number / high if isfinite(high) else 0.0, number / low if low > 0.0 else inf
    return Estimate(value, value * estimate.sd / estimate.value, unit, ends)


LISTED: Final = 0.05
"""Probability from which a description counts in an average; as from which a rival is listed."""
NAMED: Final = 0.5
"""Probability from which causes are named, two or three of a class together."""
ALONE: Final = 0.8
"""Probability from which a cause is named without its rivals."""
MOST_NAMES: Final = 3
"""In a sentence: more are no finding."""


def named_together(shares: Sequence[float], most: int = MOST_NAMES) -> int:
    """Return how many of a class are named, the most likely first; none where more were needed."""
    listed = max(sum(share >= LISTED for share in shares), 1)
    count = 1 if shares[0] >= ALONE else min(listed, MOST_NAMES)
    return count if sum(shares[:count]) >= NAMED and count <= most else 0


def averaged(estimates: Sequence[Estimate], probabilities: Sequence[float]) -> Estimate:
    """Average one quantity over descriptions that share the probability.

    Value ``sum p_i v_i``, variance ``sum p_i [sd_i^2 + (v_i - value)^2]``: the mean variance plus
    the spread between the descriptions. The interval is that of the mixture: each description
    stands for a normal distribution whose two halves reach to the ends of its own interval, so
    that what is confined by a bound stays within it.

    Parameters
    ----------
    estimates
        The quantity by each description, in one unit.
    probabilities
        Theirs; they need not add up to 1.

    Examples
    --------
    >>> averaged([Estimate(1.0, 0.1, "s"), Estimate(2.0, 0.1, "s")], [0.6, 0.6])
    Estimate(value=1.5, sd=0.50990..., unit='s', interval95=(0.835..., 2.164...), at_bound=False)
    """
    if len(estimates) == 1:
        return estimates[0]
    total = sum(probabilities)
    parts = [(p / total, each) for p, each in zip(probabilities, estimates, strict=True)]
    value = sum(p * each.value for p, each in parts)
    variance = sum(p * (each.sd**2 + (each.value - value) ** 2) for p, each in parts)
    ends = _quantile(parts, 0.025), _quantile(parts, 0.975)
    at_bound = all(each.at_bound for each in estimates)
    return Estimate(value, sqrt(variance), estimates[0].unit, ends, at_bound)


_HALVINGS: Final = 52
"""Of an interval until its ends are one number: the binary digits of a float."""


def _quantile(parts: Sequence[tuple[float, Estimate]], probability: float) -> float:
    """Return where a mixture's distribution reaches a probability, by bisection."""

    def below(place: float) -> float:
        total = 0.0
        for p, each in parts:
            end = each.bounds95[place > each.value]
            reach = abs(end - each.value) / Z95
            off = (place - each.value) / max(reach, 1e-300)
            total += 0.5 * p * (1.0 + erf(off / sqrt(2.0)))
        return total

    # Beyond the ends of all intervals there is less than 2.5 %.
    low = min(each.bounds95[0] for _, each in parts)
    high = max(each.bounds95[1] for _, each in parts)
    if not (isfinite(low) and isfinite(high)):
        return low if probability < 0.5 else high
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if below(middle) < probability else (low, middle)
    # A bound at which a part of the distribution stands is an end itself.
    return low if probability < 0.5 else high


def measured(text: str) -> Estimate:
    """Read a positive number as metrologists write it, with or without its error.

    Raises
    ------
    ValueError
        If it is none.

    Examples
    --------
    >>> measured("0.600(1)")
    Estimate(value=0.6, sd=0.001, unit='', interval95=None, at_bound=False)
    >>> measured("0.6").sd
    0.0
    """
    found = re.fullmatch(r"\s*(\d*\.?\d*)(?:\((\d+\.?\d*)\))?\s*", text)
    if found is None or not any(map(str.isdigit, found[1])) or not float(found[1]) > 0.0:
        raise ValueError(f"{text!r} is not a positive number like 0.600 or 0.600(1)")
    digits, inside = found.groups()
    last = 10.0 ** -len(digits.partition(".")[2])
    sd = 0.0 if inside is None else float(inside) * (1.0 if "." in inside else last)
    return Estimate(float(digits), sd, "")
