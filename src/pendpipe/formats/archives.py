"""Zip archives: Excel workbooks, exports of phyphox (CSV in a zip), Tracker's .trz."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, Final

from pendpipe.errors import InputError
from pendpipe.formats.matlab import most_unpacked
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import NotThisFormatError, Table
from pendpipe.formats.text import read_table as read_text
from pendpipe.formats.text import table_of_text

_MOST_ROWS: Final = 1 << 20
"""What a sheet has, and no more."""
_MOST_CELLS: Final = 1_000_000
_WIDEST: Final = 1024
_OLD_EXCEL: Final = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the workbook's sheet, or the archive's table, that holds most numbers.

    Raises
    ------
    NotThisFormatError
        When the file is no zip archive.
    InputError
        When it is one that can't be read, or holds no table.
    """
    if data.startswith(_OLD_EXCEL):
        return _of_workbook(place, data, options)
    if not data.startswith(b"PK"):
        raise NotThisFormatError("the file is no zip archive")
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = archive.infolist()
        whole = sum(part.file_size for part in parts)
        if whole > most_unpacked(len(data)):
            raise ValueError(f"it unpacks to {whole >> 20} MB")
        names = [part.filename for part in parts]
        if not any(name.startswith("xl/") for name in names):
            members = _tables(place, archive, names)
    if any(name.startswith("xl/") for name in names):
        return _of_workbook(place, data, options)
    return _of_members(place, members, options)


def _tables(place: Path, archive: zipfile.ZipFile, names: list[str]) -> dict[str, bytes]:
    """Unpack the members that may hold samples; phyphox puts remarks into ``meta/``."""
    if "content.xml" in names:
        raise InputError(place, "this is an OpenDocument table", "save it as .xlsx or CSV")
    if any(name.lower().endswith((".cap", "main.xml")) for name in names) or any(
        re.match(r"data/.*\.tmp$", name) for name in names
    ):
        raise InputError(
            place, "this is a project of PASCO Capstone", "export its data as CSV or text"
        )
    wanted = (".csv", ".tsv", ".txt", ".dat", ".trk")
    return {
        name: archive.read(name)
        for name in names
        if name.lower().endswith(wanted)
        and not name.startswith(("meta/", "__MACOSX/"))
        and "/meta/" not in name
    }


def _of_members(place: Path, members: dict[str, bytes], options: ReadOptions) -> Table:
    """Read the table of an archive with most rows; name the others."""
    tables: dict[str, Table] = {}
    reason = "it holds no CSV"
    for name, content in members.items():
        try:
            if name.lower().endswith(".trk"):
                from pendpipe.formats.xml_tables import read_table as read_xml

                tables[name] = read_xml(place, content, options)
            else:
                tables[name] = read_text(place, content, options)
        except (NotThisFormatError, InputError) as fault:
            reason = f"{name}: {getattr(fault, 'problem', fault)}"
    if not tables:
        raise InputError(place, f"the archive has no table ({reason})", "give the file in it")
    best = max(tables, key=lambda name: len(tables[name].columns[0].values))
    others = [name for name in tables if name != best]
    note = f"'{best}' of the archive" + (f" (not {', '.join(others[:8])})" if others else "")
    return replace(tables[best], notes=(note, *tables[best].notes))


def _of_workbook(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the sheet with most numbers as the text that it would export."""
    sheets = dict(_old_sheets(data) if data.startswith(_OLD_EXCEL) else _sheets(data))
    numbers = {
        title: sum(_is_number(cell) for row in rows for cell in row)
        for title, rows in sheets.items()
    }
    best = max(numbers, key=lambda title: numbers[title], default=None)
    if best is None or not numbers[best]:
        raise InputError(place, "no sheet holds numbers", "give the workbook with the samples")
    width = max(map(len, sheets[best]))
    rows = (list(row) + [None] * (width - len(row)) for row in sheets[best])
    text = "\n".join("\t".join(map(_written, row)) for row in rows) + "\n"
    plain = ReadOptions(**{**vars(options), "delimiter": "\t"})
    try:
        table = table_of_text(place, text, plain, "excel")
    except NotThisFormatError as reason:
        raise InputError(
            place, f"sheet '{best}': {reason}", "give time and angle as columns"
        ) from None
    others = [title for title, count in numbers.items() if title != best and count]
    note = f"sheet '{best}'" + (f" (not {', '.join(others)})" if others else "")
    return replace(table, notes=(note, *table.notes[1:]))


def _sheets(data: bytes) -> Iterator[tuple[str, list[Any]]]:
    """Give the rows of each sheet of a workbook."""
    import warnings

    from openpyxl import load_workbook

    _refuse_too_many_cells(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for sheet in load_workbook(io.BytesIO(data), read_only=True, data_only=True):
            if hasattr(sheet, "values"):
                yield sheet.title, _rows(sheet)


def _old_sheets(data: bytes) -> Iterator[tuple[str, list[Any]]]:
    """Give the rows of each sheet of an old workbook (.xls), as phyphox writes it."""
    import xlrd

    with xlrd.open_workbook(file_contents=data, logfile=io.StringIO()) as book:
        for sheet in book.sheets():
            yield (
                sheet.name,
                [
                    [
                        xlrd.xldate_as_datetime(cell.value, book.datemode)
                        if cell.ctype == xlrd.XL_CELL_DATE
                        else cell.value
                        if cell.value != ""
                        else None
                        for cell in row
                    ]
                    for row in sheet.get_rows()
                ],
            )


def _refuse_too_many_cells(data: bytes) -> None:
    """Count the cells of all sheets before openpyxl makes objects of them."""
    cells = 0
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for name in archive.namelist():
            if not re.match(r"xl/(worksheets/.*|sharedStrings)\.xml$", name):
                continue
            with archive.open(name) as sheet:
                while chunk := sheet.read(1 << 20):
                    cells += chunk.count(b"<c ") + chunk.count(b"<c>") + chunk.count(b"<si>")
                    if cells > _MOST_CELLS:
                        raise ValueError(f"it has more than {_MOST_CELLS} cells")


def _rows(sheet: Any) -> list[tuple[Any, ...]]:
    """Read the filled rows; their number and width in the file are not trusted."""
    sheet.reset_dimensions()
    rows = islice(sheet.values, _MOST_ROWS + 1)
    filled = []
    for number, row in enumerate(rows, start=1):
        if number > _MOST_ROWS:
            raise ValueError("a row's number is beyond the last row")
        width = len(row)
        while width and row[width - 1] is None:
            width -= 1
        if width > _WIDEST:
            raise ValueError(f"row {number} has {width} cells")
        if width:
            filled.append(row[:width])
    return filled


def _is_number(cell: Any) -> bool:
    """Say whether a cell holds a number, or a text that is one."""
    if isinstance(cell, str):
        return re.fullmatch(r"\s*[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?\s*", cell) is not None
    return isinstance(cell, int | float)


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
