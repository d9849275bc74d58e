"""Cells of text into columns of numbers, quickly, with the place of what is no number."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.formats.layout import BLANK_CELLS, Layout

_CLOCK: Final = re.compile(
    r"(?:(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})[T ]+)?(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d+)?))?"
    r"\s*(am|pm)?\s*(?:z|utc|[+-]\d{2}:?\d{2})?",
    re.I,
)


def all_numbers(rows: Sequence[str], layout: Layout) -> FloatArray | None:
    """Read rows that hold nothing but numbers; ``None`` where they hold anything else."""
    if any('"' in row for row in rows[:3]):
        return None
    if layout.decimal == ",":
        rows = [row.replace(",", ".") for row in rows]
    delimiter = None if layout.delimiter == " " else layout.delimiter
    try:
        return np.loadtxt(rows, delimiter=delimiter, comments=None, ndmin=2, dtype=np.float64)
    except ValueError:
        return None


def column_of_numbers(
    cells: Sequence[str], layout: Layout
) -> tuple[FloatArray, BoolArray, tuple[int, str] | None]:
    """Turn one column into numbers.

    Returns
    -------
    values, blank, fault
        The numbers (NaN where there is none), which cells are empty, and row and text of
        the first cell that is neither empty nor a number.
    """
    if layout.decimal == ",":
        cells = [cell.replace(",", ".") for cell in cells]
    blank = np.array([cell.lower() in BLANK_CELLS for cell in cells], dtype=bool)
    if not blank.any():
        try:
            return np.array(cells, dtype=np.float64), blank, None
        except ValueError:
            pass
    values = np.full(len(cells), np.nan)
    fault = None
    for row in np.flatnonzero(~blank).tolist():
        try:
            values[row] = float(cells[row].lower().replace("d", "e"))
        except ValueError:
            if fault is None:
                fault = (row, cells[row])
    return values, blank, fault


def column_of_clock_times(cells: Sequence[str]) -> FloatArray | None:
    """Turn ``12:34:56.7`` or ``2024-05-01T12:34:56`` into seconds; ``None`` if they are not.

    Times of day that pass midnight go on; dates are counted from 1 January 1970.
    """
    import datetime as dt

    if not cells or _CLOCK.fullmatch(cells[0].strip()) is None:
        return None
    seconds = np.empty(len(cells))
    days: dict[tuple[str, str, str], int] = {}
    for row, cell in enumerate(cells):
        match = _CLOCK.fullmatch(cell.strip())
        if match is None:
            return None
        year, month, day, hour, minute, second, half = match.groups()
        date = 0
        if year:
            try:
                date = days.setdefault(
                    (year, month, day), dt.date(int(year), int(month), int(day)).toordinal()
                )
            except ValueError:
                return None
        hours = int(hour) % 12 + 12 * (half.lower() == "pm") if half else int(hour)
        of_day = 3600 * hours + 60 * int(minute) + float((second or "0").replace(",", "."))
        seconds[row] = 86400.0 * (date - 719163 if date else 0) + of_day
    if seconds.max() < 86400:
        seconds += 86400.0 * np.cumsum(np.diff(seconds, prepend=seconds[0]) < -43200)
    return seconds
