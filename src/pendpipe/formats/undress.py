"""Tables in words and brackets: logs, serial monitors, printed lists, records of several lines.

Each function takes the dress off, or gives back the very lines that it was given. They are asked
only where a text as it stands is no table.
"""

import re
from collections import Counter
from collections.abc import Callable
from typing import Final

from pendpipe.formats.header import TOKEN
from pendpipe.formats.words import unit_of

_LONGEST_ROW: Final = 1000
"""Letters of a row with words in it."""


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
    """What a line says beside its numbers, each of which is a NUL here."""
    numberless = TOKEN.sub("\0", line[:_LONGEST_ROW].replace("\0", " "))
    return " ".join(numberless.replace("[[", " [").replace("]]", "]").split())


def _in_rows(lines: list[str]) -> list[str]:
    """Part a list that stands in one line."""
    if len(lines) >= 5:
        return lines
    text = "\n".join(lines).lstrip()
    whole, opened = re.subn(r"^(\w+\s*=\s*)?[\[{]\s*(?=[(\[{])", "", text)
    whole = re.sub(r"(?<=[)\]}])\s*[\]}][;\s]*$", "", whole) if opened else whole
    return re.sub(r"(?<=[)\]}])\s*,\s*(?=[(\[{])", "\n", whole).split("\n")


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
                for cell, unit in zip(TOKEN.findall(line), units, strict=True)
            )
            first = min(first, row)
    # The names take the place of the line above, so that the rows keep their numbers.
    return [*rows[: max(0, first - 1)], names, *rows[first:]] if names.strip() else rows


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


UNDRESSED: Final[tuple[Callable[[list[str]], list[str]], ...]] = (
    _of_several_lines,
    _in_rows,
    _bare_cells,
    _without_words,
    _upright,
)
