"""The lines above the first row of numbers: names, units, rate, remarks."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, pairwise, product
from typing import Final

from pendpipe.formats.grammar import COMMENT, Layout, is_comment
from pendpipe.formats.words import role_of, split_header, unit_of

TOKEN: Final = re.compile(
    r"(?<![\w.])(?:\d{4}-\d\d-\d\d[ T])?\d{1,2}:\d\d:\d\d(?:[.,]\d+)?(?:Z|[+-]\d\d:\d\d)?(?![\w:])"
    r"|(?<![\w.])[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:(?:[eE]|\*\^)[+-]?\d+)?"
)
"""A time of day, or a number (Mathematica's ``1.2*^-3`` too)."""


@dataclass(frozen=True)
class Header:
    """Names, units and masses (one a column, ``""`` where absent), interval, remarks.

    `names_at` is the line of the names, from 1; 0 without any.
    """

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    points: tuple[str, ...] = ()
    interval_s: float | None = None
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    names_at: int = 0


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
_LONGEST_KEY: Final = 40
"""Letters before the colon of a remark; more are a sentence."""
_VALUE: Final = re.compile(r"([+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)\s*([a-zµ/]*)", re.I)


def read_header(lines: Sequence[str], layout: Layout) -> Header:
    """Read the lines above the first row of numbers, which is the last of `lines`."""
    *above, row = lines
    filled = [(number, line) for number, line in enumerate(above, start=1) if line.strip()]
    names_at, cells = _names(filled, layout)
    interval = interval_of([line for _, line in filled[-300:]])
    metadata = _metadata([line for _, line in filled])
    glued = layout.split(filled[-1][1]) if filled else []
    is_glued = len(glued) == 2 * layout.width - 1 > 1 and layout.is_number(glued[-1])
    told = "names and the first row in one line, which is not read"
    notes = (f"line {filled[-1][0]}: {told}",) if is_glued else ()
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
    return Header(unique, tuple(units), points, interval, metadata, notes, names_at)


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
            bare_cells = (TOKEN.sub("", cell) for cell in cells)
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
        if number > 0.0:
            number *= next((size for sign, size in known.items() if sign in unit), 1.0)
            return 1.0 / number if inverse else number
    alone = re.findall(r"(?<![\w.,])(\d+(?:\.\d+)?) ?(k?)(?:Hz|sps)\b", " ".join(lines))
    rates = [float(number) * (1e3 if kilo else 1.0) for number, kilo in alone]
    return 1.0 / rates[0] if len(rates) == 1 and rates[0] > 0.0 else None


def _metadata(lines: Sequence[str]) -> dict[str, str]:
    """Keep ``key: value`` lines (with or without a comment sign) as they stand."""
    parts = (line.strip().lstrip("#%/! ").partition(":") for line in lines[:200])
    told = {k.strip(): v.strip() for k, _, v in parts if v.strip() and 0 < len(k) <= _LONGEST_KEY}
    return {"header": " ".join(lines)[:4000]} | told
