"""From a time column, or a rate, to seconds that rise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.errors import InputError
from pendpipe.formats.choose import Choice, oscillation
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, Table
from pendpipe.formats.units import plain, unit_of

_EPOCH: Final = 3e8
"""Seconds beyond which a clock counts from a date (1979 in Unix time), not a start."""


@dataclass(frozen=True)
class TimeBase:
    """Times of the rows that are kept, shape (n,); which rows those are; what was done."""

    time_s: FloatArray
    keep: BoolArray
    notes: tuple[str, ...]
    metadata: dict[str, str]


def time_base(table: Table, choice: Choice, options: ReadOptions) -> TimeBase:
    """Find the time of every row.

    In this order: the rate that the user gives, the instrument's own clock, the time
    column (in the unit told, or the one that its steps suggest), a column that counts
    samples with the rate in the header, the rate in the header alone.

    Raises
    ------
    InputError
        When there is no time, or it falls, repeats or is no number: file, line, remedy.
    """
    reading = choice.readings[0] if choice.readings else table.columns[0]
    every = np.ones(len(reading.values), dtype=bool)
    if options.sample_rate is not None:
        time: FloatArray = np.arange(len(every), dtype=np.float64) / options.sample_rate
        note = f"times are counted at the given {options.sample_rate:g} Hz from the first row"
        return TimeBase(time, every, (note,), {})
    if reading.time_s is not None:
        return TimeBase(reading.time_s, every, (), {})
    column = choice.time
    if column is not None and not choice.counts:
        every = _filled(column, reading)
        _refuse_holes(table, column, every)
        factor, note = _unit(column, reading, options)
        notes = [note] if note else []
        if not every.all():
            notes.append(f"{np.sum(~every)} row(s) with neither time nor reading left out")
        return _in_order(table, choice, column.values * factor, factor, notes, every)
    if table.interval_s is not None:
        note = f"no time column: times from the header's {1 / table.interval_s:g} Hz"
        if column is None:
            return TimeBase(
                np.arange(len(every), dtype=np.float64) * table.interval_s, every, (note,), {}
            )
        _refuse_holes(table, column, every)
        time = (column.values - column.values[0]) * table.interval_s
        notes = [f"{note} and '{column.label}'"]
        return _in_order(table, choice, time, table.interval_s, notes, every)
    counted = f" ('{column.label}' only counts)" if column is not None else ""
    raise InputError(
        table.place,
        f"there is no time column and no sample rate{counted}",
        "give --sample-rate, or name the time with --column TIME:READING",
    )


def _filled(column: Column, reading: Column) -> BoolArray:
    """Find the rows that have a time or a reading: of runs side by side one is shorter."""
    every = np.ones(len(column.values), dtype=bool)
    if column.blank is not None and reading.blank is not None:
        every &= ~(column.blank & reading.blank)
    return every


def _refuse_holes(table: Table, column: Column, rows: BoolArray) -> None:
    if column.fault is not None:
        row, text = column.fault
        raise InputError(table.where(row), f"'{text}' is no number", "mend or drop the row")
    bad = np.flatnonzero(~np.isfinite(column.values) & rows)
    if bad.size:
        raise InputError(
            table.where(int(bad[0])), "the time is missing or NaN", "mend or drop the row"
        )


def _unit(column: Column, reading: Column, options: ReadOptions) -> tuple[float, str]:
    """Find the seconds in one unit of the time column, and what to say of it."""
    if options.time_unit is not None:
        told = unit_of(options.time_unit)
        if told is None or told.kind != "time":
            raise InputError(
                "--unit", f"'{options.time_unit}' is no unit of time", "give s, ms, us"
            )
        return told.factor, ""
    for word in (column.unit, column.name):
        unit = unit_of(word) if word else None
        if unit is not None and unit.kind == "time" and plain(word) not in ("t", "h", "min"):
            return unit.factor, ""
        if unit is not None and unit.kind == "time" and word == column.unit:
            return unit.factor, ""
    values = column.values[np.isfinite(column.values)]
    step = float(np.median(np.abs(np.diff(values)))) if len(values) > 1 else 1.0
    if not np.all(values[:1000] == np.rint(values[:1000])):
        return 1.0, f"'{column.label}' is taken to be in seconds"
    if step >= 1e6:
        return 1e-9, f"'{column.label}' is taken to be in nanoseconds (steps of {step:g})"
    if step >= 500:
        return 1e-6, f"'{column.label}' is taken to be in microseconds (steps of {step:g})"
    if step > 1 or _samples_per_swing(reading.values) > 25:
        return 1e-3, f"'{column.label}' is taken to be in milliseconds (steps of {step:g})"
    return 1.0, f"'{column.label}' is taken to be in seconds"


def _samples_per_swing(values: FloatArray) -> float:
    """Samples between crossings of the mean: 25 a half cycle at 1 Hz would be a minute."""
    finite = values[np.isfinite(values)]
    if oscillation(finite) == 0:
        return 0.0
    crossings = int(np.count_nonzero(np.diff(np.signbit(finite - finite.mean()))))
    return len(finite) / (crossings or 1)


def _in_order(
    table: Table,
    choice: Choice,
    time: FloatArray,
    tick: float,
    notes: list[str],
    rows: BoolArray,
) -> TimeBase:
    """Refuse a time that falls or repeats, unless a repeat is harmless and can be told."""
    metadata: dict[str, str] = {}
    if len(time) and abs(time[0]) > _EPOCH:
        metadata["recorded_at"] = f"{time[0]:.6f} s since 1970"
        notes.append(f"times are counted from the first row ({time[0]:.6f} s on the file's clock)")
        time = time - time[0]
    keep = rows.copy()
    repeated = _repeated_rows(choice, time)
    if repeated.any():
        keep &= ~repeated
        notes.append(f"{repeated.sum()} row(s) that repeat the row above left out")
    steps = np.diff(time[keep])
    if len(steps) and steps.min() <= 0:
        rebuilt = _rounded(time[keep])
        if rebuilt is not None:
            notes.append("time stamps are rounded and repeat: times are evened out")
            return TimeBase(rebuilt, keep, tuple(notes), metadata)
        counted = _last_of_each(choice, time, keep)
        if counted is not None:
            notes.append(
                f"{keep.sum() - counted.sum()} count(s) within one tick of the clock merged with"
                " the next"
            )
            return TimeBase(time[counted], counted, tuple(notes), metadata)
        kept = np.flatnonzero(keep)
        at = int(np.argmax(steps <= 0))
        verb = "repeats" if steps[at] == 0 else "falls"
        before, after = time[kept[at]] / tick, time[kept[at + 1]] / tick
        raise InputError(
            table.where(int(kept[at + 1])),
            f"the time {verb} ({before:.10g} is followed by {after:.10g})",
            "mend the rows, or give --sample-rate if they are evenly spaced",
        )
    return TimeBase(time[keep], keep, tuple(notes), metadata)


def _repeated_rows(choice: Choice, time: FloatArray) -> BoolArray:
    """Find rows that say the same as the row above, time and all."""
    same = np.zeros(len(time), dtype=bool)
    same[1:] = np.diff(time) == 0
    for column in choice.channels:
        if len(column.values) == len(time):
            values = column.values
            same[1:] &= (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    return same


def _rounded(time: FloatArray) -> FloatArray | None:
    """Undo the rounding of evenly spaced time stamps; ``None`` if they are not that.

    All stamps must lie within one quantum of one straight line.
    """
    steps = np.diff(time)
    if len(time) < 10 or steps.min() < 0 or np.mean(steps == 0) < 0.02:
        return None
    quantum = float(steps[steps > 0].min())
    line = np.polynomial.Polynomial.fit(np.arange(len(time)), time, 1)
    even: FloatArray = line(np.arange(len(time)))
    return even if np.abs(time - even).max() <= quantum else None


def _last_of_each(choice: Choice, time: FloatArray, keep: BoolArray) -> BoolArray | None:
    """For one row a count: of the rows in one tick of the clock keep the last."""
    values = choice.readings[0].values if choice.readings else None
    if values is None or len(values) != len(time) or np.any(np.diff(time[keep]) < 0):
        return None
    jumps = np.abs(np.diff(values[keep]))
    count = float(np.median(jumps))
    if count == 0 or np.mean(np.abs(jumps - count) < 0.01 * count) < 0.9:
        return None
    rows = np.flatnonzero(keep)
    last = np.append(np.diff(time[keep]) > 0, True)
    out = np.zeros(len(time), dtype=bool)
    out[rows[last]] = True
    return out
