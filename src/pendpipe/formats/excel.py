"""Tables in Excel workbooks (.xlsx): each sheet is read as the text it would export."""

from __future__ import annotations

import io
import zipfile
from itertools import islice
from pathlib import Path
from typing import Any, Final

from pendpipe.errors import InputError
from pendpipe.formats.matlab_check import most_unpacked
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import NotThisFormatError, Table
from pendpipe.formats.text import table_of_text

_MOST_ROWS: Final = 1 << 20
"""What a sheet has, and no more."""


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the sheet that holds most numbers.

    Raises
    ------
    NotThisFormatError
        When the file is no workbook.
    InputError
        When it is one that can't be read, or holds no table.
    """
    if data[:8] == b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1":
        raise InputError(place, "this is an old Excel file (.xls)", "save it as .xlsx or CSV")
    if not data.startswith(b"PK"):
        raise NotThisFormatError("the file is no zip archive, as .xlsx is")
    import warnings

    from openpyxl import load_workbook

    try:
        _refuse_bomb(data)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            book = load_workbook(io.BytesIO(data), read_only=True, data_only=True)
            sheets = {sheet.title: _rows(sheet) for sheet in book if hasattr(sheet, "values")}
    except Exception as fault:  # openpyxl raises whatever the archive makes it stumble on
        raise InputError(
            place,
            f"the workbook can't be read ({str(fault)[:200]})",
            "save it again, or export CSV",
        ) from None
    numbers = {
        title: sum(isinstance(cell, int | float) for row in rows for cell in row)
        for title, rows in sheets.items()
    }
    best = max(numbers, key=lambda title: numbers[title], default=None)
    if best is None or not numbers[best]:
        raise InputError(place, "no sheet holds numbers", "give the workbook with the samples")
    text = "\n".join("\t".join(map(_written, row)) for row in sheets[best])
    plain = ReadOptions(**{**vars(options), "delimiter": "\t", "decimal": "."})
    try:
        table = table_of_text(place, text, plain, "excel")
    except NotThisFormatError as reason:
        raise InputError(
            place, f"sheet '{best}': {reason}", "give time and angle as columns"
        ) from None
    others = [title for title, count in numbers.items() if title != best and count]
    note = f"sheet '{best}'" + (f" (not {', '.join(others)})" if others else "")
    from dataclasses import replace

    return replace(table, notes=(note, *table.notes[1:]))


def _refuse_bomb(data: bytes) -> None:
    """Refuse an archive that says it holds far more than such a file can."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        whole = sum(part.file_size for part in archive.infolist())
    if whole > most_unpacked(len(data)):
        raise ValueError(f"it unpacks to {whole >> 20} MB")


def _rows(sheet: Any) -> list[tuple[Any, ...]]:
    """Read the filled rows; what the file says of their number and width is not believed."""
    sheet.reset_dimensions()
    rows = islice(sheet.values, _MOST_ROWS + 1)
    filled = []
    for number, row in enumerate(rows, start=1):
        if number > _MOST_ROWS:
            raise ValueError("a row's number is beyond the last row")
        if any(cell is not None for cell in row):
            filled.append(row)
    return filled


def _written(cell: Any) -> str:
    """Write a cell as CSV would: numbers in full, dates and times as ISO text."""
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return str(int(cell))
    if isinstance(cell, int | float):
        return repr(cell)
    if hasattr(cell, "isoformat"):
        return str(cell.isoformat())
    return " ".join(str(cell).split())
