"""The sentences of the page beside its numbers: findings, steps, warnings, sections."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pendpipe.figures.data import Entry, error, number, used
from pendpipe.quantities import with_error
from pendpipe.report.records import STATES

Comparison = Mapping[str, Any]


def of_campaign(comparison: Comparison, drawn: Sequence[str], folder: Path) -> dict[str, Any]:
    """What the page says beside its numbers, by the template's names."""
    return {
        "findings": findings(comparison),
        "exponents": exponent_tables(comparison),
        "budget": budget_rows(comparison),
        "checks": check_rows(comparison),
        "warned": grouped_warnings(comparison["records"]),
        "steps": steps(comparison, drawn, folder),
    }


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
        # Worth a sentence where the choice of the ends matters more than a tenth.
        if len(exponents) > 1 and max(exponents) - min(exponents) > 0.1 * abs(number(found)):
            low, high = (f"{end:.2f}".replace("-", "−") for end in (min(exponents), max(exponents)))
            yield (
                f"The exponent of the {branch} branch is no constant of nature: over parts of the"
                f" branch it lies between {low} and {high}."
            )


def steps(comparison: Comparison, drawn: Sequence[str], folder: Path) -> list[dict[str, str]]:
    """The stages, done or not."""
    entries = comparison["records"]
    fitted = used(comparison)
    refused = len(entries) - len(fitted)
    left = f", {refused} refused" if refused else ""
    calibration = comparison.get("calibration")
    coefficient = comparison.get("hysteretic_coefficient")
    theory = bool(comparison.get("has_theory"))
    diagnosed = sum(
        (folder / str(entry["record"]) / "diagnosis" / "diagnosis.json").is_file()
        for entry in entries
    )
    found = {
        "acquire": (entries, f"{len(entries)} records{left}"),
        "calibrate": (
            calibration,
            "caliper run"
            if calibration
            else "no caliper run: records bring their own constant, or are in rad already",
        ),
        "turning points": (
            fitted,
            f"{sum(int(e.get('turning_points') or 0) for e in fitted)} found",
        ),
        "fit a, b, c": (fitted, f"{len(fitted)} records"),
        "separate (Eq. 17)": (
            coefficient,
            "k from the benchmark in air" if coefficient else "no benchmark in air",
        ),
        "compare (Eq. 16)": (theory, "" if theory else "no apparatus is described"),
        "diagnose": (
            diagnosed,
            f"{diagnosed} records"
            if diagnosed
            else "not part of this run: pendpipe diagnose looks for physics left out",
        ),
        "figures": (drawn, f"{len(drawn)} of the campaign"),
    }
    return [
        dict(zip(("symbol", "colour"), STATES["ok" if done else "not run"], strict=True))
        | {"name": name, "word": "done" if done else "skipped", "remark": remark}
        for name, (done, remark) in found.items()
    ]


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
    """Source, its relative standard deviation, and the share of the variance in percent."""
    parts = comparison.get("budget") or []
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
