"""The table of records, and what is told of each one."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from pathlib import PurePath
from typing import Any, Final, NamedTuple

from pendpipe.figures.data import Entry, error, number
from pendpipe.figures.units import pretty_unit, with_error
from pendpipe.report.health import Health, health

COLUMNS: Final = (
    ("frequency", "f", "Hz", True),
    ("a", "a", "", True),
    ("b", "b", "s⁻¹", False),
    ("c", "c", "", True),
    ("quality_factor_limit", "Q limit", "", False),
    ("quality_factor_viscous", "Q viscous", "", True),
    ("quality_factor_viscous_theory", "Q of Eq. 16", "", True),
    ("chi2_per_dof", "χ²/dof", "", True),
)
"""Quantity, head, unit, and whether a narrow screen leaves it out."""


_PATH: Final = re.compile(r"(?<![\w./\\])(?:[A-Za-z]:[\\/]|~?/|\.{1,2}/)[^\s'\"(),;]+")
"""An absolute path, or one that begins at a dot; not the slash of V/rad."""


class Cell(NamedTuple):
    """A number of the table: as printed, and in full for sorting and for the CSV."""

    text: str
    value: str
    sd: str


class Line(NamedTuple):
    """A row of the table, and the record's own section."""

    name: str
    anchor: str
    health: Health
    fluid: str
    branch: str
    cells: list[Cell]
    facts: list[tuple[str, str]]
    cuts: list[str]
    warnings: list[str]
    refused: str


def lines(entries: list[Entry], hashes: Mapping[str, str]) -> list[Line]:
    """Prepare every record, refused ones included, in the order of the table of records."""
    return [_line(entry, index, hashes) for index, entry in enumerate(entries, start=1)]


def heads(entries: list[Entry]) -> list[tuple[str, str, bool]]:
    """Head, unit and narrowness of each column; units as the records have them."""
    found: dict[str, set[str]] = {}
    for entry in entries:
        for quantity, *_ in COLUMNS:
            estimate = entry.get(quantity)
            if isinstance(estimate, Mapping):
                found.setdefault(quantity, set()).add(pretty_unit(estimate.get("unit", "")))
    return [
        # Angles and lengths in one campaign: each cell then says its own unit.
        (head, units.pop() if len(units := set(found.get(quantity, {unit}))) == 1 else "", narrow)
        for quantity, head, unit, narrow in COLUMNS
    ]


def _line(entry: Entry, index: int, hashes: Mapping[str, str]) -> Line:
    name = str(entry["record"])
    refused = str(entry.get("refused") or "")
    return Line(
        name=name,
        anchor=f"record-{index}",
        health=health(entry),
        fluid=entry.get("fluid") or "",
        branch=entry.get("branch") or "",
        cells=[_cell(entry.get(quantity)) for quantity, *_ in COLUMNS],
        facts=[] if refused else list(_facts(entry, hashes.get(name, ""))),
        cuts=[_cut(cut) for cut in entry.get("cuts") or []],
        warnings=[str(warning) for warning in entry.get("warnings") or []],
        refused=without_folders(refused),
    )


def _cell(found: Any) -> Cell:
    value, sd = number(found), error(found)
    if not math.isfinite(value):
        return Cell("–", "", "")
    text = with_error(value, sd, short=True)
    if isinstance(found, Mapping) and found.get("at_bound"):
        upper = (found.get("interval95") or [None, None])[1]
        text = f"< {upper:.2g}" if upper else "0"
    return Cell(text.replace("e-0", "e−"), repr(value), repr(sd) if sd else "")


def _facts(entry: Entry, digest: str) -> Iterator[tuple[str, str]]:
    """Everything that the section of a record lists, as pairs of name and value."""
    yield "Source", without_folders(str(entry.get("source") or ""))
    place = ", ".join(filter(None, (entry.get(key) for key in ("fluid", "branch", "geometry"))))
    if place:
        yield "Fluid, branch, geometry", place
    quantities = {
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
    for text, key in quantities.items():
        found = entry.get(key)
        if math.isfinite(number(found)) and isinstance(found, Mapping):
            bound = ", at its bound" if found.get("at_bound") else ""
            yield text, with_error(number(found), error(found), found.get("unit", "")) + bound
    yield "Method", str(entry.get("method") or "")
    yield "Used", (
        f"{entry.get('samples')} samples, {entry.get('turning_points')} turning points,"
        f" {number(entry.get('start_s')):.4g} s to {number(entry.get('stop_s')):.4g} s"
    )
    yield from _noise(entry)
    if digest:
        yield "SHA-256 of the recording", digest


def _noise(entry: Entry) -> Iterator[tuple[str, str]]:
    unit = (entry.get("amplitude") or {}).get("unit", "rad")
    pair = (number(entry.get("noise_rms_rad")), number(entry.get("residual_rms_rad")))
    if all(map(math.isfinite, pair)):
        noise, residual = (with_error(value, None, unit) for value in pair)
        yield "Noise; residual (rms)", f"{noise}; {residual}"
    misfit = entry.get("misfit")
    if misfit:
        own, linear = (
            with_error(number(misfit.get(key)), None, unit)
            for key in ("amplitude_rms_rad", "linear_damping_rms_rad")
        )
        yield "Misfit of the amplitudes (rms)", f"{own}; with linear damping alone {linear}"


def _cut(cut: Mapping[str, Any]) -> str:
    start, stop = number(cut.get("start_s")), number(cut.get("stop_s"))
    return f"{start:.4g} s to {stop:.4g} s: {cut.get('reason', '')}"


def without_folders(text: str) -> str:
    """Keep the names of files and drop the folders: they are the user's own business.

    >>> without_folders("/home/rdp/data/run 7.csv, line 3: no number")
    '7.csv, line 3: no number'
    """
    return _PATH.sub(lambda found: PurePath(found.group().replace("\\", "/")).name, text)
