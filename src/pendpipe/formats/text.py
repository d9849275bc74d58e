"""Tables in text files: CSV, TSV and their many relatives."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.formats.clock import column_of_clock_times
from pendpipe.formats.grammar import (
    MOST_DAMAGED,
    WITH_UNIT,
    Layout,
    first_row,
    is_blank,
    is_comment,
    joined_commas,
    layouts,
    named,
    short_of,
)
from pendpipe.formats.header import Header, read_header
from pendpipe.formats.table import (
    FEWEST,
    Column,
    NotThisFormatError,
    ReadOptions,
    Table,
    next_reader_if,
)
from pendpipe.formats.undress import UNDRESSED
from pendpipe.formats.words import role_of, split_header, unit_of

_CONTROLS: Final = bytes([*range(9), *range(14, 27)])
_BLANKS: Final = "\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{FIGURE SPACE}\N{THIN SPACE}"
"""What is typeset between thousands; without them whatever splits at blanks splits a number."""
_EASTERN: Final = re.compile("时间|時間|角度|시간|각도|(?i:время|угол|отклонение)")
"""Words of a header by which the encodings of the East are told from one another."""
_LARGEST: Final = 512 << 20
"""Bytes of a table: ten million rows. Its lines and cells take some five times that."""
_MOST_ROWS: Final = 5_000_000
"""Rows of any length: they take 0.8 GB."""
_SHORTEST_ROW: Final = 13
"""Bytes of a row among more: a time of seven digits and its point, and a reading of four."""
_LOOKED_AT: Final = 1 << 16
"""Bytes in which an encoding shows: the header, and remarks."""
_LONGEST_LINE: Final = 1 << 20
_LONGEST_HEADER: Final = 5000
_WIDEST: Final = 64
"""Cells that a row may have, however narrow the others are; else at most four times theirs."""
_MOST_KEYS: Final = 20
"""Runs or quantities that a long table may name."""


def decode(data: bytes) -> str:
    """Turn a file's bytes into text: UTF-8, UTF-16 with its mark, else Windows-1252.

    Raises
    ------
    NotThisFormatError
        When the bytes are no text.
    """
    text = data.decode(_encoding(data), errors="replace")
    text = text.rstrip("\0")  # what a logger reserved and never filled
    text = re.sub("Â(?=[°µ²³])", "", text)  # UTF-8 taken for Windows-1252, and written anew
    for blank in _BLANKS:
        text = text.replace(blank, " ")
    text = text.lstrip("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return text.replace("\N{MINUS SIGN}", "-")


def _encoding(data: bytes) -> str:
    """Name the encoding of a text."""
    head = data[:_LOOKED_AT]
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    for start, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        if head[start::2].count(0) > 0.4 * len(head) and not head[1 - start :: 2].count(0):
            return encoding
    head = head.rstrip(b"\0")
    controls = len(head) - len(head.translate(None, _CONTROLS))
    next_reader_if(controls > len(head) // 50, "the bytes are no text")
    try:
        data.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        # A torn byte or two in a long log leave its other characters what they are.
        if fault.start > _LOOKED_AT or data.count(b"\xc3") + data.count(b"\xc2") > 8:
            return "utf-8-sig"
        eastern = ("gb18030", "big5", "cp932", "cp949", "cp1251")
        likely = (e for e in eastern if _EASTERN.search(head.decode(e, errors="replace")))
        return next(likely, "cp1252")
    return "utf-8-sig"


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read a table from a text file, whatever its layout."""
    refuse_if(
        len(data) > _LARGEST,
        place,
        f"the table holds more than {_LARGEST >> 20} MB",
        "give a part of it",
    )
    rows = data.count(b"\n")
    refuse_if(
        rows > max(_MOST_ROWS, len(data) // _SHORTEST_ROW),
        place,
        f"the table holds {rows} rows of {len(data) // max(rows, 1)} bytes: no time counts them",
        "give a part of it",
    )
    return table_of_text(place, decode(data), options, "csv")


def table_of_text(place: Path, text: str, options: ReadOptions, form: str) -> Table:
    """Read the table that is in `text`; `form` is the format's name for the user.

    As it stands, if it is a plain table; else without the words and brackets of its rows.

    Raises
    ------
    NotThisFormatError
        When no reading of it keeps nearly all rows.
    InputError
        When a reading does, but rows are damaged; or two readings do that differ.
    """
    lines = text.split("\n")
    lengths = list(map(len, lines))
    longest = max(lengths)
    refuse_if(
        longest > _LONGEST_LINE,
        f"{place}, line {lengths.index(longest) + 1}",
        f"the line is {longest} characters long",
        "give a table with one row per sample",
    )
    first: Exception | None = None
    some = lines
    for undress in (None, *UNDRESSED):
        bare = undress(some) if undress is not None else lines
        if undress is None or bare is not some:
            some = bare
            try:
                return _plain_table(place, some, options, form)
            except (NotThisFormatError, InputError) as fault:
                first = first if isinstance(first, InputError) else fault
    try:
        return _plain_table(place, lines, options, form, strict=False)
    except NotThisFormatError:
        assert first is not None
        raise first from None


def _plain_table(
    place: Path, lines: list[str], options: ReadOptions, form: str, *, strict: bool = True
) -> Table:
    """Read lines as they stand, under the first grammar that keeps 99 rows in 100."""
    reason: Exception = NotThisFormatError("no block of rows with numbers was found")
    for layout in layouts(lines, options, strict=strict):
        first = first_row(lines, layout)
        if first is None:
            continue
        refuse_if(
            first > _LONGEST_HEADER,
            place,
            f"there is no row of numbers in the first {_LONGEST_HEADER} lines",
            "give a table with one row per sample",
        )
        try:
            return _table(
                place, lines, first, _with_decimals(place, lines, first, layout, options), form
            )
        except InputError as fault:
            reason = reason if isinstance(reason, InputError) else fault
    raise reason


def _with_decimals(
    place: Path, lines: Sequence[str], first: int, layout: Layout, options: ReadOptions
) -> Layout:
    """Find which commas between commas are decimal; refuse where two ways keep all rows."""
    rows = lines[first : first + 1000]
    above = [line.strip().lstrip("#% ") for line in lines[:first] if line.strip()]
    cells = [cell for cell in layout.split(above[-1]) if cell] if above else []
    texts = 0 if any(map(layout.is_number, cells)) or len(cells) > layout.width else len(cells)
    names = texts if len(above) < 3 or texts > 1 else 0
    ways = joined_commas(rows, layout, names, options.decimal)
    refuse_if(
        len(ways) > 1,
        place,
        "its commas are both separators and decimal signs: a row may be "
        + " or ".join(f"'{named(way, lines[first], layout)}'" for way in ways[:3]),
        "give --decimal , or --decimal . (or export it with semicolons)",
    )
    way = ways[0]
    return layout if len(way) == layout.width else replace(layout, joined=way, width=len(way))


def _table(place: Path, lines: list[str], first: int, layout: Layout, form: str) -> Table:
    header = read_header(lines[: first + 1], layout)
    # What is damaged among the first rows, below the names, is part of the block.
    below = range(header.names_at if header.names_at and layout.width > 1 else first, first)
    first = next((at for at in below if layout.is_row(layout.split(lines[at]))), first)
    torn = [at for at in below if at < first and _is_torn(lines[at], layout)]
    first = min([first, *torn])
    lines, cut = _without_cut_row(lines, first, layout)
    found, keys, notes = _at_once(lines, first, layout, header), list[list[str]](), list[str]()
    numbers = np.arange(first + 1, first + 1 + (len(found[0].values) if found else 0))
    if found is None:
        rows, numbers, notes = _rows(place, lines, first, layout)
        found, keys, more, kept = _columns(place, rows, numbers, layout, header)
        numbers, notes = numbers[kept], notes + more
    for words in (*keys, *(c.values.tolist() for c in found if _numbers_runs(c))):
        found, numbers = _by_key(found, numbers, words)
    return Table(
        place=place,
        format=form,
        columns=tuple(found),
        lines=numbers,
        interval_s=header.interval_s,
        metadata=header.metadata,
        notes=(*header.notes, *notes, *cut),
        facts=(layout.fact,),
    )


def _without_cut_row(
    lines: list[str], first: int, layout: Layout
) -> tuple[list[str], tuple[str, ...]]:
    """Leave out a last row that a power cut or a full disk has cut short.

    It has fewer cells than every other row; or no end of line, and its last number has fewer
    letters, or fewer decimals, than that of every other row.
    """
    last = _last_filled(lines)
    others = [line for line in lines[max(first, last - 500) : last] if line.strip()]
    if last <= first + 2 or not others or is_comment(lines[last]):
        return lines, ()
    final, rows = layout.split(lines[last]), [layout.split(line) for line in others]
    short = len(final) < min(map(len, rows))
    numeric = not final[-1] or layout.is_number(final[-1])
    if last == len(lines) - 1 and len(final) == len(rows[-1]) and numeric:
        sizes = [_size(row[-1], layout) for row in rows]
        short = any(
            a < min(b)
            for a, b in zip(_size(final[-1], layout), zip(*sizes, strict=True), strict=True)
        )
    if not short or not any(map(layout.is_number, final)):
        return lines, ()
    return lines[:last], (f"line {last + 1} is cut short: not taken for a sample",)


def _last_filled(lines: Sequence[str]) -> int:
    return next((row for row in range(len(lines) - 1, -1, -1) if lines[row].strip()), 0)


def _size(cell: str, layout: Layout) -> tuple[int, int]:
    """Letters of a number without its sign, and those behind its decimal sign."""
    bare = cell.lstrip("+-") if not is_blank(cell) else ""
    return len(bare), len(bare.partition("." if layout.joined else layout.decimal)[2])


def _at_once(
    lines: Sequence[str], first: int, layout: Layout, header: Header
) -> list[Column] | None:
    """Read a block of nothing but numbers, one row per line; ``None`` if it is anything else.

    (By NumPy: to import pandas takes longer than to read a million rows.)
    """
    last = _last_filled(lines) + 1
    rows = lines[first:last]
    if layout.joined:
        return None
    if layout.decimal == ",":
        if any("." in row for row in rows):
            return None
        rows = [row.replace(",", ".") for row in rows]
    delimiter = None if layout.delimiter == " " else layout.delimiter
    try:
        table = np.loadtxt(rows, delimiter=delimiter, comments=None, ndmin=2, dtype=np.float64)
    except ValueError:
        return None
    # A blank line is passed over in silence: then the rows' lines are to be found.
    if len(table) != last - first:
        return None
    return [_column(header, at, values) for at, values in enumerate(table.T)]


def _rows(
    place: Path, lines: Sequence[str], first: int, layout: Layout
) -> tuple[list[list[str]], IntArray, list[str]]:
    """Pick the rows of the block, with their line numbers; report what is left out.

    Raises
    ------
    InputError
        When more than one row in a hundred has another form than the others.
    """
    kept = [
        (number, line, layout.split(line))
        for number, line in enumerate(lines[first:], start=first + 1)
        if line and not line.isspace() and not is_comment(line)
    ]
    texts = [_text_of(cells, layout) for _, _, cells in kept]
    # What a program prints below a table (mean, deviation, number) begins with its name.
    last = max((at for at, (_, begins) in enumerate(texts) if not begins), default=len(texts))
    texts[last + 1 :] = [(True, True)] * len(texts[last + 1 :])
    # A line that begins with a word, beside one of words alone, belongs to a header.
    remarks = [
        whole or (begins and any(text[0] for text in texts[max(0, at - 1) : at + 2]))
        for at, (whole, begins) in enumerate(texts)
    ]
    rows = [entry for entry, remark in zip(kept, remarks, strict=True) if not remark]
    width = _width(rows, layout)
    good = [
        len(cells) == width or short_of(cells, replace(layout, width=width)) for *_, cells in rows
    ]
    # Whole stretches of rows may end early, where one of several runs does; not every other row.
    ends_early = np.array([len(cells) < width for *_, cells in rows], dtype=np.int8)
    if np.count_nonzero(np.diff(ends_early)) > 2 * MOST_DAMAGED * len(rows) + 4:
        good = [len(cells) == width for *_, cells in rows]
    wrong = [row for row, is_good in zip(rows, good, strict=True) if not is_good]
    whole = [row for row, is_good in zip(rows, good, strict=True) if is_good]
    number, line, cells = wrong[0] if wrong else (0, "", [])
    several = len(cells) > max(_WIDEST, 4 * layout.width)
    what = (
        f"{len(cells)} cells in a row" if several else f"'{line.strip()[:60]}' is no row of numbers"
    )
    refuse_if(
        not whole or len(wrong) > MOST_DAMAGED * len(rows),
        f"{place}, line {number}" if wrong else place,
        what if wrong else "there are no samples",
        "correct or drop the row" if wrong else "record again, or give another file",
    )
    told = (
        (len(kept) - len(rows), "line(s) of text below the first row left out"),
        (len(wrong), f"damaged row(s) left out (line {number}: '{line.strip()[:40]}')"),
    )
    notes = [f"{many} {what}" for many, what in told if many]
    padded = [cells + [""] * (width - len(cells)) for *_, cells in whole]
    return padded, np.array([number for number, *_ in whole], np.int64), notes


def _is_torn(line: str, layout: Layout) -> bool:
    """Say whether a line has the form of a row, and a number among its cells."""
    cells = layout.split(line)
    return not is_comment(line) and len(cells) == layout.width and "n" in layout.kinds(cells)


def _width(rows: Sequence[tuple[int, str, list[str]]], layout: Layout) -> int:
    """Give the cells of a row: those of the widest of which there is more than one in a hundred."""
    while_blank = [len(cells) for *_, cells in rows]
    counts = {each: while_blank.count(each) for each in set(while_blank) if each > layout.width}
    often = [each for each, many in counts.items() if many > MOST_DAMAGED * len(rows)]
    limit = max(_WIDEST, 4 * layout.width)
    return max([layout.width, *(each for each in often if each <= limit)])


def _text_of(cells: Sequence[str], layout: Layout) -> tuple[bool, bool]:
    """Say whether a line is text, as loggers print between the rows; and whether it begins so.

    A row with one cell that is not a number is a row with a fault.
    """
    if not re.match(r"[^\W\d]{3}|\D*$", cells[0]):
        return False, False
    kinds = layout.kinds(filter(None, cells)).replace("d", "t")
    begins = kinds[:1] == "t"
    return begins and (set(kinds) == {"t"} or len(cells) != layout.width), begins


def _columns(
    place: Path, rows: list[list[str]], numbers: IntArray, layout: Layout, header: Header
) -> tuple[list[Column], list[list[str]], list[str], IntArray]:
    """Turn the rows into columns with the header's names, and those of words as they stand.

    Rows in which a number is garbled are left out, up to one in a hundred.
    """
    columns: list[Column] = []
    words: list[list[str]] = []
    for at, texts in enumerate(map(list, zip(*rows, strict=True))):
        known = _column(header, at, np.empty(0))
        column = column_of_numbers(texts, layout, known)
        timed = column is None or any(":" in text for text in texts[:3])
        clock = column_of_clock_times(texts) if timed else None
        if clock is not None:
            columns.append(
                Column(
                    known.name or "time", "s", clock, known.number, _filled(np.isnan(clock), texts)
                )
            )
        elif column is not None:
            columns.append(column)
        else:
            words.append(texts)
            # "0.123,V": the unit stands in a column of its own.
            same = len(set(texts)) == 1 and not is_blank(texts[0])
            if columns and unit_of(texts[0]) and not columns[-1].unit and same:
                columns[-1] = replace(columns[-1], unit=texts[0])
    most = MOST_DAMAGED * len(rows)
    spoilt = [column for column in columns if len(column.garbled) > most]
    row, text = next(((r, t) for column in spoilt for r, t in column.garbled.items()), (0, ""))
    next_reader_if(not columns, "no block of rows with numbers was found")
    refuse_if(
        len(spoilt) == len(columns),
        f"{place}, line {numbers[row]}",
        f"'{text[:60]}' is not a number",
        "correct or drop the row",
    )
    garbled = {
        row: text for c in columns if len(c.garbled) <= most for row, text in c.garbled.items()
    }
    kept = np.delete(np.arange(len(rows)), sorted(garbled)).astype(np.int64)
    if not garbled or len(garbled) > most:
        return columns, words, [], np.arange(len(rows))
    first = min(garbled)
    note = (
        f"{len(garbled)} damaged row(s) left out (line {numbers[first]}: '{garbled[first][:40]}')"
    )
    now = {int(row): at for at, row in enumerate(kept)}
    whole = [
        replace(
            column,
            values=column.values[kept],
            garbled={now[row]: text for row, text in column.garbled.items() if row in now},
        )
        for column in columns
    ]
    return whole, [[texts[row] for row in kept] for texts in words], [note], kept


def _filled(wrong: BoolArray, texts: Sequence[str]) -> dict[int, str]:
    """Give the cells among some that are not blank, by their row."""
    cells = {int(row): texts[int(row)] for row in np.flatnonzero(wrong)}
    return {row: cell for row, cell in cells.items() if not is_blank(cell)}


def column_of_numbers(cells: Sequence[str], layout: Layout, column: Column) -> Column | None:
    """Fill a column from its cells; a unit behind every number (``12.3°``) is its own.

    Returns
    -------
    column
        ``None`` where half of the filled cells are no numbers.
    """
    values, garbled, odd, unit = np.full(len(cells), np.nan), dict[int, str](), list[int](), ""
    comma = layout.decimal == "," and not layout.joined
    for row, cell in enumerate(cells):
        try:
            values[row] = float(cell.replace(",", ".") if comma and "." not in cell else cell)
        except ValueError:
            odd.append(row)
        else:
            odd += [row] if comma and "." in cell else []
    texts = {row: layout.number_text(cells[row]) for row in odd}
    texts = {row: text for row, text in texts.items() if not is_blank(text)}
    parts = [WITH_UNIT.fullmatch(text) for text in list(texts.values())[:20]]
    units = {part[2] if part else "" for part in parts}
    if len(units) == 1 and len(odd) > 0.9 * len(cells):
        unit = units.pop()
    for row, text in texts.items():
        try:
            values[row] = float(text.removesuffix(unit).rstrip().lower().replace("d", "e"))
        except ValueError:
            values[row], garbled[row] = np.nan, cells[row]
    filled = len(cells) - len(odd) + len(texts)
    if 2 * len(garbled) >= filled or not np.isfinite(values).any():
        return None
    return replace(column, values=values, garbled=garbled, unit=column.unit or unit)


def _numbers_runs(column: Column) -> bool:
    """Say whether a column may number runs that stand below one another."""
    changes = np.count_nonzero(np.diff(column.values))
    return role_of(column.name) == "index" and 0 < int(changes) < _MOST_KEYS


def _by_key(
    columns: list[Column], numbers: IntArray, keys: Sequence[str | float]
) -> tuple[list[Column], IntArray]:
    """Put the quantities or runs of a long table, each named by a key, side by side.

    It is long where the time rises among the rows of each key, and not in the file.
    """
    which = np.array(keys)
    clock = next(
        (c for c in columns if role_of(c.name) == "time" and len(c.values) == len(which)), None
    )
    rows = [np.flatnonzero(which == key) for key in dict.fromkeys(keys) if key != ""]
    some_keys, rows = len(rows), [each for each in rows if len(each) >= FEWEST]
    if (
        clock is None
        or not rows
        or not 1 < some_keys <= _MOST_KEYS
        or np.all(np.diff(clock.values) > 0)
        or any(np.any(np.diff(clock.values[each]) <= 0) for each in rows)
    ):
        return columns, numbers
    longest = max(map(len, rows))
    values = [c for c in columns if c is not clock and not np.array_equal(c.values, which)]
    found, numbered = list[Column](), isinstance(keys[0], float)
    for some in rows:
        one = not found or numbered or not np.array_equal(clock.values[some], clock.values[rows[0]])
        for column in [clock, *values] if one else values:
            said = [] if column is clock else [str(keys[some[0]]).removesuffix(".0")]
            named = column is clock or len(values) > 1 or numbered
            name, unit = split_header(" ".join([*said, column.name] if named else said))
            filled = np.append(column.values[some], np.full(longest - len(some), np.nan))
            found.append(Column(name, column.unit or unit, filled, len(found) + 1))
    return found, numbers[max(rows, key=len)]


def _column(header: Header, place: int, values: FloatArray) -> Column:
    known = place < len(header.names)
    name, unit = (header.names[place], header.units[place]) if known else ("", "")
    of = header.points[place] if header.points else ""
    return Column(name, unit, np.ascontiguousarray(values), place + 1, of=of)
