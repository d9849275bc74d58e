"""How a text file writes its table: the signs between cells and in numbers, cells to numbers."""

import csv
import datetime as dt
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import refuse_if
from pendpipe.formats.table import Column, NotThisFormatError, ReadOptions
from pendpipe.formats.words import unit_of

_NAMES: Final = {
    "tab": "\t",
    "\\t": "\t",
    "comma": ",",
    "semicolon": ";",
    "space": " ",
    "blank": " ",
    "whitespace": " ",
    "pipe": "|",
}
_SIGN_WORDS: Final = {"\t": "tabs", ",": "commas", ";": "semicolons", " ": "blanks", "|": "bars"}
_DECIMALS: Final = {"comma": ",", "point": ".", "dot": "."}
COMMENT: Final = ("#", "%", "//", "!")
_IN_A_ROW: Final = 4
"""So many rows follow one another where the samples begin; a header has fewer."""
MOST_COLUMNS: Final = 1024
"""A row of more cells is no sample of an instrument."""
_BLANK: Final = re.compile(
    r'|""|[-*]{1,4}|--[.:]--|n/?a|#n/a|#nv|[+-]?∞|null|none|nan|#value!|\?|ol|over(load|flow|range)?'
    r"|missing|invalid|err|error",
    re.I,
)
"""What programs write where they have no reading."""
_NUMBER: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?|[+-]?(nan|inf(inity)?)", re.I)


_GROUPED: Final = {
    decimal: re.compile(
        rf"[+-]?\d{{1,3}}(([{group}]\d{{3}})+[{decimal}]\d*|([{group}]\d{{3}}){{2,}}"
        rf"|(['’ ]\d{{3}})+([{decimal}]\d*)?)"
    )
    for decimal, group in ((".", ","), (",", "."))
}
"""Numbers with signs between their thousands; ``1,234`` alone is none, it may be 1.234."""


@dataclass(frozen=True)
class Layout:
    """The signs of a table: between its cells, and in its numbers; and its width."""

    delimiter: str
    decimal: str
    width: int

    def split(self, line: str) -> list[str]:
        """Split a line into its cells, quotes and blanks around them removed."""
        if '"' not in line:
            blank = self.delimiter == " "
            return line.split() if blank else [cell.strip() for cell in line.split(self.delimiter)]
        try:
            rows = csv.reader([line.strip()], delimiter=self.delimiter, skipinitialspace=True)
            return [cell.strip() for cell in next(rows) if cell.strip() or self.delimiter != " "]
        except csv.Error:  # a quote that opens 128 kB of text
            return [line.strip()]

    def is_number(self, cell: str) -> bool:
        """Say whether a cell is a number in this layout."""
        cell = self.ungrouped(cell)
        if self.decimal == ",":
            cell = "x" if "." in cell else cell.replace(",", ".")
        parts = _WITH_UNIT.fullmatch(cell)
        return bool(_NUMBER.fullmatch(cell)) or (
            parts is not None and unit_of(parts[2]) is not None
        )

    def kinds(self, cells: Iterable[str]) -> str:
        """Say what each cell is, by a letter: number, clock time or date, blank, text."""
        return "".join(
            "n"
            if self.is_number(cell)
            else "b"
            if is_blank(cell)
            else "c"
            if _DATE.fullmatch(cell) or _CLOCK.fullmatch(cell.lstrip("'"))
            else "t"
            for cell in cells
        )

    def ungrouped(self, cell: str) -> str:
        """Take the signs between thousands out of ``1,234.5``, ``1.234,5`` and ``1'234``."""
        signs = r"['’ ,]" if self.decimal == "." else r"['’ .]"
        return re.sub(signs, "", cell) if _GROUPED[self.decimal].fullmatch(cell) else cell

    @property
    def description(self) -> str:
        """The layout in words, for the notes."""
        between = _SIGN_WORDS.get(self.delimiter, repr(self.delimiter))
        cells = f"columns separated by {between}" if self.width > 1 else "one column"
        return cells + (", decimal commas" if self.decimal == "," else "")


def is_blank(cell: str) -> bool:
    """Say whether a cell stands for no reading."""
    return _BLANK.fullmatch(cell) is not None


def is_comment(line: str) -> bool:
    """Say whether a line is a remark."""
    return line.startswith(COMMENT) or line.lstrip().startswith(COMMENT)


def guess_layout(lines: Sequence[str], options: ReadOptions) -> Layout:
    """Find the signs under which most of the lines are rows of as many numbers.

    Raises
    ------
    NotThisFormatError
        When under none of them a third of the lines are rows of numbers.
    """
    # Of a long file evenly spaced lines will do.
    some = lines[:: max(1, len(lines) // 2000)]
    full = [line for line in some if line.strip() and not is_comment(line)]
    sample = full[len(full) // 20 :: max(1, len(full) // 200)]
    # "0,025","0,5": the same sign twice, separated by the quotes alone.
    quoted = any('"' in line for line in sample)
    candidates = [
        Layout(delimiter, decimal, 0)
        for delimiter in _wanted("--delimiter", options.delimiter, _NAMES, "\t;|, ", r"[^\w.+\"-]")
        for decimal in _wanted("--decimal", options.decimal, _DECIMALS, ".,", r"[.,]")
        if delimiter != decimal or (quoted and delimiter == ",")
    ]
    scored = [(_score(sample, layout), layout) for layout in candidates]
    (score, _, width), best = max(scored, key=lambda each: each[0][:2])
    if score < 0.3:
        raise NotThisFormatError("no block of rows with numbers was found")
    forced = options.delimiter is not None or options.decimal is not None
    if best.delimiter == "," and width == 2 and not forced and _is_one_column(sample):
        return Layout(" ", ",", 1)
    return replace(best, width=width)


def _score(sample: Sequence[str], layout: Layout) -> tuple[float, int, int]:
    """Score a layout: share of number cells in rows of the usual width; numbers; width."""
    rows = [layout.split(line) for line in sample]
    width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    if not 0 < width <= MOST_COLUMNS:
        return 0.0, 0, 0
    kinds = [layout.kinds(row) for row in rows if len(row) == width]
    full = sum(
        (width - row.count("t") - row.count("b")) / max(width - row.count("b"), 1) for row in kinds
    )
    numbers = sum(column.count("n") > len(rows) / 2 for column in zip(*kinds, strict=True))
    return round(full / len(rows), 3), numbers, width


def _is_one_column(sample: Sequence[str]) -> bool:
    """Tell ``-45,27`` (one number) from ``12,-4`` (two): the first of two is a rising time."""
    pairs = [line.strip().split(",") for line in sample if line.count(",") == 1]
    if not all(re.fullmatch(r"[+-]?\d+", a) and re.fullmatch(r"\d+", b) for a, b in pairs):
        return False
    first = [int(a) for a, _ in pairs]
    # "0,49" and "-0,47" all begin with the same number.
    return any(b < a for a, b in pairwise(first)) or len(set(first)) == 1


def _wanted(option: str, given: str | None, names: dict[str, str], usual: str, fit: str) -> str:
    """Give the signs that are tried: all usual ones, or the one that the user gives."""
    if given is None:
        return usual
    sign = names.get(given.lower(), given)
    refuse_if(
        not re.fullmatch(fit, sign),
        option,
        f"'{sign}' can't be used",
        "give '.' or ','" if option == "--decimal" else "give tab, space, ',' or ';'",
    )
    return sign


def first_row(lines: Sequence[str], layout: Layout) -> int:
    """Find the first line of the block of numbers.

    It has the usual width and at least half of its filled cells are numbers; so have the next
    rows, in the same cells (a few rows of numbers, or a title that ends in one, belong to the
    header).
    """
    above: list[tuple[int, list[str]]] = []
    first: list[int] = []
    for place, line in enumerate(lines):
        if not line.strip() or is_comment(line):
            continue
        cells = layout.split(line)
        row = _is_row(cells, layout)
        if not row or (above and _is_title(above[-1][1], cells, layout)):
            above = []
        if row:
            first = first or [place]
            above.append((place, cells))
        if len(above) == _IN_A_ROW:
            break
    if not first:
        raise NotThisFormatError("no row of numbers was found")
    return above[0][0] if above else first[0]


def _is_title(above: Sequence[str], cells: Sequence[str], layout: Layout) -> bool:
    """Say whether a row has words where the next one has a number or a time of day."""
    return any(
        not any(map(str.isdigit, word)) and not is_blank(word)
        for word, cell in zip(above, cells, strict=True)
        if any(map(str.isdigit, cell)) and not layout.is_number(word)
    )


def _is_row(cells: Sequence[str], layout: Layout) -> bool:
    kinds = layout.kinds(cells) if len(cells) == layout.width else ""
    filled = len(kinds) - kinds.count("b")
    # "Record Length,2500" belongs to a header.
    return "n" in kinds and 2 * kinds.count("t") <= filled and kinds not in ("tn", "nt")


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


_DATE: Final = re.compile(r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}")
_WITH_UNIT: Final = re.compile(
    r"([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(?![eEdD][+-]?\d)([^\d\s.+-]\S{0,5})"
)
"""``12.3°``; but ``5.9E-01`` is a number, not 5.9 of the unit E-01."""


def column_of_numbers(cells: Sequence[str], layout: Layout, column: Column) -> Column:
    """Fill a column from its cells; a unit behind every number (``12.3°``) is its own."""
    cells = [layout.ungrouped(cell) for cell in cells]
    if layout.decimal == ",":
        cells = [cell.replace(",", ".") for cell in cells]
    filled, unit = [row for row, cell in enumerate(cells) if not is_blank(cell)], ""
    parts = [_WITH_UNIT.fullmatch(cells[row]) for row in filled[:1]]
    parts = [_WITH_UNIT.fullmatch(cells[row]) for row in filled if any(parts)]
    units = {part[2] if part else "" for part in parts}
    if len(units) == 1 and "" not in units:
        unit = units.pop()
        cells = [cell.removesuffix(unit).rstrip() for cell in cells]
    values, fault = np.full(len(cells), np.nan), None
    for row in filled:
        try:
            values[row] = float(cells[row].lower().replace("d", "e"))
        except ValueError:
            fault = fault or (row, cells[row])
    return replace(column, values=values, fault=fault, unit=column.unit or unit)


_CLOCK: Final = re.compile(
    r"(?:0 days? )?"
    r"(?:(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})[T ,]+|(\d{1,2})[-/.](\d{1,2})[-/.](\d{4})[T ,]+)?"
    r"(?:(\d{1,3}):)?(\d{1,2}):(\d{1,2}(?:[.,:]\d+)?)"
    r"\s*(am|pm)?\s*(?:z|utc|[+-]\d{2}:?\d{2})?",
    re.I,
)


def column_of_clock_times(cells: Sequence[str]) -> FloatArray | None:
    """Turn ``12:34:56.7``, ``0:05.2`` or ``2024-05-01T12:34:56`` into seconds.

    Times of day that pass midnight go on; dates are counted from 1 January 1970. Of two
    parts the last is seconds. A day and month that could be either are taken as month/day
    with slashes, as day.month else: it matters at midnight only.

    Returns
    -------
    seconds
        ``None`` if the cells are no times.
    """
    matches = [_CLOCK.fullmatch(cell.strip().lstrip("'")) for cell in cells]
    if not cells or any(match is None for match in matches):
        return None
    seconds = np.empty(len(cells))
    days = {match.groups()[:6]: 0 for match in matches if match is not None}
    for row, match in enumerate(matches):
        assert match is not None
        date, (hour, minute, second, half) = match.groups()[:6], match.groups()[6:]
        days[date] = days[date] or _days(date, "/" in match[0])
        hours = int(hour or 0)
        hours = hours % 12 + 12 * (half.lower() == "pm") if half else hours
        of_day = 3600 * hours + 60 * int(minute) + float(re.sub("[,:]", ".", second))
        seconds[row] = 86400.0 * days[date] + of_day
    if min(days.values()) < 0:
        return None
    if seconds.max() < 86400:
        seconds -= 86400.0 * np.cumsum(np.rint(np.diff(seconds, prepend=seconds[0]) / 86400.0))
    return seconds


def _days(date: tuple[str | None, ...], slashed: bool) -> int:
    """Count the days since 1970; 0 without a date, -1 where there is no such day."""
    parts = [int(part or 0) for part in date]
    if not any(date):
        return 0
    year, month, day = parts[:3] if date[0] else parts[:2:-1]
    if not date[0] and (month > 12 or (slashed and day <= 12)):
        day, month = month, day
    try:
        return max(-1, dt.date(year, month, day).toordinal() - 719163)
    except ValueError:
        return -1
