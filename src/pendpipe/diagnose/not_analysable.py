"""The form on disk of a diagnosis that could not be made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def not_analysable(
    baseline: str, reason: str, provenance: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return ``diagnosis.json`` of a recording that can't be analysed.

    It has every key that another diagnosis has, so that a program need not ask which are
    there; numbers that do not exist are None.

    Parameters
    ----------
    baseline
        The model that was asked for.
    reason
        Why it can't be analysed, one line.
    provenance
        Goes into the result.
    """
    nothing: dict[str, Any] = {"parameters": {}, "residual_rms_rad": None, "chi2_per_dof": None}
    return {
        "schema_version": 1,
        "baseline": {"name": baseline, **nothing},
        "noise_rms_rad": None,
        "verdict": "not-analysable",
        "reason": reason,
        "p_value": None,
        "effects": [],
        "improved": dict(nothing),
        "held_out": {
            "log_density_before": None,
            "log_density_after": None,
            "gain": None,
            "gain_sd": None,
        },
        "unexplained": {"residual_rms_rad": None, "p_value": None},
        "statement": f"This recording can't be analysed: {reason}.",
        "figures": [],
        "warnings": [],
        "provenance": dict(provenance or {}),
    }
