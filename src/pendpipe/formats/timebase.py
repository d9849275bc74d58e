"""From a time column, or a rate, to seconds that rise."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.errors import InputError
from pendpipe.formats.choose import Choice, one_way
from pendpipe.formats.samples import swing_of
from pendpipe.formats.table import Column, ReadOptions, Table
from pendpipe.formats.words import plain, unit_of

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
    """

    time_s: FloatArray
    rows: IntArray
    notes: list[str] = field(default_factory=list)
    weak_guesses: list[str] = field(default_factory=list)
    metadata: dict[str, str] = field(default_factory=dict)


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
        time: FloatArray = every.astype(np.float64) / options.sample_rate
        note = f"times are counted at the given {options.sample_rate:g} Hz from the first row"
        return TimeBase(time, every, [note])
    if reading.time_s is not None:
        return TimeBase(reading.time_s, every)
    column = choice.time
    if column is not None and not choice.counts:
        return _from_column(table, choice, column, reading, options)
    if table.interval_s is not None:
        note = f"no time column: times from the header's {1 / table.interval_s:g} Hz"
        if column is None:
            return TimeBase(every.astype(np.float64) * table.interval_s, every, [note])
        _refuse_missing_times(table, column, np.ones(len(every), dtype=bool))
        time = (column.values - column.values[0]) * table.interval_s
        base = TimeBase(time, every, [f"{note} and '{column.label}'"])
        return _in_order(table, choice, base, table.interval_s)
    counted = f" ('{column.label}' only counts)" if column is not None else ""
    raise InputError(
        table.place,
        f"there is no time column and no sample rate{counted}",
        "give --sample-rate, or name the time with --column TIME:READING",
    )


def _from_column(
    table: Table, choice: Choice, column: Column, reading: Column, options: ReadOptions
) -> TimeBase:
    """Read the times off a column."""
    filled = np.ones(len(column.values), dtype=bool)
    if len(reading.values) == len(filled):
        # Of runs side by side one is shorter.
        filled &= ~(np.isnan(column.values) & ~np.isfinite(reading.values))
    _refuse_missing_times(table, column, filled)
    factor, note, weak = _unit(column, reading, options)
    if weak and table.interval_s is not None:
        # A clock without a unit ticks in some decimal part of a second.
        factor = table.interval_s / float(np.median(np.abs(np.diff(column.values[filled]))))
        factor, rate = 10.0 ** np.rint(np.log10(factor)), 1.0 / table.interval_s
        note, weak = (
            f"'{column.label}' ticks every {factor:g} s, by the header's {rate:g} Hz",
            False,
        )
    rows = np.flatnonzero(filled)
    base = TimeBase(column.values[rows] * factor, rows)
    if len(rows) < len(filled):
        base.notes.append(
            f"{len(filled) - len(rows)} row(s) with neither time nor reading left out"
        )
    if note:
        (base.weak_guesses if weak else base.notes).append(note)
    return _in_order(table, choice, base, factor)


def refuse_text(table: Table, column: Column, remedy: str) -> None:
    """Refuse a column by the first of its cells that should be a number and is not."""
    if column.fault is not None:
        row, text = column.fault
        raise InputError(table.where(row), f"'{text}' is no number", remedy)


def _refuse_missing_times(table: Table, column: Column, rows: BoolArray) -> None:
    refuse_text(table, column, "correct or drop the row")
    bad = np.flatnonzero(~np.isfinite(column.values) & rows)
    if bad.size:
        raise InputError(
            table.where(int(bad[0])), "the time is missing or NaN", "correct or drop the row"
        )


def _unit(column: Column, reading: Column, options: ReadOptions) -> tuple[float, str, bool]:
    """Find the seconds in one unit of the time column, the reason, and whether it is weak."""
    if options.time_unit is not None:
        given = unit_of(options.time_unit)
        if given is None or given.kind != "time":
            raise InputError(
                "--unit", f"'{options.time_unit}' is no unit of time", "give s, ms, us"
            )
        return given.factor, "", False
    values = column.values[np.isfinite(column.values)]
    largest = float(np.abs(values).max(initial=0.0))
    period = _period(reading, values)
    for word in (column.unit, column.name):
        unit = unit_of(word) if word else None
        if unit is None or unit.kind != "time" or largest * unit.factor > _LATEST:
            continue
        if word == column.unit or plain(word) not in ("t", "h", "min"):
            return unit.factor, "", False
    for least, factor, name in _EPOCHS:
        ticks = factor < 1.0 and float(np.ptp(values)) > 0.1 * largest
        if largest > least and not ticks and factor * period < _LONGEST_S:
            return factor, f"'{column.label}' counts {name} since 1970", False
    return _unit_by_size(column, period, values)


def _period(reading: Column, values: FloatArray) -> float:
    """Period of the reading on a clock, in the clock's unit; 0 where nothing swings."""
    cycle = swing_of(reading.values).samples_per_cycle
    span = float(np.ptp(values)) if len(values) else 0.0
    return cycle * span / max(1, len(values) - 1)


def _unit_by_size(column: Column, period: float, values: FloatArray) -> tuple[float, str, bool]:
    """Take seconds, unless no pendulum would be so slow."""
    step = float(np.median(np.abs(np.diff(values)))) if len(values) > 1 else 1.0
    whole = bool(np.all(values[:1000] == np.rint(values[:1000])))
    if period > _LONGEST_S or (not period and whole and step >= 500):
        cycle = period or 50.0 * step
        ticks = ((3e7, 1e-9, "nanoseconds"), (3e4, 1e-6, "microseconds"), (0, 1e-3, "milliseconds"))
        factor, name = next((size, name) for least, size, name in ticks if cycle > least)
        seen = f"a period of {period:.4g}" if period else f"steps of {step:.4g}"
        note = f"'{column.label}' has no unit: taken to be {name} by {seen} (--unit s: for seconds)"
        return factor, note, True
    if 0.0 < period < _SHORTEST_S < 86400.0 * period < _LONGEST_S * 1e3:
        dated = 2e4 < float(np.abs(values).max(initial=0.0)) < 1e6
        note = f"'{column.label}' is taken to be in days, as spreadsheets count (--unit s: for s)"
        return 86400.0, note, not dated
    note = f"'{column.label}' is taken to be in seconds"
    weak = whole or not 0.02 < period < 60.0
    if weak and period:
        return 1.0, f"{note}: a period of {period:.4g} s (--unit ms: for milliseconds)", True
    return 1.0, note, False


def _in_order(table: Table, choice: Choice, base: TimeBase, tick: float) -> TimeBase:
    """Turn times that are out of order, or repeat, into times that rise; or refuse them."""
    if len(base.time_s) and one_way(base.time_s) > 0.95 and base.time_s[-1] < base.time_s[0]:
        base.time_s, base.rows = base.time_s[::-1].copy(), base.rows[::-1].copy()
        base.notes.append("the newest row stands first: rows turned round")
    if len(base.time_s) and abs(base.time_s[0]) > _EPOCH:
        start = float(base.time_s[0])
        base.metadata["recorded_at"] = f"{start:.6f} s since 1970"
        base.notes.append(f"times are counted from the first row ({start:.6f} s on its clock)")
        base.time_s = base.time_s - start
    if not len(base.time_s) or np.diff(base.time_s).min(initial=1.0) > 0:
        return base
    even = _rounded(base.time_s)
    if even is not None:
        frames = round((even[-1] - even[0]) / np.diff(even).min()) + 1 - len(even)
        base.time_s = even
        lost = f", with {frames} missing" if frames else ""
        base.notes.append(
            "time stamps are rounded and repeat: rows are counted at"
            f" {1.0 / np.diff(even).min():.6g} Hz{lost}, which all stamps agree with"
        )
        return base
    last = _last_of_each(choice, base)
    if last is not None:
        merged = len(base.rows) - int(last.sum())
        base.time_s, base.rows = base.time_s[last], base.rows[last]
        base.notes.append(f"{merged} count(s) within one tick of the clock merged with the next")
        return base
    _drop_repeats(choice, base)
    _first_of_stacked(base)
    _sorted(choice, base)
    steps = np.diff(base.time_s)
    if not len(steps) or steps.min() > 0:
        return base
    at = int(np.argmax(steps <= 0))
    verb = "repeats" if steps[at] == 0 else "falls"
    before, after = base.time_s[at] / tick, base.time_s[at + 1] / tick
    raise InputError(
        table.where(int(base.rows[at + 1])),
        f"the time {verb} ({before:.10g} is followed by {after:.10g})",
        "correct the rows, or give --sample-rate if they are evenly spaced",
    )


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
        base.notes.append(f"{again.sum()} row(s) that repeat the time of an earlier row left out")
        base.time_s, base.rows = base.time_s[~again], base.rows[~again]


def _first_of_stacked(base: TimeBase) -> None:
    """Keep the first of several runs that stand below one another, each from its own start."""
    starts = np.flatnonzero(np.diff(base.time_s) < 0) + 1
    if not len(starts):
        return
    edges = np.concatenate(([0], starts, [len(base.time_s)]))
    lengths = np.diff(edges)
    again = np.abs(base.time_s[starts] - base.time_s[0]) < 0.05 * np.ptp(base.time_s)
    if len(starts) > 50 or lengths.min() < 50 or not again.all():
        return
    base.weak_guesses.append(
        f"{len(lengths)} runs stand below one another: the first is read ({lengths[0]} rows);"
        " put each into a file of its own for the others"
    )
    base.time_s, base.rows = base.time_s[: starts[0]], base.rows[: starts[0]]


def _sorted(choice: Choice, base: TimeBase) -> None:
    """Sort rows that came out of order (threads, radio), where that makes the motion smooth."""
    order = np.argsort(base.time_s, kind="stable")
    steps = np.diff(base.time_s[order])
    values = choice.readings[0].values if choice.readings else np.empty(0)
    if np.all(np.diff(order) == 1) or len(values) <= base.rows.max(initial=0):
        return
    even = float(np.mean(np.abs(steps - np.median(steps)) <= 0.2 * np.median(steps)))
    before, after = (
        float(np.nansum(np.abs(np.diff(values[rows])))) for rows in (base.rows, base.rows[order])
    )
    if steps.min(initial=1.0) <= 0 or even < 0.9 or after > 0.8 * before:
        return
    moved = int(np.sum(order != np.arange(len(order))))
    base.notes.append(f"{moved} row(s) out of order: sorted by time")
    base.time_s, base.rows = base.time_s[order], base.rows[order]


def _rounded(time: FloatArray) -> FloatArray | None:
    """Undo the rounding of evenly spaced time stamps; ``None`` if they are not that.

    Each row is counted one interval after the row above, or, where a stamp shows that frames
    are missing, as many as bring it within the stamp's last digit. The interval with which
    fewest are missing is right.
    """
    steps = np.diff(time)
    if len(time) < 10 or steps.min() < 0 or np.mean(steps == 0) < 0.02:
        return None
    # A clock's own jitter comes on top: a tenth of an interval.
    digit = _last_digit(time) + 0.15 * float(time[-1] - time[0]) / len(time)
    index = np.arange(len(time), dtype=np.float64)
    even: FloatArray = np.polynomial.Polynomial.fit(index, time, 1, w=1.0 / digit)(index)
    if np.all(np.abs(time - even) <= 0.6 * digit):
        return even if even[-1] > even[0] else None
    # The first stamps are the finest.
    early = time[: max(10, min(30, int(np.argmax(steps == 0))))]
    best: FloatArray | None = None
    for change in (0.0, 1e-3, -1e-3, 5e-3, -5e-3, 1e-2, -1e-2):
        found = _frames(time, digit, (1.0 + change) * float(np.median(np.diff(early))))
        # Fewest frames in all is the longest interval.
        if found is not None and (best is None or np.diff(found).min() > np.diff(best).min()):
            best = found
    return best


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


def _frames(time: FloatArray, digit: FloatArray, interval: float) -> FloatArray | None:
    """Count the frames from the first row to each, improving their interval on the way.

    Returns
    -------
    time_s
        ``None`` where some stamp contradicts the count, or more than 2 % are missing: of
        so many any interval would do.
    """
    if not interval > 0:
        return None
    index = np.arange(len(time), dtype=np.float64)
    start = float(time[0])
    for _ in range(8):
        # At least one more than the row above, and at least what the stamp asks for.
        least = np.ceil((time - start - 0.6 * digit) / interval - 1e-9)
        count = index + np.maximum.accumulate(np.maximum(least - index, 0.0))
        if count[-1] > 1.02 * len(time) + 3:
            return None
        even: FloatArray = start + interval * count
        if np.all(np.abs(even - time) <= 0.6 * digit):
            return even
        fitted = np.polynomial.Polynomial.fit(count, time, 1, w=1.0 / digit).convert()
        start, interval = float(fitted.coef[0]), float(fitted.coef[1])
        if not interval > 0:
            return None
    return None


def _last_of_each(choice: Choice, base: TimeBase) -> BoolArray | None:
    """For one row a count: of the rows in one tick of the clock keep the last."""
    values = choice.readings[0].values if choice.readings else None
    if values is None or len(values) <= base.rows.max() or np.any(np.diff(base.time_s) < 0):
        return None
    jumps = np.abs(np.diff(values[base.rows]))
    count = float(np.median(jumps))
    if count == 0 or np.mean(np.abs(jumps - count) < 0.01 * count) < 0.9:
        return None
    return np.append(np.diff(base.time_s) > 0, True)
