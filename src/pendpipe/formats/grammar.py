"""The grammar of a plain table: separator, decimal sign and width, chosen together.

The one reading is taken under which nearly all lines below the header are rows of the same numbers.
It is chosen on some of the lines and checked on all: what would lose more than one row in a
hundred is never taken, and where two readings keep all rows, a time that rises evenly decides.
"""

import csv
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.errors import refuse_if
from pendpipe.facts import Fact
from pendpipe.formats.clock import is_clock
from pendpipe.formats.table import FEWEST_ROWS, ReadOptions, evenness
from pendpipe.formats.words import unit_of

COMMENT: Final = ("#", "%", "//", "!")
MOST_DAMAGED: Final = 0.01
"""Share of the rows that may be garbled or torn."""
_NEARLY_ALL: Final = 1.0 - 2.0 * MOST_DAMAGED
"""Share of the cells of one form: a damaged row spoils that below it, too."""
MOST_COLUMNS: Final = 1024
"""A row of more cells is no sample of an instrument."""
_LONGEST_CELL: Final = 500
_SAMPLES, _TOGETHER = 15, 20
"""Places at which a reading is chosen, and lines at each that follow one another."""
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
_MOST_WAYS: Final = 5000
"""Ways to read a row of commas that are tried."""
_BLANK: Final = re.compile(
    r'|""|[-*]{1,4}|--[.:]--|n/?[ad]|n\.[ad]\.|k\.a\.|\.|#+|#n/a|#nv|#[^\W\d]+(/0)?[!?]|[+-]?∞|null|none'
    r"|-?nan(\(ind\))?|-?1\.#(qnan|snan|ind|inf)\d*|\?|ol|over(load|flow|range)?|no data"
    r"|missing|invalid|err|error",
    re.I,
)
"""What programs write where they have no reading."""
# Digits are taken whole (++): of hundreds of them no pattern tries every length.
_NUMBER: Final = re.compile(
    r"[+-]?(\d++(\.\d*+)?|\.\d++)([eEdD][+-]?\d++)?|[+-]?(nan|inf(inity)?)", re.I
)
WITH_UNIT: Final = re.compile(
    r"([+-]?[\d.]++(?:[eE][+-]?\d++)?)\s*+(?![eEdD][+-]?\d)([^\d\s.,;+-]\S{0,5})"
)
"""``12.3°``; but ``5.9E-01`` is a number, not 5.9 of the unit E-01."""
_DRESSED: Final = re.compile(
    r".*(->|=|±).*|.*:|[\[({<].*|.*[\])}>]|(?=.*\d)[\d\W]*[^\w\s.:/+-]|\w*[^\W\d]\w*['\"]?:\s*[+-]?\d.*"
)
"""Words and brackets about a number, which say what it is: no plain cell."""
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
    """The signs of a table: between its cells, and in its numbers; and its width.

    Parameters
    ----------
    delimiter, decimal, width
        The sign between cells, that in numbers, cells of a row.
    joined
        Where the decimal sign is the delimiter too: of how many pieces (1 or 2) each cell is.
    """

    delimiter: str
    decimal: str
    width: int = 0
    joined: tuple[int, ...] = ()

    def split(self, line: str) -> list[str]:
        """Split a line into its cells, quotes and blanks around them removed; one at least."""
        if '"' not in line:
            cells = line.split(None if self.delimiter == " " else self.delimiter)
            return self.with_decimals([cell.strip() for cell in cells])
        try:
            rows = csv.reader([line.strip()], delimiter=self.delimiter, skipinitialspace=True)
            cells = [cell.strip() for cell in next(rows) if cell.strip() or self.delimiter != " "]
            return cells or [line.strip()]
        except csv.Error:  # a quote that opens 128 kB of text
            return [line.strip()]

    def with_decimals(self, pieces: list[str]) -> list[str]:
        """Put together the numbers that their own decimal commas have parted.

        A row of numbers with fewer pieces, or more, is damaged: it becomes one cell that is none.
        """
        if not self.joined:
            return pieces
        if len(pieces) != sum(self.joined):
            return [",".join(pieces)] if _NUMBER.fullmatch(pieces[0]) else pieces
        rest = iter(pieces)
        return [".".join(next(rest) for _ in range(many)) for many in self.joined]

    def number_text(self, cell: str) -> str:
        """Write a number as Python reads it; what is none stays, or becomes none."""
        signs = r"['’ ,]" if self.decimal == "." else r"['’ .]"
        cell = re.sub(signs, "", cell) if _GROUPED[self.decimal].fullmatch(cell) else cell
        if self.decimal == "." or self.joined:
            return cell
        return f"{cell}?" if "." in cell else cell.replace(",", ".")

    def is_number(self, cell: str) -> bool:
        """Say whether a cell is a number in this layout."""
        cell = self.number_text(cell)
        if _NUMBER.fullmatch(cell):
            return True
        parts = WITH_UNIT.fullmatch(cell)
        return parts is not None and unit_of(parts[2]) is not None

    def kinds(self, cells: Iterable[str]) -> str:
        """Say what each cell is by a letter: number, clock time, blank, dressed number, text."""
        return "".join(
            "t"
            if len(cell) > _LONGEST_CELL
            else "n"
            if self.is_number(cell)
            else "b"
            if is_blank(cell)
            else "c"
            if is_clock(cell)
            else "d"
            if _DRESSED.fullmatch(cell)
            else "t"
            for cell in cells
        )

    def is_row(self, cells: Sequence[str]) -> bool:
        """Say whether cells are a row: of its width, and at least half of them numbers."""
        return len(cells) == self.width and self.is_row_of(self.kinds(cells))

    @staticmethod
    def is_row_of(kinds: str) -> bool:
        """Say whether cells of these kinds are a row: at least half of them numbers."""
        filled = len(kinds) - kinds.count("b")
        words = kinds.count("t") + kinds.count("d")
        # "Record Length,2500" belongs to a header.
        return "n" in kinds and 2 * words <= filled and kinds not in ("tn", "nt", "dn", "nd")

    @property
    def fact(self) -> Fact:
        """The layout in words, shown by the rows that it keeps."""
        between = _SIGN_WORDS.get(self.delimiter, repr(self.delimiter))
        cells = f"columns separated by {between}" if self.width > 1 else "one column"
        said = cells + (", decimal commas" if self.decimal == "," or self.joined else "")
        return Fact("layout", said, "shown", said)


def is_blank(cell: str) -> bool:
    """Say whether a cell stands for no reading."""
    return _BLANK.fullmatch(cell) is not None


def is_comment(line: str) -> bool:
    """Say whether a line is a remark."""
    return line.startswith(COMMENT) or line.lstrip().startswith(COMMENT)


def has_number(line: str) -> bool:
    """Say whether a line holds digits: without any nothing is lost with it."""
    return re.search(r"\d", line) is not None


def layouts(lines: Sequence[str], options: ReadOptions, *, strict: bool = True) -> list[Layout]:
    """Find the readings of a text as a table, the best first.

    Parameters
    ----------
    strict
        Whether numbers in words and brackets are left to those who undress them.
    """
    sample = _some(lines) or _some([line for line in lines if not is_comment(line)])
    # "0,025","0,5": the same sign twice, separated by the quotes alone.
    quoted = any('"' in line for line in sample)
    decimals = _wanted("--decimal", options.decimal, _DECIMALS, ".,", r"[.,]")
    candidates = [
        # Commas between cells and in them: pieces that are joined later.
        Layout(delimiter, decimal if delimiter != decimal or quoted else ".")
        for delimiter in _wanted("--delimiter", options.delimiter, _NAMES, "\t;|, ", r"[^\w.+\"-]")
        for decimal in (decimals if delimiter != "," or quoted else decimals[:1])
    ]
    scored = [(_score(sample, layout, strict=strict), layout) for layout in candidates]
    kept = [(score[:2], replace(of, width=score[2])) for score, of in scored if score[0] > 0.0]
    best = max((score[0] for score, _ in kept), default=0.0)
    kept = [each for each in kept if each[0][0] > 0.9 * best]
    # Blanks part a date from its time of day as well.
    kept.sort(key=lambda each: (each[0][1], each[1].delimiter != " ", each[0][0]), reverse=True)
    return [layout for _, layout in kept]


def _some(lines: Sequence[str]) -> list[str]:
    """Choose lines that follow one another, at several places; none that is blank or a remark."""
    starts = np.linspace(0, max(0, len(lines) - _TOGETHER), _SAMPLES).astype(int).tolist()
    chosen = {at for start in starts for at in range(start, min(start + _TOGETHER, len(lines)))}
    some = (lines[at] for at in sorted(chosen))
    return [line for line in some if line and not line.isspace() and not is_comment(line)]


def _score(sample: Sequence[str], layout: Layout, *, strict: bool) -> tuple[float, int, int]:
    """Score a layout: rows in its block, by their share of numbers; columns of numbers; width.

    The block is the stretch of lines with most rows, three to each line that is none: headers
    and remarks above and below count for nothing, and lines of two kinds in turn are no block.
    """
    rows = [layout.split(line) for line in sample]
    width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
    if not 0 < width <= MOST_COLUMNS:
        return 0.0, 0, 0
    kinds = [layout.kinds(row) if len(row) == width else "" for row in rows]
    # A row may end early where its last cells are empty.
    good = [layout.is_row_of(kind) and not (strict and "d" in kind) for kind in kinds]
    value, start, best, span = 0, 0, 0, (0, 0)
    for at, is_good in enumerate(good):
        gain = 1 if is_good else -3 if has_number(sample[at]) else -1
        value, start = (value + gain, start) if value > 0 else (gain, at)
        best, span = max((best, span), (value, (start, at + 1)))
    if best < min(2, len(sample)):
        return 0.0, 0, 0
    block = [kind for kind in kinds[slice(*span)] if kind]
    numeric = sum(
        (width - row.count("t") - row.count("d") - row.count("b")) / max(width - row.count("b"), 1)
        for row in block
    )
    numbers = sum(column.count("n") > len(block) / 2 for column in zip(*block, strict=True))
    return round(best / len(sample) * numeric / len(block), 3), numbers, width


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


def first_row(lines: Sequence[str], layout: Layout) -> int | None:
    """Find the first line of the block of rows: four rows with hardly a line between them.

    Where there are fewer rows than four, the first of them.
    """
    value, start, first = 0, 0, None
    for at, line in enumerate(lines):
        if not line or line.isspace() or is_comment(line):
            continue
        good = layout.is_row(layout.split(line))
        first = at if first is None and good else first
        gain = 1 if good else -2 if has_number(line) else -1
        value, start = (value + gain, start) if value > 0 else (gain, at)
        if value == FEWEST_ROWS:
            return start
    return first


def joined_commas(
    lines: Sequence[str], layout: Layout, names: int, decimal: str | None = None
) -> list[tuple[int, ...]]:
    """Find how pieces between commas make numbers with decimal commas; all ways that are left.

    Parameters
    ----------
    lines
        Rows.
    names
        Names of the header; 0 without one.
    decimal
        The sign that the user gives, which decides.

    Returns
    -------
    ways
        Each the pieces (1 or 2) of each cell. Of a whole number nobody writes ``02`` or ``-0``:
        these are parts of a decimal. A decimal part changes, and a time rises evenly.
    """
    rows = [row for row in map(layout.split, lines) if len(row) == layout.width]
    columns = (
        [list(column) for column in zip(*rows, strict=True)] if len(rows) >= FEWEST_ROWS else []
    )
    whole = [_often(r"[+-]?\d+", column) > _NEARLY_ALL for column in columns]
    parts = [_often(r"[0-9]+", column) > _NEARLY_ALL for column in columns]
    pairs = [a and b for a, b in zip(whole, parts[1:], strict=False)]
    plain = (1,) * layout.width
    said = _DECIMALS.get(decimal or "", decimal)
    commas = (layout.delimiter, layout.decimal) == (",", ".") and said != "."
    if not commas or not any(pairs) or names == layout.width:
        return [plain]
    ways = list(islice(_ways(pairs, names), _MOST_WAYS)) or [plain]
    ways = [way for way in ways if said is None or way != plain] or ways
    for fits in (_is_whole, _parts_change):
        ways = [way for way in ways if fits(way, columns)] or ways
    # Whole numbers under no names are whole numbers, unless that leaves no time, or one that never
    # changes stands before others of one length, as the 0 of 0,38 does.
    fixed = [_often(re.escape(column[0]), column) > _NEARLY_ALL for column in columns]
    alike = [_often(rf"\d{{{max(2, len(c[0]))}}}", c) > _NEARLY_ALL for c in columns]
    zeros = {(at, 2) for at, pair in enumerate(pairs) if pair and fixed[at] and alike[at + 1]}
    joined = [way for way in ways if zeros and zeros <= {*_placed(way)}]
    if not names and plain in ways and _evenness(_numbers(columns, plain)):
        return [plain, *joined[:1]]
    ways = joined or ways if said else ways
    ranks = [_evenness(_numbers(columns, way)) for way in ways]
    return [way for way, rank in zip(ways, ranks, strict=True) if rank == max(ranks)]


def _is_whole(way: Sequence[int], columns: Sequence[Sequence[str]]) -> bool:
    """Say whether no number begins as ``02``, and none is ``-0``: these are parts of decimals."""
    odd = {1: r"-0|[+-]?0\d+", 2: r"[+-]?0\d+"}
    return all(_often(odd[many], columns[at]) <= MOST_DAMAGED for at, many in _placed(way))


def _often(pattern: str, cells: Sequence[str]) -> float:
    """Give the share of cells that have a form."""
    return sum(re.fullmatch(pattern, cell) is not None for cell in cells) / len(cells)


def _parts_change(way: Sequence[int], columns: Sequence[Sequence[str]]) -> bool:
    """Say whether decimal parts end in many a digit (a flag does not), or are all zeros."""
    parts = [columns[at + 1] for at, many in _placed(way) if many == 2]
    ends = [{cell[-1:] for cell in part} for part in parts]
    return all(len(end) > 4 or end == {"0"} for end in ends)


def _ways(pairs: Sequence[bool], cells: int, at: int = 0) -> Iterator[tuple[int, ...]]:
    """Give all ways to part pieces into so many cells (0: any), each of one or of a pair."""
    left = len(pairs) + 1 - at
    for many in (1, 2) if left > 1 and pairs[at] else (1,):
        if left == many:
            yield from [(many,)] if cells in (0, 1) else []
        elif cells != 1 and (not cells or (left + 1) // 2 <= cells <= left):
            yield from ((many, *rest) for rest in _ways(pairs, max(cells - 1, 0), at + many))


def _placed(way: Sequence[int]) -> list[tuple[int, int]]:
    """Give the first piece of each cell, and how many it has."""
    starts = [sum(way[:cell]) for cell in range(len(way))]
    return list(zip(starts, way, strict=True))


def _numbers(columns: Sequence[Sequence[str]], way: Sequence[int]) -> list[FloatArray]:
    """Give the columns as they are read in this way; times of day and words by their rows."""
    found: list[FloatArray] = []
    for at, many in _placed(way):
        texts = columns[at] if many == 1 else map(".".join, zip(*columns[at : at + 2], strict=True))
        numbers = (text.lower().replace("d", "e") for text in texts)  # Fortran's 1D5
        values = np.array([float(text) if _NUMBER.fullmatch(text) else np.nan for text in numbers])
        lost = np.isnan(values)
        values[lost] = (
            np.interp(np.flatnonzero(lost), np.flatnonzero(~lost), values[~lost])
            if not lost.all()
            else np.flatnonzero(lost)
        )
        found.append(values)
    return found


def _evenness(numbers: Sequence[FloatArray]) -> int:
    """Say whether the first of several columns rises evenly (2), but for a clock that begins again.

    1 where it rises at all.
    """
    if len(numbers) < 2 or not np.ptp(numbers[0]):
        return 0
    steps = np.diff(numbers[0])
    even = np.median(steps) > 0.0 and evenness(numbers[0]) > 0.9
    return 2 if even else int(np.mean(steps >= 0.0) > _NEARLY_ALL)


def named(way: Sequence[int], row: str, layout: Layout) -> str:
    """Show a row as it would be read, for a refusal."""
    cells = replace(layout, joined=tuple(way)).split(row)
    return " | ".join(cells)


def short_of(cells: Sequence[str], layout: Layout) -> bool:
    """Say whether a row may be one whose last cells are empty: not between blanks."""
    return 0 < len(cells) < layout.width and layout.delimiter != " " and layout.is_number(cells[0])
