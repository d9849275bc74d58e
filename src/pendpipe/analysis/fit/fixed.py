"""Parameters that the user holds (``--fix NAME=VALUE``)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final

from pendpipe.errors import InputError

NAMES: Final = (
    "a", "b", "c", "frequency", "amplitude", "offset",
    "quality_factor_hysteretic", "quality_factor_viscous",
)  # fmt: skip
_POSITIVE: Final = ("frequency", "amplitude", "quality_factor_hysteretic", "quality_factor_viscous")


def parse_fixed(words: Iterable[str]) -> dict[str, float]:
    """Read ``NAME=VALUE`` words.

    Raises
    ------
    InputError
        On an unknown name, a number that is none, or one that is impossible.
    """
    fixed: dict[str, float] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or name not in NAMES:
            raise InputError(
                f"--fix {word}",
                "this names no parameter",
                f"use NAME=VALUE, NAME of {', '.join(NAMES)}",
            )
        try:
            value = float(text)
        except ValueError:
            raise InputError(f"--fix {word}", f"'{text}' is no number", "give a number") from None
        least = 0.0 if name != "offset" else -math.inf
        if not math.isfinite(value) or value < least or (name in _POSITIVE and value == 0.0):
            raise InputError(f"--fix {word}", f"{name} can't be {text}", "give a possible value")
        fixed[name] = value
    quality_factors = [name for name in fixed if name.startswith("quality_factor")]
    if "b" in fixed and quality_factors:
        raise InputError(
            "--fix", f"b and {quality_factors[0]} are both held", "hold one of the two"
        )
    return fixed


def loss_rates_of(fixed: Mapping[str, float], frequency: float) -> dict[str, float]:
    """The held parts of b in 1/s, by name: ``pi f/Q``."""
    return {
        part: math.pi * frequency / fixed[f"quality_factor_{part}"]
        for part in ("hysteretic", "viscous")
        if f"quality_factor_{part}" in fixed
    }
