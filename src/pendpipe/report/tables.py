"""The page's tables: each record's numbers, light and remarks, and the campaign's numbers.

These stand beside the paper's, and beside the truth where it was simulated.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.configuration.apparatus import in_tank
from pendpipe.configuration.models import Tank
from pendpipe.figures.data import Entry, error, number, typical_record, used
from pendpipe.files import without_folders
from pendpipe.quantities import compact, in_columns, pretty_unit, stretch, with_error
from pendpipe.templates import render as fill_template


class Column(NamedTuple):
    """A column of numbers: quantity, head, unit, and whether a narrow screen leaves it out."""

    quantity: str
    head: str
    unit: str = ""
    narrow: bool = True


COLUMNS: Final = (
    Column("frequency", "f", narrow=False),
    Column("a", "a"),
    Column("b", "b"),
    Column("c", "c"),
    Column("quality_factor_limit", "Q limit", narrow=False),
    Column("quality_factor_viscous", "Q viscous"),
    Column("quality_factor_viscous_theory", "Q of Eq. 16"),
    Column("amplitude_rms_rad", "Misfit"),
    Column("linear_damping_rms_rad", "Linear misfit"),
    Column("chi2_per_dof", "χ²/dof"),
)
_MISFITS: Final = ("amplitude_rms_rad", "linear_damping_rms_rad")


class Cell(NamedTuple):
    """A number of the table: as printed, and in full for sorting and for the CSV."""

    text: str
    value: str
    sd: str


def table_of_records(
    entries: list[Entry], *, has_theory: bool
) -> tuple[list[Column], list[dict[str, Any]]]:
    """Prepare every record, refused ones included, in the order of the table of records.

    A column that no record fills is left out. Beside a theory there is no room for the
    misfits, which then stand in each record's own section only.

    Returns
    -------
    columns
        Of numbers.
    lines
        Each a row of the table, and what the record's own section lists.
    """
    columns = [
        column._replace(unit=_common_unit(entries, column.quantity))
        for column in COLUMNS
        if any(_cell(column, entry).value for entry in entries)
        and not (has_theory and column.quantity in _MISFITS)
    ]
    lines = [
        {
            "name": str(entry["record"]),
            "anchor": f"record-{index}",
            "health": health(entry),
            "fluid": entry.get("fluid") or "",
            "branch": entry.get("branch") or "",
            "frequency": _cell(COLUMNS[0], entry).text,
            "cells": [_cell(column, entry) for column in columns],
            "entry": entry,
            "known": _resolved(entry),
            "cuts": [
                f"{stretch(number(cut.get('start_s')), number(cut.get('stop_s')))}:"
                f" {cut.get('reason', '')}"
                for cut in entry.get("cuts") or []
            ],
            "warnings": [str(warning) for warning in entry.get("warnings") or []],
            "refused": without_folders(str(entry.get("refused") or "")),
            "sha256": entry.get("input_sha256") or "",
        }
        for index, entry in enumerate(entries, start=1)
    ]
    return columns, lines


def _common_unit(entries: list[Entry], quantity: str) -> str:
    """The unit of a column for its head; none where angles and lengths are mixed."""
    units = {
        pretty_unit(found.get("unit", ""))
        for entry in entries
        if isinstance(found := _found(entry, quantity), Mapping)
    }
    return units.pop() if len(units) == 1 and quantity not in _MISFITS else ""


def _found(entry: Entry, quantity: str) -> Any:
    """A quantity of a record; the misfits are in a group of their own."""
    if quantity not in _MISFITS:
        return entry.get(quantity)
    value = number((entry.get("misfit") or {}).get(quantity))
    return {"value": value, "unit": (entry.get("amplitude") or {}).get("unit", "rad")}


def _cell(column: Column, entry: Entry) -> Cell:
    """A number of the table, with its unit where the column's head has none."""
    found = _found(entry, column.quantity)
    value, sd = number(found), error(found)
    unit = "" if column.unit or not isinstance(found, Mapping) else found.get("unit", "")
    if not math.isfinite(value) or _unresolved(column.quantity, found):
        return Cell("–", "", "")
    full = (repr(value), repr(sd) if sd else "")
    if column.quantity == "chi2_per_dof":
        return Cell(f"{value:.3f}" if value < 9.995 else f"{value:.0f}", *full)
    if column.quantity in _MISFITS:
        return Cell(compact(value, unit), *full)
    if found.get("at_bound"):
        upper = (found.get("interval95") or [None, None])[1]
        return Cell(f"< {with_error(float(f'{upper:.2g}'), None, unit)}" if upper else "0", *full)
    return Cell(with_error(value, sd, unit, short=True), *full)


def _unresolved(quantity: str, found: Any) -> bool:
    """Whether Eq. 17 has left nothing but noise: in air the hysteresis is all there is."""
    spread = error(found)
    return quantity == "quality_factor_viscous" and spread > 0.3 * abs(number(found))


QUANTITIES: Final = {
    "Frequency ω/(2π)": "frequency",
    "Amplitude at the first turning point": "amplitude",
    "Quadratic rate a": "a",
    "Linear rate b": "b",
    "Coulomb rate c": "c",
    "Level": "offset",
    "Limit of Q for a = c = 0": "quality_factor_limit",
    "Hysteretic Q, k f²": "quality_factor_hysteretic",
    "Viscous Q, Eq. 17": "quality_factor_viscous",
    "Viscous Q of Eq. 16": "quality_factor_viscous_theory",
    "Moment of inertia from distances": "moment_of_inertia",
    "Moment of inertia from the frequency": "moment_of_inertia_from_frequency",
    "Sensor constant": "volts_per_radian",
}
"""What the section of a record lists."""


def _resolved(entry: Entry) -> dict[str, str]:
    """The quantities of a record that are known, as they are printed."""
    return {
        text: with_error(number(found), error(found), found.get("unit", ""))
        + (", at its bound" if found.get("at_bound") else "")
        for text, key in QUANTITIES.items()
        if isinstance(found := entry.get(key), Mapping)
        and math.isfinite(number(found))
        and not _unresolved(key, found)
    }


class Health(NamedTuple):
    """How a record's fit stands."""

    word: str
    symbol: str
    colour: str
    """A class of the style sheet."""
    reason: str


STATES: Final = {
    "green": ("✔", "good"),
    "amber": ("▲", "look"),
    "red": ("✖", "bad"),
    "refused": ("○", "none"),
}
"""Symbol and class of each light: colour never carries a meaning alone."""


def health(entry: Mapping[str, Any]) -> Health:
    """The light of a record's fit, with its reason; red without a, b, c (not without a period)."""
    needed = ("a", "b", "c")
    missing = [each for each in needed if not math.isfinite(number(entry.get(each)))]
    if entry.get("refused"):
        word, reason = "refused", "refused"
    elif missing:
        word, reason = "red", f"no value of {', '.join(missing)}"
    else:
        word, reason = str(entry["light"]), str(entry["light_reason"])
    return Health(word, *STATES[word], reason)


Comparison = Mapping[str, Any]


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


class Row(NamedTuple):
    """One number: what it is, the campaign's, the paper's, and the hidden truth."""

    name: str
    found: str
    paper: str = ""
    difference: str = ""
    truth: str = ""
    pull: str = ""


def headline(comparison: Comparison, configuration: Mapping[str, Any]) -> list[Row]:
    """The table at the top of the page.

    Parameters
    ----------
    comparison
        The content of comparison.json.
    configuration
        Its section ``simulated`` is the truth; real recordings have none.
    """
    truth: Mapping[str, Any] = configuration.get("simulated") or {}
    drag = _simulated_drag(comparison, configuration)
    calibration = comparison.get("calibration") or {}
    rows = [
        _row(
            "Sensor constant",
            calibration.get("volts_per_radian"),
            "volts_per_radian",
            (truth.get("sensor") or {}).get("volts_per_radian"),
        ),
        _row(
            f"Hysteretic coefficient k of Q = k f², from the air benchmark{_reference(comparison)}",
            comparison.get("hysteretic_coefficient"),
            "hysteretic_coefficient",
            truth.get("hysteretic_coefficient_s2"),
        ),
        *(
            _row(f"Loss torque κ″ in {assembly}{_reference(comparison)}", found, "")
            for assembly, found in (comparison.get("loss_torque") or {}).items()
        ),
        _row(
            "Drag measured over Eq. 16, one factor for all records",
            comparison.get("drag_factor"),
            "theory_factor",
            drag,
        ),
        _row(
            "Drag measured over Eq. 16, mean of the records",
            comparison.get("theory_factor"),
            "theory_factor",
            drag,
        ),
        _row(
            "Drag measured over Eq. 16 with the walls of the told tank",
            comparison.get("theory_factor_in_tank"),
            "",
        ),
        _row(
            "History coefficient C_H of Eq. 2, if it takes the whole difference",
            comparison.get("history_coefficient"),
            "history_coefficient",
            truth.get("history_coefficient") if drag == 1.0 else None,
        ),
        *_exponents(comparison),
        *_typical(comparison),
        *_extremes(comparison),
    ]
    return [row for row in rows if row is not None]


def _simulated_drag(comparison: Comparison, configuration: Mapping[str, Any]) -> float | None:
    """The simulated drag over Eq. 16, mean of the records; None where nothing is simulated."""
    truth, apparatus = configuration.get("simulated"), configuration.get("apparatus")
    wet = [ratio for each in comparison["records"] if (ratio := each.get("a_over_delta"))]
    if not (truth and apparatus and apparatus.get("sphere") and wet):
        return None
    there = truth.get("tank") or apparatus.get("tank")
    tank, radius_m = there and Tank.model_validate(there), apparatus["sphere"]["diameter_m"] / 2
    walls = [in_tank(tank, radius_m, radius_m / each).drag_factor for each in wet]
    return float(truth["drag_factor"] * np.mean(walls))


def _reference(comparison: Comparison) -> str:
    """The moment of inertia to which k belongs, in words."""
    inertia = comparison.get("reference_inertia")
    return f", at {number(inertia):g} kg m²" if inertia else ""


def as_text(rows: list[Row]) -> str:
    """The same table for a terminal, one line per number."""
    return in_columns(
        [
            (
                row.name,
                row.found,
                "; ".join(
                    f"{whose} {value}"
                    for whose, value in (("paper", row.paper), ("truth", row.truth))
                    if value
                ),
            )
            for row in rows
        ]
    )


def _row(name: str, found: Any, key: str, truth: float | None = None) -> Row | None:
    """A row for an estimate; none where the campaign has none."""
    value, sd = number(found), error(found)
    if not math.isfinite(value):
        return None
    unit = found.get("unit", "") if isinstance(found, Mapping) else ""
    paper = NUMBERS.get(key, Printed(""))
    pull = f"{(value - truth) / sd:+.1f}".replace("-", "−") if truth is not None and sd else ""
    shown = "" if truth is None else with_error(float(truth), None, unit)
    return Row(
        name,
        with_error(value, sd, unit),
        paper.text,
        _percent(value, paper),
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
        of_paper = " branch (Eq. 11)" if key in NUMBERS else ""
        yield _row(f"Exponent x of Q_v ∝ fˣ, {branch}{of_paper}", found, key)


def _typical(comparison: Comparison) -> Iterator[Row | None]:
    """The rows about the record of figures 7 and 8."""
    entry = typical_record(comparison)
    if entry is None:
        return
    frequency, rates = number(entry["frequency"]), [number(entry.get(key)) for key in "abc"]
    first = physics.quality_factor(number(entry.get("amplitude")), frequency, *rates)
    found = {
        "Limit of Q for a = c = 0": (entry.get("quality_factor_limit"), "limit"),
        "Hysteretic Q = k f²": (entry.get("quality_factor_hysteretic"), "hysteretic"),
        "Viscous Q measured, Eq. 17": (entry.get("quality_factor_viscous"), "viscous"),
        "Viscous Q of Eq. 16": (entry.get("quality_factor_viscous_theory"), "viscous_theory"),
        "Moment of inertia, from distances": (entry.get("moment_of_inertia"), "inertia"),
        "1 + a/δ of Eq. 2": (1.0 + number(entry.get("a_over_delta")), ""),
        "Largest Q in the decay": (physics.largest_quality_factor(frequency, *rates), "largest"),
        "Q at the first turning point": (first, "first"),
    }
    # The paper's numbers are those of one frequency; they say nothing about another.
    same = abs(frequency / TYPICAL_FREQUENCY_HZ - 1.0) < 0.01
    for text, (value, key) in found.items():
        row = _row(f"{entry['record']} ({frequency:.3f} Hz): {text}", value, key)
        yield row if row is None or same else row._replace(paper="", difference="")


def _extremes(comparison: Comparison) -> Iterator[Row | None]:
    wet = [entry for entry in used(comparison) if entry.get("a_over_delta")]
    limits = [
        value for entry in wet if math.isfinite(value := number(entry.get("quality_factor_limit")))
    ]
    if limits:
        yield _row("Smallest limiting Q in water", min(limits), "smallest")
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
