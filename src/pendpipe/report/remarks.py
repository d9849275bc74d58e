"""The sentences of the page beside its numbers: findings, steps, warnings, sections."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from pendpipe.figures.data import Entry, error, number
from pendpipe.quantities import with_error
from pendpipe.templates import render as fill_template

Comparison = Mapping[str, Any]


def of_campaign(comparison: Comparison) -> dict[str, Any]:
    """What the page says beside its numbers, by the template's names."""
    return {
        "findings": findings(comparison),
        "exponents": exponent_tables(comparison),
        "budget": budget_rows(comparison),
        "checks": check_rows(comparison),
        "warned": grouped_warnings(comparison["records"]),
    }


def findings(comparison: Comparison) -> list[str]:
    """A sentence or two for each thing that the campaign can tell."""
    text = fill_template(
        "pendpipe.report",
        "findings.txt",
        comparison=comparison,
        number=number,
        error=error,
        with_error=with_error,
    )
    return text.splitlines()


def grouped_warnings(entries: Sequence[Entry]) -> list[tuple[str, list[str]]]:
    """Warnings that differ in their numbers only, listed once with all their records."""
    groups: dict[str, tuple[str, list[str]]] = {}
    for entry in entries:
        for warning in entry.get("warnings") or []:
            key = re.sub(r"[-+]?\d[\d.e+-]*", "#", str(warning))
            groups.setdefault(key, (str(warning), []))[1].append(str(entry["record"]))
    return sorted(groups.values(), key=lambda group: -len(group[1]))


def exponent_tables(comparison: Comparison) -> list[dict[str, Any]]:
    """For each branch: the exponent, its curvature, and how it depends on the range."""
    tables = []
    for branch, found in (comparison.get("viscous_exponents") or {}).items():
        if not found:
            continue
        curvature = found.get("curvature")
        slopes = found.get("local_slopes") or []
        tables.append(
            {
                "branch": branch,
                "value": with_error(number(found), error(found)),
                "curvature": with_error(number(curvature), error(curvature)) if curvature else "",
                "slopes": ", ".join(_slope(slope) for slope in slopes),
                "ranges": [
                    (part["first"], part["last"], with_error(part["exponent"], part["sd"]))
                    for part in found.get("ranges") or []
                ],
            }
        )
    return tables


def _slope(slope: float | None) -> str:
    """A local exponent; between two records of one frequency there is none."""
    return "–" if slope is None else f"{slope:.2f}".replace("-", "−")


def budget_rows(comparison: Comparison) -> list[tuple[str, str, float]]:
    """Source, its relative standard deviation, and the share of the known variance in percent."""
    budget = comparison.get("budget") or []
    parts = [part for part in budget if part["relative_sd"] is not None]
    total = sum(part["relative_sd"] ** 2 for part in parts) or 1.0
    rows = [
        (
            part["source"],
            f"{100 * part['relative_sd']:.2g} %",
            100 * part["relative_sd"] ** 2 / total,
        )
        for part in parts
    ]
    return sorted(rows, key=lambda row: -row[2])


def check_rows(comparison: Comparison) -> list[tuple[str, str, str, str]]:
    """With and without the history term and the hysteresis: theory over measurement, chi^2."""
    rows = []
    for check in comparison.get("checks") or []:
        ratio = [value for value in check.get("ratio") or [] if value is not None]
        chi2 = float(f"{number(check.get('chi2')):.2g}")
        rows.append(
            (
                "with" if check["history"] else "left out",
                "with" if check["hysteresis"] else "left out",
                f"{min(ratio):.3g} to {max(ratio):.3g}" if ratio else "–",
                f"{with_error(chi2, None)} / {check['dof']}" if math.isfinite(chi2) else "–",
            )
        )
    return rows


def joint_rows(comparison: Comparison) -> list[tuple[str, ...]]:
    """The numbers of the joint fits beside those of the paper's route."""
    joint = comparison.get("joint")
    if not joint:
        return []
    names = {
        "hysteretic_coefficient": ("Hysteretic coefficient k", "hysteretic_coefficient"),
        "drag_factor": ("Drag over Eq. 16", "theory_factor"),
        "history_coefficient": ("History coefficient C_H", "history_coefficient"),
        "added_mass_coefficient": ("Added mass over the displaced fluid", ""),
    }
    routes = [joint["with_benchmark"], joint["without_benchmark"] or {}]
    rows = []
    for name, (words, paper) in names.items():
        found = [*(route.get(name) for route in routes), comparison.get(paper)]
        texts = (with_error(number(x), error(x), x.get("unit", "")) if x else "" for x in found)
        rows.append((words, *texts))
    return rows
