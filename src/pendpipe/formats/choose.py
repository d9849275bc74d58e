"""Which column is the time, and which is the pendulum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.formats.names import Role, role_of
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, Table
from pendpipe.formats.units import unit_of

_WORTH: Final[dict[Role, float]] = {
    "angle": 6.0,
    "length": 4.0,
    "volts": 3.0,
    "unknown": 2.0,
    "index": 0.5,
    "time": -1.0,
    "angular velocity": 0.2,
    "other": -9.0,
}


_ABSURD: Final = 1e100
"""Beyond this nothing was measured; squares of it are no numbers."""


@dataclass(frozen=True)
class Choice:
    """The columns that were chosen.

    Parameters
    ----------
    time
        The time column, or a column that counts samples; ``None`` where there is none.
    counts
        Whether `time` counts samples rather than seconds.
    readings
        The reading; or two, the position (x, y) seen from a pivot.
    channels
        All that could have been chosen as the reading.
    notes
        What was guessed.
    """

    time: Column | None
    counts: bool
    readings: tuple[Column, ...]
    channels: tuple[Column, ...]
    notes: tuple[str, ...]


def listed(names: Sequence[str], most: int = 12) -> str:
    """Join names for a message of one line: the first dozen, each of a bearable length."""
    shown = [name if len(name) <= 60 else name[:57] + "..." for name in names[:most]]
    more = len(names) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "") or "none"


def meaning(column: Column) -> Role:
    """Say what a column holds, by its name and, where that is silent, by its unit."""
    role: Role = role_of(column.name) if column.name else "unknown"
    unit = unit_of(column.unit) if column.unit else None
    if unit is None or role in ("other", "angular velocity"):
        return role
    by_unit: dict[str, Role] = {"angle": "angle", "volts": "volts", "length": "length"}
    if unit.kind in ("other", "angular velocity"):
        counts = column.unit.lower().startswith(("count", "tick", "px", "pix", "step", "lsb"))
        return role if counts else "angular velocity" if unit.kind != "other" else "other"
    return "time" if unit.kind == "time" else by_unit.get(unit.kind, role)


def rising(values: FloatArray) -> float:
    """Share of the steps that rise."""
    finite = values[np.isfinite(values)]
    if len(finite) < 3:
        return 0.0
    return float(np.mean(np.diff(finite) > 0))


def oscillation(values: FloatArray) -> float:
    """Root mean square about the trend, 0 unless the trend is crossed three times."""
    finite = values[np.isfinite(values)]
    if len(finite) < 4 or np.abs(finite).max() > _ABSURD:
        return 0.0
    ramp = np.linspace(-1.0, 1.0, len(finite))
    slope = float(finite @ ramp) / float(ramp @ ramp)
    rest = finite - finite.mean() - slope * ramp
    crossings = np.count_nonzero(np.diff(np.signbit(rest)))
    return float(np.sqrt(np.mean(rest**2))) if crossings >= 3 else 0.0


def choose(table: Table, options: ReadOptions, *, reading: bool = True) -> Choice:
    """Choose the columns; what the user says goes before every guess.

    Parameters
    ----------
    reading
        Whether a reading must be found; without it `readings` may be empty.

    Raises
    ------
    InputError
        When a named column does not exist, or no column can be the reading.
    """
    if not table.columns:
        raise InputError(table.place, "there is no column of numbers", "give time and readings")
    own_clock = [column for column in table.columns if column.time_s is not None]
    time, counts = (None, False) if own_clock else _time(table, options)
    channels = tuple(column for column in table.columns if column is not time)
    if options.reading_column is not None:
        picked = tuple(find(table, table.columns, part) for part in _parts(table, options))
        return Choice(time, counts, picked, channels, ())
    if options.channel is not None:
        return Choice(time, counts, (_channel(table, channels, options.channel),), channels, ())
    readings, notes = _readings(_of_one_run(channels, time))
    if not readings and reading:
        names = listed([column.label for column in table.columns])
        raise InputError(
            table.place,
            f"no column looks like an angle, a voltage or a displacement (found {names})",
            "name it with --column or --channel (and its unit with --unit)",
        )
    return Choice(time, counts, readings, channels, notes)


def find(table: Table, columns: Sequence[Column], key: str) -> Column:
    """Find a column by its name (in any case) or its number in the file."""
    exact = [column for column in columns if column.name == key]
    alike = [column for column in columns if column.name.lower() == key.lower()]
    if exact or alike:
        return (exact or alike)[0]
    if key.isdigit():
        for column in columns:
            if column.number == int(key):
                return column
    names = listed([column.label for column in columns])
    raise InputError(table.place, f"there is no column '{key}'", f"choose from: {names}")


def _parts(table: Table, options: ReadOptions) -> list[str]:
    """Split ``x,y`` unless a column bears that very name."""
    key = options.reading_column or ""
    if any(column.name == key for column in table.columns) or "," not in key:
        return [key]
    parts = [part.strip() for part in key.split(",")]
    if len(parts) != 2:
        raise InputError("--column", f"'{key}' names {len(parts)} columns", "give one, or x,y")
    return parts


def _channel(table: Table, channels: Sequence[Column], key: str) -> Column:
    """Find a channel by name, or by its number among those that ``inspect`` lists."""
    for column in channels:
        if column.name.lower() == key.lower():
            return column
    if key.isdigit() and 1 <= int(key) <= len(channels):
        return channels[int(key) - 1]
    names = listed([f"{i} {column.label}" for i, column in enumerate(channels, start=1)])
    raise InputError(table.place, f"there is no channel '{key}'", f"choose from: {names}")


def _time(table: Table, options: ReadOptions) -> tuple[Column | None, bool]:
    """Find the column of times, or else one that counts the samples."""
    if options.time_column is not None:
        told = find(table, table.columns, options.time_column)
        return told, meaning(told) == "index"
    runs = [column for column in table.columns if meaning(column) == "time"]
    if options.reading_column is not None and len(runs) > 1:
        # Runs side by side, each with its own time: the one before the reading is meant.
        reading = find(table, table.columns, _parts(table, options)[0])
        before = [column for column in runs if column.number < reading.number]
        if before:
            return before[-1], False
    taken = (options.reading_column or "").lower()
    best: tuple[float, Column | None] = (0.0, None)
    for place, column in enumerate(table.columns):
        role, share = meaning(column), rising(column.values)
        if role == "other" or taken in (column.name.lower() or "-", str(column.number)):
            continue
        named = role == "time"
        if share < (0.5 if named else 0.95):
            continue
        # A drifting reading rises too, but hardly in even steps.
        even = _evenness(column.values)
        score = 10.0 * named + 2.0 * (place == 0) + 3.0 * even + share
        if not named and even < 0.5 and (place > 0 or role not in ("unknown", "index")):
            continue
        if role == "index":
            score -= 5.0
        if role in ("angle", "volts", "length", "angular velocity"):
            score -= 4.0
        if score > best[0]:
            best = (score, column)
    found = best[1]
    return found, found is not None and _counts_samples(found)


def _of_one_run(channels: Sequence[Column], time: Column | None) -> Sequence[Column]:
    """Of runs side by side, each with its own time column, keep the columns of one."""
    if time is None:
        return channels
    others = [column.number for column in channels if meaning(column) == "time"]
    end = min((number for number in others if number > time.number), default=None)
    mine = [c for c in channels if end is None or time.number < c.number < end]
    return mine or channels


def _evenness(values: FloatArray) -> float:
    """Share of the steps within a tenth of the median step."""
    steps = np.diff(values[np.isfinite(values)])
    middle = float(np.median(steps)) if len(steps) else 0.0
    return float(np.mean(np.abs(steps - middle) <= 0.1 * middle)) if middle > 0 else 0.0


def _counts_samples(column: Column) -> bool:
    """Say whether a column counts 1, 2, 3, ... and is not called a time."""
    values = column.values
    if not np.isfinite(values).all() or np.any(values != np.rint(values)):
        return False
    return float(np.median(np.diff(values))) == 1.0 and meaning(column) in ("index", "unknown")


def _readings(channels: Sequence[Column]) -> tuple[tuple[Column, ...], tuple[str, ...]]:
    """Choose the reading by its name, then by its unit, then by how it swings."""
    alive = [column for column in channels if _moves(column)]
    pair = _position_pair(alive)
    candidates: list[tuple[float, float, tuple[Column, ...]]] = []
    for column in alive:
        worth = _WORTH[meaning(column)]
        if worth <= 0:
            continue
        swing = oscillation(column.values) if meaning(column) != "unknown" else 0.0
        unit = unit_of(column.unit)
        candidates.append((worth, swing * (unit.factor if unit else 1.0), (column,)))
    if pair is not None:
        candidates.append((5.0, 0.0, pair))
    if not candidates:
        return (), ()
    worth = max(entry[0] for entry in candidates)
    swing = max(entry[1] for entry in candidates if entry[0] == worth)
    # The first of equals, unless another swings far more (a channel that nothing moves).
    chosen = next(e[2] for e in candidates if e[0] == worth and e[1] >= swing / 3)
    labels = " and ".join(f"'{column.label}'" for column in chosen)
    others = [column.label for column in channels if column not in chosen]
    rest = f" (not {', '.join(others[:8])})" if others else ""
    return chosen, (f"the reading is taken from {labels}{rest}",)


def _moves(column: Column) -> bool:
    """Leave out columns that stand still, or are mostly empty."""
    finite = column.values[np.isfinite(column.values)]
    return len(finite) >= max(2, len(column.values) // 2) and bool(finite.max() > finite.min())


def _position_pair(columns: Sequence[Column]) -> tuple[Column, Column] | None:
    """Find x, y of something that moves on a circle about the origin, below or above it."""
    named = {column.name.lower(): column for column in columns}
    pairs = [
        (named[a], named[b]) for a, b in (("x", "y"), ("px", "py")) if a in named and b in named
    ]
    silent = [column for column in columns if not column.name]
    if not pairs and len(silent) >= 2:
        pairs = [(silent[0], silent[1])]
    for x, y in pairs:
        radius = np.hypot(x.values, y.values)
        radius = radius[np.isfinite(radius)]
        sided = abs(np.nanmean(np.sign(y.values))) > 0.95
        if not sided or np.std(radius) > 0.08 * np.mean(radius) or oscillation(x.values) == 0:
            continue
        # On a circle y follows x squared; two columns without names must show it.
        if x.name or np.corrcoef(x.values**2, np.abs(y.values))[0, 1] < -0.5:
            return x, y
    return None
