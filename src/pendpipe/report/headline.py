"""The campaign's numbers beside the paper's, and beside the truth where it was simulated."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from pendpipe import physics
from pendpipe.figures.data import Entry, error, number, used
from pendpipe.quantities import with_error


class Printed(NamedTuple):
    """A number as the paper prints it, and its value where it is one."""

    text: str
    value: float | None = None


TYPICAL_FREQUENCY_HZ: Final = 0.516
"""The frequency of the paper's figures 7 and 8."""

NUMBERS: Final = {
    "hysteretic_coefficient": Printed("3940 s²", 3940.0),
    "volts_per_radian": Printed("3.85 V/rad", 3.85),
    "limit": Printed("136", 136.0),
    "largest": Printed("about 120", 120.0),
    "first": Printed("below 40"),
    "hysteretic": Printed("1049", 1049.0),
    "viscous": Printed("156", 156.0),
    "viscous_theory": Printed("176", 176.0),
    "inertia": Printed("0.099 kg m²", 0.099),
    "theory_factor": Printed("1.13 (176/156)", 176.0 / 156.0),
    "history_coefficient": Printed("1 (assumed)", 1.0),
    "exponent_high": Printed("−5.6", -5.6),
    "exponent_low": Printed("0.50", 0.50),
    "steady": Printed("1000 to 3000 %"),
    "smallest": Printed("about 10", 10.0),
    "ratio": Printed("about ten and more"),
}


Comparison = Mapping[str, Any]


class Row(NamedTuple):
    """One number: what it is, the campaign's, the paper's, and the hidden truth."""

    name: str
    found: str
    paper: str = ""
    difference: str = ""
    truth: str = ""
    pull: str = ""


def typical_record(comparison: Comparison) -> Entry | None:
    """The record of figures 7 and 8, unless it was refused."""
    name = comparison.get("typical_record")
    return next((entry for entry in used(comparison) if entry["record"] == name), None)


def headline(comparison: Comparison, truth: Mapping[str, Any]) -> list[Row]:
    """The table at the top of the page.

    Parameters
    ----------
    comparison
        The content of comparison.json.
    truth
        The section ``simulated`` of the configuration; empty for real recordings.
    """
    calibration = comparison.get("calibration") or {}
    rows = [
        _row(
            "Sensor constant",
            calibration.get("volts_per_radian"),
            "volts_per_radian",
            (truth.get("sensor") or {}).get("volts_per_radian"),
        ),
        _row(
            "Hysteretic coefficient k of Q = k f², from the air benchmark",
            comparison.get("hysteretic_coefficient"),
            "hysteretic_coefficient",
            truth.get("hysteretic_coefficient_s2"),
        ),
        _row(
            "Drag measured over Eq. 16",
            comparison.get("theory_factor"),
            "theory_factor",
            truth.get("drag_factor"),
        ),
        _row(
            "History coefficient C_H of Eq. 2, if it takes the whole difference",
            comparison.get("history_coefficient"),
            "history_coefficient",
            truth.get("history_coefficient") if truth.get("drag_factor") == 1.0 else None,
        ),
        *_exponents(comparison),
        *_typical(comparison),
        *_extremes(comparison),
    ]
    return [row for row in rows if row is not None]


def as_text(rows: list[Row]) -> str:
    """The same table for a terminal, a line a number."""
    first, second = (max(len(row[column]) for row in rows) + 2 for column in (0, 1))
    lines = []
    for row in rows:
        beside = {"paper": row.paper, "truth": row.truth}
        others = "; ".join(f"{whose} {value}" for whose, value in beside.items() if value)
        lines.append(f"{row.name:<{first}}{row.found:<{second}}{others}".rstrip())
    return "\n".join(lines)


def _row(name: str, found: Any, key: str, truth: float | None = None) -> Row | None:
    """A row for an estimate; none where the campaign has none."""
    value, sd = number(found), error(found)
    if not math.isfinite(value):
        return None
    unit = found.get("unit", "") if isinstance(found, Mapping) else ""
    pull = f"{(value - truth) / sd:+.1f}".replace("-", "−") if truth is not None and sd else ""
    shown = "" if truth is None else with_error(float(truth), None, unit)
    return Row(
        name,
        with_error(value, sd, unit),
        NUMBERS[key].text,
        _percent(value, NUMBERS[key]),
        shown,
        pull,
    )


def _percent(value: float, printed: Printed) -> str:
    """How far a value lies from the paper's, in percent of the paper's."""
    if not printed.value:
        return ""
    percent = round(100.0 * (value / printed.value - 1.0), 1)
    return f"{percent:+.1f} %".replace("-", "−") if percent else "0.0 %"


def _exponents(comparison: Comparison) -> Iterator[Row | None]:
    for branch, found in (comparison.get("viscous_exponents") or {}).items():
        key = f"exponent_{branch}"
        if key in NUMBERS:
            yield _row(f"Exponent x of Q_v ∝ fˣ, {branch} branch (Eq. 11)", found, key)
        elif found:
            name = f"Exponent x of Q_v ∝ fˣ, {branch}"
            yield Row(name, with_error(number(found), error(found)))


def _typical(comparison: Comparison) -> Iterator[Row | None]:
    """The rows about the record of figures 7 and 8."""
    entry = typical_record(comparison)
    if entry is None:
        return
    frequency = number(entry["frequency"])
    name = f"{entry['record']} ({frequency:.3f} Hz)"
    estimates = {
        "Limit of Q for a = c = 0": ("quality_factor_limit", "limit"),
        "Hysteretic Q = k f²": ("quality_factor_hysteretic", "hysteretic"),
        "Viscous Q measured, Eq. 17": ("quality_factor_viscous", "viscous"),
        "Viscous Q of Eq. 16": ("quality_factor_viscous_theory", "viscous_theory"),
        "Moment of inertia, from distances": ("moment_of_inertia", "inertia"),
    }
    rows = [
        _row(f"{name}: {text}", entry.get(quantity), key)
        for text, (quantity, key) in estimates.items()
    ]
    if entry.get("a_over_delta"):
        ratio = number(entry["a_over_delta"])
        rows.append(Row(f"{name}: 1 + a/δ of Eq. 2", f"{1.0 + ratio:.1f}"))
    rates = [number(entry.get(key)) for key in "abc"]
    if all(map(math.isfinite, rates)):
        largest = float(physics.largest_quality_factor(frequency, *rates))
        first = float(physics.quality_factor(number(entry["amplitude"]), frequency, *rates))
        found = {
            "Largest Q in the decay": (largest, "largest"),
            "Q at the first turning point": (first, "first"),
        }
        rows += [
            Row(f"{name}: {text}", f"{value:.1f}", NUMBERS[key].text, _percent(value, NUMBERS[key]))
            for text, (value, key) in found.items()
        ]
    # The paper's numbers are those of one frequency; they say nothing about another.
    same = abs(frequency / TYPICAL_FREQUENCY_HZ - 1.0) < 0.01
    for row in rows:
        yield row if row is None or same else row._replace(paper="", difference="")


def _extremes(comparison: Comparison) -> Iterator[Row | None]:
    wet = [entry for entry in used(comparison) if entry.get("a_over_delta")]
    limits = [number(entry.get("quality_factor_limit")) for entry in wet]
    limits = [value for value in limits if math.isfinite(value)]
    if limits:
        yield Row("Smallest limiting Q in water", f"{min(limits):.1f}", NUMBERS["smallest"].text)
    if wet:
        ratios = [number(entry["a_over_delta"]) for entry in wet]
        yield Row(
            "History term a/δ", f"{min(ratios):.1f} to {max(ratios):.1f}", NUMBERS["ratio"].text
        )
    steady = comparison.get("steady_stokes_percent")
    if steady:
        yield Row(
            "Steady Stokes law underestimates the damping by",
            f"{steady[0]:.0f} to {steady[1]:.0f} %",
            NUMBERS["steady"].text,
        )
