"""How a number is printed: with its unit, an SI prefix, and its error."""

import math
from collections.abc import Sequence

import numpy as np

from pendpipe.arrays import FloatArray

_SI_UNITS = ("rad", "m", "V", "s", "Hz", "kg")
_PREFIXES = {0: "", -3: "m", -6: "µ", -9: "n", -12: "p", 3: "k", 6: "M"}


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """Factor and unit for an axis that reaches `largest`.

    >>> prefixed(0.068, "rad")
    (1000.0, 'mrad')

    Counts, pixels and readings of an unknown unit have no prefixes.

    >>> prefixed(0.068, "1")
    (1.0, '')
    """
    if unit.split("/")[0] not in _SI_UNITS:
        return 1.0, "" if unit == "1" else unit
    if not (math.isfinite(largest) and largest > 0.0):
        return 1.0, unit
    power = min(max(3 * math.floor(math.log10(largest) / 3.0), -12), 6)
    return 10.0**-power, _PREFIXES[power] + unit


def axis_unit(values: FloatArray, unit: str) -> tuple[float, str]:
    """Factor and unit for the axis of some values (NaN does not count)."""
    finite = np.isfinite(values)
    return prefixed(float(np.max(np.abs(values), initial=0.0, where=finite)), unit)


def compact(value: float, unit: str) -> str:
    """A size without its error, to three digits, with an SI prefix.

    >>> compact(8.032e-5, "rad")
    '80.3 µrad'
    """
    factor, short = prefixed(abs(value), unit)
    shown = factor * value
    digits = f"{shown:#.3g}".rstrip(".") if abs(shown) < 999.5 else f"{shown:.0f}"
    return f"{digits}{after_number(short)}"


def stretch(start_s: float, stop_s: float) -> str:
    """A stretch of time, to as many digits as tell its ends apart.

    >>> stretch(0.0, 0.72941), stretch(45296.0, 45296.72941)
    ('0 to 0.7294 s', '45296 to 45296.729 s')
    """
    largest, length = max(abs(start_s), abs(stop_s)), abs(stop_s - start_s)
    finer = 3 + math.ceil(math.log10(largest / length)) if length > 0.0 else 0
    digits = max(4, len(f"{largest:.0f}"), finer)
    return f"{start_s:.{digits}g} to {stop_s:.{digits}g} s"


def pretty_unit(unit: str) -> str:
    """A unit of the result files as it is printed.

    >>> pretty_unit("1/(rad s)"), pretty_unit("1/rad^2"), pretty_unit("m/s^2"), pretty_unit("1/1")
    ('rad⁻¹ s⁻¹', 'rad⁻²', 'm/s²', '')
    """
    if unit.startswith("1/") and "sqrt" not in unit:
        return " ".join(
            f"{of}⁻{'¹²³⁴'[int(n) - 1 if n in '1234' and n else 0]}"
            for of, _, n in [part.partition("^") for part in unit[2:].strip("()").split()]
            if of != "1"
        )
    return "" if unit == "1" else unit.replace("^2", "²")


def after_number(unit: str) -> str:
    """What follows a number in a sentence: a space and the unit, or nothing.

    >>> after_number("rad"), after_number("1")
    (' rad', '')
    """
    return f" {pretty_unit(unit)}".rstrip()


def with_error(value: float, sd: float | None, unit: str = "", *, short: bool = False) -> str:
    """Value and standard deviation to two digits of the latter.

    Without a standard deviation four digits are printed. `short` gives the metrologists'
    form, in which the error of the last digits stands in brackets.

    >>> with_error(3.85031, 0.00072, "V/rad")
    '(3.85031 ± 0.00072) V/rad'
    >>> with_error(1.4291e-06, 2.6e-08, "rad/s", short=True)
    '1.429(26) × 10⁻⁶ rad/s'
    """
    unit = pretty_unit(unit)
    if not math.isfinite(value):
        return "–"
    known = sd is not None and math.isfinite(sd) and sd > 0.0
    error = float(f"{sd:.1e}") if known and sd is not None else 0.0
    size = max(abs(value), error)
    power = math.floor(math.log10(size)) if size > 0.0 else 0
    power = power if power >= 6 or power <= -4 else 0
    scaled, error = value / 10.0**power, error / 10.0**power
    raised = str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    tens = f" × 10{raised}" if power else ""
    if not known:
        number = f"{scaled:.0f}" if "e" in f"{scaled:.4g}" else f"{scaled:.4g}"
        return f"{_minus(number)}{tens} {unit}".rstrip()
    decimals = max(1 - math.floor(math.log10(error) + 1e-9), 0)
    # An error of 120 leaves no meaning in the last digit of 1234.
    coarse = min(1 - math.floor(math.log10(error) + 1e-9), 0)
    number = _minus(f"{round(scaled, coarse) if coarse else scaled:.{decimals}f}")
    if short:
        digits = f"{error:.{decimals}f}"
        # Below one only the digits count; from one on the point stays, as in 136.1(1.2).
        inside = digits if error >= 1.0 else digits.lstrip("0.") or "0"
        return f"{number}({inside}){tens} {unit}".rstrip()
    text = f"{number} ± {error:.{decimals}f}"
    return f"({text}){tens} {unit}".rstrip() if tens or unit else text


def _minus(number: str) -> str:
    return number.replace("-", "\N{MINUS SIGN}")


def in_columns(rows: Sequence[Sequence[str]]) -> str:
    """Rows of words in columns as wide as they need, one line per row.

    >>> print(in_columns([("f", "0.5 Hz"), ("Q limit", "136")]))
    f        0.5 Hz
    Q limit  136
    """
    width = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(size) for cell, size in zip(row, width, strict=True)).rstrip()
        for row in rows
    )


def listed(items: Sequence[str], last: str = "and") -> str:
    """Join items to "x, y and z"."""
    if len(items) < 2:
        return "".join(items)
    return f"{', '.join(items[:-1])} {last} {items[-1]}"
