"""``campaign.json``: the campaign's numbers, as programs outside the project read them."""

from __future__ import annotations

from typing import Any, Final

NUMBERS: Final = (
    "frequency",
    "moment_of_inertia",
    "a",
    "b",
    "c",
    "quality_factor_limit",
    "quality_factor_hysteretic",
    "quality_factor_viscous",
    "quality_factor_viscous_theory",
)


def campaign_summary(comparison: dict[str, Any]) -> dict[str, Any]:
    """Take the contract's numbers out of the comparison; each has value, sd and unit."""
    exponents = comparison["viscous_exponents"] or {}
    calibration = comparison["calibration"]
    return {
        "schema_version": 1,
        "hysteretic_coefficient": _number(comparison["hysteretic_coefficient"]),
        "viscous_exponents": {branch: _number(exponents.get(branch)) for branch in ("low", "high")},
        "theory_factor": _number(comparison["theory_factor"]),
        "history_coefficient": _number(comparison["history_coefficient"]),
        "volts_per_radian": _number(calibration and calibration["volts_per_radian"]),
        "records": [
            {name: record[name] for name in ("record", "fluid", "branch")}
            | {name: _number(record.get(name)) for name in NUMBERS}
            for record in comparison["records"]
            if record["refused"] is None
        ],
        "refused": [
            {"record": record["record"], "reason": record["refused"]}
            for record in comparison["records"]
            if record["refused"] is not None
        ],
    }


def _number(content: dict[str, Any] | None) -> dict[str, Any] | None:
    """Value, sd and unit of a number; ``None`` where the campaign has none."""
    if content is None:
        return None
    return {name: content[name] for name in ("value", "sd", "unit")}
