"""What takes the green light from an answer, however well its law fits: guesses and absurdities."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.analysis.fit.printed import pendulum_of
from pendpipe.facts import Fact
from pendpipe.physics.pendulum import STANDARD_GRAVITY_M_PER_S2

if TYPE_CHECKING:
    from pendpipe.analysis.fit.result import FitResult
    from pendpipe.arrays import FloatArray

_OFF: Final = 2.0
"""Ratio of g, or of its inverse, that no rod, no buoyancy and no stretched string makes of it."""
_TALLEST_M: Final = 70.0
"""The longest pendulum of Foucault (67 m); what is longer is given in cm."""


def doubted(result: FitResult, facts: Sequence[Fact], time_s: FloatArray) -> FitResult:
    """Take green from an answer that rests on a guess or is absurd, and say what settles it.

    Parameters
    ----------
    result
        A fit; amber and red keep their reasons. A period that rests on a guess is not quoted.
    facts
        Of the recording.
    time_s
        Of the readings that were fitted, shape (n,).
    """
    guessed = [fact for fact in facts if fact.changes]
    why = [
        *_absurd(result, time_s),
        *(f"it rests on a guess: {fact.words}" for fact in guessed),
    ]
    if any("period" in fact.changes for fact in guessed):
        kept = tuple(name for name in result.quotable if name != "period")
        result = replace(result, quotable=kept)
    if not why or result.light != "green":
        return result
    return replace(result, light="amber", light_reason=why[0])


def _absurd(result: FitResult, time_s: FloatArray) -> Iterator[str]:
    """Say what no pendulum gives, with the option that settles it."""
    span, clock = float(np.ptp(time_s)), "check the unit of time (--unit s:)"
    if span < result["period"].value:
        yield f"the readings span {span:.3g} s, less than a period: {clock}"
    for name, found in pendulum_of(result).items():
        usual = found.value / STANDARD_GRAVITY_M_PER_S2
        if name == "g" and not 1.0 / _OFF < usual < _OFF:
            yield f"g comes out as {found.value:.3g} m/s²: give the length in m (--length)"
        if name == "length" and found.value > _TALLEST_M:
            yield f"the pendulum would be {found.value:.3g} m long: {clock}"
