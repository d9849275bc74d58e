"""Parameters that the user holds (``--fix NAME=VALUE``)."""

import math
from collections.abc import Iterable, Mapping
from typing import Final

from pendpipe.analysis.fit.result import Baseline
from pendpipe.errors import InputError, refuse_if

NAMES: Final = (
    "a",
    "b",
    "c",
    "frequency",
    "amplitude",
    "offset",
    "quality_factor_hysteretic",
    "quality_factor_viscous",
)
_NOT_VISCOUS: Final = ("a", "c", "quality_factor_hysteretic")
"""What Eq. 3 lacks: its only loss is viscous."""
_POSITIVE: Final = ("frequency", "amplitude", "quality_factor_hysteretic", "quality_factor_viscous")


def parse_fixed(words: Iterable[str], baseline: Baseline = "eq8") -> dict[str, float]:
    """Read ``NAME=VALUE`` words.

    Raises
    ------
    InputError
        On a number that is none, a name that comes twice, and what `check_fixed` refuses.
    """
    fixed: dict[str, float] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals:
            raise _nameless(word)
        refuse_if(name in fixed, f"--fix {word}", f"{name} is held twice", "give it once")
        try:
            fixed[name] = float(text)
        except ValueError:
            raise InputError(f"--fix {word}", f"'{text}' is no number", "give a number") from None
    check_fixed(fixed, baseline)
    return fixed


def check_fixed(fixed: Mapping[str, float], baseline: Baseline) -> None:
    """Refuse what can't be held.

    Raises
    ------
    InputError
        On a name that is no parameter's, a value that none can have, two that contradict each
        other, or a parameter that the baseline lacks.
    """
    for name, value in fixed.items():
        word = f"{name}={value:g}"
        if name not in NAMES:
            raise _nameless(word)
        least = 0.0 if name != "offset" else -math.inf
        refuse_if(
            not math.isfinite(value) or value < least or (name in _POSITIVE and value == 0.0),
            f"--fix {word}",
            f"{name} can't be {value:g}",
            "give a possible value",
        )
        refuse_if(
            baseline == "viscous" and name in _NOT_VISCOUS,
            f"--fix {word}",
            f"the viscous baseline (Eq. 3) has no {name}",
            "leave it out, or use --baseline eq8",
        )
    quality_factors = [name for name in fixed if name.startswith("quality_factor")]
    if "b" in fixed and quality_factors:
        raise InputError(
            "--fix", f"b and {quality_factors[0]} are both held", "hold one of the two"
        )


def _nameless(word: str) -> InputError:
    return InputError(
        f"--fix {word}", "this names no parameter", f"use NAME=VALUE, NAME of {', '.join(NAMES)}"
    )


def loss_rates_of(fixed: Mapping[str, float], frequency: float) -> dict[str, float]:
    """The held parts of b in 1/s, by name: ``pi f/Q``."""
    return {
        part: math.pi * frequency / fixed[f"quality_factor_{part}"]
        for part in ("hysteretic", "viscous")
        if f"quality_factor_{part}" in fixed
    }
