"""What the figures draw from: a campaign's numbers as arrays, and one record's decay."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray

Entry = Mapping[str, Any]
"""One record of ``comparison.json``."""


class NothingToDrawError(Exception):
    """A figure's data are not there; the message is a clause that says what is missing."""


class Series(NamedTuple):
    """Points with error bars; arrays of shape (n,), and the records' names."""

    x: FloatArray
    x_sd: FloatArray
    y: FloatArray
    y_sd: FloatArray
    names: tuple[str, ...]

    def mapped(self, function: Callable[[FloatArray], FloatArray], slope: FloatArray) -> Series:
        """The same points with another ordinate: y -> function(y), errors times |slope|."""
        return self._replace(y=function(self.y), y_sd=np.abs(slope) * self.y_sd)


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
        ``a``, ``b``, ``c``, ``frequency``, ``amplitude`` as in fit.json.
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
    parameters: Mapping[str, Mapping[str, Any]]
    names: tuple[str, ...]
    covariance: FloatArray
    unit: str = "rad"

    def value(self, name: str) -> float:
        """The fitted value of a parameter."""
        return number(self.parameters[name])

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
        (number(e["frequency"]), error(e["frequency"]), number(e.get(quantity)),
         error(e.get(quantity)), e["record"])
        for e in entries
    ]  # fmt: skip
    rows = sorted(row for row in rows if np.isfinite(row[0]) and np.isfinite(row[2]))
    table = np.array([row[:4] for row in rows], dtype=np.float64).reshape(-1, 4)
    x, x_sd, y, y_sd = table.T
    return Series(x, x_sd, y, y_sd, tuple(row[4] for row in rows))


def branches(comparison: Mapping[str, Any]) -> list[str]:
    """The branches that have a theory curve, the paper's order first."""
    return sorted(comparison.get("curves") or {}, key=lambda name: (name != "high", name))


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


def read_decay(folder: Path, entry: Entry) -> Decay:
    """Read a record's turning points and fit from its folder of the results.

    Raises
    ------
    NothingToDrawError
        If the files are not there, or were left by a refused record.
    """
    name = entry["record"]
    try:
        fit = json.loads((folder / name / "fit.json").read_text(encoding="utf-8"))
        text = (folder / name / "turning_points.csv").read_text(encoding="utf-8")
    except FileNotFoundError as fault:
        raise NothingToDrawError(f"{name} has no {Path(str(fault.filename)).name}") from None
    if "refused" in fit:
        raise NothingToDrawError(f"{name} was refused")
    columns, metadata = _table(text)
    if columns is None or len(columns["time_s"]) < 3:
        raise NothingToDrawError(f"{name} has fewer than three turning points")
    # The fit counts its time from the first turning point that it kept.
    start = entry.get("start_s")
    keep = columns["time_s"] >= (-np.inf if start is None else start - 1e-9)
    stop = entry.get("stop_s")
    keep &= columns["time_s"] <= (np.inf if stop is None else stop + 1e-9)
    if np.count_nonzero(keep) < 3:
        keep[:] = True
    columns = {key: column[keep] for key, column in columns.items()}
    covariance = fit.get("covariance") or {}
    return Decay(
        name, columns["time_s"], _amplitude(columns, metadata, fit), columns["angle_sd_rad"],
        columns["level_rad"],
        fit["parameters"], tuple(covariance.get("order", ())),
        np.array(covariance.get("matrix", []), dtype=np.float64), metadata.get("unit", "rad"),
    )  # fmt: skip


def _amplitude(
    columns: Mapping[str, FloatArray], metadata: Mapping[str, str], fit: Mapping[str, Any]
) -> FloatArray:
    """Angles without their alternating sign, about the level that the fit found.

    A level too high by one lowers the signed angles by the table's ``level_coupling``.
    """
    # Signed, so that noise about zero stays noise about zero.
    side = 1.0 - 2.0 * (columns["half_cycle"] % 2.0)
    if float(np.sum(side * columns["angle_rad"])) < 0.0:
        side = -side
    too_high = float(np.mean(columns["level_rad"])) - number(fit["parameters"].get("offset"))
    coupling = float(metadata.get("level_coupling", "1"))
    shift = coupling * too_high if np.isfinite(too_high) else 0.0
    return side * (columns["angle_rad"] + shift)


def _table(text: str) -> tuple[dict[str, FloatArray] | None, dict[str, str]]:
    """Columns and metadata of turning_points.csv."""
    lines = text.splitlines()
    head = [line for line in lines if line.startswith("#")]
    rows = [line for line in lines if line.strip() and not line.startswith("#")]
    metadata = {
        key.strip(): value.strip()
        for key, _, value in (line.lstrip("# ").partition(":") for line in head)
    }
    if len(rows) < 2:
        return None, metadata
    values = np.loadtxt(rows[1:], delimiter=",", ndmin=2)
    return dict(zip(rows[0].split(","), values.T, strict=True)), metadata
