"""Spreadsheet exports of WinDaq: ``Relative Time,Date,...`` with units for names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.formats.layout import Layout, column_of_clock_times
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, Marker, NotThisFormatError, Table
from pendpipe.formats.text import decode, table_of_text
from pendpipe.formats.words import unit_of

_CLOCKS = ("time stamp", "timestamp", "clock")


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read an export; its columns are named by their units, so they go by their place.

    Relative Time is rounded to microseconds: times are the index over the rate, where the
    rounding allows. The last column holds ``Resume`` or a comment at an event; what the
    clock columns gained over Relative Time there is the pause.
    """
    if b"elative Time" not in data[:4096].replace(b"\0", b""):
        raise NotThisFormatError("there is no line that begins with 'Relative Time'")
    text = decode(data)
    lines = text.split("\n")
    starts = (n for n, line in enumerate(lines) if re.match(r"\W*relative time", line, re.I))
    top = next(starts, None)
    if top is None:
        raise NotThisFormatError("there is no line that begins with 'Relative Time'")
    table = table_of_text(place, text, options, "windaq-csv")
    sign = ";" if ";" in lines[top] else "\t" if "\t" in lines[top] else ","
    layout = Layout(sign, ",", 0) if sign == ";" else Layout(sign, ".", 0)
    names = [name.strip() for name in layout.split(lines[top])]
    rows = [
        layout.split(lines[line - 1]) for line in (table.lines if table.lines is not None else ())
    ]
    time = next((column for column in table.columns if column.number == 1), None)
    if time is None or time.fault is not None or not np.isfinite(time.values).all():
        return table
    events, clock, date = (_cells(names, rows, words) for words in (("event",), _CLOCKS, ("date",)))
    seconds, pauses = _with_pauses(_evened(time.values), events, clock)
    columns: list[Column] = []
    for column in table.columns:
        label = names[column.number - 1] if column.number <= len(names) else ""
        if (
            column is time
            or label.lower().startswith(("date", *_CLOCKS))
            or "event" in label.lower()
        ):
            continue
        place_of = len(columns) + 1
        unit = label if unit_of(label) else ""
        columns.append(
            replace(column, name=f"channel {place_of}", unit=unit or label, time_s=seconds)
        )
    metadata = dict(table.metadata)
    if date and clock and date[0] and clock[0]:
        metadata["recorded_at"] = f"{date[0]} {clock[0]}"
    return replace(
        table,
        columns=tuple(columns),
        markers=tuple(
            Marker(row, float(seconds[row]), text) for row, text in enumerate(events) if text
        ),
        metadata=metadata,
        notes=(*table.notes, *pauses),
    )


def _cells(names: Sequence[str], rows: Sequence[Sequence[str]], words: Sequence[str]) -> list[str]:
    """Cells of the first column, but for Relative Time, whose name has one of the words."""
    found = (i for i, name in enumerate(names) if i and any(word in name.lower() for word in words))
    place = next(found, None)
    if place is None:
        return [""] * len(rows)
    return [row[place] if place < len(row) else "" for row in rows]


def _evened(time: FloatArray) -> FloatArray:
    """Undo the rounding of evenly spaced times, if it is no more than that."""
    if len(time) < 3:
        return time
    rate = (len(time) - 1) / (time[-1] - time[0]) if time[-1] > time[0] else 0.0
    if not rate:
        return time
    # WinDaq's rates are mostly whole: take the whole one if it fits as well.
    for candidate in (float(round(rate)), rate):
        if candidate <= 0:
            continue
        even: FloatArray = time[0] + np.arange(len(time), dtype=np.float64) / candidate
        if np.abs(even - time).max() <= 1.5e-6:
            return even
    return time


def _with_pauses(
    time: FloatArray, events: Sequence[str], clock: Sequence[str]
) -> tuple[FloatArray, list[str]]:
    """Put the pauses back at rows marked ``Resume``, from the clock column's seconds."""
    clock_s = column_of_clock_times(clock)
    time, notes = time.copy(), []
    for row, event in enumerate(events):
        if row == 0 or clock_s is None or event.lower() != "resume":
            continue
        missing = (clock_s[row] - clock_s[row - 1]) - (time[row] - time[row - 1])
        if missing > 1.0:
            time[row:] += missing
            notes.append(f"pause of {missing:.0f} s before row {row + 1}, by the clock column")
    return time, notes
