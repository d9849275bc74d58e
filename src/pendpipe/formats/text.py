"""Tables in text files: CSV, TSV and their many relatives."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import unescape
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError
from pendpipe.formats.layout import (
    COMMENT,
    Layout,
    all_numbers,
    column_of_clock_times,
    column_of_numbers,
    first_row,
    guess_layout,
    is_comment,
)
from pendpipe.formats.table import Column, NotThisFormatError, ReadOptions, Table
from pendpipe.formats.words import role_of, split_header, unit_of

_CONTROLS: Final = bytes([*range(1, 9), *range(14, 27)])
_BLANKS: Final = "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{FIGURE SPACE}\N{THIN SPACE}"
"""What is typeset between thousands; without them whatever splits at blanks splits a number."""
_WIDEST: Final = 64
"""Cells that a row may have, however narrow the others are; else at most four times theirs."""
_EASTERN: Final = re.compile("时间|時間|角度|시간|각도|(?i:время|угол|отклонение)")
"""Words of a header by which the encodings of the East are told from one another."""
_LARGEST: Final = 512 << 20
"""Bytes of a table: ten million rows. Its lines and cells take some five times that."""
_LONGEST_LINE: Final = 1 << 20
_LONGEST_HEADER: Final = 5000


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
    for start, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        zeros = head[start::2].count(0)
        if zeros > 0.4 * len(head) and not head[1 - start :: 2].count(0):
            return _unified(data.decode(encoding, errors="replace"))
    if b"\0" in head or len(head) - len(head.translate(None, _CONTROLS)) > len(head) // 50:
        raise NotThisFormatError("the bytes are no text")
    try:
        return _unified(data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        for encoding in ("gb18030", "big5", "cp932", "cp949", "cp1251"):
            if _EASTERN.search(head.decode(encoding, errors="replace")):
                return _unified(data.decode(encoding, errors="replace"))
        return _unified(data.decode("cp1252", errors="replace"))


def _unified(text: str) -> str:
    """Give line ends, minus signs and blanks one form each."""
    for wrong in "°µ²³":  # UTF-8 that a program took for Windows-1252, and wrote anew
        text = text.replace(f"Â{wrong}", wrong)
    text = text.lstrip("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    for blank in _BLANKS:
        text = text.replace(blank, " ")
    return text.replace("\N{MINUS SIGN}", "-")


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read a table from a text file, whatever its layout."""
    if len(data) > _LARGEST:
        raise InputError(
            place, f"the table holds more than {_LARGEST >> 20} MB", "give a part of it"
        )
    return table_of_text(place, decode(data), options, "csv")


def table_of_text(place: Path, text: str, options: ReadOptions, form: str) -> Table:
    """Read the table that is in `text`; `form` is the format's name for the user."""
    lines = _without_tags(text).split("\n")
    _refuse_long(place, lines)
    for form_of in (
        _without_labview_heads,
        _side_by_side,
        _in_rows,
        _bare_cells,
        _without_cassy_limits,
        _without_panel,
        _without_split_decimals,
        _upright,
    ):
        lines = form_of(lines)
    lines = _without_labels(lines)
    layout = guess_layout(lines, options)
    first = first_row(lines, layout)
    if first > _LONGEST_HEADER:
        raise InputError(
            place,
            f"no row of numbers stands in the first {_LONGEST_HEADER} lines",
            "give a table with a row a sample",
        )
    header = read_header(place, lines[:first], layout)
    lines, cut = _without_cut_row(lines, first, layout)
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
        notes=(layout.description, *header.notes, *notes, *cut),
    )


def _without_tags(text: str) -> str:
    """Make of the tables of a web page rows with tabs."""
    if not re.match(r"\s*<(!doctype html|html|table|meta|div)\b", text[:200], re.I):
        return text
    # (No pattern here runs on over the next sign, or a hostile page would take hours.)
    text = re.sub(r"(?i)<(style|script|title)\b[^<]*", "", " ".join(text.split()))
    text = re.sub(r"(?i)</tr ?>|<br ?/? ?>", "\n", text)
    return unescape(re.sub(r"<[^<>]*>", "", re.sub(r"(?i)</t[dh] ?>(?! ?\n)", "\t", text)))


def _without_labview_heads(lines: list[str]) -> list[str]:
    """Make of the two headers that LabVIEW writes (.lvm) remarks and one row of names."""
    ends = [row for row, line in enumerate(lines[:100]) if line.startswith("***End_of_Header***")]
    if not ends or not lines[0].startswith("LabVIEW Measurement"):
        return lines
    at = ends[-1] + 1
    told = {line.split("\t")[0]: line.split("\t")[1:] for line in lines[:at]}
    units = ["s", *told.get("Y_Unit_Label", [])]
    names = [name for name in lines[at].split("\t") if name not in ("Comment", "")]
    head = [f"{n} ({u})" if u else n for n, u in zip(names, [*units, *names], strict=False)]
    bare = told.get("X_Columns") == ["No"]  # then the rows begin with an empty cell
    rows = [line[bare:].rstrip("\t") for line in lines[at + 1 :]]
    return [*("# " + line for line in lines[:at]), "\t".join(head[bare:]), *rows]


def _side_by_side(lines: list[str]) -> list[str]:
    """Put columns that Octave saves below one another beside one another."""
    if not lines[0].startswith("# Created by Octave"):
        return lines
    blocks = re.split(r"^# name: ", "\n".join(lines), flags=re.M)[1:]
    columns = [
        [b.split("\n", 1)[0], *re.findall(r"^ *([^#\s]+) *$", b.split("\n", 1)[-1], re.M)]
        for b in blocks
    ]
    longest = max(map(len, columns), default=0)
    columns = [column for column in columns if len(column) == longest]
    if longest < 5:
        return lines
    return ["\t".join(row) for row in zip(*columns, strict=True)]


def _bare_cells(lines: list[str]) -> list[str]:
    """Take off what programs and people put about numbers, where most lines have it."""
    for found, put in _CLOTHED:
        some = [line for line in lines[:100] if found.search(line)]
        if len(some) > 0.5 * len([line for line in lines[:100] if line.strip()]):
            lines = [found.sub(put, line) for line in lines]
    return lines


def _degrees(match: re.Match[str]) -> str:
    size = int(match[2]) + float(match[3]) / 60 + float(match[4] or 0) / 3600
    return f"{match[1]}{size:.9g}°"


def _stamped(match: re.Match[str]) -> str:
    sign = next((sign for sign in "\t;," if sign in match[3]), " ")
    return (match[1] or match[2]).replace(" ", "T") + sign + match[3]


_CLOCK: Final = r"(?:\d{4}-\d\d-\d\d[ T])?\d{1,2}:\d\d:\d\d(?:[.,]\d+)?"
_CLOTHED: Final[tuple[tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]], ...]] = (
    (
        re.compile(
            r"(?<![\d.])([+-]?)(\d+)\s?[°º]\s?(\d{1,2}(?:\.\d+)?)\s?['′’]"
            r"(?:\s?(\d{1,2}(?:\.\d+)?)\s?(?:\"\"?|″|''))?"
        ),
        _degrees,
    ),
    (re.compile(r"(?<=\d)\s*(?:±|\+/?-)\s*\d+(?:\.\d+|,\d+(?=[^,]*[;\t]|[^,]*$))?"), ""),
    (re.compile(r"np\.float\d\d\(([^()]*)\)"), r"\1"),
    (re.compile(r"^([^;]*\d);\s*$"), r"\1"),
    (re.compile(rf"^\s*(?:({_CLOCK})\s*->|\[({_CLOCK})\])\s*(.*)$"), _stamped),
    (re.compile(r"^\s*[\[({]+([^\[\](){}]*)[\])}]+,?\s*$"), r"\1"),
)
"""Degrees and minutes (``-12°05'30"``); errors (``± 0.1``); NumPy's types; rows that end in ``;``;
times that serial monitors put before each line (``12:03:04.5 ->``, ``[2024-05-01 12:03:04.5]``);
rows printed as lists."""


def _without_cassy_limits(lines: list[str]) -> list[str]:
    """Make of the header that CASSY Lab writes (MIN=, MAX=, SCALE=, DEC=, DEF=) a line of names."""
    if not any(line.startswith("DEF=") for line in lines[:50]):
        return lines
    head = [
        line.removeprefix("DEF=").replace('"', "").replace("&", "")
        if line.startswith("DEF=")
        else re.sub("^(?=(MIN|MAX|SCALE|DEC)=)", "# ", line)
        for line in lines[:50]
    ]
    return head + lines[50:]


_LABELLED: Final = re.compile(
    r"\s*([A-Za-z]\w*)\s*[:=]\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*[,;|]?\s*"
)


def _in_rows(lines: list[str]) -> list[str]:
    """Part a list that stands in one line."""
    if len(lines) >= 5:
        return lines
    whole = re.sub(r"^(\w+\s*=\s*)?\[\s*(?=[(\[])", "", "\n".join(lines).lstrip())
    return re.sub(r"(?<=[)\]])\s*,\s*(?=[(\[])", "\n", whole).split("\n")


_PANEL: Final = re.compile(r"([^,]*),([^,]*),([^,]*),(\s*[+-]?[\d.]+(?:[eE][+-]?\d+)?,.*)")


def _without_panel(lines: list[str]) -> list[str]:
    """Put above what Tektronix writes in three columns to the left of its first readings."""
    if not lines[0].startswith(("Record Length,", '"Record Length",')):
        return lines
    rows = [_PANEL.fullmatch(line) for line in lines]
    if any(row is None for row, line in zip(rows, lines, strict=True) if line.strip()):
        return lines
    told = {row[1].strip(): row[2].strip() for row in rows[:30] if row is not None}
    across, up = told.get("Horizontal Units", "s"), told.get("Vertical Units", "V")
    names = f"time ({across}),{told.get('Source', 'CH1')} ({up}),"
    return [names, *(row[4] if row is not None else "" for row in rows)]


def _without_split_decimals(lines: list[str]) -> list[str]:
    """Repair rows with commas in the numbers and between them: as many again as there are names."""
    head = next((row for row, line in enumerate(lines[:50]) if _SPLIT.fullmatch(line)), 0)
    cells = lines[head].split(",")
    names = lines[head - 1].split(",") if head else []
    if len(names) < 2 or len(cells) != 2 * len(names):
        return lines
    if not all(
        _SPLIT.fullmatch(line) and line.count(",") == len(cells) - 1
        for line in lines[head : head + 100]
        if line
    ):
        return lines
    rows = [re.sub(r"(\d+),(\d+)(,|$)", r"\1.\2\3", line) for line in lines[head:]]
    return [*lines[:head], *rows]


_SPLIT: Final = re.compile(r"[+-]?\d+,\d+(,[+-]?\d+,\d+)+")


def _upright(lines: list[str]) -> list[str]:
    """Turn a table that lies on its side: a few long lines, each of one quantity."""
    rows = [line for line in lines[:_FEW_LINES] if line.strip()]
    if len(lines) > _FEW_LINES or len(rows) < 2:
        return lines
    sign = max("\t;,", key=rows[0].count)
    cells = [row.strip().split(sign if sign in rows[0] else None) for row in rows]
    width = len(cells[0])
    if width < 5 * _FEW_LINES or any(len(row) != width for row in cells):
        return lines
    return ["\t".join(column) for column in zip(*cells, strict=True)]


_FEW_LINES: Final = 12


def _without_labels(lines: list[str]) -> list[str]:
    """Take names out of rows that repeat them (``t:0.01,theta:0.5``) and put them above."""
    first = next((row for row, line in enumerate(lines[:100]) if _labels(line)), None)
    if first is None:
        return lines
    names = _labels(lines[first])
    rows = [line for line in lines[first : first + 50] if line.strip()]
    if len(rows) < 4 or any(_labels(line) != names for line in rows[:-1]):
        return lines
    bare = [
        ",".join(match[2] for match in _LABELLED.finditer(line)) if _labels(line) else line
        for line in lines[first:]
    ]
    # The names take the place of the line above, so that the rows keep their numbers.
    return [*lines[: max(0, first - 1)], ",".join(names), *bare]


def _labels(line: str) -> list[str]:
    """The names in a row of names and numbers; none where it is anything else."""
    found = _LABELLED.findall(line) if ":" in line or "=" in line else []
    whole = bool(found) and not _LABELLED.sub("", line).strip()
    return [name for name, _ in found] if whole else []


def _refuse_long(place: Path, lines: Sequence[str]) -> None:
    longest = max(range(len(lines)), key=lambda number: len(lines[number]))
    if len(lines[longest]) > _LONGEST_LINE:
        raise InputError(
            f"{place}, line {longest + 1}",
            f"the line is {len(lines[longest])} letters long",
            "give a table with a row a sample",
        )


def _without_cut_row(
    lines: list[str], first: int, layout: Layout
) -> tuple[list[str], tuple[str, ...]]:
    """Leave out a last row that a power cut or a full disk has cut short.

    It has fewer cells than every other row; or no end of line, and its last number has fewer
    letters, or fewer decimals, than that of every other row.
    """
    last = len(lines) - 1
    while last > first and not lines[last].strip():
        last -= 1
    others = [line for line in lines[max(first, last - 500) : last] if line.strip()]
    if last <= first + 2 or not others or is_comment(lines[last]):
        return lines, ()
    final, rows = layout.split(lines[last]), [layout.split(line) for line in others]
    short = len(final) < min(map(len, rows))
    ended = last < len(lines) - 1
    if not ended and not final[-1] and all(row[-1] for row in rows):
        short = True
    if not short and not ended and len(final) == len(rows[-1]) and layout.is_number(final[-1]):
        sizes = [_size(row[-1], layout) for row in rows if layout.is_number(row[-1])]
        letters, decimals = _size(final[-1], layout)
        short = len(sizes) > 2 and (
            letters < min(size[0] for size in sizes) or decimals < min(size[1] for size in sizes)
        )
    if not short or not any(map(layout.is_number, final)):
        return lines, ()
    note = f"line {last + 1} is cut short: not taken for a sample"
    return lines[:last], (note,)


def _size(cell: str, layout: Layout) -> tuple[int, int]:
    """Letters of a number without its sign, and those behind its decimal sign."""
    bare = cell.lstrip("+-")
    return len(bare), len(bare.partition(layout.decimal)[2])


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
    """Pick the rows of the block, with their line numbers; report what is left out."""
    kept = [
        (number, line)
        for number, line in enumerate(lines[first:], start=first + 1)
        if line and not line.isspace()
    ]
    texts = [_text_of(line, layout) for _, line in kept]
    # What a program prints below a table (mean, deviation, number) begins with its name.
    last = max((at for at, (_, begins) in enumerate(texts) if not begins), default=len(texts))
    texts[last + 1 :] = [(True, True)] * len(texts[last + 1 :])
    # A line that begins with a word, beside one of words alone, belongs to a header.
    remarks = [
        whole or (begins and any(text[0] for text in texts[max(0, at - 1) : at + 2]))
        for at, (whole, begins) in enumerate(texts)
    ]
    rows = [entry for entry, remark in zip(kept, remarks, strict=True) if not remark]
    left = len(kept) - len(rows)
    notes = [f"{left} line(s) of text below the first row left out"] if left else []
    numbers = np.array([number for number, _ in rows], dtype=np.int64)
    return [line for _, line in rows], numbers, notes


def _text_of(line: str, layout: Layout) -> tuple[bool, bool]:
    """Say whether a line is text, as loggers print between the rows; and whether it begins so.

    A row with one cell that is no number is a row with a fault.
    """
    if _NO_TEXT.fullmatch(line) or is_comment(line):
        return (is_comment(line),) * 2
    cells = layout.split(line)
    kinds = layout.kinds(filter(None, cells))
    begins = kinds.startswith("t")
    return begins and (set(kinds) == {"t"} or len(cells) != layout.width), begins


_NO_TEXT: Final = re.compile(r"[\s\d.,;:+\-eE|/\"']*")


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
            f"{place}, line {numbers[row]}", f"{width} cells in a row", "correct or drop the row"
        )
    columns = []
    for place_of in range(width):
        texts = [row[place_of] if place_of < len(row) else "" for row in cells]
        column = column_of_numbers(texts, layout, _column(header, place_of, np.empty(0)))
        if not np.isfinite(column.values).any():
            clock = column_of_clock_times(texts)
            if clock is None:
                continue
            column = Column(column.name or "time", "s", clock, column.number)
        columns.append(column)
    return columns


def _column(header: Header, place: int, values: FloatArray) -> Column:
    known = place < len(header.names)
    name, unit = (header.names[place], header.units[place]) if known else ("", "")
    return Column(name, unit, np.ascontiguousarray(values), place + 1)


_RATE_WORD: Final = re.compile(
    r"sampl\w*[\s_\-.]*(rate|freq)|abtast(rate|freq)|frame[\s_]*rate|scan[\s_]*rate|\bfps\b|\bfs\b"
    r"|messrate|rate[\s_]*\(?hz|sampled at|(update|output|data)[\s_]*rate",
    re.I,
)
_INTERVAL_WORD: Final = re.compile(
    r"sampl\w*[\s_\-.]*(interval|period|time|step)|\bdt\b|delta[\s_]*t\b|time[\s_]*step"
    r"|abtast(zeit|intervall)|\bts\b|\bdelta_x\b|\binterval|increment|\btinc\b",
    re.I,
)
_SAMPLING: Final = re.compile(
    r"\b(sampl\w*|abtastung|aufzeichnung|acquisition|logging|échantillonnage|muestreo"
    r"|campionamento)\s*[:=@]",
    re.I,
)
"""``Sampling: 50 Hz``, ``sampling: 20 ms``: the unit alone tells which it is."""
_VALUE: Final = re.compile(r"([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)\s*([a-zµ/]*)", re.I)


@dataclass(frozen=True)
class Header:
    """Names and units (one a column, ``""`` where absent), interval, remarks."""

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    interval_s: float | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read_header(place: Path, lines: Sequence[str], layout: Layout) -> Header:
    """Read the lines above the first row of numbers.

    Raises
    ------
    InputError
        When a line under the names is a row with text where the numbers begin.
    """
    filled = [(number, line) for number, line in enumerate(lines, start=1) if line.strip()]
    names_at, cells = _names(filled, layout)
    _refuse_damaged_rows(place, filled, names_at, layout)
    interval = _interval([line for _, line in filled[-300:]])
    metadata = _metadata([line for _, line in filled])
    if not cells:
        return Header(
            (), (), interval, metadata, ("no header: columns are recognised by their values",)
        )
    notes: tuple[str, ...] = ()
    pairs = [split_header(cell) for cell in cells]
    names, units = [name for name, _ in pairs], [unit for _, unit in pairs]
    below = [line for number, line in filled if number > names_at]
    row_of_units = _row_of_units(below, layout)
    if row_of_units:
        units = [unit or own for unit, own in zip(row_of_units, units, strict=True)]
    if missing := layout.width - len(cells):
        names, units = [""] * missing + names, [""] * missing + units
        notes = (f"the header names {len(cells)} of {layout.width} columns: taken as the last",)
    return Header(tuple(_unique(names)), tuple(units), interval, metadata, notes)


def _splits(line: str, layout: Layout) -> Iterator[list[str]]:
    """Split a line of names as its rows are, and in the other ways that fit their width."""
    bare = line.strip().lstrip("".join(COMMENT)).strip()
    own = [layout.split(line), layout.split(bare)]
    yield from (cells for cells in own if len(cells) == layout.width)
    told = ": " in bare  # a remark, unless the rows' own sign splits it
    if not told and not any(map(layout.is_number, layout.split(bare))):
        # "t (s) theta (rad)", "t / s  phi / rad": a unit belongs to the name before it.
        joined = re.sub(r"\s+(?=[\[({])|\s*/\s*", lambda gap: gap[0].strip() or "\0", bare).split()
        for cells in (
            *(bare.split(sign) for sign in "\t;,|"),
            re.split(r"\s{2,}", bare),
            [cell.replace("\0", " ") for cell in joined],
        ):
            cells = [cell.strip() for cell in cells]
            while len(cells) > layout.width and not cells[-1]:
                cells.pop()
            if len(cells) == layout.width:
                yield cells
    if is_comment(line):
        yield bare.split()
    yield from own


def _are_units(cells: Sequence[str]) -> bool:
    """Say whether a row holds nothing but units: known ones, or all in brackets."""
    filled = [cell for cell in cells if cell]
    bracketed = all(re.fullmatch(r"[\[({<].*[\])}>]", cell) for cell in filled)
    return bool(filled) and (bracketed or all(map(unit_of, filled)))


def _names(filled: Sequence[tuple[int, str]], layout: Layout) -> tuple[int, list[str]]:
    """Find the line of names: the last (but for a row of units) that fits the columns."""
    candidates: list[tuple[int, int, list[str]]] = []
    for number, line in filled:
        bare = line.strip().lstrip("".join(COMMENT)).strip()
        own = layout.split(line)
        if candidates and len(own) == layout.width and all(map(layout.is_number, own)):
            break  # the block has begun: what follows is damaged
        for cells in _splits(line, layout):
            while len(cells) > layout.width and not cells[-1]:
                cells.pop()
            texts = [cell for cell in cells if any(map(str.isalpha, cell)) or "°" in cell]
            texts = [cell for cell in texts if not layout.is_number(cell)]
            if not texts or len(cells) > layout.width or len(texts) < len(cells) / 2:
                continue
            if bare.endswith(("[", "{", "(")):  # A = [
                continue
            numbered = len(cells) == layout.width - 1 and len(texts) == len(cells) > 1
            timed = numbered and role_of(split_header(cells[0])[0]) == "time"
            if len(cells) < layout.width and not is_comment(line) and not timed:
                continue
            if (candidates or layout.width < 4) and any(map(layout.is_number, cells)):
                continue
            if _are_units(cells) and candidates and candidates[-1][0] == len(cells):
                continue
            words = len(bare.split())
            titled = words > 4 or (words > 1 and not split_header(bare)[1])
            if layout.width == 1 and (titled or "," in bare or ":" in bare):
                continue
            candidates.append((len(cells), number, [cell.lstrip("#%") for cell in cells]))
            break
    if not candidates:
        return 0, []
    width, number, cells = max(candidates, key=lambda entry: entry[:2])
    return number, cells if width else []


def _row_of_units(below: Sequence[str], layout: Layout) -> list[str] | None:
    """Read a row under the names that holds units only."""
    for line in below:
        for cells in _splits(line.strip().lstrip("#%"), layout):
            if len(cells) == layout.width and _are_units(cells):
                return [cell.strip("[](){} ") for cell in cells]
    return None


def _refuse_damaged_rows(
    place: Path, filled: Sequence[tuple[int, str]], names_at: int, layout: Layout
) -> None:
    """Refuse text where the numbers begin: a row of the block's width under the names.

    Rows of numbers alone are no damage; but then the line after them is, for the block
    would else begin with them.
    """
    below = [(number, line) for number, line in filled if names_at and number > names_at]
    for place_of, (number, line) in enumerate(below):
        cells = layout.split(line)
        numbers = [layout.is_number(cell) for cell in cells]
        if len(cells) != layout.width or layout.width == 1 or not any(numbers):
            continue
        wrong = [cell for cell, good in zip(cells, numbers, strict=True) if not good and cell]
        if not wrong:
            number, text = below[place_of + 1] if place_of + 1 < len(below) else (number, line)
            wrong = [text.strip()[:60]]
        raise InputError(
            f"{place}, line {number}", f"'{wrong[0]}' is no number", "correct or drop the row"
        )


def _interval(lines: Sequence[str]) -> float | None:
    """Find the time between samples in ``Sample rate: 100 Hz`` and its relatives."""
    for line, follower in zip(lines, [*lines, ""][1:], strict=True):
        for words, inverse in ((_RATE_WORD, True), (_INTERVAL_WORD, False), (_SAMPLING, None)):
            found = words.search(line)
            if found is None:
                continue
            value = _VALUE.search(line, found.end())
            if value is None and "," in line:
                # A row of names over a row of values.
                names, cells = line.split(","), follower.split(",")
                place = next(i for i, name in enumerate(names) if words.search(name))
                value = _VALUE.search(cells[place]) if place < len(cells) else None
            if value is None:
                continue
            number = float(value[1].replace(",", "."))
            unit = value[2].lower() or line[found.end() : found.end() + 8].lower()
            if inverse is None:
                inverse = any(word in unit for word in ("hz", "s/s", "sps", "fps"))
                if not inverse and unit not in ("s", "ms", "us", "µs"):
                    continue
            if not 1e-9 < number < 1e12:
                continue
            known = {"khz": 1e3} if inverse else {"ms": 1e-3, "us": 1e-6, "µs": 1e-6}
            number *= next((size for word, size in known.items() if word in unit), 1.0)
            return 1.0 / number if inverse else number
    alone = re.findall(r"(?<![\w.,])(\d+(?:\.\d+)?) ?(k?)Hz\b", " ".join(lines))
    if len(alone) == 1 and float(alone[0][0]) > 0.0:
        return 1.0 / (float(alone[0][0]) * (1e3 if alone[0][1] else 1.0))
    return None


def _metadata(lines: Sequence[str]) -> dict[str, str]:
    """Keep ``key: value`` lines (with or without a comment sign) as they stand."""
    kept = {"header": " ".join(lines)[:4000]}
    for line in lines[:200]:
        key, colon, value = line.strip().lstrip("#%/! ").partition(":")
        if colon and value.strip() and 0 < len(key) <= 40:
            kept[key.strip()] = value.strip()
    return kept


def _unique(names: Sequence[str]) -> list[str]:
    """Number names that stand more than once (``Volt``, ``Volt (2)``)."""
    counts = [list(names[:place]).count(name) + 1 for place, name in enumerate(names)]
    return [
        name if count == 1 or not name else f"{name} ({count})"
        for name, count in zip(names, counts, strict=True)
    ]
