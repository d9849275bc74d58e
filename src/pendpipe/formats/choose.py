"""Which column is the time, and which is the pendulum."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import refuse_if
from pendpipe.formats.samples import derivative_slope, swing_of
from pendpipe.formats.table import Column, ReadOptions, Table
from pendpipe.formats.words import Role, plain, role_of, unit_of

_WORTH: Final[Mapping[Role, float]] = {
    "angle": 6.0,
    "length": 4.0,
    "volts": 3.0,
    "unknown": 2.0,
    "signal": 1.0,
    "velocity": 0.8,
    "acceleration": 0.7,
    "index": -1.0,
    "time": -1.0,
    "none": -9.0,
}
_PAIR: Final = 5.0
"""A position x, y on a circle about the pivot is worth less than an angle, more than x."""
_STILL: Final = 0.01
"""What a column is worth that does not oscillate, beside one that does."""


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
    notes, weak_guesses
        What was guessed, and what of it on slender grounds.
    """

    time: Column | None
    counts: bool
    readings: tuple[Column, ...]
    channels: tuple[Column, ...]
    notes: tuple[str, ...] = ()
    weak_guesses: tuple[str, ...] = ()


def listed(names: Sequence[str], most: int = 12) -> str:
    """Join names for a message of one line: the first dozen, each of a bearable length."""
    shown = [name if len(name) <= 60 else name[:57] + "..." for name in names[:most]]
    return ", ".join(shown) + f" and {len(names) - most} more" * (len(names) > most) or "none"


_BY_UNIT: Final[Mapping[str, Role]] = {
    "rad/s": "velocity",
    "m/s": "velocity",
    "px/s": "velocity",
    "m/s^2": "acceleration",
    "rad/s^2": "acceleration",
}


def meaning(column: Column) -> Role:
    """Say what a column holds, by its name and, where that is silent, by its unit."""
    role: Role = role_of(column.name) if column.name else "unknown"
    unit = unit_of(column.unit) if column.unit else None
    if unit is None or role == "none":
        return role
    if unit.kind == "own" and unit.name in _BY_UNIT:
        return _BY_UNIT[unit.name] if role in ("unknown", "angle", "length", "index") else role
    if unit.kind == "own":
        return "signal" if role == "unknown" else role
    # "(m)" beside a velocity: a rate whose unit is printed without its "/s".
    rate = role in ("velocity", "acceleration") and unit.kind in ("angle", "length")
    return role if rate else unit.kind


@np.errstate(invalid="ignore", over="ignore")
def choose(table: Table, options: ReadOptions, *, reading: bool = True) -> Choice:
    """Choose the columns; what the user gives goes before every guess.

    Parameters
    ----------
    reading
        Whether a reading must be found; without it `readings` may be empty.

    Raises
    ------
    InputError
        When a named column does not exist, or no column can be the reading.
    """
    refuse_if(
        not table.columns, table.place, "there is no column of numbers", "give time and readings"
    )
    columns = _whole_times([replace(column, role=meaning(column)) for column in table.columns])
    table = replace(table, columns=tuple(map(_settled, columns)))
    time, counts = _time(table, options)
    if time is not None and time.role in ("length", "unknown"):
        # Headed "x, y", with x the time: then y is what was plotted, and no height.
        plotted = {c for c in table.columns if re.fullmatch(r"[yYzZ]\d?", c.name) and not c.unit}
        columns = [replace(c, role="unknown") if c in plotted else c for c in table.columns]
        table = replace(table, columns=tuple(columns))
    channels = tuple(column for column in table.columns if column is not time)
    parts = _parts(table, options) if options.columns[1] is not None else []
    picked = [find(table, table.columns, part) for part in parts]
    if not parts and options.channel is not None:
        picked = [find(table, channels, options.channel, range(1, len(channels) + 1))]
    if picked:
        return Choice(time, counts, tuple(picked), channels)
    mine, others = _of_one_run(channels, time)
    readings, notes, weak = _readings(mine, time)
    # What an instrument sampled by a clock of its own is no list.
    told = readings or [c for c in mine if c.role != "index"]
    falling = [c.label for c in told if c.time_s is None and _only_falls(c.values)]
    refuse_if(
        reading and falling and len(falling) == len(readings or falling),
        table.place,
        f"'{''.join(falling[:1])}' only falls: amplitudes, not a recording of the swing",
        "give the recording that they were read from",
    )
    names = listed([column.label for column in table.columns])
    refuse_if(
        reading and not readings,
        table.place,
        f"no column looks like the motion of a pendulum (found {names})",
        "give the recording of the swing: periods alone tell no loss"
        if any(plain(column.name).startswith("period") for column in table.columns)
        else "name it with --column (and its unit with --unit)",
    )
    if others:
        notes = (*notes, f"the first of several runs is read; choose with --column: {others}")
    return Choice(time, counts, readings, channels, notes, weak)


def find(table: Table, columns: Sequence[Column], key: str, numbers: Sequence[int] = ()) -> Column:
    """Find a column by its name (in any case), or by its number: in the file, or as given."""
    names = [f"{n} {c.label}" for n, c in zip(numbers, columns, strict=False)]
    numbers = numbers or [column.number for column in columns]
    alike = [c for form in (str, str.lower) for c in columns if form(c.name) == form(key)]
    alike += [c for c, number in zip(columns, numbers, strict=True) if str(number) == key]
    known = listed(names or [column.label for column in columns])
    refuse_if(not alike, table.place, f"there is no column '{key}'", f"choose from: {known}")
    return alike[0]


def _only_falls(values: FloatArray) -> bool:
    """Whether a column holds a decay without its swings: sizes that fall from row to row."""
    sizes = np.abs(values[np.isfinite(values)])
    steps = np.diff(sizes)
    return len(steps) >= 5 and sizes[-1] < 0.8 * sizes[0] and bool(np.mean(steps < 0.0) > 0.85)


def _parts(table: Table, options: ReadOptions) -> list[str]:
    """Split ``x,y`` unless a column bears that very name."""
    key = options.columns[1] or ""
    if any(column.name == key for column in table.columns) or "," not in key:
        return [key]
    parts = [part.strip() for part in key.split(",")]
    refuse_if(
        len(parts) != 2, "--column", f"'{key}' names {len(parts)} columns", "give one, or x,y"
    )
    return parts


def _settled(column: Column) -> Column:
    """Undo a clock's overflow; and "run1" counts nothing where it swings."""
    if column.role == "time":
        return replace(column, values=_counted_on(column.values))
    swings = column.role == "index" and column.swing.clear
    return replace(column, role="unknown") if swings else column


def _whole_times(columns: list[Column]) -> list[Column]:
    """Add to a time in whole seconds the part of a second that stands in the next column."""
    for whole, part in pairwise(columns):
        unit = unit_of(part.unit) or unit_of(part.name)
        if whole.role != "time" or unit is None or unit.kind != "time":
            continue
        steps, fraction = np.diff(whole.values), part.values * unit.factor
        in_part = unit.factor < 1.0 and fraction.min() >= 0.0 and 0.5 < fraction.max() < 1.0
        in_whole = len(steps) > 0 and steps.min() >= 0.0 and set(np.unique(steps)) <= {0.0, 1.0}
        if in_part and in_whole and np.any(np.diff(fraction) < 0.0):
            one = replace(whole, values=whole.values + fraction, unit="s")
            return [one if c is whole else c for c in columns if c is not part]
    return columns


def _counted_on(values: FloatArray) -> FloatArray:
    """Count on where a clock of 16 or 32 bits begins again at 0 (``micros()`` after 71 minutes)."""
    steps = np.diff(values)
    for turn in (2.0**16, 2.0**32):
        over = steps < -0.5 * turn
        across = np.abs(steps[over] + turn).max(initial=0.0)
        if over.any() and values.max() < turn and across < 10.0 * np.median(np.abs(steps)):
            return np.asarray(values + turn * np.append(0, np.cumsum(over)))
    return values


def one_way(values: FloatArray) -> float:
    """Share of the steps that go the way of the whole; 0 where it does not move."""
    finite = values[np.isfinite(values)]
    if len(finite) < 3 or finite[-1] == finite[0]:
        return 0.0
    steps = np.diff(finite) * np.sign(finite[-1] - finite[0])
    return float(np.mean(steps >= 0)) if np.any(steps > 0) else 0.0


def _time(table: Table, options: ReadOptions) -> tuple[Column | None, bool]:
    """Find the column of times, or else one that counts the samples.

    Times may fall (the newest row first) and repeat (printed with few digits). An instrument's own
    clock needs none.
    """
    if any(column.time_s is not None for column in table.columns):
        return None, False
    if (key := options.columns[0]) is not None:
        given = find(table, table.columns, key)
        return given, given.role == "index"
    runs = [column for column in table.columns if column.role == "time"]
    wanted = (options.columns[1] or options.channel or "").lower()
    if wanted and len(runs) > 1 and not (options.channel is not None and wanted.isdigit()):
        # Runs side by side, each with its own time: the one before the reading is meant.
        meant = [c.number for c in table.columns if wanted in (c.name.lower(), str(c.number))]
        before = [column for column in runs if meant and column.number < meant[0]]
        if before:
            return before[-1], False
    taken = (options.columns[1] or "").lower()
    best: tuple[float, Column | None] = (0.0, None)
    counted = len(table.columns) > 2 and _counts_samples(table.columns[0])
    for place, column in enumerate(table.columns, start=-counted):
        role, share = column.role, one_way(column.values)
        named = role == "time"
        if (
            role in ("none", "signal", "volts", "velocity", "acceleration")
            or taken in (column.name.lower() or "-", str(column.number))
            or share < (0.5 if named else 0.95)
        ):
            continue
        # A drifting reading rises too, but hardly in even steps.
        even = _evenness(column.values[np.isfinite(column.values)])
        first = place <= 0 and role in ("unknown", "index", "length") and share > 0.99
        if not named and even < 0.5 and not first:
            continue
        score = 10.0 * named + 2.0 * (place <= 0) + 3.0 * even + share
        # A number of the row, where anything else is a time.
        score -= 5.0 * (role == "index") or 3.0 * (not named and _counts_samples(column))
        score -= 4.0 * (role == "angle" or (role == "length" and place > 0))
        best = max(best, (score, column), key=lambda each: each[0])
    found = best[1]
    return found, found is not None and _counts_samples(found)


def _of_one_run(channels: Sequence[Column], time: Column | None) -> tuple[Sequence[Column], str]:
    """Of runs side by side, each with its own time column, keep one; name the others."""
    start = time.number if time is not None else len(channels) + 2
    clocks = [
        c.number
        for c in channels
        if time is not None and _moves(c) and (c.role == "time" or _same(time, c))
    ]
    holding = [c.number for c in channels if _WORTH[c.role] > 0.5 and _moves(c)]
    end = min((number for number in clocks if number > start), default=start)
    if not any(start < number < end for number in holding):
        return channels, ""
    mine = [c for c in channels if start < c.number < end]
    wanted = [c.number - start for c in mine]
    others = [c.label for c in channels if any(c.number - number in wanted for number in clocks)]
    return mine, listed(others, 6)


def _same(clock: Column, column: Column) -> bool:
    """Say whether a column without a name repeats the clock, as far as it goes."""
    filled = np.isfinite(column.values)
    return bool(np.array_equal(column.values[filled], clock.values[filled]))


def _evenness(finite: FloatArray) -> float:
    """Share of the steps within a tenth of the median step."""
    steps = np.abs(np.diff(finite))
    middle = float(np.median(steps)) if len(steps) else 0.0
    return float(np.mean(np.abs(steps - middle) <= 0.1 * middle)) if middle > 0 else 0.0


def _counts_samples(column: Column) -> bool:
    """Say whether a column counts 1, 2, 3, ... and is not called a time."""
    values = column.values
    if column.role not in ("index", "unknown", "length") or len(values) < 2:
        return False
    whole = np.isfinite(values).all() and np.all(values == np.rint(values))
    return bool(whole and abs(np.median(np.diff(values))) == 1.0)


def _readings(
    channels: Sequence[Column], time: Column | None
) -> tuple[tuple[Column, ...], tuple[str, ...], tuple[str, ...]]:
    """Choose the reading by its name, then by how it swings."""
    alive = [c for c in channels if _moves(c) and _WORTH[c.role] > 0]
    any_clear = any(column.swing.clear for column in alive)
    candidates: list[tuple[float, tuple[Column, ...]]] = [
        (_WORTH[c.role] if c.swing.clear or not any_clear else _STILL * _WORTH[c.role], (c,))
        for c in alive
    ]
    pair = _position_pair(alive)
    if pair is not None:
        candidates.append((_PAIR, pair))
    if not candidates:
        return (), (), ()
    most = max(entry[0] for entry in candidates)
    chosen, why = _of_equals([entry[1] for entry in candidates if entry[0] == most])
    clock = time.values if time is not None else None
    if len(chosen) == 1:
        chosen, why = _not_a_derivative(chosen[0], alive, clock, why)
    labels = " and ".join(f"'{column.label}'" for column in chosen)
    others = [column.label for column in channels if column not in chosen]
    rest = f" (not {listed(others, 8)})" if others else ""
    note = f"the reading is taken from {labels}{why}{rest}"
    nameless = len(alive) > 1 and chosen[0].role == "unknown" and len(chosen) == 1
    unclear = any_clear and not chosen[0].swing.clear
    if (nameless and not why) or unclear:
        what = "its name does not tell what it holds" if not unclear else "it hardly oscillates"
        return chosen, (), (f"{note}: {what} (--column)",)
    return chosen, (note,), ()


def _of_equals(equals: Sequence[tuple[Column, ...]]) -> tuple[tuple[Column, ...], str]:
    """The first of equals, unless another swings far more, or it is a drive."""
    first = equals[0]
    if len(equals) == 1 or len(first) > 1:
        return first, ""
    # A drive has one size from beginning to end; a free decay has all of them.
    own = first[0].swing
    graded = [c for c in equals if c[0].swing.clear and c[0].swing.graded > 0.3]
    if graded and own.graded < 0.1 and own.clear:
        return graded[0], ", whose swing decays"
    units = {(unit_of(c[0].unit) or c[0].unit) for c in equals if c[0].unit}
    if len(units) > 1 or not all(c[0].unit or c[0].name for c in equals):
        return first, ""
    for column in equals:
        # Height, and the pull along the string, go through two cycles in one of the swing.
        ratio = column[0].swing.samples_per_cycle / (own.samples_per_cycle or np.inf)
        if column[0].swing.clear and abs(ratio - 2.0) < 0.05:
            return column, f", of which '{first[0].label}' has twice the frequency"
    largest = max(column[0].swing.amplitude for column in equals)
    wide = next(c for c in equals if c[0].swing.amplitude >= largest / 3)
    return wide, "" if wide is first else ", which swings most"


def _not_a_derivative(
    chosen: Column,
    alive: Sequence[Column],
    clock: FloatArray | None,
    why: str,
) -> tuple[tuple[Column, ...], str]:
    """Of two nameless columns take the one whose derivative the other is."""
    if clock is None or chosen.role != "unknown":
        return (chosen,), why
    for column in (each for each in alive if each is not chosen):
        forward = derivative_slope(clock, chosen.values, column.values)
        backward = derivative_slope(clock, column.values, chosen.values)
        if forward is None and backward is None:
            continue
        # Of a swing the derivative's derivative is the swing again, but upside down.
        first = forward is not None and forward > 0.0
        kept, other = (chosen, column) if first else (column, chosen)
        return (kept,), f", whose derivative '{other.label}' is"
    return (chosen,), why


def _moves(column: Column) -> bool:
    """Leave out columns that stand still, or are mostly empty."""
    finite = column.values[np.isfinite(column.values)]
    enough = max(2, min(50, len(column.values) // 2))
    return len(finite) >= enough and bool(finite.max() > finite.min())


def _position_pair(columns: Sequence[Column]) -> tuple[Column, Column] | None:
    """Find x, y of something that moves on a circle about the origin, below or above it."""
    named = {column.name.lower(): column for column in columns}
    silent = tuple(column for column in columns if not column.name)
    pairs = [(named[a], named[b]) for a, b in ("xy", ("px", "py")) if {a, b} <= named.keys()]
    bare = [(silent[0], silent[1])] if len(silent) > 1 else []
    round_the_pivot = (
        (x, y)
        for x, y in pairs or _bob_from_pivot(columns) or bare
        # x, y, z without a unit come from a phone's sensor: of a position it knows nothing.
        if not ("z" in named and not x.unit)
        and _on_a_circle(x.values, y.values, named=bool(x.name))
    )
    return next(round_the_pivot, None)


def _bob_from_pivot(columns: Sequence[Column]) -> list[tuple[Column, Column]]:
    """Of two tracked points give the place of the one that moves, seen from the other."""
    points: dict[str, dict[str, Column]] = {}
    for column in columns:
        axis = re.fullmatch(r"([xy])[\s_]*(.+)|(.+?)[\s_.]*([xy])", column.name.lower())
        if axis is not None:
            points.setdefault(axis[2] or axis[3], {})[axis[1] or axis[4]] = column
    both = [point for point in points.values() if len(point) == 2]
    if len(both) != 2:
        return []
    pivot, bob = sorted(both, key=lambda point: float(np.nanstd(point["x"].values)))
    x, y = (
        replace(
            bob[axis],
            name=f"{bob[axis].name} - {pivot[axis].name}",
            values=bob[axis].values - pivot[axis].values,
        )
        for axis in "xy"
    )
    return [(x, y)]


def _on_a_circle(x: FloatArray, y: FloatArray, *, named: bool) -> bool:
    """Say whether x, y go to and fro on a circle about the origin, level with its centre line.

    Pixels counted from an image's corner keep much the same distance from it as well: but
    there the distance follows x, and the swing is not about a vertical through the origin.
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y, sides = x[good], np.abs(y[good]), np.sign(y[good])
    if len(x) < 8 or max(np.abs(x).max(), y.max()) > 1e100:
        return False
    radius = np.hypot(x, y)
    if (
        not 0.0 < np.std(radius) <= min(0.08 * np.mean(radius), 0.3 * np.std(x))
        or abs(np.mean(sides)) <= 0.95
        or abs(np.median(np.arctan2(x, y))) > 0.4
        or not swing_of(x).clear
    ):
        return False
    # On a circle y falls with x squared; two columns without names must show it.
    follows = float(np.corrcoef(x**2, y)[0, 1])  # NaN where either stands still
    shown = follows < -0.5 and np.std(radius) < 0.5 * np.std(y) and one_way(y) < 0.9
    return not follows >= 0.5 if named else bool(shown)
