"""What the figures draw from: a campaign's numbers as arrays, and one record's decay."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pendpipe.analysis.fit.result import read_fit
from pendpipe.analysis.turning_points import TurningPoints, read_turning_points
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.estimate import Estimate
from pendpipe.files import read_json, without_folders
from pendpipe.manifest import check

Entry = Mapping[str, Any]
"""One record of ``comparison.json``."""


class NothingToDrawError(Exception):
    """A figure's data are not there; the message names what is missing."""


class Series(NamedTuple):
    """Points with error bars; arrays of shape (n,), and the records' names."""

    x: FloatArray
    x_sd: FloatArray
    y: FloatArray
    y_sd: FloatArray
    names: tuple[str, ...]


@dataclass(frozen=True)
class Decay:
    """One record's turning points and fit.

    Parameters
    ----------
    record
        Its name.
    time_s, amplitude_rad, amplitude_sd_rad, level_rad
        The turning points: when, how far from the level, its error, the level; shape (n,).
    parameters
        The fit's, by name.
    names, covariance
        Order and matrix of the covariance of the parameters.
    unit
        ``"rad"``, or ``"m"`` for what is no pendulum.
    """

    record: str
    time_s: FloatArray
    amplitude_rad: FloatArray
    amplitude_sd_rad: FloatArray
    level_rad: FloatArray
    parameters: Mapping[str, Estimate]
    names: tuple[str, ...]
    covariance: FloatArray
    unit: str = "rad"

    def value(self, name: str) -> float:
        """The fitted value of a parameter."""
        return self.parameters[name].value

    @property
    def rates(self) -> tuple[float, float, float]:
        """a, b, c of Eq. 13."""
        return self.value("a"), self.value("b"), self.value("c")

    @property
    def elapsed_s(self) -> FloatArray:
        """Time since the first turning point: the t of Eq. 14."""
        elapsed: FloatArray = self.time_s - self.time_s[0]
        return elapsed


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
            e["record"],
        )
        for e in entries
    ]
    rows = sorted(row for row in rows if np.isfinite(row[0]) and np.isfinite(row[2]))
    table = np.array([row[:4] for row in rows], dtype=np.float64).reshape(-1, 4)
    x, x_sd, y, y_sd = table.T
    return Series(x, x_sd, y, y_sd, tuple(row[4] for row in rows))


def branches(comparison: Mapping[str, Any]) -> list[str]:
    """The branches that have a theory curve, the paper's order first."""
    if not comparison.get("curves"):
        raise NothingToDrawError("the campaign has no theory curves")
    return sorted(comparison["curves"], key=lambda name: (name != "high", name))


def of_branch(comparison: Mapping[str, Any], name: str) -> list[Entry]:
    """The records of a branch that were not refused."""
    return [entry for entry in used(comparison) if entry.get("branch") == name]


def curve(comparison: Mapping[str, Any], branch: str, quantity: str) -> tuple[FloatArray, ...]:
    """Frequency and a quantity along a branch's theory curve, by rising frequency."""
    columns = comparison["curves"][branch]
    if not columns.get(quantity):
        raise NothingToDrawError(f"there is no theory curve of {quantity.replace('_', ' ')}")
    frequency = np.array(columns["frequency_hz"], dtype=np.float64)
    values = np.array(columns[quantity], dtype=np.float64)
    order = np.argsort(frequency)
    return frequency[order], values[order]


def read_content(path: Path, remedy: str = "run the campaign first") -> dict[str, Any]:
    """Read a JSON file that holds an object.

    Raises
    ------
    InputError
        If there is no such file, or it holds something else.
    """
    if not path.is_file():
        raise InputError(path, "there is no such file", remedy)
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(path, "this is no JSON object", "make it again")
    return content


def read_compared(campaign: Path, comparison: Path) -> tuple[dict[str, Any], Path, dict[str, Any]]:
    """Read a campaign's configuration and comparison.json.

    Returns
    -------
    configuration, folder, comparison
        The content of each, and between them the folder of the results: a folder a record.

    Raises
    ------
    InputError
        If one of them is absent or something else; DamagedError if it was altered.
    """
    configuration = read_content(campaign)
    check([comparison])
    content = read_content(comparison, "run pendpipe compare first")
    if "records" not in content:
        raise InputError(comparison, "it has no records", "make it again with pendpipe compare")
    return configuration, Path(str(configuration.get("results") or "results")), content


def read_decay(folder: Path, entry: Entry) -> Decay:
    """Read a record's turning points and fit from its folder of the results.

    Raises
    ------
    NothingToDrawError
        If the files can't be used, as those of a refused record.
    """
    name = entry["record"]
    try:
        fit = read_fit(folder / name / "fit.json")
        points = read_turning_points(folder / name / "turning_points.csv")
    except InputError as fault:
        raise NothingToDrawError(f"{name}: {without_folders(fault.problem)}") from None
    # The fit counts its time from the first turning point that it kept.
    low, high = entry.get("start_s", -math.inf), entry.get("stop_s", math.inf)
    keep = (points.time_s >= low - 1e-9) & (points.time_s <= high + 1e-9)
    if np.count_nonzero(keep) >= 3:
        points = points.chosen(keep)
    if len(points) < 3:
        raise NothingToDrawError(f"{name} has fewer than three turning points")
    offset = fit.parameters.get("offset")
    return Decay(
        name,
        points.time_s,
        _amplitude(points, math.nan if offset is None else offset.value),
        points.angle_sd_rad,
        points.level_rad,
        fit.parameters,
        fit.covariance_order,
        fit.covariance,
        points.unit,
    )


def _amplitude(points: TurningPoints, offset_rad: float) -> FloatArray:
    """Angles without their alternating sign, about the level that the fit found.

    A level too high by one lowers the signed angles by the table's ``level_coupling``.
    """
    too_high = float(np.mean(points.level_rad)) - offset_rad
    shift = points.level_coupling * too_high if math.isfinite(too_high) else 0.0
    # Signed, so that noise about zero stays noise about zero.
    amplitude: FloatArray = points.side * (points.angle_rad + shift)
    return amplitude
