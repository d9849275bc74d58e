"""Files of other programs: workbooks, zips (phyphox), XML (CASSY Lab, Logger Pro, Tracker)."""

import io
import re
import xml.etree.ElementTree as ET
import zipfile
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.errors import InputError, refuse_if
from pendpipe.formats.lists import SETTINGS, STATES, WAVEFORM, holds_settings
from pendpipe.formats.table import (
    ABSURD,
    FEWEST_ROWS,
    Column,
    NotThisFormatError,
    ReadOptions,
    Table,
    damaged_if,
    zip_archive,
)
from pendpipe.formats.text import read_table as read_text, table_of_text

_MOST_ROWS: Final = 1 << 20
"""What a sheet has, and no more."""
_MOST_CELLS: Final = 600_000
"""150,000 rows of four columns; openpyxl takes 5 microseconds a cell."""
_MOST_TABLES: Final = 200
"""Tables of an archive: a class's recordings. To tell that a text is none takes 2 to 10 ms."""
_MOST_REPEATED: Final = 64
"""Columns that one cell of an OpenDocument table may fill: it fills the empty rest of the row."""
_Sheets = dict[str, list[list[Any]]]
OLD_EXCEL: Final = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read the workbook's sheet, or the archive's table, that holds most numbers.

    Raises
    ------
    InputError
        When it can't be read, or holds no table.
    """
    if data.startswith(OLD_EXCEL):
        return _of_sheets(place, _sheets_of_excel(data), options)
    with zip_archive(data) as archive:
        names = archive.namelist()
        if any(name.startswith("xl/") for name in names):
            _refuse_large_workbook(archive)
            return _of_sheets(place, _sheets_of_excel(data), options)
        if "content.xml" in names:
            return _of_sheets(place, _sheets_of_opendocument(archive), options)
        return _of_members(place, _tables(place, archive, names), options)


def _tables(place: Path, archive: zipfile.ZipFile, names: list[str]) -> dict[str, bytes]:
    """Unpack the members that may hold samples; phyphox puts remarks into ``meta/``."""
    refuse_if(
        any(name.lower().endswith((".cap", "main.xml")) for name in names)
        or any(re.match(r"data/.*\.tmp$", name) for name in names),
        place,
        "this is a project of PASCO Capstone",
        "export its data as CSV or text",
    )
    wanted = (".csv", ".tsv", ".txt", ".dat", ".trk", "data.xml", *STATES)
    tables = [
        name
        for name in names
        if name.lower().endswith(wanted)
        and not name.startswith(("meta/", "__MACOSX/"))
        and "/meta/" not in name
    ]
    refuse_if(
        len(tables) > _MOST_TABLES,
        place,
        f"the archive holds {len(tables)} tables",
        "unpack it, and give the files inside",
    )
    return {name: archive.read(name) for name in tables}


def _of_members(place: Path, members: dict[str, bytes], options: ReadOptions) -> Table:
    """Read the table of an archive with most rows; name the others."""
    tables: dict[str, Table] = {}
    reason = "it holds no CSV"
    for name, content in members.items():
        reader = read_project if name.lower().endswith((".trk", ".xml")) else read_text
        try:
            tables[name] = reader(place, content, options)
        except (NotThisFormatError, InputError) as fault:
            reason = f"{name}: {getattr(fault, 'problem', fault)}"
    states = [
        holds_settings(name, content[:20_000].decode("utf-8", "replace"))
        for name, content in members.items()
    ]
    refuse_if(not tables and states and all(states), place, SETTINGS, WAVEFORM)
    refuse_if(
        not tables,
        place,
        f"the archive has no table ({reason})",
        "unpack it, and give the file inside",
    )
    best = max(tables, key=lambda name: len(tables[name].columns[0].values))
    return _noted(tables[best], f"'{best}' of the archive", [n for n in tables if n != best])


def _sheets_of_excel(data: bytes) -> _Sheets:
    """Read all sheets of a workbook, .xls or .xlsx."""
    import warnings

    import pandas as pd

    with warnings.catch_warnings(), redirect_stdout(io.StringIO()):  # xlrd prints
        warnings.simplefilter("ignore")
        sheets = pd.read_excel(
            io.BytesIO(data), None, header=None, dtype=object, na_filter=False, nrows=_MOST_ROWS
        )
    return {str(title): sheet.to_numpy().tolist() for title, sheet in sheets.items()}


def _sheets_of_opendocument(archive: zipfile.ZipFile) -> _Sheets:
    """Read all sheets of an OpenDocument table, whose cells say how often they repeat.

    Cells are counted while they are read: half a megabyte may stand for gigabytes of them.
    """
    sheets: _Sheets = {}
    rows: list[list[Any]] = []
    row: list[str] = []
    cells = 0
    for nodes, (at, node) in enumerate(ET.iterparse(archive.open("content.xml"), ("start", "end"))):
        damaged_if(cells + nodes // 4 > _MOST_CELLS, f"it has more than {_MOST_CELLS} cells")
        if at == "start":
            continue
        kind = node.tag.rpartition("}")[2]
        if kind == "table-cell":
            told = {name.rpartition("}")[2]: value for name, value in node.attrib.items()}
            values = (told.get(name) for name in ("value", "date-value", "time-value"))
            value = next(filter(None, values), " ".join("".join(node.itertext()).split()))
            value = re.sub(r"^PT(\d+)H(\d+)M([\d.]+)S$", r"\1:\2:\3", value)
            many = min(int(told.get("number-columns-repeated", 1)), _MOST_REPEATED)
            row += [value] * many
            cells += many if value else 1
        elif kind == "table-row":
            rows.append("\t".join(row).rstrip("\t").split("\t"))
            row = []
            node.clear()
        elif kind == "table":
            sheets[f"{len(sheets) + 1}"], rows = rows, []
    return sheets


def _of_sheets(place: Path, sheets: _Sheets, options: ReadOptions) -> Table:
    """Read the sheet with most numbers as the text that it would export."""
    numbers = {
        title: sum(_is_number(cell) for row in sheet for cell in row)
        for title, sheet in sheets.items()
    }
    best = max(numbers, key=lambda title: numbers[title], default="")
    refuse_if(
        not numbers.get(best), place, "no sheet holds numbers", "give the workbook with the samples"
    )
    text = "\n".join("\t".join(map(_written, row)) for row in sheets[best]) + "\n"
    try:
        table = table_of_text(place, text, replace(options, delimiter="\t"), "excel")
    except NotThisFormatError as reason:
        raise InputError(
            place, f"sheet '{best}': {reason}", "give time and angle as columns"
        ) from None
    return _noted(table, f"sheet '{best}'", [t for t, n in numbers.items() if t != best and n], 1)


def _noted(table: Table, note: str, others: list[str], without: int = 0) -> Table:
    """Name the part that was read, and those that were not, before the table's other notes."""
    left = f" (not {', '.join(others[:8])})" if others else ""
    return replace(table, notes=(note + left, *table.notes), facts=table.facts[without:])


def _refuse_large_workbook(archive: zipfile.ZipFile) -> None:
    """Count cells, texts and other elements of all members before openpyxl makes objects of them.

    Of every member, whatever its path, since the workbook itself says where its sheets are; and of
    elements with any prefix. What is not UTF-8 can't be counted so.
    """
    cells = others = 0
    for name in archive.namelist():
        with archive.open(name) as member:
            chunk = rest = member.read(1 << 20)
            damaged_if(b"\0" in chunk[:4] and b"<" in chunk[:4], _NOT_UTF_8)
            damaged_if(chunk.startswith((b"\xff\xfe", b"\xfe\xff")), _NOT_UTF_8)
            if not chunk.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<"):
                continue  # a picture
            while chunk:
                # A tag that the end of a piece cuts is counted with the next.
                whole, rest = rest[: rest.rfind(b"<")], rest[rest.rfind(b"<") :]
                damaged_if(b"<!DOCTYPE" in whole, "its XML declares entities")
                elements = Counter(_ELEMENT.findall(whole))
                cells += elements[b"c"] + elements[b"si"]
                others += elements.total() - sum(elements[each] for each in _OF_A_CELL)
                damaged_if(cells > _MOST_CELLS, f"it has more than {_MOST_CELLS} cells")
                damaged_if(others > _MOST_OTHERS, f"it has more than {_MOST_OTHERS} formats")
                damaged_if(
                    _FAR_CELL.search(whole),
                    "a cell stands beyond column ZZ, or beyond the last row",
                )
                chunk = member.read(1 << 20)
                rest += chunk


_ELEMENT: Final = re.compile(rb"<(?:[^\s<>/:]+:)?([^\s<>/:?!]+)")
_FAR_CELL: Final = re.compile(
    rb"""<(?:[^\s<>/:]+:)?(?:c\s[^<>]*r=["'][A-Z]{3}|row\s[^<>]*r=["']\d{8})"""
)
_OF_A_CELL: Final = (b"c", b"v", b"f", b"is", b"t", b"si", b"row")
_MOST_OTHERS: Final = 100_000
"""Elements besides cells, above all formats: openpyxl takes 50 microseconds for one."""
_NOT_UTF_8: Final = "its XML is not UTF-8"


def _is_number(cell: Any) -> bool:
    """Say whether a cell holds a number, or a text that is one."""
    if isinstance(cell, str):
        return re.fullmatch(r"\s*[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?\s*", cell) is not None
    return isinstance(cell, int | float)


def _written(cell: Any) -> str:
    """Write a cell as CSV would: numbers in full, dates and times as ISO text."""
    return " ".join(str(cell.isoformat() if hasattr(cell, "isoformat") else cell).split())


_LARGEST = 32 << 20
"""A tree of elements takes some twenty-five times the file's memory."""


def read_project(place: Path, data: bytes, options: ReadOptions) -> Table:  # noqa: ARG001
    """Read the samples out of a project file.

    Entities are refused: none of these programs writes them, and they can be made to fill
    the memory.

    Raises
    ------
    NotThisFormatError
        When the file is no XML, or none of these programs' own.
    InputError
        When it is damaged, or holds no samples.
    """
    for wrong, what in (
        (b"<!DOCTYPE" in data or b"<!ENTITY" in data, "declares entities"),
        (len(data) > _LARGEST, f"holds more than {_LARGEST >> 20} MB"),
    ):
        refuse_if(wrong, place, f"the XML {what}", "export the data as CSV")
    try:
        root = ET.fromstring(data)
    except (ET.ParseError, ValueError, LookupError) as fault:
        raise InputError(
            place, f"the XML is damaged ({fault})", "save it again, or export CSV"
        ) from None
    if root.tag == "cassylab":
        name, found = "cassy-labx", _of_cassy(root)
    elif root.find(".//ColumnCells") is not None:
        name, found = "logger-pro", list(_of_logger_pro(root))
    elif "TrackerPanel" in root.get("class", ""):
        name, found = "tracker", _of_tracker(place, root)
    else:
        raise NotThisFormatError("the XML is none of CASSY Lab's, Logger Pro's or Tracker's")
    found = [(title, unit, values) for title, unit, values in found if len(values) >= FEWEST_ROWS]
    refuse_if(not found, place, "the project holds no samples", "export the data as CSV")
    # Runs side by side are of unlike length: the shorter end in empty cells.
    values = np.array([*zip_longest(*(each[2] for each in found), fillvalue=np.nan)], np.float64)
    return Table(
        place=place,
        format=name,
        columns=tuple(
            Column(title.strip(), unit.strip(), np.ascontiguousarray(values[:, number]), number + 1)
            for number, (title, unit, _) in enumerate(found)
        ),
    )


def _number(text: str | None) -> float:
    """Read a cell; what is empty, or a mark of a lost sample, is NaN."""
    try:
        value = float((text or "").strip().replace(",", "."))
    except ValueError:
        value = np.nan
    return value if abs(value) < ABSURD else np.nan


_Named = tuple[str, str, Sequence[float]]


def _of_cassy(root: ET.Element) -> list[_Named]:
    """Give each channel of a .labx file: quantity and symbol, unit, values; run after run.

    A file of several runs has those of one channel together, and empty ones where it was off.
    """
    found, before = list[tuple[int, _Named]](), Counter[str]()
    for channel in root.iter("channel"):
        title = f"{channel.findtext('quantity') or ''} {channel.findtext('symbol') or ''}"
        cells = [_number(cell.text) for cell in channel.find("values") or ()]
        named = (title.replace("&", ""), channel.findtext("unit") or "", cells)
        found.append((before[title], named))
        before[title] += 1
    return [named for _, named in sorted(found, key=lambda each: each[0])]


def _of_logger_pro(root: ET.Element) -> Iterator[_Named]:
    """Give each filled column of each data set."""
    for column in root.iter("DataColumn"):
        cells = (column.findtext("ColumnCells") or "").split("\n")
        values = [_number(cell) for cell in cells if cell.strip()]
        if np.isfinite(values).any():
            yield (
                column.findtext("DataObjectName") or "",
                column.findtext("ColumnUnits") or "",
                values,
            )


def _of_tracker(place: Path, root: ET.Element) -> list[_Named]:
    """Give t, x, y of the point mass with most frames, as Tracker itself would print them.

    The image's y points down; origin, scale and tilt of the axes are those of the frame.
    """
    told = {each.get("name"): each.text for each in [*root.iter("property")][::-1] if each.text}
    steps = [_number(each.text) for each in root.iter("property") if each.get("name") == "delta_t"]
    step_ms = next((step for step in steps if step > 0), np.nan)
    of: dict[str, list[dict[int, dict[str, float]]]] = {"PointMass": [{}], "ImageCoordSystem": [{}]}
    for track in root.iter("object"):
        kind = track.get("class", "").rpartition(".")[2]
        if kind in of:
            of[kind].append(_frames(track, f"{kind}$FrameData"))
    mass, axes = max(of["PointMass"], key=len), next(filter(None, of["ImageCoordSystem"]), {})
    for wrong, what in ((not mass, "has no point mass"), (not step_ms > 0, "gives no frame rate")):
        refuse_if(wrong, place, f"the project {what}", "export its data as text")
    numbers = [number for number in sorted(mass) if {"x", "y"} <= mass[number].keys()]
    # The axes of a frame are those that were set last.
    known = sorted(axes)
    places = [bisect_right(known, number) - 1 for number in numbers]
    last = [axes[known[place]] if place >= 0 else {} for place in places]
    x, y = (np.array([mass[number][axis] for number in numbers]) for axis in "xy")
    x0, y0, angle, across, up = (
        np.array([frame.get(name) or usual for frame in last], np.float64)
        for name, usual in (
            ("xorigin", 0),
            ("yorigin", 0),
            ("angle", 0),
            ("xscale", 1),
            ("yscale", 1),
        )
    )
    turned = (x - x0 + 1j * (y0 - y)) * np.exp(-1j * np.radians(angle))
    first, start_ms = _number(told.get("startframe", "0")), _number(told.get("starttime", "0"))
    time = 1e-3 * ((np.array(numbers) - first) * step_ms + start_ms)
    scaled = any(axis.get("xscale", 1.0) != 1.0 for axis in axes.values())
    unit = (told.get("length_unit") or "") if scaled else "px"
    return [("t", "s", time), ("x", unit, turned.real / across), ("y", unit, turned.imag / up)]


def _frames(track: ET.Element, kind: str) -> dict[int, dict[str, float]]:
    """Read the numbers that are kept for each frame of the video."""
    frames: dict[int, dict[str, float]] = {}
    for entry in track.iter("property"):
        place = re.fullmatch(r"\[(\d{1,9})\]", entry.get("name", ""))
        content = entry.find("object")
        if place is None or content is None or not content.get("class", "").endswith(kind):
            continue
        numbers = {
            each.get("name", ""): _number(each.text)
            for each in content.iter("property")
            if each.get("type") in ("double", "int")
        }
        # Newer versions number the entries through and keep the frame as n.
        frame = numbers.get("n", np.nan)
        frames[int(frame) if frame == frame else int(place[1])] = numbers
    return frames
