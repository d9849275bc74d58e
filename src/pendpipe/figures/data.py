"""What the figures draw from: a campaign's numbers, and as arrays; a record's decay."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pendpipe import physics
from pendpipe.analysis.fit.result import FitResult, read_fit
from pendpipe.analysis.turning_points import TurningPoints, read_turning_points
from pendpipe.arrays import FloatArray
from pendpipe.configuration.load import read_configuration
from pendpipe.dynamics import Release, turning_points
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import read_json, without_folders

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


@dataclass(frozen=True)
class Decay:
    """One record's turning points and fit.

    Parameters
    ----------
    record
        Its name.
    points
        The turning points, from the first that was fitted.
    fit
        The fit, whose time begins at the first of them.
    """

    record: str
    points: TurningPoints
    fit: FitResult

    @property
    def law_name(self) -> str:
        """The fitted law's, for a key."""
        return self.fit.equation.replace("the torque of ", "")

    @property
    def _too_high(self) -> float:
        """By how much the turning points' level exceeds the one that the fit found."""
        too_high = float(np.mean(self.points.level_rad)) - self.fit.value("offset")
        return too_high if math.isfinite(too_high) else 0.0

    @property
    def level_rad(self) -> FloatArray:
        """The fitted level, with the course of that of the turning points; shape (n,)."""
        return self.points.level_rad - self._too_high

    @property
    def amplitude_rad(self) -> FloatArray:
        """Angles without their alternating sign, about the level that the fit found.

        A level too high by one lowers the signed angles by the table's ``level_coupling``.
        """
        # Signed, so that noise about zero stays noise about zero.
        shift = self.points.level_coupling * self._too_high
        return self.points.side * (self.points.angle_rad + shift)

    @property
    def elapsed_s(self) -> FloatArray:
        """Time since the first turning point: the t of Eq. 14."""
        return np.asarray(self.points.time_s - self.points.time_s[0])

    @property
    def residual_rad(self) -> FloatArray:
        """Amplitudes less the fitted law's."""
        return self.amplitude_rad - self.along(self.elapsed_s)[0]

    def along(self, elapsed_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Amplitude and Q of the law that was fitted, at times since the first turning point.

        Where that is no Eq. 14 (Q: Eq. 15), the amplitudes y are those at which the motion of
        Eq. 8 turns, and Q is pi/ln(y'/y) from one to the next on the same side.
        """
        start, *rates = (self.fit.value(name) for name in ("amplitude", "a", "b", "c"))
        frequency = self.fit.value("frequency")
        if self.fit.equation == "Eq. 14":
            y = physics.amplitude(elapsed_s, start, *rates)
            with np.errstate(divide="ignore", invalid="ignore"):
                return y, physics.quality_factor(y, frequency, *rates)
        if self.fit.method == "amplitudes":
            y = self.fit.predict(self.points.time_s[0] + elapsed_s)
            # Without a period there is no Q.
            timeless = not math.isfinite(frequency)
            q = [math.nan if timeless else self.fit.quality_factor(each).value for each in y]
            return y, np.array(q)
        until_s = float(elapsed_s[-1]) + 2.0 / frequency
        turned = turning_points(self.fit.law, Release(0.0, start), until_s=until_s)
        if len(turned.time_s) < 4:
            raise NothingToDrawError("the fitted law stops within two cycles")
        y = np.abs(turned.angle_rad)
        with np.errstate(divide="ignore", invalid="ignore"):  # no loss: Q is infinite
            time_s, quality = turned.time_s[1:-1], np.pi / np.log(y[:-2] / y[2:])
            slope = (quality[1] - quality[0]) / (time_s[1] - time_s[0])
        return (
            np.interp(elapsed_s, turned.time_s, y),
            np.interp(elapsed_s, [0.0, *time_s], [quality[0] - slope * time_s[0], *quality]),
        )


def read_decay(folder: Path, entry: Entry) -> Decay:
    """Read a record's turning points and fit from its folder of the results.

    Raises
    ------
    NothingToDrawError
        If the files can't be used, as those of a refused record.
    """
    home = folder / entry["record"]
    return decay_of(entry, home / "fit.json", home / "turning_points.csv")


def decay_of(entry: Entry, fit_json: Path, table: Path) -> Decay:
    """Read a record's turning points and fit, each from its file; else as `read_decay`."""
    name = entry["record"]
    try:
        fit = read_fit(fit_json)
        points = read_turning_points(table)
    except InputError as fault:
        raise NothingToDrawError(f"{name}: {without_folders(fault.problem)}") from None
    # The fit counts its time from the first turning point that it kept.
    low, high = entry.get("start_s", -math.inf), entry.get("stop_s", math.inf)
    keep = (points.time_s >= low - 1e-9) & (points.time_s <= high + 1e-9)
    if np.count_nonzero(keep) >= 3:
        points = points.chosen(keep)
    if len(points) < 3:
        raise NothingToDrawError(f"{name} has fewer than three turning points")
    return Decay(name, points, fit)


FALL = 0.75
"""A measured point spans turning points until the amplitude has fallen to this share."""


def local_quality(decay: Decay) -> FloatArray:
    """Q from the logarithmic decrement between turning points, without a model.

    ``Q = pi n/ln(y1/y2)`` over n cycles in which the amplitude falls to `FALL`;
    the error is that of the two amplitudes.

    Returns
    -------
    FloatArray
        Time, Q and its standard deviation, shape (3, n).
    """
    rows = []
    time, y, sd = decay.points.time_s, decay.amplitude_rad, decay.points.angle_sd_rad
    for first, last in spans(decay):
        decrement = np.log(y[first] / y[last])
        half_cycles = decay.points.half_cycle[last] - decay.points.half_cycle[first]
        value = 0.5 * np.pi * half_cycles / decrement
        spread = value * np.hypot(sd[first] / y[first], sd[last] / y[last]) / decrement
        rows.append((0.5 * (time[first] + time[last]), value, spread))
    return np.array(rows, dtype=np.float64).reshape(-1, 3).T


def spans(decay: Decay) -> Iterator[tuple[int, int]]:
    """First and last turning point of spans in which the amplitude falls to `FALL`."""
    y, sd, first = decay.amplitude_rad, decay.points.angle_sd_rad, 0
    for last in range(1, len(y)):
        if min(y[first], y[last]) <= 10.0 * max(sd[first], sd[last]):
            return
        if y[last] <= FALL * y[first]:
            yield first, last
            first = last
