"""Tables in text files: CSV, TSV and their many relatives."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError
from pendpipe.formats.cells import all_numbers, column_of_clock_times, column_of_numbers
from pendpipe.formats.header import Header, read_header
from pendpipe.formats.layout import Layout, first_row, guess_layout, is_comment
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, NotThisFormatError, Table

_CONTROLS: Final = bytes([*range(1, 9), *range(14, 27)])
_WIDEST: Final = 64
"""Cells that a row may have, however narrow the others are; else at most four times theirs."""


def decode(data: bytes) -> str:
    """Turn a file's bytes into text: UTF-8, UTF-16 with its mark, else Windows-1252.

    Raises
    ------
    NotThisFormatError
        When the bytes are no text.
    """
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return _unified(data.decode("utf-16", errors="replace"))
    head = data[:65536]
    if b"\0" in head or len(head) - len(head.translate(None, _CONTROLS)) > len(head) // 50:
        raise NotThisFormatError("the bytes are no text")
    try:
        return _unified(data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        return _unified(data.decode("cp1252", errors="replace"))


def _unified(text: str) -> str:
    return text.lstrip("\ufeff").replace("\r\n", "\n").replace("\r", "\n")


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read a table from a text file, whatever its layout."""
    return table_of_text(place, decode(data), options, "csv")


def table_of_text(place: Path, text: str, options: ReadOptions, form: str) -> Table:
    """Read the table that is in `text`; `form` is the format's name for the user."""
    lines = text.split("\n")
    layout = guess_layout(lines, options)
    first = first_row(lines, layout)
    header = read_header(place, lines[:first], layout)
    found = _at_once(lines, first, layout, header)
    if found is None:
        rows, numbers, notes = _rows(lines, first, layout)
        if not rows:
            raise InputError(place, "there are no samples", "record again, or give another file")
        found = _columns(place, rows, numbers, layout, header)
    else:
        numbers, notes = np.arange(first + 1, first + 1 + len(found[0].values)), []
    return Table(
        place=place,
        format=form,
        columns=tuple(found),
        lines=numbers,
        interval_s=header.interval_s,
        metadata=header.metadata,
        notes=(layout.spoken, *header.notes, *notes),
    )


def _at_once(
    lines: Sequence[str], first: int, layout: Layout, header: Header
) -> list[Column] | None:
    """Read a block of nothing but numbers, a row a line; ``None`` if it is anything else."""
    last = len(lines)
    while last > first and not lines[last - 1].strip():
        last -= 1
    table = all_numbers(lines[first:last], layout)
    # A blank line is passed over in silence: then the rows' lines are to be found.
    if table is None or len(table) != last - first:
        return None
    return [_column(header, place, values) for place, values in enumerate(table.T)]


def _rows(
    lines: Sequence[str], first: int, layout: Layout
) -> tuple[list[str], IntArray, list[str]]:
    """Pick the rows of the block, with their line numbers; say what is left out."""
    rows: list[str] = []
    numbers: list[int] = []
    remarks = 0
    for number, line in enumerate(lines[first:], start=first + 1):
        if not line or line.isspace():
            continue
        if is_comment(line):
            remarks += 1
            continue
        rows.append(line)
        numbers.append(number)
    footer = 0
    while rows and not any(map(layout.is_number, layout.split(rows[-1]))):
        rows.pop()
        numbers.pop()
        footer += 1
    notes = [f"{footer} line(s) of text after the last row left out"] if footer else []
    if remarks:
        notes.append(f"{remarks} comment line(s) between the rows left out")
    return rows, np.array(numbers, dtype=np.int64), notes


def _columns(
    place: Path, rows: list[str], numbers: IntArray, layout: Layout, header: Header
) -> list[Column]:
    """Turn the rows into columns with the header's names."""
    table = all_numbers(rows, layout)
    if table is not None:
        return [_column(header, column, values) for column, values in enumerate(table.T)]
    cells = [layout.split(row) for row in rows]
    width = max(layout.width, max(map(len, cells)))
    if width > max(_WIDEST, 4 * layout.width):
        row = int(np.argmax([len(row) for row in cells]))
        raise InputError(
            f"{place}, line {numbers[row]}", f"{width} cells in a row", "mend or drop the row"
        )
    columns = []
    for column in range(width):
        texts = [row[column] if column < len(row) else "" for row in cells]
        values, blank, fault = column_of_numbers(texts, layout)
        if np.isfinite(values).any():
            columns.append(_column(header, column, values, blank if blank.any() else None, fault))
            continue
        clock = column_of_clock_times(texts)
        if clock is not None:
            name = header.names[column] if column < len(header.names) else ""
            columns.append(Column(name or "time", "s", clock, column + 1))
    return columns


def _column(
    header: Header,
    place: int,
    values: FloatArray,
    blank: np.ndarray[tuple[int], np.dtype[np.bool_]] | None = None,
    fault: tuple[int, str] | None = None,
) -> Column:
    known = place < len(header.names)
    return Column(
        name=header.names[place] if known else "",
        unit=header.units[place] if known else "",
        values=np.ascontiguousarray(values),
        number=place + 1,
        blank=blank,
        fault=fault,
    )
