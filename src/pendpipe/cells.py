"""Cells of tables: nothing that a file or its name holds becomes a formula of a spreadsheet.

A spreadsheet computes a cell that begins with ``=``, ``+``, ``-`` or ``@``, and a formula can call
programs. All text that is written passes `inert`, which puts an apostrophe before such a
beginning; `original` takes it off again. Numbers stay numbers.
"""

import csv
import io
import re
from collections.abc import Iterable
from itertools import chain, repeat
from typing import Any, Final

from pendpipe.files import MADE_BY, MARK

_BEGINS: Final = (
    r"(?!(?:[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?) *(?:[,;\t\r\n]|\Z))"  # no number
    r"[ ']*[=+\-@\uff1d\uff0b\uff0d\uff20]"  # the wide ones of East Asian keyboards too
)
_CELL: Final = r"(\A|[,;\t\r\n])"
"""A text may be split once more: where a decimal comma is usual, a CSV is read by semicolons."""
_FORMULA: Final = re.compile(_CELL + f"(?={_BEGINS})", re.IGNORECASE)
_QUOTED: Final = re.compile(_CELL + f"'(?={_BEGINS})", re.IGNORECASE)


def inert(text: str) -> str:
    """Put an apostrophe before what a spreadsheet would compute, as its users do.

    >>> inert("=1+1"), inert("-0.0012"), inert("a;=1"), inert("pendulum-1.csv")
    ("'=1+1", '-0.0012', "a;'=1", 'pendulum-1.csv')
    """
    return _FORMULA.sub(r"\1'", text)


def original(text: str) -> str:
    """Take the apostrophes of `inert` off.

    >>> original("'=1+1"), original("'tis")
    ('=1+1', "'tis")
    """
    return _QUOTED.sub(r"\1", text)


def csv_text(head: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a table for a file of ours, which says in its last column who made it."""
    marked = zip(rows, chain([MADE_BY], repeat("")), strict=False)
    return csv_rows([(*head, MARK), *((*row, mark) for row, mark in marked)])


def csv_rows(rows: Iterable[Iterable[Any]]) -> str:
    """Return rows as CSV: text is inert, what is None is empty."""
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(
        [inert(cell) if isinstance(cell, str) else cell for cell in row] for row in rows
    )
    return out.getvalue()
