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
    missing = [each for each in ("frequency", "a", "b", "c") if not _known(entry.get(each))]
    chi2 = number(entry.get("chi2_per_dof"))
    states = (
        ("not run", entry.get("refused"), "refused"),
        ("failed", missing, f"no value of {', '.join(missing)}"),
        ("failed", entry.get("light") == "red", str(entry.get("light_reason"))),
        ("look", not math.isfinite(chi2), "the fit's χ² is unknown"),
        (
            "look",
            chi2 > CHI2_RANGE[1],
            f"χ² per degree of freedom is {chi2:.3g}: the model misses something",
        ),
        (
            "look",
            chi2 < CHI2_RANGE[0],
            f"χ² per degree of freedom is {chi2:.2g}: the noise is overestimated",
        ),
        (
            "look",
            not _known(entry.get("quality_factor_limit")),
            "b came out as zero: there is no limiting Q",
        ),
        ("ok", True, "the noise explains the misfit"),
    )
    word, reason = next((word, reason) for word, holds, reason in states if holds)
    return Health(word, *STATES[word], reason)


def _known(quantity: Any) -> bool:
    return math.isfinite(number(quantity))
