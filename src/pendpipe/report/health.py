"""The traffic light of a record's fit: a word, a symbol and a colour, in four states."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from pendpipe.figures.data import number

CHI2_RANGE: Final = (0.5, 2.0)
"""Chi^2 per degree of freedom within which a fit is called ok."""


class Health(NamedTuple):
    """How a record's fit stands."""

    word: str
    symbol: str
    colour: str
    """A class of the style sheet."""
    reason: str


STATES: Final = {
    "ok": ("✔", "good"),
    "look": ("▲", "look"),
    "failed": ("✖", "bad"),
    "not run": ("○", "none"),
}


def health(entry: Mapping[str, Any]) -> Health:
    """Judge one record of comparison.json.

    ok
        a, b, c and the frequency have values, and the misfit is what the noise explains.
    look
        They have values, but chi^2 per degree of freedom is outside `CHI2_RANGE`, or the
        exponential losses came out as zero, so that no limiting Q exists.
    failed
        The fit has no finite values, or its law contradicts the decay (a red light).
    not run
        The record was refused, so nothing was fitted.
    """
    if entry.get("refused"):
        return _state("not run", "refused")
    missing = [
        name for name in ("frequency", "a", "b", "c") if not math.isfinite(number(entry.get(name)))
    ]
    if missing:
        return _state("failed", f"no value of {', '.join(missing)}")
    if entry.get("light") == "red":
        return _state("failed", str(entry["light_reason"]))
    chi2 = number(entry.get("chi2_per_dof"))
    if not math.isfinite(chi2):
        return _state("look", "the fit's χ² is unknown")
    if chi2 > CHI2_RANGE[1]:
        return _state("look", f"χ² per degree of freedom is {chi2:.3g}: the model misses something")
    if chi2 < CHI2_RANGE[0]:
        return _state("look", f"χ² per degree of freedom is {chi2:.2g}: the noise is overestimated")
    if not math.isfinite(number(entry.get("quality_factor_limit"))):
        return _state("look", "b came out as zero: there is no limiting Q")
    return _state("ok", "the noise explains the misfit")


def _state(word: str, reason: str) -> Health:
    symbol, colour = STATES[word]
    return Health(word, symbol, colour, reason)
