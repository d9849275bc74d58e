"""What stands above a table: names, units, the sample rate, and remarks."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pendpipe.errors import InputError
from pendpipe.formats.layout import COMMENT, Layout, is_comment
from pendpipe.formats.words import split_header, unit_of

_RATE_WORD: Final = re.compile(
    r"sampl\w*[\s_\-.]*(rate|freq)|abtast(rate|freq)|frame[\s_]*rate|scan[\s_]*rate|\bfps\b|\bfs\b"
    r"|messrate|rate[\s_]*\(?hz|sampled at",
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
    if len(cells) < layout.width:
        missing = layout.width - len(cells)
        names, units = [""] * missing + names, [""] * missing + units
        notes = (f"the header names {len(cells)} of {layout.width} columns: taken as the last",)
    return Header(tuple(_unique(names)), tuple(units), interval, metadata, notes)


def _splits(line: str, layout: Layout) -> Iterator[list[str]]:
    """Split a line of names as its rows are, and in the other ways that fit their width."""
    bare = line.strip().lstrip("".join(COMMENT)).strip()
    own = [layout.split(line), layout.split(bare)]
    yield from (cells for cells in own if len(cells) == layout.width)
    told = ": " in bare  # a remark, unless the rows' own sign splits it
    if layout.width > 1 and not told and not any(map(layout.is_number, layout.split(bare))):
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
            if len(cells) < layout.width and not is_comment(line):
                continue
            if (candidates or layout.width < 4) and any(map(layout.is_number, cells)):
                continue
            if _are_units(cells) and candidates and candidates[-1][0] == len(cells):
                continue
            if layout.width == 1 and (len(bare.split()) > 4 or "," in bare or ":" in bare):
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
            if inverse:
                return 1.0 / (number * (1e3 if "khz" in unit else 1.0))
            return number * (
                1e-3 if "ms" in unit else 1e-6 if "us" in unit or "µs" in unit else 1.0
            )
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
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 or not name else f"{name} ({seen[name]})")
    return out
