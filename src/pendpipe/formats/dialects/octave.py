"""Octave's text: columns, rows and matrices below one another, each with its name."""

import re

from pendpipe.formats.plugin import text_dialect
from pendpipe.formats.table import FEWEST_ROWS


def _lines(lines: list[str]) -> list[str]:
    """Put those of the usual length side by side."""
    blocks = [block.split("\n") for block in "\n".join(lines).split("# name: ")[1:]]
    rows = [[line.split() for line in b[1:] if line.strip() and line[:1] != "#"] for b in blocks]
    across = [each if len(each) == 1 else zip(*each, strict=False) for each in rows]
    columns = [[b[0], *cells] for b, some in zip(blocks, across, strict=True) for cells in some]
    longest = max(map(len, columns), default=0)
    columns = [column for column in columns if len(column) == longest]
    return (
        ["\t".join(row) for row in zip(*columns, strict=True)] if longest > FEWEST_ROWS else lines
    )


OCTAVE = text_dialect("file of Octave", re.compile("# Created by Octave").match, _lines)
