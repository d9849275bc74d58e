"""What the user holds: parameters that are not fitted."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from pendpipe.analysis.fit.fitted import PARTS, Baseline
from pendpipe.dynamics.eq8 import OMEGA, PLACES, SHARE, SHARE_MEAN, Eq8, Restoring, share_of
from pendpipe.errors import InputError, refuse_if

_ENVELOPE: Final = ("a", "b", "c", "amplitude", "offset")
NAMES: Final = (*PLACES, *PARTS)
_NOT_VISCOUS: Final = ("a", "c", "quality_factor_hysteretic")
"""What Eq. 3 lacks: its only loss is viscous."""
_POSITIVE: Final = ("frequency", "amplitude", *PARTS)


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
            raise InputError(
                f"--fix {word}", f"'{text}' is not a number", "give a number"
            ) from None
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


@dataclass(frozen=True)
class Held:
    """Parameters that are not fitted.

    Parameters
    ----------
    fixed
        Their values by name (`NAMES`).
    baseline
        ``"eq8"``, or ``"viscous"`` for Eq. 3, which has no a, no c and no hysteretic part of b.
    frequency_hz
        By which a quality factor is a rate, ``pi f/Q``.
    """

    fixed: Mapping[str, float]
    baseline: Baseline
    frequency_hz: float

    @cached_property
    def parts(self) -> dict[str, float]:
        """The parts of b that are held, 1/s."""
        known = {name.rpartition("_")[2]: q for name, q in self.fixed.items() if name in PARTS}
        parts = {part: math.pi * self.frequency_hz / q for part, q in known.items()}
        return parts | {"hysteretic": 0.0} if parts and self.baseline == "viscous" else parts

    @cached_property
    def envelope(self) -> dict[str, float]:
        """What of a, b, c, the amplitude and the offset is held."""
        held = {name: self.fixed[name] for name in _ENVELOPE if name in self.fixed}
        if self.baseline == "viscous":
            held |= {"a": 0.0, "c": 0.0}
        return held | {"b": sum(self.parts.values())} if len(self.parts) == 2 else held

    @property
    def angular_frequency(self) -> float | None:
        """omega, where it is held."""
        return math.tau * self.fixed["frequency"] if "frequency" in self.fixed else None

    @property
    def places(self) -> tuple[int, ...]:
        """Indices of what is not fitted to the readings."""
        held = [PLACES[name] for name in self.envelope]
        held += [OMEGA] if "frequency" in self.fixed else []
        no_share = self.parts or self.baseline == "viscous" or self.envelope.get("b") == 0.0
        return (*held, SHARE) if no_share else tuple(held)

    def share(self, b: float) -> float | None:
        """The hysteretic share of b where the user, or the baseline, tells it."""
        return 0.0 if self.baseline == "viscous" else share_of(self.parts, b)

    def likely_share(self, b: float) -> float:
        """The same, or what it is beforehand."""
        share = self.share(b)
        return SHARE_MEAN if share is None else share

    def law(self, omega: float, rates: Sequence[float], restoring: Restoring = "linear") -> Eq8:
        """Eq. 8 with a, b and c; half of b is hysteretic where nothing tells how much."""
        a, b, c = rates
        hysteretic = self.likely_share(b) * b
        return Eq8(omega, a, hysteretic, b - hysteretic, c, restoring)
