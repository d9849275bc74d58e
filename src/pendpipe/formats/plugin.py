"""What a dialect is: a kind of file that no plain table is, and how it is read.

A new dialect is one small module in `pendpipe.formats.dialects`, or in any other package that
names its `Dialect` under the entry point ``pendpipe.formats``. Nothing else has to know of it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

from pendpipe.formats.table import NotThisFormatError, ReadOptions, Table
from pendpipe.formats.text import decode, table_of_text

HEAD: Final = 1 << 15
"""Bytes of a file by which a dialect knows its own."""

Read = Callable[[Path, bytes, ReadOptions], Table]


@dataclass(frozen=True)
class Dialect:
    """A kind of file.

    Parameters
    ----------
    name
        For messages: "the NAME can't be read".
    is_mine
        Whether a file is of this kind, by its first `HEAD` bytes; wrong by chance next to never.
    read
        The file's table, from its place, its bytes and the user's options. It may raise
        `InputError`, `NotThisFormatError` where the file is none of its kind after all, or
        whatever a library raises that stumbles on a damaged file.
    suffixes
        Names that promise this kind, even where the head is damaged.
    """

    name: str
    is_mine: Callable[[bytes], bool]
    read: Read
    suffixes: tuple[str, ...] = ()


@lru_cache(maxsize=2)
def text_of(head: bytes) -> str:
    """Decode the head of a text; ``""`` where it is none."""
    try:
        return decode(head)
    except NotThisFormatError:
        return ""


def text_dialect(
    name: str, is_mine: Callable[[str], object], lines_of: Callable[[list[str]], list[str]]
) -> Dialect:
    """Make a dialect of text: known by its beginning, and rewritten as the lines of a plain table.

    Parameters
    ----------
    is_mine
        Whether the text of the head is of this kind (``re.compile(...).match``).
    lines_of
        The lines of a plain table, of those of the file.
    """

    def read(place: Path, data: bytes, options: ReadOptions) -> Table:
        return table_of_text(place, "\n".join(lines_of(decode(data).split("\n"))), options, "csv")

    return Dialect(name, lambda head: bool(is_mine(text_of(head))), read)
