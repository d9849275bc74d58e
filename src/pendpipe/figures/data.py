"""What the figures draw from: a campaign's numbers, and as arrays."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.configuration.load import read_configuration
from pendpipe.errors import refuse_if
from pendpipe.files import read_json

Entry = Mapping[str, Any]
"""One record of ``comparison.json``."""


class NothingToDrawError(Exception):
    """A figure's data are not there; the message names what is missing."""


class Series(NamedTuple):
    """Points with error bars; arrays of shape (n,)."""

    x: FloatArray
    x_sd: FloatArray
    y: FloatArray
    y_sd: FloatArray


def number(entry: Any) -> float:
    """The value of an estimate, or a plain number; NaN where there is none."""
    value = entry.get("value") if isinstance(entry, Mapping) else entry
    return float("nan") if value is None else float(value)


def error(entry: Any) -> float:
    """The standard deviation of an estimate; 0 where none is given."""
    value = entry.get("sd") if isinstance(entry, Mapping) else None
    return 0.0 if value is None else float(value)


def used(comparison: Mapping[str, Any]) -> list[Entry]:
    """The records that were not refused."""
    return [entry for entry in comparison["records"] if not entry.get("refused")]


def typical_record(comparison: Mapping[str, Any]) -> Entry | None:
    """The record of figures 7 and 8, unless it was refused."""
    name = comparison.get("typical_record")
    return next((entry for entry in used(comparison) if entry["record"] == name), None)


def series(entries: Iterable[Entry], quantity: str) -> Series:
    """A quantity of the records against their frequency, by rising frequency.

    Records without a finite value of either are left out.
    """
    rows = [
        (
            number(e["frequency"]),
            error(e["frequency"]),
            number(e.get(quantity)),
            error(e.get(quantity)),
        )
        for e in entries
    ]
    rows = sorted(row for row in rows if np.isfinite(row[0]) and np.isfinite(row[2]))
    return Series(*np.array(rows, dtype=np.float64).reshape(-1, 4).T)


def branches(comparison: Mapping[str, Any]) -> list[str]:
    """The branches that have a theory curve, the paper's order first."""
    if not comparison.get("curves"):
        raise NothingToDrawError("the campaign has no theory curves")
    return sorted(comparison["curves"], key=lambda name: (name != "high", name))


def of_branch(comparison: Mapping[str, Any], name: str) -> list[Entry]:
    """The records of a branch that were not refused."""
    return [entry for entry in used(comparison) if entry.get("branch") == name]


def theory(
    comparison: Mapping[str, Any], branch: str, quantity: str
) -> tuple[FloatArray, FloatArray]:
    """Frequency and a quantity along a branch's theory curve, by rising frequency."""
    columns = comparison["curves"][branch]
    if not columns.get(quantity):
        raise NothingToDrawError(f"there is no theory curve of {quantity.replace('_', ' ')}")
    return np.array(columns["frequency_hz"], float), np.array(columns[quantity], float)


def read_compared(
    campaign: Path, comparison: Path | None
) -> tuple[dict[str, Any], Path, dict[str, Any]]:
    """Read a campaign's configuration and comparison.json, by default that of its results.

    Returns
    -------
    configuration, folder, comparison
        The content of each, and between them the folder of the results: a folder a record.

    Raises
    ------
    InputError
        If one of them is absent or something else; DamagedError if it was altered.
    """
    configuration = read_configuration(campaign)
    folder = Path(str(configuration.get("results") or "results"))
    comparison = comparison or folder / "comparison.json"
    content = read_json(comparison)
    again = "make it again with pendpipe compare"
    whole = isinstance(content, dict) and "records" in content
    refuse_if(not whole, comparison, "it has no records", again)
    return configuration, folder, content
