"""What the columns of a table mean: which is the time, which the pendulum, and in what units.

From the chosen columns come seconds that rise, and readings in radians, volts, metres or so.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from pendpipe.analysis.readings import amplitudes_in, sizes_of
from pendpipe.arrays import FloatArray
from pendpipe.errors import refuse_if
from pendpipe.facts import Fact, How
from pendpipe.formats.circle import on_a_circle, pivot_of
from pendpipe.formats.grammar import MOST_DAMAGED
from pendpipe.formats.lists import ONE_WAY, Listed, counts_samples, list_in, one_way
from pendpipe.formats.table import (
    Column,
    ReadOptions,
    Swing,
    Table,
    derivative_slope,
    evenness,
)
from pendpipe.formats.words import Role, Unit, counts_swings, plain, role_of, split_header, unit_of

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
_LONG: Final = 60
"""Letters of a column's name in a message of one line."""
_PACE: Final = 1.4
"""By which a pendulum's pace and its drive's differ at most: far off resonance it hardly moves."""
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
    facts
        How the time, the reading and a list were found.
    listed
        What list the table is, where it is no recording.
    """

    time: Column | None
    counts: bool
    readings: tuple[Column, ...]
    channels: tuple[Column, ...]
    facts: tuple[Fact, ...] = ()
    listed: Listed | None = None


def listing(names: Sequence[str], most: int = 12) -> str:
    """Join names for a message of one line: the first dozen, each of a bearable length."""
    shown = [name if len(name) <= _LONG else name[: _LONG - 3] + "..." for name in names[:most]]
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
    # Of an array's path ("Meas.Gyro.Timestamp") the last part says so.
    role = "time" if role_of(column.name.rpartition(".")[2]) == "time" else role
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
    if not any(column.role == "time" for column in columns):
        columns = list(map(_summed, columns))
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
    mine: Sequence[Column] = channels
    others, readings = "", tuple(picked)
    label = " and ".join(column.label for column in picked)
    facts = [Fact("reading", label, "stated")] if picked else []
    if not picked:
        time, mine, others = _of_one_run(channels, time)
        readings, facts = _readings(mine, time)
    names = listing([column.label for column in table.columns])
    found = list_in((*([time] if time else []), *mine), readings, time, counts=counts)
    if found is not None and found.remedy:
        refuse_if(reading and not picked, table.place, found.problem, found.remedy)
    elif found is not None:
        sizes = replace(found.column, values=sizes_of(found.column.values), role="unknown")
        fact = amplitudes_in(
            sizes.label, None if time is None else time.values, found.column.values
        )
        readings, facts = (sizes,), [fact]
    refuse_if(
        reading and not readings,
        table.place,
        f"no column looks like the motion of a pendulum (found {names})",
        "name it with --column (and its unit with --unit)",
    )
    said = f"one of several runs is read; choose with --column: {others}"
    facts += [Fact("rows", "one run", "stated", said)] * bool(others)
    if time is not None:
        told = options.columns[0] is not None or time.role in ("time", "index")
        facts.insert(0, Fact("time column", time.label, "stated" if told else "shown"))
        if time.made:
            facts.insert(1, Fact("clock", "repaired", "shown", f"'{time.label}' {time.made}"))
    return Choice(time, counts, readings, channels, tuple(facts), found)


def find(table: Table, columns: Sequence[Column], key: str, numbers: Sequence[int] = ()) -> Column:
    """Find a column by its name (in any case; its unit may follow), or by its number.

    The number is that in the file, or as given.
    """
    names = [f"{n} {c.label}" for n, c in zip(numbers, columns, strict=False)]
    numbers = numbers or [column.number for column in columns]
    called = [(name, c) for c in columns for name in (c.name, c.label, c.of)]
    alike = [c for form in (str, str.lower) for name, c in called if form(name) == form(key)]
    alike += [c for c in columns if (c.name, c.unit) == split_header(key)]
    alike += [c for c, number in zip(columns, numbers, strict=True) if str(number) == key]
    known = listing(names or [column.label for column in columns])
    refuse_if(not alike, table.place, f"there is no column '{key}'", f"choose from: {known}")
    return alike[0]


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
    if column.role == "time" or not column.name:
        column = _counted_on(column)
    swings = column.role == "index" and column.swing.clear
    return replace(column, role="unknown") if swings else column


def _summed(column: Column) -> Column:
    """Add up the times since the row above (``dt (ms)``), where there is no other time."""
    unit = unit_of(column.unit)
    lasts = unit is not None and unit.kind == "time" and column.values.min() > 0.0
    named = re.fullmatch(r"(d|δ|delta)[_ ]?t|interval\w*", plain(column.name))
    if not (lasts and named):
        return column
    made = "holds times since the row above: added up"
    return replace(column, values=np.cumsum(column.values), role="time", made=made)


def _whole_times(columns: list[Column]) -> list[Column]:
    """Join hours, minutes, seconds and their parts that stand in columns side by side."""
    for whole, part in pairwise(columns):
        turn, tick = _seconds(whole, "s"), _seconds(part, "" if whole.name else "ns")
        steps, fraction = np.diff(whole.values), part.values * tick
        in_part = tick < turn and fraction.min() >= 0.0 and 0.5 < fraction.max() / turn < 1.0
        in_whole = len(steps) > 0 and steps.min() >= 0.0 and set(np.unique(steps)) <= {0.0, 1.0}
        falls = np.diff(fraction) < 0.0
        if in_part and in_whole and np.any(falls) and np.all(steps[falls] == 1.0):
            seconds = whole.values * turn + fraction
            made = f"is '{whole.label}' and '{part.label}' joined"
            one = replace(whole, values=seconds, name="time", unit="s", role="time", made=made)
            return _whole_times([one if c is whole else c for c in columns if c is not part])
    return columns


def _seconds(column: Column, usual: str) -> float:
    """Seconds in one unit of a column of times; infinite where it can be none."""
    said = unit_of(column.unit or column.name)
    named = said if said is not None and said.kind == "time" else None
    silent = unit_of(usual) if column.role == "time" or not column.name else None
    return (named or silent or Unit("time", np.inf)).factor


_TURNS: Final = (2.0**16, 2.0**32, *(size * days for size in (86400.0, 864e5) for days in (1, 7)))
"""Ticks of a clock's turn: ``micros()`` takes 71 minutes, a day and a week are in s and ms."""


def _counted_on(column: Column) -> Column:
    """Count on where a clock begins again at 0: of 16 or 32 bits, of the day, of the GPS week."""
    values, steps = column.values, np.diff(column.values)
    falls = steps.min(initial=0.0)
    for turn in (turn for turn in _TURNS if falls < -0.5 * turn):
        over = steps < -0.5 * turn
        across = np.abs(steps[over] + turn).max(initial=0.0)
        on = over.any() and values.max() < turn and steps[~over].min(initial=1.0) >= 0.0
        if on and across < 10.0 * np.median(np.abs(steps)):
            made = f"begins again at 0 after {turn:.10g} {over.sum()} time(s): counted on"
            values = values + turn * np.append(0, np.cumsum(over))
            return replace(column, values=values, made=made)
    return column


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
    counted = len(table.columns) > 2 and counts_samples(table.columns[0])
    for place, column in enumerate(table.columns, start=-counted):
        role, share = column.role, one_way(column.values)
        named = role == "time"
        if (
            role in ("none", "signal", "volts", "velocity", "acceleration")
            or taken in (column.name.lower() or "-", str(column.number))
            or share < (0.5 if named else ONE_WAY)
            or (len(table.columns) == 1 and not named)
        ):
            continue
        # A drifting reading rises too, but hardly in even steps.
        even = evenness(column.values[np.isfinite(column.values)])
        first = place <= 0 and role in ("unknown", "index", "length") and share > 1.0 - MOST_DAMAGED
        if not named and even < 0.5 and not first:
            continue
        score = 10.0 * named + 2.0 * (place <= 0) + 3.0 * even + share
        # A number of the row, where anything else is a time.
        score -= 5.0 * (role == "index") or 3.0 * (not named and counts_samples(column))
        score -= 4.0 * (role == "angle" or (role == "length" and place > 0))
        best = max(best, (score, column), key=lambda each: each[0])
    found = best[1] or next(filter(_only_rises, table.columns[1:]), None)
    return found, found is not None and counts_samples(found) and not counts_swings(
        f"{found.name} {found.unit}"
    )


def _only_rises(column: Column) -> bool:
    """Say whether a column goes one way from row to row, as times do that are printed short."""
    rises = one_way(column.values) == 1.0 and len(np.unique(column.values)) > _FEWEST_TIMES
    return rises and column.role in ("length", "unknown") and not column.garbled


_FEWEST_TIMES: Final = 100
"""Different times by which a column without a name is known as their column: a reading that
swings, however slowly, turns before."""


def _of_one_run(
    channels: Sequence[Column], time: Column | None
) -> tuple[Column | None, Sequence[Column], str]:
    """Of runs side by side, each with its own time column, keep the first that swings.

    Returns its time column and its others, and the names of the other runs' columns.
    """
    start = time.number if time is not None else len(channels) + 2
    # A column without a name may repeat the clock, as far as it goes.
    clocks = [
        c
        for c in channels
        if time is not None
        if _moves(c) and (c.role == "time" or not np.any(np.abs(c.values - time.values) > 0.0))
    ]
    starts = [start, *(c.number for c in clocks if c.number > start)]
    ends = [*starts[1:], len(channels) + 2]
    runs = [
        [c for c in channels if first < c.number < end]
        for first, end in zip(starts, ends, strict=True)
    ]
    filled = [any(_WORTH[c.role] > 0.5 and _moves(c) for c in run) for run in runs]
    if len(starts) == 1 or not (filled[0] or sum(filled) > 1):
        return time, channels, ""
    one = next((k for k, run in enumerate(runs) if any(c.swing.clear for c in run)), 0)
    wanted = [c.number - starts[one] for c in runs[one]]
    before = [c.number for c in (*clocks, *([time] if time and one else []))]
    others = [
        c.label
        for c in channels
        if c not in runs[one] and any(c.number - number in wanted for number in before)
    ]
    clock = next((c for c in clocks if c.number == starts[one]), time)
    return clock, runs[one], listing(others, 6)


def _readings(
    channels: Sequence[Column], time: Column | None
) -> tuple[tuple[Column, ...], list[Fact]]:
    """Choose the reading by its name, then by how it swings."""
    alive = [c for c in channels if _moves(c) and _WORTH[c.role] > 0]
    any_clear = any(column.swing.clear for column in alive)
    candidates: list[tuple[float, tuple[Column, ...]]] = [
        (_WORTH[c.role] if c.swing.clear or not any_clear else _STILL * _WORTH[c.role], (c,))
        for c in alive
    ]
    pair = _position_pair(alive)
    candidates += [(_PAIR, pair)] if pair is not None else []
    if not candidates:
        return (), []
    most = max(entry[0] for entry in candidates)
    chosen, why = _of_equals([entry[1] for entry in candidates if entry[0] == most])
    clock = time.values if time is not None else None
    if len(chosen) == 1:
        chosen, why = _not_a_derivative(chosen[0], alive, clock, why)
    labels = " and ".join(f"'{column.label}'" for column in chosen)
    others = [column.label for column in channels if column not in chosen]
    rest = f" (not {listing(others, 8)})" if others else ""
    note = f"the reading is taken from {labels}{why}{rest}"
    nameless = len(alive) > 1 and chosen[0].role == "unknown" and len(chosen) == 1
    unclear = any_clear and not chosen[0].swing.clear
    if (nameless and not why) or unclear:
        what = "its name does not say what it holds" if not unclear else "it hardly oscillates"
        return chosen, [Fact("reading", labels, "guessed", f"{note}: {what}")]
    known: How = "stated" if chosen[0].role not in ("unknown", "index") else "shown"
    return chosen, [Fact("reading", labels, known, note)]


def _of_equals(equals: Sequence[tuple[Column, ...]]) -> tuple[tuple[Column, ...], str]:
    """The first of equals, unless another swings far more, or it is a drive."""
    free = [each for each in equals if not _drives(each[0].swing, equals)]
    if len(free) < len(equals):
        chosen, why = _of_equals(free)
        return chosen, why or ", whose swing decays"
    # Some wander, through a few cycles at most, and one swings.
    often = [each for each in equals if each[0].swing.clear and not each[0].wanders] or equals
    clearest = max(column[0].swing.clarity for column in often)
    clear = [each for each in often if each[0].swing.clarity >= 0.7 * clearest]
    hardly = equals[0][0].swing.clarity < 0.5 * clearest
    wander = len(clear) == 1 < len(equals) or (hardly and len(clear) < len(equals))
    wander = wander and clear[0][0].swing.clear
    equals = clear if wander else equals
    first = equals[0]
    if len(equals) == 1 or len(first) > 1:
        return first, ", which alone swings clearly" * wander
    own, apart = first[0].swing, [first]
    for column in equals:
        swing = column[0].swing
        ratio = swing.clear * swing.samples_per_cycle / (own.samples_per_cycle or np.inf)
        along = 1.0 / _PACE < ratio < _PACE
        # Height, and the pull along the string, go through two cycles in one of the swing.
        # Known to one cycle more or less in the whole.
        blur = max(0.05, min(1.01 * swing.samples_per_cycle / len(column[0].values), 0.2))
        if abs(ratio - 2.0) < blur:
            return column, f", of which '{first[0].label}' has twice the frequency"
        apart += [column] if ratio and not along and not column[0].wanders else []
    units = {(unit_of(c[0].unit) or c[0].unit) for c in equals if c[0].unit}
    named = all(c[0].unit or c[0].name for c in equals)
    if len(units) > 1:
        return first, ""
    # What swings along with a column that nobody names may be its derivative.
    some = equals if named else apart
    largest = max(column[0].swing.amplitude for column in some)
    wide = next(c for c in some if c[0].swing.amplitude >= largest / 3)
    return wide, ", which swings most" if wide is not first and named else ""


def _drives(own: Swing, equals: Sequence[tuple[Column, ...]]) -> bool:
    """Whether a swing has one size from beginning to end, beside one of its pace that has all."""
    beside = (column[0].swing for column in equals)
    return (own.clear and own.graded < _DRIVE) and any(
        each.clear
        and each.graded > _DECAY
        and 1.0 / _PACE < each.samples_per_cycle / own.samples_per_cycle < _PACE
        for each in beside
    )


_DRIVE, _DECAY = 0.1, 0.3
"""Shares of cycles of middling size: of a drive at most, of a decay at least."""


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
    """Find x, y of something that moves on a circle, about the origin or another pivot."""
    silent = [column for column in columns if not column.name]
    # x, y, z without a unit come from a phone's sensor: of a position it knows nothing.
    sensed = any(column.name.lower() == "z" for column in columns)
    round_the_pivot = (
        (x, y)
        for x, y in _tracked(columns) or pairwise(silent[:2])
        if not (sensed and not x.unit)
        and (
            on_a_circle(x.values, y.values, named=bool(x.name))
            or (x.name and x.swing.clear and pivot_of(x.values, y.values) is not None)
        )
    )
    return next(round_the_pivot, None)


def _tracked(columns: Sequence[Column]) -> list[tuple[Column, Column]]:
    """Give the places of tracked points; of two the one that moves, seen from the other."""
    points: dict[str, dict[str, Column]] = {}
    for column in columns:
        axis = re.fullmatch(r"([xy])[\s_]*(.*)|(.+?)[\s_.]*([xy])", column.name.lower())
        if axis is not None and column.role in ("length", "unknown"):
            points.setdefault(axis[2] or axis[3] or "", {})[axis[1] or axis[4]] = column
    both = [(point["x"], point["y"]) for point in points.values() if len(point) == 2]
    both.sort(key=lambda point: float(np.nanstd(point[0].values)))
    if len(both) != 2 or "" in points:
        return both
    still, bob = both
    if np.nanstd(still[0].values) > 0.5 * np.nanstd(bob[0].values):
        return []
    x, y = (
        replace(of, name=f"{of.name} - {pivot.name}", values=of.values - pivot.values)
        for of, pivot in zip(bob, still, strict=True)
    )
    return [(x, y)]
