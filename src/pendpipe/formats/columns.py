"""What the columns of a table mean: which is the time, which the pendulum, and in what units.

From the chosen columns come seconds that rise, and readings in radians, volts, metres or so.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.formats.grammar import MOST_DAMAGED
from pendpipe.formats.table import (
    Column,
    ReadOptions,
    Table,
    derivative_slope,
    follows_sine,
    is_uniform,
    periods,
    swing_of,
)
from pendpipe.formats.words import Role, Unit, plain, role_of, unit_of
from pendpipe.recording import Quantity, find_step, from_below, jumps_of_a_turn

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
    if picked:
        return Choice(time, counts, tuple(picked), channels)
    time, mine, others = _of_one_run(channels, time)
    readings, notes, weak = _readings(mine, time)
    # What an instrument sampled by a clock of its own is no list.
    told = readings or [c for c in mine if c.role != "index"]
    falling = [c.label for c in told if c.time_s is None and _only_falls(c.values)]
    counting = [c.label for c in readings if _counts_samples(c) and one_way(c.values) == 1.0]
    named = [c for c in table.columns if not readings and plain(c.name).startswith("period")]
    lasting = [c.label for c in (*named, *filter(_lasts, table.columns))]
    names = listed([column.label for column in table.columns])
    counted = time is None or time.role != "time"
    spectrum = [c.label for c in table.columns if counted and _counts_frequencies(c)]
    swing = "give the recording of the swing: "
    for wrong, problem, remedy in (
        (
            lasting and (named or time is None or counts or time.label in lasting),
            f"'{''.join(lasting[:1])}' holds periods, not a recording of the swing",
            f"{swing}periods alone tell no loss",
        ),
        (
            spectrum,
            f"'{''.join(spectrum[:1])}' counts frequencies: a spectrum, no recording of the swing",
            "give the recording that it was made from",
        ),
        (
            falling and len(falling) == len(readings or falling),
            f"'{''.join(falling[:1])}' only falls: amplitudes, not a recording of the swing",
            "give the recording that they were read from",
        ),
        (
            counting,
            f"'{''.join(counting[:1])}' only counts, as passages of a light gate do: no recording"
            " of the swing",
            f"{swing}times of passages tell no amplitude",
        ),
        (
            not readings,
            f"no column looks like the motion of a pendulum (found {names})",
            "name it with --column (and its unit with --unit)",
        ),
    ):
        refuse_if(reading and wrong, table.place, problem, remedy)
    if others:
        notes = (*notes, f"one of several runs is read; choose with --column: {others}")
    return Choice(time, counts, readings, channels, notes, weak)


def find(table: Table, columns: Sequence[Column], key: str, numbers: Sequence[int] = ()) -> Column:
    """Find a column by its name (in any case), or by its number: in the file, or as given."""
    names = [f"{n} {c.label}" for n, c in zip(numbers, columns, strict=False)]
    numbers = numbers or [column.number for column in columns]
    called = [(name, c) for c in columns for name in (c.name, c.label, c.of)]
    alike = [c for form in (str, str.lower) for name, c in called if form(name) == form(key)]
    alike += [c for c, number in zip(columns, numbers, strict=True) if str(number) == key]
    known = listed(names or [column.label for column in columns])
    refuse_if(not alike, table.place, f"there is no column '{key}'", f"choose from: {known}")
    return alike[0]


def _only_falls(values: FloatArray) -> bool:
    """Whether a column holds a decay without its swings: sizes that fall from row to row."""
    sizes = np.abs(values[np.isfinite(values)])
    steps = np.diff(sizes)
    if len(steps) < 5 or not sizes[-1] < 0.8 * sizes[0]:
        return False
    # Of a swing as many sizes rise as fall; of a list few rise, but some may be alike.
    falls, rises = float(np.mean(steps < 0.0)), float(np.mean(steps > 0.0))
    return falls > max(0.4, 3.0 * rises)


def _counts_frequencies(column: Column) -> bool:
    """Whether a column of frequencies rises from row to row."""
    named = plain(column.name).startswith(("freq", "f(hz")) or plain(column.unit) in ("hz", "khz")
    return named and one_way(column.values) == 1.0


def _lasts(column: Column) -> bool:
    """Whether a column of times holds durations: they go up and down, and none is near 0."""
    times = column.values[np.isfinite(column.values)]
    some = column.role == "time" and len(times) > 2 and one_way(times) < 0.9
    return bool(some and times.min() > 0.3 * np.median(times))


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
        column = replace(column, values=_counted_on(column.values))
    swings = column.role == "index" and column.swing.clear
    return replace(column, role="unknown") if swings else column


def _summed(column: Column) -> Column:
    """Add up the times since the row above (``dt (ms)``), where there is no other time."""
    unit = unit_of(column.unit)
    lasts = unit is not None and unit.kind == "time" and column.values.min() > 0.0
    named = re.fullmatch(r"(d|δ|delta)[_ ]?t|interval\w*", plain(column.name))
    return (
        replace(column, values=np.cumsum(column.values), role="time") if lasts and named else column
    )


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
            one = replace(whole, values=seconds, name="time", unit="s", role="time")
            return _whole_times([one if c is whole else c for c in columns if c is not part])
    return columns


def _seconds(column: Column, usual: str) -> float:
    """Seconds in one unit of a column of times; infinite where it can be none."""
    said = unit_of(column.unit or column.name)
    named = said if said is not None and said.kind == "time" else None
    silent = unit_of(usual) if column.role == "time" or not column.name else None
    return (named or silent or Unit("time", np.inf)).factor


def _counted_on(values: FloatArray) -> FloatArray:
    """Count on where a clock of 16 or 32 bits begins again at 0 (``micros()`` after 71 minutes)."""
    steps = np.diff(values)
    for turn in (2.0**16, 2.0**32):
        over = steps < -0.5 * turn
        across = np.abs(steps[over] + turn).max(initial=0.0)
        on = over.any() and values.max() < turn and steps[~over].min(initial=1.0) >= 0.0
        if on and across < 10.0 * np.median(np.abs(steps)):
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
            or (len(table.columns) == 1 and not named)
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
    if len(starts) == 1 or not any(_WORTH[c.role] > 0.5 and _moves(c) for c in runs[0]):
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
    return clock, runs[one], listed(others, 6)


def _evenness(finite: FloatArray) -> float:
    """Share of the steps within a tenth of the median step."""
    steps = np.abs(np.diff(finite))
    middle = float(np.median(steps)) if len(steps) else 0.0
    return float(np.mean(np.abs(steps - middle) <= 0.1 * middle)) if middle > 0 else 0.0


def _counts_samples(column: Column) -> bool:
    """Say whether a column counts 1, 2, 3, ... and is not called a time."""
    values = column.values[np.isfinite(column.values)]
    if column.role not in ("index", "unknown", "length") or len(values) < 2:
        return False
    whole = len(values) > 0.98 * len(column.values) and np.all(values == np.rint(values))
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
    # Of columns without a name some wander, through a few cycles at most, and one swings.
    often = [each for each in equals if each[0].swing.clear and _cycles(each[0]) > 8.0] or equals
    clearest = max(column[0].swing.clarity for column in often)
    clear = [each for each in often if each[0].swing.clarity >= 0.7 * clearest]
    wander = len(clear) == 1 < len(equals) and not clear[0][0].name
    equals = clear if wander else equals
    first = equals[0]
    if len(equals) == 1 or len(first) > 1:
        return first, ", which alone swings clearly" * wander
    # A drive has one size from beginning to end; a free decay has all of them.
    own = first[0].swing
    for column in equals:
        swing = column[0].swing
        ratio = swing.samples_per_cycle / (own.samples_per_cycle or np.inf)
        # The pendulum goes along with its drive; what only drifts does not.
        graded = swing.clear and swing.graded > 0.3 and 0.7 < ratio < 1.4
        if graded and own.graded < 0.1 and own.clear:
            return column, ", whose swing decays"
        # Height, and the pull along the string, go through two cycles in one of the swing.
        # Known to one cycle more or less in the whole.
        blur = max(0.05, min(1.01 * swing.samples_per_cycle / len(column[0].values), 0.2))
        if swing.clear and abs(ratio - 2.0) < blur:
            return column, f", of which '{first[0].label}' has twice the frequency"
    units = {(unit_of(c[0].unit) or c[0].unit) for c in equals if c[0].unit}
    if len(units) > 1 or not all(c[0].unit or c[0].name for c in equals):
        return first, ""
    largest = max(column[0].swing.amplitude for column in equals)
    wide = next(c for c in equals if c[0].swing.amplitude >= largest / 3)
    return wide, "" if wide is first else ", which swings most"


def _cycles(column: Column) -> float:
    return len(column.values) / max(column.swing.samples_per_cycle, 1.0)


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
            _on_a_circle(x.values, y.values, named=bool(x.name))
            or (x.name and x.swing.clear and _pivot(x.values, y.values) is not None)
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


def _on_a_circle(x: FloatArray, y: FloatArray, *, named: bool) -> bool:
    """Say whether x, y go to and fro on a circle about the origin, and hang above or below it.

    Pixels counted from an image's corner keep much the same distance from it as well: but
    there the distance follows x, and the vertical through the origin lies outside the swing.
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y, sides = x[good], np.abs(y[good]), np.sign(y[good])
    if len(x) < 8 or max(np.abs(x).max(), y.max()) > 1e100:
        return False
    radius, angle = np.hypot(x, y), np.arctan2(x, y)
    if (
        not 0.0 < np.std(radius) <= min(0.08 * np.mean(radius), 0.3 * np.std(x))
        or abs(np.mean(sides)) <= 0.95
        or abs(np.median(angle)) > min(0.4, 0.5 * np.ptp(angle))
        or not swing_of(x).clear
    ):
        return False
    # On a circle y falls with x squared; two columns without names must show it.
    follows = float(np.corrcoef(x**2, y)[0, 1])  # NaN where either stands still
    shown = follows < -0.5 and np.std(radius) < 0.5 * np.std(y) and one_way(y) < 0.9
    return not follows >= 0.5 if named else bool(shown)


_EPOCH: Final = 3e8
"""Seconds beyond which a clock counts from a date (1979 in Unix time), not a start."""
_LATEST: Final = 1e10
"""Seconds since 1970 that no recording has reached: the unit in the header is wrong."""
_EPOCHS: Final = (
    (3e17, 1e-9, "nanoseconds"),
    (3e14, 1e-6, "microseconds"),
    (3e11, 1e-3, "milliseconds"),
    (_EPOCH, 1.0, "seconds"),
)
_LONGEST_S: Final = 300.0
"""Period beyond which a time without a unit is hardly in seconds: no pendulum is so slow."""
_SHORTEST_S: Final = 5e-4
"""Period below which it is hardly in seconds either."""


@dataclass
class TimeBase:
    """Times of the rows that are kept; which rows those are, in order; what was done.

    Parameters
    ----------
    time_s
        Shape (n,), rising.
    rows
        Row of the table that each comes from, shape (n,); a permutation where the file
        has its newest row first.
    lines
        Line of the file that each comes from, where it has lines: a lost row leaves one.
    """

    time_s: FloatArray
    rows: IntArray
    lines: IntArray | None = None
    notes: list[str] = field(default_factory=list)
    weak_guesses: list[str] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)

    def keep(self, rows: slice | BoolArray | IntArray, *notes: str) -> None:
        """Keep some of the rows, or put them into another order, and say so."""
        self.time_s, self.rows = self.time_s[rows], self.rows[rows]
        self.lines = None if self.lines is None else self.lines[rows]
        self.notes.extend(notes)


def time_base(table: Table, choice: Choice, options: ReadOptions) -> TimeBase:
    """Find the time of every row.

    In this order: the rate that the user gives, the instrument's own clock, the time
    column (in the unit given, or the one that fits), a column that counts samples with the
    rate in the header, the rate in the header alone.

    Raises
    ------
    InputError
        When there is no time, or it falls, repeats or is no number: file, line, remedy.
    """
    reading = choice.readings[0] if choice.readings else table.columns[0]
    every = np.arange(len(reading.values))
    if options.sample_rate is not None:
        note = f"times are counted at the given {options.sample_rate:g} Hz from the first row"
        return TimeBase(every.astype(np.float64) / options.sample_rate, every, notes=[note])
    if reading.time_s is not None:
        return TimeBase(reading.time_s, every)
    column = choice.time
    if column is not None and not choice.counts:
        return _from_column(table, choice, column, reading, options)
    counted = f" ('{column.label}' only counts)" if column is not None else ""
    interval_s = table.interval_s or np.nan
    refuse_if(
        table.interval_s is None,
        table.place,
        f"there is no time column and no sample rate{counted}",
        "give --sample-rate, or name the time with --column TIME:READING",
    )
    number = every.astype(np.float64) if column is None else column.values - column.values[0]
    note = f"no time column: times from the header's {1 / interval_s:g} Hz"
    note += f" and '{column.label}'" if column is not None else ""
    base = TimeBase(number * interval_s, every, notes=[note])
    return _in_order(table, choice, base, interval_s, options)


def _from_column(
    table: Table, choice: Choice, column: Column, reading: Column, options: ReadOptions
) -> TimeBase:
    """Read the times off a column."""
    filled = np.ones(len(column.values), dtype=bool)
    if len(reading.values) == len(filled):
        # Of runs side by side one is shorter.
        filled &= ~(np.isnan(column.values) & ~np.isfinite(reading.values))
    refuse_text(table, column, "correct or drop the row")
    lost = ~np.isfinite(column.values) & filled
    bad = np.flatnonzero(lost)
    if few := 0 < len(bad) <= MOST_DAMAGED * len(filled):
        filled &= ~lost
    refuse_if(
        bad.size and not few,
        table.where(int(bad.min(initial=len(filled) - 1))),
        "the time is missing or NaN",
        "correct or drop the row",
    )
    factor, note, weak = _time_unit(column, reading, options)
    if weak and table.interval_s is not None:
        # A clock without a unit ticks in some decimal part of a second.
        factor = table.interval_s / float(np.median(np.abs(np.diff(column.values[filled]))))
        factor, rate, weak = 10.0 ** np.rint(np.log10(factor)), 1.0 / table.interval_s, False
        note = f"'{column.label}' ticks every {factor:g} s, by the header's {rate:g} Hz"
    rows = np.flatnonzero(filled)
    lines = None if table.lines is None or len(table.lines) < len(filled) else table.lines[rows]
    base = TimeBase(column.values[rows] * factor, rows, lines)
    if few:
        base.notes.append(f"{len(bad)} row(s) without a time left out")
    if left := len(filled) - len(rows) - few * len(bad):
        base.notes.append(f"{left} row(s) with neither time nor reading left out")
    (base.weak_guesses if weak else base.notes).extend([note] * bool(note))
    return _in_order(table, choice, base, factor, options)


def refuse_text(table: Table, column: Column, remedy: str) -> None:
    """Refuse a column by the first of its cells that should be a number and is not."""
    row, text = next(iter(column.garbled.items()), (0, ""))
    refuse_if(column.garbled, table.where(row), f"'{text}' is no number", remedy)


def _time_unit(column: Column, reading: Column, options: ReadOptions) -> tuple[float, str, bool]:
    """Find the seconds in one unit of the time column, the reason, and whether it is weak."""
    if (asked := options.units[0]) is not None:
        given = unit_of(asked) or _UNKNOWN
        refuse_if(given.kind != "time", "--unit", f"'{asked}' is no unit of time", "give s, ms, us")
        return given.factor, "", False
    values = column.values[np.isfinite(column.values)]
    largest = float(np.abs(values).max(initial=0.0))
    period = _period(reading, values)
    for word in filter(unit_of, (column.unit, column.name)):
        unit = unit_of(word)
        fits = unit is not None and unit.kind == "time" and largest * unit.factor <= _LATEST
        if unit and fits and (word == column.unit or plain(word) not in ("t", "h", "min")):
            return unit.factor, "", False
    for least, factor, name in _EPOCHS:
        ticks = factor < 1.0 and float(np.ptp(values)) > 0.1 * largest
        if largest > least and not ticks and factor * period < _LONGEST_S:
            return factor, f"'{column.label}' counts {name} since 1970", False
    return _time_by_size(column, period, values)


def _period(reading: Column, values: FloatArray) -> float:
    """Period of the reading on a clock, in the clock's unit; 0 where nothing swings."""
    cycle = reading.swing.samples_per_cycle
    span = float(np.ptp(values)) if len(values) else 0.0
    return cycle * span / max(1, len(values) - 1)


def _time_by_size(column: Column, period: float, values: FloatArray) -> tuple[float, str, bool]:
    """Take seconds, unless no pendulum would be so slow."""
    step = float(np.median(np.abs(np.diff(values)))) if len(values) > 1 else 1.0
    whole = bool(np.all(values[:1000] == np.rint(values[:1000])))
    taken = f"'{column.label}' is taken to be in"
    if period > _LONGEST_S or (not period and whole and step >= 500):
        cycle, seen = period or 50.0 * step, f"a period of {period:.4g}"
        ticks = ((3e7, 1e-9, "nanoseconds"), (3e4, 1e-6, "microseconds"), (0, 1e-3, "milliseconds"))
        factor, name = next((size, name) for least, size, name in ticks if cycle > least)
        seen = seen if period else f"steps of {step:.4g}"
        note = f"'{column.label}' has no unit: taken to be {name} by {seen} (--unit s: for seconds)"
        return factor, note, True
    if 0.0 < period < _SHORTEST_S < 86400.0 * period < _LONGEST_S * 1e3:
        dated = 2e4 < float(np.abs(values).max(initial=0.0)) < 1e6
        return 86400.0, f"{taken} days, as spreadsheets count (--unit s: for s)", not dated
    if period and (whole or not 0.02 < period < 60.0):
        said = f"{taken} seconds: a period of {period:.4g} s (--unit ms: for milliseconds)"
        return 1.0, said, True
    return 1.0, f"{taken} seconds", False


def _in_order(
    table: Table, choice: Choice, base: TimeBase, tick: float, options: ReadOptions
) -> TimeBase:
    """Turn times that are out of order, or repeat, into times that rise; or refuse them."""
    if one_way(base.time_s) > 0.95 and base.time_s[-1] < base.time_s[0]:
        base.keep(slice(None, None, -1), "the newest row stands first: rows turned round")
    if len(base.time_s) and abs(base.time_s[0]) > _EPOCH:
        start = float(base.time_s[0])
        base.metadata["recorded_at"] = f"{start:.6f} s since 1970"
        base.notes.append(f"times are counted from the first row ({start:.6f} s on its clock)")
        base.time_s = base.time_s - start
    if np.diff(base.time_s).min(initial=1.0) <= 0:
        # What lies before --start, or behind --stop, need not be in order.
        start_s, stop_s = options.start_s, options.stop_s
        late = np.flatnonzero(base.time_s >= (np.inf if stop_s is None else stop_s))
        base.keep(slice(late.min(initial=len(base.time_s)) + 1))
        early = np.flatnonzero(base.time_s <= (-np.inf if start_s is None else start_s))
        base.keep(slice(early.max(initial=0), None))
    for repaired in (
        _drop_torn,
        _count_rows,
        _keep_last,
        _drop_repeats,
        _lone_stamps,
        _first_of_stacked,
    ):
        if np.diff(base.time_s).min(initial=1.0) <= 0:
            repaired(choice, base)
    steps = np.diff(base.time_s)
    if steps.min(initial=1.0) > 0:
        _count_late_rows(choice, base)
        _without_lone_ends(base)
        return base
    at = int(np.argmax(steps <= 0))
    verb = "repeats" if steps[at] == 0 else "falls"
    before, after = base.time_s[at] / tick, base.time_s[at + 1] / tick
    clocks = (
        f"take the time from '{column.label}' (--column '{column.label}:READING'), "
        for column in table.columns
        if column is not choice.time and not _counts_samples(column)
        if np.diff(column.values).min(initial=np.inf) > 0
    )
    end = f"{base.time_s[at]:.10g}"
    raise InputError(
        table.where(int(base.rows[at + 1])),
        f"the time {verb} ({before:.10g} is followed by {after:.10g})",
        f"{next(clocks, '')}read what lies before it (--stop {end}) or behind it (--start {end}),"
        " or give --sample-rate if the rows are evenly spaced",
    )


def _count_rows(_choice: Choice, base: TimeBase) -> None:
    """Count the rows where stamps are rounded and repeat; a logger may slow down behind them."""
    whole = len(base.time_s)
    last = int(np.max(np.flatnonzero(np.diff(base.time_s) == 0.0), initial=-2)) + 2
    for rows in sorted({whole, last}, reverse=True):
        even = _rounded(base.time_s[:rows], base.lines)
        # So far from its zero a clock has no digits left between the rows.
        interval = 0.0 if even is None else float(np.diff(even).min())
        if even is None or not interval > 0.0:
            continue
        frames = round((even[-1] - even[0]) / interval) + 1 - len(even)
        lost = f", with {frames} missing" if frames else ""
        until = f" until {even[-1]:.6g} s" if rows < whole else ""
        exact = min(interval, np.ptp(base.time_s[:rows] - even))
        base.notes.append(
            f"time stamps are rounded and repeat{until}: rows are counted at"
            f" {1.0 / interval:.6g} Hz{lost}, which all stamps agree with: the rate is known to"
            f" {100.0 * exact / np.ptp(even):.1g} %"
        )
        base.time_s = np.append(even, base.time_s[rows:])
        return


def _count_late_rows(choice: Choice, base: TimeBase) -> None:
    """Count rows that were stamped as they arrived: by rows the periods agree far better."""
    values = _values(choice, base)
    if not len(values) or is_uniform(base.time_s):
        return
    index = np.arange(len(values))
    even: FloatArray = np.polynomial.Polynomial.fit(index, base.time_s, 1)(index)
    stamped, counted = (periods(time, values)[0] for time in (base.time_s, even))
    if min(len(stamped), len(counted)) < 8:
        return
    scatter = [np.median(np.abs(np.diff(found))) / np.median(found) for found in (stamped, counted)]
    if scatter[1] < min(0.1 * scatter[0], 0.03):
        late = float(np.std(base.time_s - even))
        base.weak_guesses.append(
            f"time stamps scatter by {late:.2g} s, as of arrival: rows are counted at"
            f" {1.0 / (even[1] - even[0]):.6g} Hz, by which the periods agree"
            f" {scatter[0] / scatter[1]:.0f} times better; the rate is known"
            f" to {100.0 * late / np.ptp(even):.1g} % (--sample-rate)"
        )
        base.time_s = even


def _without_lone_ends(base: TimeBase) -> None:
    """Leave out a first or last row that a torn stamp has put a long way from the others."""
    steps = np.diff(base.time_s)
    usual = float(np.median(steps)) if len(steps) > 99 and is_uniform(base.time_s) else np.inf
    first, last = bool(steps[:1] > 50.0 * usual), bool(steps[-1:] > 50.0 * usual)
    if first or last:
        note = f"{first + last} lone row(s) left out, with a stamp far from the others'"
        base.keep(slice(int(first), len(base.time_s) - last), note)


def _values(choice: Choice, base: TimeBase) -> FloatArray:
    """Give the readings of the rows that are kept; none where there are fewer."""
    values = choice.readings[0].values if choice.readings else np.empty(0)
    return values[base.rows] if len(values) > base.rows.max(initial=0) else np.empty(0)


def _drop_repeats(choice: Choice, base: TimeBase) -> None:
    """Leave out rows with the time of an earlier row: a logger that sends what it has sent.

    Whole copies always; with other readings where they are rare, for then the earlier row,
    which stands where its time belongs, is the true one.
    """
    _, first, which = np.unique(base.time_s, return_index=True, return_inverse=True)
    origin = first[which.reshape(-1)]
    again = origin < np.arange(len(origin))
    if again.sum() > max(20, 0.01 * len(again)):
        for column in choice.channels:
            if len(column.values) > base.rows.max():
                values = column.values[base.rows]
                same = (values == values[origin]) | (np.isnan(values) & np.isnan(values[origin]))
                again &= same
    if again.any():
        base.keep(~again, f"{again.sum()} row(s) that repeat the time of an earlier row left out")


def _first_of_stacked(_choice: Choice, base: TimeBase) -> None:
    """Keep the first of several runs that stand below one another, each from its own start."""
    starts = np.flatnonzero(np.diff(base.time_s) < 0) + 1
    lengths = np.diff(np.concatenate(([0], starts, [len(base.time_s)])))
    again = np.abs(base.time_s[starts] - base.time_s[0]) < 0.05 * np.ptp(base.time_s)
    if not 0 < len(starts) <= 50 or lengths.min() < 50 or not again.all():
        return
    base.weak_guesses.append(
        f"{len(lengths)} runs stand below one another: the first is read ({lengths[0]} rows);"
        " put each into a file of its own for the others"
    )
    base.keep(slice(starts[0]))


def _fallen(time: FloatArray) -> IntArray:
    """Find stamps that fall out of a time that rises without them."""
    padded = np.concatenate(([-np.inf], time, [np.inf]))
    at = np.flatnonzero(np.diff(time) < 0)
    # Either the stamp before a fall is too late, or the one behind it too early.
    return np.where(padded[at + 3] >= padded[at + 1], at + 1, at)


def _drop_torn(_choice: Choice, base: TimeBase) -> None:
    """Leave out rows with torn stamps among those that are rounded, up to one in a hundred."""
    wrong, steps = _fallen(base.time_s), np.diff(base.time_s)
    good = np.delete(base.time_s, wrong)
    rare = 0 < len(wrong) <= MOST_DAMAGED * len(steps) and np.mean(steps == 0.0) > 0.02
    if rare and np.diff(good).min(initial=0.0) >= 0.0:
        kept = np.delete(np.arange(len(base.time_s)), wrong)
        base.keep(kept, f"{len(wrong)} row(s) with a stamp that falls out of order left out")


def _lone_stamps(_choice: Choice, base: TimeBase) -> None:
    """Interpolate stamps that fall out of a time that rises without them."""
    wrong = _fallen(base.time_s)
    good = np.delete(np.arange(len(base.time_s)), wrong)
    inside = not {0, len(base.time_s) - 1} & set(wrong.tolist())
    rows, steps = np.diff(good), np.diff(base.time_s[good])
    # Behind a clock that was set back the next row comes too soon.
    soon = np.any(steps[rows > 1] < 0.5 * rows[rows > 1] * np.median(steps))
    rises = steps.min(initial=1.0) > 0 and not soon
    if inside and rises and len(wrong) <= 0.05 * len(good):
        base.time_s = np.interp(np.arange(len(base.time_s)), good, base.time_s[good])
        base.notes.append(f"{len(wrong)} time stamp(s) that fall out of order interpolated")


def _rounded(time: FloatArray, lines: IntArray | None = None) -> FloatArray | None:
    """Undo the coarseness of the stamps of evenly spaced rows; ``None`` if they are not that.

    One test for stamps that are rounded, cut, or stand for a block of rows: the rows are even
    within what one stamp stands for (`_coarseness`), which may change on the way. Stamps lie at
    the middle of it (rounded), or at either end (cut; the arrival of a block).

    Where a stamp shows that frames are missing, each row is counted one interval after the row
    above, or as many as bring it within its stamp. The interval with which fewest are missing
    is right.
    """
    steps = np.diff(time)
    if len(time) < 10 or steps.min() < 0 or np.mean(steps == 0) < 0.001:
        return None
    # A clock's own jitter comes on top: a tenth of an interval.
    digit = _coarseness(time) + 0.15 * float(time[-1] - time[0]) / len(time)
    index: FloatArray = np.arange(len(time), dtype=np.float64)
    placed = index if lines is None else (lines[: len(time)] - lines[0]).astype(np.float64)
    if not 0.0 < placed[-1] - index[-1] <= 0.03 * len(time):
        placed = index
    places = (placed, index)[placed is index :]
    for place, late in product(places, (0.0, 0.5, -0.5)):
        centre = time + late * digit
        even: FloatArray = np.polynomial.Polynomial.fit(place, centre, 1, w=1.0 / digit)(place)
        # Of two rows in three the rounding errors have a mean: the line lies midway.
        even += 0.5 * float(np.max(centre - even) + np.min(centre - even)) * (late == 0.0)
        if np.all(np.abs(centre - even) <= 0.6 * digit) and even[-1] > even[0]:
            return even
    if np.mean(steps == 0) < 0.02:
        return None
    # The first stamps are the finest.
    early = time[: max(10, min(30, int(np.argmax(steps == 0))))]
    usual = (float(np.median(np.diff(early))), float(np.ptp(time)) / float(placed[-1]))
    changes = (0.0, 1e-3, -1e-3, 5e-3, -5e-3, 1e-2, -1e-2)
    for step, place in product(usual, places):
        tried = [_frames(time, digit, (1.0 + c) * step, place) for c in changes]
        if found := [even for even in tried if even is not None]:
            # Fewest frames in all is the longest interval.
            return max(found, key=lambda even: np.diff(even).min())
    return None


def _coarseness(time: FloatArray) -> FloatArray:
    """Find what one stamp stands for, shape (n,): its last digit, or the step to the next stamp.

    The step where several rows have one stamp, as whole blocks and arrays do.
    """
    digit = _last_digit(time)
    starts = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)
    if len(starts) < 9:
        return digit
    rows = np.diff(np.append(starts, len(time)))
    step = np.diff(time[starts])
    around = sliding_window_view(np.pad(np.append(step, step[-1:]), 4, mode="edge"), 9)
    usual = np.median(around, axis=1)
    crowded = np.mean(sliding_window_view(np.pad(rows, 4, mode="reflect"), 9), axis=1) > 1.3
    blocks: FloatArray = np.repeat(np.where(crowded, usual, 0.0), rows)
    return np.maximum(digit, blocks)


def _last_digit(time: FloatArray) -> FloatArray:
    """What one in the last printed digit of each stamp is worth.

    Either all have so many decimals, or all so many digits: then it grows with the time.
    """
    some = time[:: max(1, len(time) // 1000)]
    texts = [f"{abs(stamp):.10f}".rstrip("0") for stamp in (*time[:100], *some) if stamp]
    decimals = max((len(text.partition(".")[2]) for text in texts), default=0)
    digits = max((len(text.replace(".", "").lstrip("0")) for text in texts), default=1)
    size = np.floor(np.log10(np.maximum(np.abs(time), 1e-9)) + 1e-9)
    return np.maximum(10.0**-decimals, 10.0 ** (size - digits + 1))


def _frames(
    time: FloatArray, digit: FloatArray, interval: float, index: FloatArray
) -> FloatArray | None:
    """Count the frames from the first row to each, improving their interval on the way.

    Each row is at least as many after the first as `index` says.

    Returns
    -------
    time_s
        ``None`` where some stamp contradicts the count, or more than 2 % are missing: of
        so many any interval would do.
    """
    start, tries = float(time[0]), 8
    while interval > 0 and tries:
        # At least one more than the row above, and at least what the stamp asks for.
        least = np.ceil((time - start - 0.6 * digit) / interval - 1e-9)
        count = index + np.maximum.accumulate(np.maximum(least - index, 0.0))
        even: FloatArray = start + interval * count
        if count[-1] > 1.02 * len(time) + 3:
            break
        if np.all(np.abs(even - time) <= 0.6 * digit):
            return even
        fitted = np.polynomial.Polynomial.fit(count, time, 1, w=1.0 / digit).convert()
        start, interval = fitted.coef.tolist()
        tries -= 1
    return None


def _keep_last(choice: Choice, base: TimeBase) -> None:
    """For one row a count: of the rows in one tick of the clock keep the last."""
    jumps = np.abs(np.diff(_values(choice, base)))
    count = float(np.median(jumps)) if len(jumps) and np.all(np.diff(base.time_s) >= 0) else 0.0
    if count > 0 and np.mean(np.abs(jumps - count) < 0.01 * count) >= 0.9:
        last = np.append(np.diff(base.time_s) > 0, True)
        base.keep(
            last, f"{np.sum(~last)} count(s) within one tick of the clock merged with the next"
        )


_RADIAN = Unit("angle", 1.0, "rad")
_DEGREE = Unit("angle", np.pi / 180, "rad")
_TURN = Unit("angle", 2 * np.pi, "rad")
_UNKNOWN = Unit("own", 1.0, "1")
_QUANTITIES: dict[str, Quantity] = {
    "angle": "angle_rad",
    "volts": "volts",
    "length": "displacement_m",
    "own": "reading",
}


@dataclass(frozen=True)
class Readings:
    """Values of all rows, shape (n,), in the unit of `quantity`; scale; what was guessed."""

    values: FloatArray
    quantity: Quantity
    factor: float
    unit: str
    notes: tuple[str, ...] = ()
    weak_guesses: tuple[str, ...] = ()
    radius_excess: FloatArray | None = None


@dataclass(frozen=True)
class _Guess:
    """A unit, its reason, and whether it is a weak guess."""

    unit: Unit
    why: str = ""
    weak: bool = False


def readings(table: Table, choice: Choice, options: ReadOptions, base: TimeBase) -> Readings:
    """Turn the chosen column, or the pair x, y, into one of the quantities.

    Raises
    ------
    InputError
        When the columns have fewer rows than the times, or the column is no motion.
    """
    rows = len(choice.readings[0].values)
    refuse_if(
        any(len(c.values) != rows for c in choice.readings) or base.rows.max(initial=0) >= rows,
        table.place,
        "the columns are of unequal length",
        "choose with --column",
    )
    if len(choice.readings) == 2:
        return _position(choice.readings[0], choice.readings[1], base)
    time_s = np.full(rows, np.nan)
    time_s[base.rows] = base.time_s
    column = choice.readings[0]
    guess = _unit(table, choice, column, options, time_s)
    unit, values, notes = guess.unit, column.values * guess.unit.factor, tuple[str, ...]()
    if unit.kind == "angle":
        values, notes = from_below(values)
    elif unit.name == "counts":
        values, notes = _over_the_turn(values)
    stated = f"'{column.label}' {guess.why}"
    if guess.why and not guess.weak:
        notes = (stated, *notes)
    return Readings(
        values,
        _QUANTITIES[unit.kind],
        unit.factor,
        unit.name,
        notes,
        (f"{stated} (--unit)",) if guess.weak else (),
    )


def _unit(
    table: Table, choice: Choice, column: Column, options: ReadOptions, time_s: FloatArray
) -> _Guess:
    """Find the unit: from the user, from the file, or from the numbers."""
    if (asked := options.units[1]) is not None:
        given = unit_of(asked) or Unit("none", 1.0)
        refuse_if(
            given.kind not in _QUANTITIES,
            "--unit",
            f"'{asked}' is not known",
            "give rad, deg, V, mV, m, mm, px, counts, rad/s, m/s^2, ...",
        )
        return _Guess(given)
    # "second,Volt,Volt": some programs print the unit for a name.
    written = unit_of(column.unit or (column.name if len(column.name) > 2 else ""))
    role = column.role
    if written is not None and written.kind in _QUANTITIES:
        if role == "velocity" and written.kind in ("angle", "length"):
            return _Guess(Unit("own", written.factor, f"{written.name}/s"))
        return _contradicted(column, written, time_s) or _Guess(written)
    if column.unit and written is None:
        return _Guess(Unit("own", 1.0, column.unit), f"is in {column.unit}, analysed as it stands")
    refuse_if(
        written is not None or role in ("none", "time", "index"),
        table.place,
        f"'{column.label}' ({column.unit or 'by its name'}) is nothing that a pendulum's"
        " motion is read from",
        "choose another with --column, or give its unit with --unit",
    )
    finite = column.values[np.isfinite(column.values)]
    headed = [*_UNITS_OF.findall(table.metadata.get("header", "")), ""][0]
    named = unit_of(headed) or Unit("none", 1.0)
    if named.kind in ("length", "volts") and role in ("unknown", named.kind):
        return _Guess(named, f"is in {headed}, by the header")
    if np.all(finite == np.rint(finite)) and re.search(r"(?i)enc|count|tick|raw|adc", column.name):
        return _Guess(Unit("own", 1.0, "counts"), "holds whole numbers: analysed as counts", True)
    if role == "volts":
        return _Guess(Unit("volts", 1.0, "V"), "has no unit: taken to be volts", True)
    # A phone's sensor: of a position it knows nothing.
    names = {other.name.lower() for other in choice.channels if not other.unit}
    sensed = role == "length" and {"x", "y", "z"} <= names
    what = " (one of x, y, z)" if sensed else f" ({role})" if role in _OF_SENSORS else ""
    found = None if what else _angle_unit(table, choice, column, time_s)
    return found or _Guess(
        _UNKNOWN, f"{what.strip()} has no unit: analysed in its own".strip(), True
    )


_OF_SENSORS: Final = ("velocity", "acceleration", "signal")
_UNITS_OF = re.compile(r"(?i)\b(?:vertical|length) units?\W+([a-zµ]+)")
"""What an oscilloscope, or a system of cameras, says above its table."""


def _reach(finite: FloatArray) -> float:
    """How far the readings go from their middle."""
    if not len(finite):
        return 0.0
    low, middle, high = np.percentile(finite, (0.2, 50, 99.8))
    return max(float(high - middle), float(middle - low))


def _contradicted(column: Column, written: Unit, time_s: FloatArray) -> _Guess | None:
    """Doubt a header that gives the one unit of angles where the period shows the other."""
    reach = _reach(column.values[np.isfinite(column.values)])
    for unit, headed, least, most, other, name in (
        (_DEGREE, "degrees", 0.3, 3.0, _RADIAN, "radians"),
        (_RADIAN, "radians", 3.6, 170.0, _DEGREE, "degrees"),
    ):
        doubtful = written == unit and least < reach < most
        slope = follows_sine(time_s, column.values, other.factor) if doubtful else None
        if slope is not None and abs(slope - 1.0) <= 0.25:
            why = f"is headed in {headed}, but its period grows as a swing in {name} does"
            return _Guess(other, f"{why}: taken as such", weak=True)
    return None


def _angle_unit(table: Table, choice: Choice, column: Column, time_s: FloatArray) -> _Guess | None:
    """Find an angle's unit in the header's words, or by a test of physics; ``None`` without either.

    In this order: the derivative beside it in a known unit; the period, which lengthens as that
    of sin x does in one unit only; numbers that are round in the other unit; jumps of a turn; a
    step that is a turn over the number of an encoder's lines.
    """
    finite = column.values[np.isfinite(column.values)]
    if not len(finite):
        return _Guess(_RADIAN)
    words = " ".join((column.name, *table.metadata, *table.metadata.values())).lower()
    stated = re.search(
        r"\b(deg|degs|degrees?|grad|grado|gradi|grados)\b(?! c)|_deg|°(?!\s*[cf])", words
    )
    named = column.role == "angle"
    if stated and column.role != "length" and "rad" not in words.replace("grad", ""):
        return _Guess(_DEGREE, "is taken to be in degrees (the header names them)")
    return (
        _by_rate(choice, column, time_s)
        or _by_period(column, time_s)
        or (_by_digits(finite) if column.role != "length" else None)
        or (_by_lines(finite) if named else None)
        or (_Guess(_RADIAN, "jumps by 2 pi: it is in radians") if jumps_of_a_turn(finite) else None)
    )


def _by_period(column: Column, time_s: FloatArray) -> _Guess | None:
    """Take for radians, degrees or turns what is swung through ever faster, just as they are.

    The period goes as K(sin(A/2)^2): to second order as 1 + A^2/16, so that of units which differ
    by a factor of 39 or more at most one fits.
    """
    units = (_RADIAN, "radians"), (_DEGREE, "degrees"), (_TURN, "turns")
    # Of what is named a position other units may well be pixels, of any length.
    for unit, name in units[: 1 if column.role == "length" else None]:
        slope = follows_sine(time_s, column.values, unit.factor)
        if slope is not None and abs(slope - 1.0) < 0.35:
            why = f"is in {name}: its period lengthens with the swing as sin x has it"
            # Of a pendulum 1 m long (2 s) metres look the same.
            usual = float(np.median(periods(time_s, column.values)[0]))
            metres = unit == _RADIAN and column.role != "angle" and abs(usual - 2.0) < 0.3
            return _Guess(unit, why + ", or in metres, with a string of 1 m" * metres, weak=metres)
    return None


def _by_digits(finite: FloatArray) -> _Guess | None:
    """Read the unit off printed digits: all numbers are multiples of one in the other unit."""
    if _printed_digit(finite, 1.0) is not None:
        return None
    for unit, scale, name, other in (
        (_RADIAN, 180 / np.pi, "radians", "degrees"),
        (_DEGREE, np.pi / 180, "degrees", "radians"),
    ):
        if digit := _printed_digit(finite, scale):
            why = f"converted to {other}, its values are multiples of {digit:.4g}"
            return _Guess(unit, f"is in {name} ({why})")
    return None


def _by_lines(finite: FloatArray) -> _Guess | None:
    """Compare the step of a column that is named an angle with a turn over an encoder's counts.

    These are 2^k, or 1, 2, 4, 5, 8 times a power of ten: forty numbers, to six digits, are met by
    chance once in ten thousand times.
    """
    step = find_step(finite)
    for turn, unit, name in ((2 * np.pi, _RADIAN, "radians"), (360.0, _DEGREE, "degrees")):
        counts = turn / step if step else 0.0
        whole = round(counts)
        usual = whole & (whole - 1) == 0 or re.fullmatch("[12458]0+", str(whole))
        # A step of three digits may as well be one that was printed.
        printed = not step or abs(float(f"{step:.3g}") / step - 1.0) < 1e-6
        if 100 <= whole <= 1 << 20 and usual and not printed and abs(counts / whole - 1.0) < 2e-6:
            return _Guess(unit, f"is in {name} (its step is a turn over {whole})")
    return None


def _printed_digit(finite: FloatArray, scale: float) -> float | None:
    """Find the decimal place of which all readings, times `scale`, are multiples."""
    some = finite[:: max(1, len(finite) // 2000)]
    # Beyond 1e9 a double has no such digits left.
    if len(some) < 20 or np.abs(some).max() > 1e9:
        return None
    some = scale * some
    for place in range(7):
        whole = some * 10.0**place
        # Of readings that have no such digit a few in a hundred are this near to one.
        if np.ptp(whole) > 20.0 and np.all(np.abs(whole - np.rint(whole)) < 0.03):
            return 10.0**-place
    return None


def _by_rate(choice: Choice, column: Column, time_s: FloatArray) -> _Guess | None:
    """Compare its derivative with one in a known unit that stands beside it."""
    for other in choice.channels:
        unit = unit_of(other.unit) if other.unit else None
        if unit is None or unit.name != "rad/s" or len(other.values) != len(column.values):
            continue
        slope = derivative_slope(time_s, column.values, other.values) or 0.0
        for guess, name in ((_RADIAN, "radians"), (_DEGREE, "degrees")):
            if abs(unit.factor * abs(slope) / guess.factor - 1.0) < 0.25:
                return _Guess(guess, f"is taken to be in {name} (by '{other.label}' beside it)")
    return None


def _over_the_turn(values: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Undo the jumps of an absolute encoder of 2^k counts that hangs near its zero."""
    finite = np.isfinite(values)
    low, high = np.min(values[finite], initial=0.0), np.max(values[finite], initial=0.0)
    turn = 2.0 ** np.ceil(np.log2(high + 1.0)) if high > 0.0 else 1.0
    if low < 0.0 or turn < 256.0 or not np.any(np.abs(np.diff(values[finite])) > 0.8 * turn):
        return values, ()
    values[finite] = np.unwrap(values[finite], period=turn)
    return values, (f"the counts jump by a turn of {turn:g}: unwrapped",)


def _position(x: Column, y: Column, base: TimeBase) -> Readings:
    """Turn a position into an angle about the pivot: atan2(x, -y), 0 straight down.

    Positions that are not on a circle about (0, 0) are on one about the pivot. Where both fit
    nearly, and the other's centre fits better by an F test, the length of the pendulum that has
    this period under gravity decides; where that agrees with neither, the better circle is a guess.
    """
    left, up, seen = x.values, y.values, "the position seen from (0, 0)"
    pivot, weak = _pivot(left, up), tuple[str, ...]()
    if pivot is None and (better := _better_circle(left, up)) is not None:
        period_s = float(np.median(periods(base.time_s, left[base.rows])[0]))
        length_m = 9.81 * (period_s / (2.0 * np.pi)) ** 2
        arms = [float(np.nanmedian(np.hypot(left - a, up - b))) for a, b in ((0.0, 0.0), better)]
        agree = [any(abs(arm * f / length_m - 1.0) < 0.05 for f in _LENGTHS) for arm in arms]
        if not agree[0]:
            pivot = better
        if agree == [False, False]:
            weak = (
                f"the pivot is not (0, 0) but ({better[0]:.4g}, {better[1]:.4g}), about which"
                " the positions lie on a circle (--column x for the position itself)",
            )
    if pivot is not None:
        left, up = left - pivot[0], up - pivot[1]
        seen = f"about the centre of their circle, ({pivot[0]:.5g}, {pivot[1]:.5g})"
    down, sign = (-1.0, "-") if float(np.nanmedian(up)) < 0 else (1.0, "")
    note = f"angle = atan2({x.label}, {sign}{y.label}), {seen}"
    angle, radius = np.arctan2(left, down * up), np.hypot(left, up)
    excess = radius / np.nanmedian(radius) - 1.0
    return Readings(angle, "angle_rad", 1.0, "rad", (note,), weak, radius_excess=excess)


_LENGTHS: Final = (1.0, 0.01, 1e-3, 0.0254)
"""Metres of the units in which positions are given."""


def _better_circle(x: FloatArray, y: FloatArray) -> FloatArray | None:
    """Find the centre of a circle that fits positions better than that about (0, 0), by an F test.

    The two further parameters lower the sum of squares by F > 30; the centre is known to 3 % of the
    radius, and further than a tenth of it from (0, 0).
    """
    from scipy.optimize import least_squares

    points = np.column_stack([x, y])[np.isfinite(x) & np.isfinite(y)]
    if len(points) < 50 or not _on_a_circle(x, y, named=True):
        return None

    def excess(centre: FloatArray) -> FloatArray:
        radius = np.hypot(*(points - centre).T)
        return np.asarray(radius - radius.mean())

    fitted = least_squares(excess, np.zeros(2))
    spread, arm = float(fitted.fun @ fitted.fun), float(np.hypot(*(points - fitted.x).T).mean())
    test = 0.5 * (float(np.sum(excess(np.zeros(2)) ** 2)) / spread - 1.0) * (len(points) - 3)
    slopes = np.asarray(fitted.jac)
    inverse = np.linalg.pinv(slopes.T @ slopes)
    known = float(np.sqrt(spread / len(points) * np.trace(inverse))) < 0.03 * arm
    return fitted.x if known and test > 30.0 and math.hypot(*fitted.x) > 0.1 * arm else None


def _pivot(x: FloatArray, y: FloatArray) -> FloatArray | None:
    """Find the centre of the circle from which positions have the least rms distance.

    It starts from x^2 + y^2 = 2 (a x + b y) + c, which alone is biased by noise, and leaves out
    positions far from it (a hand, a lost marker). None where they lie on none, its centre is
    uncertain by 3 % of its radius, or within a tenth of it of (0, 0), and where the swing is
    below a tenth of a radian.
    """
    good = np.isfinite(x) & np.isfinite(y)
    points = np.column_stack([x[good], y[good]])
    if len(points) < 8 or np.abs(points).max() > 1e100:
        return None
    one, middle = np.ones((len(points), 1)), points.mean(axis=0)
    inverse = np.linalg.pinv(np.hstack([2.0 * (points - middle), one]))
    centre = (inverse @ np.sum((points - middle) ** 2, axis=1))[:2] + middle
    for _ in range(6):
        arm = points - centre
        radius = np.hypot(*arm.T)
        off = np.abs(radius - np.median(radius))
        # Exact positions are off by rounding alone, which leaves none of them out.
        far = max(6.0 * float(np.median(off)), 1e-9 * float(np.median(radius)))
        near = (off <= far) & (radius > 0.0)
        inverse = np.linalg.pinv(np.hstack([arm / radius[:, None], one])[near])
        centre = centre + (inverse @ radius[near])[:2]
    mean, (wide, high) = float(radius[near].mean()), np.abs(arm[near]).T
    known = float(np.std(radius[near])) * float(np.linalg.norm(inverse[:2])) < 0.03 * mean
    hangs = high.min() > 0.05 * mean and wide.max() > 0.1 * mean
    away = math.hypot(*centre) / mean
    # The farther from (0, 0), the less the circle need show.
    clear = np.std(radius[near]) < min(max(0.3, 1.5 * away), 0.5) * np.std(points[near, 1])
    return centre if known and hangs and clear and away > 0.1 else None
