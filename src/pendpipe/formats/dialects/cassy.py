"""CASSY Lab's text, of version 2 (MIN=, MAX=, SCALE=, DEC=, DEF=) and of version 1 (.lab)."""

import re

from pendpipe.formats.plugin import text_dialect


def _lines(lines: list[str]) -> list[str]:
    """Make of the definitions a line of names."""
    head = [re.sub("^(?=(MIN|MAX|SCALE|DEC)=)", "# ", line) for line in lines[:50]]
    head = [re.sub('^DEF=|"|&', "", line) if line[:4] == "DEF=" else line for line in head]
    return head + lines[50:]


def _lines_of_lab(lines: list[str]) -> list[str]:
    """Read name, symbol and unit of each column, then the rows, whose number is said above them.

    Each column is three lines of text above one of at least fifteen settings. Of columns that are
    computed some are not kept: then those behind the time have no names.
    """
    settings = re.compile(r"[-+\d.eE]+( [-+\d.eE]+){14,}")
    at = [
        row
        for row in range(4, min(len(lines), 500))
        if settings.fullmatch(lines[row].strip()) and not lines[row - 2].strip()[:1].isdigit()
    ]
    names = [" ".join(lines[row - 3 : row - 1]) for row in at]
    head = [
        f"{n} ({lines[row - 1]})" if lines[row - 1] else n for n, row in zip(names, at, strict=True)
    ]
    sizes = (
        (row, int(found[1]), int(found[2]))
        for row, line in enumerate(lines[:1000])
        if (found := re.fullmatch(r"(\d+) (\d+) *", line))
        and lines[row + 1 : row + 2] != []
        and len(lines[row + 1].rstrip("\t").split("\t")) == int(found[1]) > 1
    )
    start, wide, many = next(sizes, (len(lines), len(head), 0))
    head = head if len(head) == wide else [*head[:2], *[""] * (wide - 2)]
    return ["\t".join(head), *(line.rstrip("\t") for line in lines[start + 1 : start + 1 + many])]


CASSY = text_dialect("CASSY text", re.compile(r"(?:.*\n){0,49}DEF=").match, _lines)
CASSY_1 = text_dialect("CASSY .lab", re.compile(r"CL[34]\n").match, _lines_of_lab)
