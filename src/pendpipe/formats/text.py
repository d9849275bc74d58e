"""Tables in text files: CSV, TSV and their many relatives.

Below the dialects stand the layout (the signs between cells and in numbers), the rows, the header.
"""

import csv
import datetime as dt
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import unescape
from itertools import accumulate, pairwise, product, zip_longest
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError, refuse_if
from pendpipe.formats.table import Column, ReadOptions, Table, next_reader_if
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
_LONGEST_ROW: Final = 1000
"""Letters of a row with words in it."""
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
    for wrong in "°µ²³":  # UTF-8 that a program took for Windows-1252, and wrote anew
        text = text.replace(f"Â{wrong}", wrong)
    for blank in _BLANKS:
        text = text.replace(blank, " ")
    text = text.lstrip("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    return text.replace("\N{MINUS SIGN}", "-")


def _encoding(data: bytes) -> str:
    """Name the encoding of a text."""
    head = data[:65536]
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    for start, encoding in ((1, "utf-16-le"), (0, "utf-16-be")):
        if head[start::2].count(0) > 0.4 * len(head) and not head[1 - start :: 2].count(0):
            return encoding
    controls = len(head) - len(head.translate(None, _CONTROLS))
    next_reader_if(b"\0" in head or controls > len(head) // 50, "the bytes are no text")
    try:
        data.decode("utf-8-sig")
    except UnicodeDecodeError:
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
    return table_of_text(place, decode(data), options, "csv")


def table_of_text(place: Path, text: str, options: ReadOptions, form: str) -> Table:
    """Read the table that is in `text`; `form` is the format's name for the user."""
    lines = _without_tags(text).split("\n")
    longest = max(range(len(lines)), key=lambda number: len(lines[number]))
    refuse_if(
        len(lines[longest]) > _LONGEST_LINE,
        f"{place}, line {longest + 1}",
        f"the line is {len(lines[longest])} letters long",
        "give a table with a row a sample",
    )
    for begins, own_form in _DIALECTS:
        if begins.match("\n".join(lines[:50])):
            lines = own_form(lines)
    for form_of in (
        _of_several_lines,
        _in_rows,
        _bare_cells,
        _without_words,
        _without_split_decimals,
        _upright,
    ):
        lines = form_of(lines)
    layout = guess_layout(lines, options)
    first = first_row(lines, layout)
    refuse_if(
        first > _LONGEST_HEADER,
        place,
        f"no row of numbers stands in the first {_LONGEST_HEADER} lines",
        "give a table with a row a sample",
    )
    header = read_header(place, lines[: first + 1], layout)
    lines, cut = _without_cut_row(lines, first, layout)
    found, keys = _at_once(lines, first, layout, header), list[list[str]]()
    notes: list[str] = []
    numbers = np.arange(first + 1, first + 1 + (len(found[0].values) if found else 0))
    if found is None:
        rows, numbers, notes = _rows(lines, first, layout)
        refuse_if(not rows, place, "there are no samples", "record again, or give another file")
        found, keys = _columns(place, rows, numbers, layout, header)
    for words in (*keys, *(c.values.tolist() for c in found if _numbers_runs(c))):
        found, numbers = _by_key(found, numbers, words)
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
    """Make of the tables of a web page, or of Excel's XML, rows with tabs."""
    if not re.match(
        r"\s*<(!doctype html|html|table|meta|div|\?xml[^<]*(<\?[^<]*)?<workbook)\b",
        text[:400],
        re.I,
    ):
        return text
    # (No pattern here runs on over the next sign, or a hostile page would take hours.)
    text = re.sub(r"(?i)<(style|script|title)\b[^<]*", "", " ".join(text.split()))
    text = re.sub(r"(?i)</(tr|row) ?>|<br ?/? ?>", "\n", text)
    return unescape(re.sub(r"<[^<>]*>", "", re.sub(r"(?i)</(t[dh]|data) ?>(?! ?\n)", "\t", text)))


def _of_labview(lines: list[str]) -> list[str]:
    """Make of the two headers that LabVIEW writes (.lvm) remarks and one row of names."""
    ends = [row for row, line in enumerate(lines[:100]) if line.startswith("***End_of_Header***")]
    at = max(ends[:2], default=-1) + 1
    told = {key: cells for key, *cells in (line.split("\t") for line in lines[:at])}
    names = [name for name in lines[at].split("\t") if name not in ("Comment", "")]
    units = ["s", *told.get("Y_Unit_Label", [])][: len(names)]
    head = [f"{n} ({u})" if u else n for n, u in zip_longest(names, units, fillvalue="")]
    bare = told.get("X_Columns") == ["No"]  # then the rows begin with an empty cell
    # Each segment has a header of its own.
    below = (line for line in lines[at + 1 :] if not re.match(r"[A-Z*]", line))
    rows = [line[bare:].rstrip("\t") for line in below]
    return [*("# " + line for line in lines[:at]), "\t".join(head[bare:]), *rows]


def _of_octave(lines: list[str]) -> list[str]:
    """Put what Octave saves below one another, columns, rows and matrices, side by side."""
    blocks = [block.split("\n") for block in "\n".join(lines).split("# name: ")[1:]]
    rows = [[line.split() for line in b[1:] if line.strip() and line[:1] != "#"] for b in blocks]
    across = [each if len(each) == 1 else zip(*each, strict=False) for each in rows]
    columns = [[b[0], *cells] for b, some in zip(blocks, across, strict=True) for cells in some]
    longest = max(map(len, columns), default=0)
    columns = [column for column in columns if len(column) == longest]
    return ["\t".join(row) for row in zip(*columns, strict=True)] if longest > 4 else lines


def _of_cassy(lines: list[str]) -> list[str]:
    """Make of the header that CASSY Lab writes (MIN=, MAX=, SCALE=, DEC=, DEF=) a line of names."""
    head = [re.sub("^(?=(MIN|MAX|SCALE|DEC)=)", "# ", line) for line in lines[:50]]
    head = [re.sub('^DEF=|"|&', "", line) if line[:4] == "DEF=" else line for line in head]
    return head + lines[50:]


_PANEL: Final = re.compile(r"([^,]*),([^,]*),([^,]*),(\s*[+-]?[\d.]+(?:[eE][+-]?\d+)?,.*)")


def _of_tektronix(lines: list[str]) -> list[str]:
    """Put above what Tektronix writes in three columns to the left of its first readings."""
    rows = [_PANEL.fullmatch(line) for line in lines]
    if any(row is None for row, line in zip(rows, lines, strict=True) if line.strip()):
        return lines
    told = {row[1].strip(): row[2].strip() for row in rows[:30] if row is not None}
    across, up = told.get("Horizontal Units", "s"), told.get("Vertical Units", "V")
    names = f"time ({across}),{told.get('Source', 'CH1')} ({up}),"
    return [names, *(row[4] if row is not None else "" for row in rows)]


def _of_igor(lines: list[str]) -> list[str]:
    """Make of Igor's text a table: names above, and the interval, which stands below."""
    text = "\n".join(lines)
    scale = re.search(r"SetScale */P +x[ ,]+[^,]*,([^,]*),", text)
    said = re.findall(r'SetScale(?: */P)? +[yd][ ,]+[^,]*,[^,]*, *"([^"]+)", *(\w+)', text)
    units = {name: f"{name} ({unit})" for unit, name in said}
    names = "\t".join(units.get(name, name) for name in re.split(r"[,\s]+", lines[1].strip())[1:])
    rows = [line.strip() for line in lines[2:] if not re.match(r"\s*(BEGIN|END|X )", line)]
    return [f"# dt = {scale[1].strip()} s" if scale else "#", names, *rows]


_SEGMENT: Final = re.compile(
    r"(?:TIMESERIES|WID2)\b(?=.*?(?:\bINT +\d+|, \d+ samples,) +(?![0.]+\b)(\d+\.?\d*)\b)"
    r".*?(\d{4})[-/](\d\d)[-/](\d\d[T ][\d:.]+).*\n(?:[A-Z].*\n)*([-+\d.eE\s]*)"
)


def _of_seismograph(lines: list[str]) -> list[str]:
    """Put the samples of SLIST and GSE2, several in a line, below one another, with their times."""
    unit = [*re.findall(r", (\S+)$", lines[0]), "counts"][0]
    rows = [f"time (s)\tchannel ({unit})"]
    for rate, *date, samples in _SEGMENT.findall("\n".join(lines)):
        start = column_of_clock_times(["-".join(date)])
        first_s = 0.0 if start is None else float(start[0])
        cells = enumerate(samples.split())
        rows += [f"{first_s + at / float(rate):.6f}\t{cell}" for at, cell in cells]
    return rows


def _of_sac(lines: list[str]) -> list[str]:
    """Put the samples of SAC's text below one another: first of all stands their interval."""
    return [f"# dt = {lines[0].split()[0]} s", *" ".join(lines[30:]).split()]


_DIALECTS: Final[tuple[tuple[re.Pattern[str], Callable[[list[str]], list[str]]], ...]] = (
    (re.compile(r"LabVIEW Measurement[\s\S]*\*\*\*End_of_Header"), _of_labview),
    (re.compile("# Created by Octave"), _of_octave),
    (re.compile(r"(?:.*\n)*DEF="), _of_cassy),
    (re.compile('"?Record Length"?,'), _of_tektronix),
    (re.compile(r"IGOR\s*\nWAVES"), _of_igor),
    (re.compile(r"(?:.*\n){0,9}WID2 .* INT |TIMESERIES .*SLIST"), _of_seismograph),
    (re.compile(r"(?: *\S+(?: +\S+){4} *\n){22}.*-12345"), _of_sac),
)
"""Texts that are no plain table, by how they begin."""


def _bare_cells(lines: list[str]) -> list[str]:
    """Take off what programs and people put behind numbers, where most lines have it."""
    filled = sum(bool(line.strip()) for line in lines[:100])
    for found, put in _CLOTHED:
        if sum(bool(found.search(line)) for line in lines[:100]) > 0.5 * filled:
            lines = [found.sub(put, line) for line in lines]
    return lines


_MONTH: Final = "jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec"
_CLOTHED: Final[tuple[tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]], ...]] = (
    (re.compile(r"(?<=\d)\s*(?:±|\+/?-)\s*\d+(?:\.\d+|,\d+(?=[^,]*[;\t]|[^,]*$))?"), ""),
    (re.compile(r"^([^;]*\d);\s*$"), r"\1"),
    (
        re.compile(r"^(\d{1,2}:\d\d:\d\d[.,]\d+) -> (?=[^,;\t=:]*([,;\t]))"),
        lambda found: found[1] + found[2],
    ),
    (
        re.compile(rf"(?i)\b(\d\d?)[- ]({_MONTH})[a-z]*[- ](?=\d{{4}}\b)"),
        lambda found: f"{found[1]}.{_MONTH.index(found[2].lower()) // 4 + 1}.",
    ),
    (
        re.compile(rf"(?i)\b[a-z]{{3}} ({_MONTH}) +(\d+) ([\d:.]+) (\d{{4}})\b"),
        lambda found: f"{found[2]}.{_MONTH.index(found[1].lower()) // 4 + 1}.{found[4]} {found[3]}",
    ),
)
"""Errors (``± 0.1``); rows that end in ``;``; a serial monitor's clock; months as words."""


def _of_several_lines(lines: list[str]) -> list[str]:
    """Join the lines of each record: blocks of ``name: value``, XML, two prints a sample."""
    filled = [line for line in lines if line.strip()]
    shapes = [_shape(line) for line in filled[:400]]
    alike = (
        (sum(map(str.__eq__, shapes, shapes[n:])) / max(1, len(shapes) - n), n)
        for n in range(1, _FEW_LINES * 5)
    )
    length = next((n for share, n in alike if share > 0.9), 1)
    again = zip(shapes, shapes[length:], strict=False)
    start = next((at for at, (one, other) in enumerate(again) if one == other), 0)
    record = filled[start : start + length]
    widths = {len(re.split(r"[\t;,]| +", line.strip())) for line in record}
    if length == 1 or (len(widths) == 1 and widths != {1}):
        return lines
    sign = next((sign for sign in "\t;," if any(sign in line for line in record)), " ")
    starts = range(start, len(filled), length)
    return [*filled[:start], *(sign.join(filled[at : at + length]) for at in starts)]


def _shape(line: str) -> str:
    """What a line says beside its numbers."""
    numberless = _TOKEN.sub("\0", line[:_LONGEST_ROW])
    return " ".join(numberless.replace("[[", " [").replace("]]", "]").split())


def _in_rows(lines: list[str]) -> list[str]:
    """Part a list that stands in one line."""
    if len(lines) >= 5:
        return lines
    whole = re.sub(r"^(\w+\s*=\s*)?[\[{]\s*(?=[(\[{])", "", "\n".join(lines).lstrip())
    return re.sub(r"(?<=[)\]}])\s*,\s*(?=[(\[{])", "\n", whole).split("\n")


_TOKEN: Final = re.compile(
    r"(?<![\w.])(?:\d{4}-\d\d-\d\d[ T])?\d{1,2}:\d\d:\d\d(?:[.,]\d+)?(?:Z|[+-]\d\d:\d\d)?(?![\w:])"
    r"|(?<![\w.])[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:(?:[eE]|\*\^)[+-]?\d+)?"
)
"""A time of day, or a number (Mathematica's ``1.2*^-3`` too)."""
_SAID: Final = re.compile(r"(?:([^\W\d]\w*)['\"]?\s*[:=]\s*(?:- |\[)?\s*['\"]?|<(\w+)[^<>]*>)\s*$")
_WORDS: Final = re.compile(r"[^\W\d]\w*['\"]?\s*[:=]\s*(?:- )?['\"]?\0|(->|[\[({>]|\])\s*\0")


def _without_words(lines: list[str]) -> list[str]:
    """Keep the numbers and units of rows that say the same words about them, each time anew.

    So serial monitors, logs and printed lists have it: ``t = 12 ms, theta: 0.5 deg``,
    ``12:03:04.5 -> 0.3``, ``(0.1, 0.2),``. The words become the names.
    """
    some = [line for line in lines[:100] if line.strip() and len(line) < _LONGEST_ROW]
    shapes = Counter(map(_shape, some))
    shape, many = shapes.most_common(1)[0] if shapes else ("", 0)
    if 2 * many <= len(some) + 1 or not _WORDS.search(shape):
        return lines
    said = [_SAID.search(piece) for piece in shape.split("\0")[:-1]]
    behind = [piece.split()[:1] for piece in re.sub(r"->|[,;|)\]}\"]", " ", shape).split("\0")[1:]]
    units = [word[0] if word and unit_of(word[0]) else "" for word in behind]
    names = "\t".join(each[1] or each[2] if each else "" for each in said)
    rows, first = list(lines), len(lines)
    for row, line in enumerate(lines):
        if len(line) < _LONGEST_ROW and _shape(line) == shape:
            rows[row] = "\t".join(
                f"{cell.replace(' ', 'T').replace('*^', 'e')} {unit}".strip()
                for cell, unit in zip(_TOKEN.findall(line), units, strict=True)
            )
            first = min(first, row)
    # The names take the place of the line above, so that the rows keep their numbers.
    return [*rows[: max(0, first - 1)], names, *rows[first:]] if names.strip() else rows


def _without_split_decimals(lines: list[str]) -> list[str]:
    """Repair rows with commas in the numbers and between them: as many again as there are names."""
    head = next((row for row, line in enumerate(lines[:50]) if _SPLIT.fullmatch(line)), 0)
    cells, names = lines[head].split(","), lines[head - 1].split(",") if head else []
    if len(names) < 2 or len(cells) != 2 * len(names):
        return lines
    rows = [line for line in lines[head:] if line]
    if not all(_SPLIT.fullmatch(row) and row.count(",") == len(cells) - 1 for row in rows[:100]):
        return lines
    return [*lines[:head], *(re.sub(r"(\d+),(\d+)(,|$)", r"\1.\2\3", row) for row in lines[head:])]


_SPLIT: Final = re.compile(r"[+-]?\d+,\d+(,[+-]?\d+,\d+)+")


def _upright(lines: list[str]) -> list[str]:
    """Turn a table that lies on its side: a few long lines, each of one quantity."""
    longest = max(lines[:_FEW_LINES], key=len).strip(";, ")
    sign = next((sign for sign in "\t;," if sign in longest), " ")
    some = (re.sub(_BRACKETS, rf"\1{sign}\2", line.strip()) for line in lines[:_FEW_LINES])
    cells = [row.split(sign if sign != " " else None) for row in some if row]
    cells = [row for row in cells if len(row) >= 5 * _FEW_LINES]
    if len(lines) > _FEW_LINES or len(cells) < 2 or len(set(map(len, cells))) > 1:
        return lines
    return ["\t".join(column) for column in zip(*cells, strict=True)]


_BRACKETS: Final = re.compile(r"^['\"]?(\w+)['\"]?\s*[:=]\s*\[([^\[\]]*)\]\s*[;,]?$")
"""``t = [0 0.1 0.2];``: MATLAB, Python, YAML."""
_FEW_LINES: Final = 12


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
    r'|""|[-*]{1,4}|--[.:]--|n/?[ad]|n\.[ad]\.|k\.a\.|\.|#+|#n/a|#nv|#[^\W\d]+(/0)?[!?]|[+-]?∞|null|none'
    r"|-?nan(\(ind\))?|-?1\.#(qnan|snan|ind|inf)\d*|\?|ol|over(load|flow|range)?|no data"
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


@dataclass(frozen=True)
class Header:
    """Names, units and masses (one a column, ``""`` where absent), interval, remarks."""

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    interval_s: float | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


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
    next_reader_if(score < 0.3, "no block of rows with numbers was found")
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
    rows (a few rows of numbers belong to the header).
    """
    above: list[int] = []
    first: list[int] = []
    for place, line in enumerate(lines):
        if not line.strip() or is_comment(line):
            continue
        above = [*above, place] if _is_row(layout.split(line), layout) else []
        first = first or above
        if len(above) == _IN_A_ROW:
            break
    next_reader_if(not first, "no row of numbers was found")
    return (above or first)[0]


def _is_row(cells: Sequence[str], layout: Layout) -> bool:
    kinds = layout.kinds(cells) if len(cells) == layout.width else ""
    filled = len(kinds) - kinds.count("b")
    # "Record Length,2500" belongs to a header.
    return "n" in kinds and 2 * kinds.count("t") <= filled and kinds not in ("tn", "nt")


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
    r"(?:(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})[T ,]+|(\d{1,2})[-/.](\d{1,2})[-/.](\d{4}|\d\d)[T ,]+)?"
    r"(?!\d+\.\d+\s*(?:[a-z+-]|$))"  # 12.50 is a number
    # Points part hours from minutes where they part these from seconds: 38:05.6 has no hours.
    r"(?:(\d{1,3})(?::(?=\d+:)|\.(?=\d+\.)))?(\d{1,2})[:.](\d{1,2}(?:[.,:]\d+)?)"
    r"\s*(am|pm)?\s*(?:z|utc|[+-]\d{2}:?\d{2})?",
    re.I,
)


def column_of_clock_times(cells: Sequence[str]) -> FloatArray | None:
    """Turn ``12:34:56.7``, ``0:05.2`` or ``2024-05-01T12:34:56`` into seconds.

    Times of day that pass midnight go on, and minutes that pass the hour; dates are counted
    from 1 January 1970. Of two parts the last is seconds. A day and month that could be either
    are taken as month/day with slashes, as day.month else: it matters at midnight only.

    Returns
    -------
    seconds
        ``None`` if the cells are no times.
    """
    matches = [_CLOCK.fullmatch(cell.strip().lstrip("'")) for cell in cells]
    if not cells or any(match is None for match in matches):
        return None
    seconds = np.empty(len(cells))
    slashed = {match.groups()[:6]: "/" in match[0] for match in matches if match is not None}
    try:
        days = {date: _days(date, slashes) for date, slashes in slashed.items()}
    except ValueError:  # there is no such day
        return None
    for row, match in enumerate(matches):
        assert match is not None
        date, (hour, minute, second, half) = match.groups()[:6], match.groups()[6:]
        hours = int(hour or 0)
        hours = hours % 12 + 12 * (half.lower() == "pm") if half else hours
        of_day = 3600 * hours + 60 * int(minute) + float(re.sub("[,:]", ".", second))
        seconds[row] = 86400.0 * days[date] + of_day
    if min(days.values()) < 0:
        return None
    if seconds.max() < 86400:
        turn = 86400.0 if any(match and match[7] for match in matches) else 3600.0
        seconds -= turn * np.cumsum(np.rint(np.diff(seconds, prepend=seconds[0]) / turn))
    return seconds


def _days(date: tuple[str | None, ...], slashed: bool) -> int:
    """Count the days since 1970; 0 without a date."""
    parts = [int(part or 0) for part in date]
    if not any(date):
        return 0
    year, month, day = parts[:3] if date[0] else parts[:2:-1]
    if not date[0] and (month > 12 or (slashed and day <= 12)):
        day, month = month, day
    return dt.date(year + 2000 * (year < 100), month, day).toordinal() - 719163


def _without_cut_row(
    lines: list[str], first: int, layout: Layout
) -> tuple[list[str], tuple[str, ...]]:
    """Leave out a last row that a power cut or a full disk has cut short.

    It has fewer cells than every other row; or no end of line, and its last number has fewer
    letters, or fewer decimals, than that of every other row.
    """
    last = max((row for row, line in enumerate(lines) if line.strip()), default=0)
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


def _size(cell: str, layout: Layout) -> tuple[int, int]:
    """Letters of a number without its sign, and those behind its decimal sign."""
    bare = cell.lstrip("+-") if not is_blank(cell) else ""
    return len(bare), len(bare.partition(layout.decimal)[2])


def _all_numbers(rows: Sequence[str], layout: Layout) -> FloatArray | None:
    """Read rows that hold nothing but numbers; ``None`` where they hold anything else."""
    if layout.decimal == ",":
        rows = [row.replace(",", ".") for row in rows]
    delimiter = None if layout.delimiter == " " else layout.delimiter
    try:
        return np.loadtxt(rows, delimiter=delimiter, comments=None, ndmin=2, dtype=np.float64)
    except ValueError:
        return None


def _at_once(
    lines: Sequence[str], first: int, layout: Layout, header: Header
) -> list[Column] | None:
    """Read a block of nothing but numbers, a row a line; ``None`` if it is anything else."""
    last = max(row for row, line in enumerate(lines, start=1) if line.strip())
    table = _all_numbers(lines[first:last], layout)
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
    notes = [f"{left} line(s) of text below the first row left out"] * bool(left)
    return [line for _, line in rows], np.array([number for number, _ in rows], np.int64), notes


def _text_of(line: str, layout: Layout) -> tuple[bool, bool]:
    """Say whether a line is text, as loggers print between the rows; and whether it begins so.

    A row with one cell that is no number is a row with a fault.
    """
    if _NO_TEXT.fullmatch(line) or is_comment(line):
        return (is_comment(line),) * 2
    cells = layout.split(line)
    kinds = layout.kinds(filter(None, cells))
    begins = kinds[:1] == "t"
    return begins and (set(kinds) == {"t"} or len(cells) != layout.width), begins


_NO_TEXT: Final = re.compile(r"[\s\d.,;:+\-eE|/\"']*")


def _columns(
    place: Path, rows: list[str], numbers: IntArray, layout: Layout, header: Header
) -> tuple[list[Column], list[list[str]]]:
    """Turn the rows into columns with the header's names, and those of words as they stand."""
    table = _all_numbers(rows, layout)
    if table is not None:
        return [_column(header, column, values) for column, values in enumerate(table.T)], []
    cells = [layout.split(row) for row in rows]
    widths = list(map(len, cells))
    width = max(layout.width, *widths)
    refuse_if(
        width > max(_WIDEST, 4 * layout.width),
        f"{place}, line {numbers[widths.index(max(widths))]}",
        f"{width} cells in a row",
        "correct or drop the row",
    )
    columns: list[Column] = []
    words: list[list[str]] = []
    for place_of, texts in enumerate(map(list, zip_longest(*cells, [""] * width, fillvalue=""))):
        del texts[-1]
        column = column_of_numbers(texts, layout, _column(header, place_of, np.empty(0)))
        clock = None if np.isfinite(column.values).any() else column_of_clock_times(texts)
        if clock is not None:
            columns.append(Column(column.name or "time", "s", clock, column.number))
        elif np.isfinite(column.values).any():
            columns.append(column)
        else:
            words.append(texts)
            # "0.123,V": the unit stands in a column of its own.
            same = len(set(texts)) == 1 and not is_blank(texts[0])
            if columns and unit_of(texts[0]) and not columns[-1].unit and same:
                columns[-1] = replace(columns[-1], unit=texts[0])
    return columns, words


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
    some_keys, rows = len(rows), [each for each in rows if len(each) >= 8]
    if clock is None or not rows or not 1 < some_keys <= _MOST_KEYS:
        return columns, numbers
    if np.all(np.diff(clock.values) > 0) or any(
        np.any(np.diff(clock.values[each]) <= 0) for each in rows
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


_RATE_WORD: Final = re.compile(
    r"sampl\w*[\s_\-.]*(rate|freq)|abtast(rate|freq)|frame[\s_]*rate|scan[\s_]*rate|\bfps\b|\bfs\b"
    r"|messrate|(?-i:^FREQUENCY\t)|rate[\s_]*\(?hz|sampled at|(update|output|data)[\s_]*rate",
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


def read_header(place: Path, lines: Sequence[str], layout: Layout) -> Header:
    """Read the lines above the first row of numbers, which is the last of `lines`.

    Raises
    ------
    InputError
        When a line under the names is a row with text where the numbers begin.
    """
    *above, row = lines
    filled = [(number, line) for number, line in enumerate(above, start=1) if line.strip()]
    names_at, cells = _names(filled, layout)
    _refuse_damaged_rows(place, filled, names_at, layout.split(row), layout)
    interval = interval_of([line for _, line in filled[-300:]])
    metadata = _metadata([line for _, line in filled])
    notes: tuple[str, ...] = ()
    glued = layout.split(filled[-1][1]) if filled else []
    if len(glued) == 2 * layout.width - 1 > 1 and layout.is_number(glued[-1]):
        notes = (f"line {filled[-1][0]}: names and the first row in one line, which is not read",)
    if not cells:
        told = "no header: columns are recognised by their values"
        return Header((), (), (), interval, metadata, (told, *notes))
    pairs = [split_header(cell) for cell in cells]
    names, units = [name for name, _ in pairs], [unit for _, unit in pairs]
    row_of_units = _row_of_units([line for number, line in filled if number > names_at], layout)
    if row_of_units:
        said = zip(row_of_units[-len(units) :], units, strict=True)
        units = [unit or own for unit, own in said]
    if missing := layout.width - len(cells):
        # Rows may end in a sign that the header lacks.
        ends = not layout.split(row)[-1]
        names, units = (
            each + [""] * missing if ends else [""] * missing + each for each in (names, units)
        )
        at = "first" if ends else "last"
        named = f"the header names {len(cells)} of {layout.width} columns: taken as the {at}"
        notes = (*notes, named)
    # Names that stand more than once are numbered: Volt, Volt (2).
    before = ((name, names[:place].count(name)) for place, name in enumerate(names))
    unique = tuple(f"{name} ({n + 1})" if n and name else name for name, n in before)
    over = [layout.split(line) for number, line in filled if number < names_at][-1:]
    points = _points(over[0], unique) if over and unique != tuple(names) else ()
    return Header(unique, tuple(units), points, interval, metadata, notes)


def _points(cells: list[str], names: Sequence[str]) -> tuple[str, ...]:
    """Read Tracker's names of masses, each above the first of the mass's columns."""
    if len(cells) != len(names) or cells[0] or not cells[1]:
        return ()
    return tuple(accumulate(cells, lambda mass, cell: cell or mass))


def _splits(line: str, layout: Layout) -> Iterator[list[str]]:
    """Split a line of names as its rows are, and in the other ways that fit their width."""
    bare = line.strip().lstrip("".join(COMMENT)).strip()
    own = [layout.split(line), layout.split(bare)]
    # Origin's labels stand before the columns.
    labelled = own[0][1:] if _LABEL.fullmatch(own[0][0]) else own[0]
    yield from (cells for cells in (*own, labelled) if len(cells) == layout.width)
    told = ": " in f"{bare} "  # a remark, unless the rows' own sign splits it
    if not told and not any(map(layout.is_number, layout.split(bare))):
        # "t (s) theta (rad)", "t / s  phi / rad": a unit belongs to the name before it.
        joined = re.sub(r"\s+(?=[\[({])|\s*/\s*", lambda gap: gap[0].strip() or "\0", bare).split()
        others = [bare.split(sign) for sign in "\t;,|"] + [re.split(r"\s{2,}", bare)]
        ways = (*others, [cell.replace("\0", " ") for cell in joined])
        trimmed = (_trimmed([cell.strip() for cell in cells], layout.width) for cells in ways)
        yield from (cells for cells in trimmed if len(cells) == layout.width)
    yield from ([bare.split()] if is_comment(line) else [])
    yield from own


def _trimmed(cells: list[str], width: int) -> list[str]:
    """Leave out empty cells beyond the width."""
    while len(cells) > width and not cells[-1]:
        cells = cells[:-1]
    return cells


_LABEL: Final = re.compile(
    r"(?i)((long )?name|units?|einheit(en)?|unidad(es)?|unit[àé]s?|eenhe(id|den))?"
)


def _are_units(cells: Sequence[str]) -> bool:
    """Say whether a row holds nothing but units: known ones, or all in brackets."""
    filled = [cell for cell in cells if not _LABEL.fullmatch(cell)]
    bracketed = all(re.fullmatch(r"[\[({<].*[\])}>]", cell) for cell in filled)
    known = [unit_of(cell) is not None for cell in filled]
    return any(known) and (bracketed or all(known))


def _names(filled: Sequence[tuple[int, str]], layout: Layout) -> tuple[int, list[str]]:
    """Find the line of names: the last (but for a row of units) that fits the columns."""
    candidates: list[tuple[int, int, list[str]]] = []
    for above, (number, line) in pairwise([(0, ""), *filled]):
        bare = line.strip().lstrip("".join(COMMENT)).strip()
        own = layout.split(line)
        if candidates and len(own) == layout.width and all(map(layout.is_number, own)):
            break  # the block has begun: what follows is damaged
        words = len(bare.split())
        titled = (
            words > 4 or (words > 1 and not split_header(bare)[1]) or "," in bare or ":" in bare
        )
        if bare.endswith(("[", "{", "(")) or (layout.width == 1 and titled):  # A = [
            continue
        for cells in _splits(line, layout):
            # Rigol's names go on beyond the rows.
            longer = layout.delimiter in "\t;," and number >= filled[-1][0] - 1 and cells == own
            cells = cells[: layout.width] if longer else _trimmed(cells, layout.width)
            cells = [cell.lstrip("#%") for cell in cells]
            bare_cells = (_TOKEN.sub("", cell) for cell in cells)
            said = [any(map(str.isalpha, cell)) or "°" in cell for cell in bare_cells]
            numbers = list(map(layout.is_number, cells))
            texts = sum(a and not b for a, b in zip(said, numbers, strict=True))
            few = len(cells) < layout.width and not is_comment(line)
            # A column of row numbers may have no name.
            timed = few and len(cells) == layout.width - 1 and texts == len(cells) > 1
            if few and not (timed and role_of(split_header(cells[0])[0]) == "time"):
                continue
            if (
                texts
                and len(cells) / 2 <= texts <= len(cells) <= layout.width
                and not ((candidates or layout.width < 4) and any(numbers))
                and not (
                    _are_units(cells)
                    and [(above[0], len(cells))] == [(n, len(c)) for _, n, c in candidates[-1:]]
                )
            ):
                candidates.append((sum(map(bool, cells)), number, cells))
                break
    _, number, names = max(candidates, key=lambda entry: entry[:2], default=(0, 0, []))
    return number, names


def _row_of_units(below: Sequence[str], layout: Layout) -> list[str] | None:
    """Read a row under the names that holds units only."""
    rows = (
        [cell.strip("[](){} ") for cell in cells]
        for line in reversed(below)  # "t A v" above "s rad rad/s" are symbols
        for cells in _splits(line.strip(" ").lstrip("#%"), layout)
        if len(cells) == layout.width and _are_units(cells)
    )
    return next(rows, None)


def _refuse_damaged_rows(
    place: Path, filled: Sequence[tuple[int, str]], names_at: int, row: list[str], layout: Layout
) -> None:
    """Refuse text where the numbers begin: a row of the block's width under the names.

    Rows of numbers alone are no damage; but then the line after them is, for the block
    would else begin with them.
    """
    below = [(number, line) for number, line in filled if names_at and number > names_at]
    for place_of, (number, line) in enumerate(below):
        cells = layout.split(line)
        good = list(map(layout.is_number, cells))
        if len(cells) != len(row) or layout.width == 1 or not any(good):
            continue
        texts = [at for at, is_good in enumerate(good) if not is_good and cells[at]]
        wrong = [cells[at] for at in texts if layout.is_number(row[at])]
        if texts and not wrong:
            continue
        if not wrong:
            number, line = below[min(place_of + 1, len(below) - 1)]
            wrong = [line.strip()[:60]]
        raise InputError(
            f"{place}, line {number}", f"'{wrong[0]}' is no number", "correct or drop the row"
        )


def interval_of(lines: Sequence[str]) -> float | None:
    """Find the time between samples in ``Sample rate: 100 Hz`` and its relatives."""
    for (line, follower), (word, inverse) in product(
        zip(lines, [*lines[1:], ""], strict=False),
        ((_RATE_WORD, True), (_INTERVAL_WORD, False), (_SAMPLING, None)),
    ):
        found = word.search(line)
        # Else names stand over their values.
        place = len(re.findall("[,\t]", line[: found.start()])) if found else 0
        cells = re.split("[,\t]", follower) if re.search("[,\t]", line) else [follower]
        below = "".join(cells[place : place + 1]).strip()
        value = found and (_VALUE.search(line, found.end()) or _VALUE.fullmatch(below))
        if not found or not value:
            continue
        number = float(value[1].replace(",", "."))
        unit = value[2].lower() or line[found.end() : found.end() + 8].lower()
        if inverse is None:
            inverse = any(sign in unit for sign in ("hz", "s/s", "sps", "fps"))
            number *= inverse or unit in ("s", "ms", "us", "µs")
        known = {"khz": 1e3} if inverse else {"ms": 1e-3, "us": 1e-6, "µs": 1e-6}
        if 1e-9 < number < 1e12:
            number *= next((size for sign, size in known.items() if sign in unit), 1.0)
            return 1.0 / number if inverse else number
    alone = re.findall(r"(?<![\w.,])(\d+(?:\.\d+)?) ?(k?)(?:Hz|sps)\b", " ".join(lines))
    rates = [float(number) * (1e3 if kilo else 1.0) for number, kilo in alone]
    return 1.0 / rates[0] if len(rates) == 1 and rates[0] > 0.0 else None


def _metadata(lines: Sequence[str]) -> dict[str, str]:
    """Keep ``key: value`` lines (with or without a comment sign) as they stand."""
    parts = (line.strip().lstrip("#%/! ").partition(":") for line in lines[:200])
    told = {k.strip(): v.strip() for k, _, v in parts if v.strip() and 0 < len(k) <= 40}
    return {"header": " ".join(lines)[:4000]} | told
