"""What a campaign found, in sentences that hold for the numbers they are made from."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from pendpipe.figures.data import error, number
from pendpipe.quantities import with_error

Comparison = Mapping[str, Any]


def findings(comparison: Comparison) -> list[str]:
    """A sentence or two for each thing that the campaign can tell."""
    return [
        *_hysteresis(comparison),
        *_drag(comparison),
        *_left_out(comparison),
        *_exponents(comparison),
    ]


def _hysteresis(comparison: Comparison) -> Iterator[str]:
    fitted = comparison.get("hysteretic_coefficient") or {}
    exponent = fitted.get("free_exponent")
    if not exponent or not error(exponent):
        return
    away = abs(number(exponent) - 2.0) / error(exponent)
    verdict = (
        "the square that internal friction of the structure gives"
        if away < 3.0
        else f"{away:.1f} standard deviations from the square that internal friction gives"
    )
    text = with_error(number(exponent), error(exponent))
    yield f"In air Q grows as the frequency to the power {text}: {verdict}."


def _drag(comparison: Comparison) -> Iterator[str]:
    factor = comparison.get("theory_factor") or {}
    value, sd = number(factor), error(factor)
    if not math.isfinite(value) or not sd:
        return
    away = abs(value - 1.0) / sd
    if away < 3.0:
        yield f"The drag in water is that of Eq. 16 ({with_error(value, sd)} times it)."
        return
    yield (
        f"The drag in water is {with_error(value, sd)} times that of Eq. 16,"
        f" {away:.0f} standard deviations from 1 (paper: 1.13)."
    )
    history = comparison.get("history_coefficient") or {}
    better = (history.get("chi2") or 0.0) - (factor.get("chi2") or 0.0)
    if better > 9.0:
        yield (
            "A common factor describes that better than a larger history term"
            f" (χ² lower by {better:.0f})."
        )
    worst = max(comparison.get("budget") or [], key=lambda part: part["relative_sd"], default=None)
    if worst:
        yield (
            f"What limits that number most is the {worst['source']}"
            f" ({100 * worst['relative_sd']:.2g} %)."
        )


def _left_out(comparison: Comparison) -> Iterator[str]:
    steady = comparison.get("steady_stokes_percent")
    if steady:
        yield (
            f"Stokes' law for steady flow, without the history term, would underestimate the"
            f" damping by {steady[0]:.0f} to {steady[1]:.0f} %."
        )
    for check in comparison.get("checks") or []:
        if check["history"] and not check["hysteresis"] and check.get("ratio"):
            yield (
                f"Eq. 16 without the hysteretic part overestimates Q by a factor of up to"
                f" {max(check['ratio']):.1f}."
            )


def _exponents(comparison: Comparison) -> Iterator[str]:
    for branch, found in (comparison.get("viscous_exponents") or {}).items():
        exponents = [part["exponent"] for part in (found or {}).get("ranges") or []]
        # Worth saying where the choice of the ends matters more than a tenth.
        if len(exponents) > 1 and max(exponents) - min(exponents) > 0.1 * abs(number(found)):
            low, high = (f"{end:.2f}".replace("-", "−") for end in (min(exponents), max(exponents)))
            yield (
                f"The exponent of the {branch} branch is no constant of nature: over parts of the"
                f" branch it lies between {low} and {high}."
            )
