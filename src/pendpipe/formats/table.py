"""What every reader of a file returns: named columns of numbers, before any is chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pendpipe.arrays import FloatArray, IntArray


class NotThisFormatError(Exception):
    """A reader's reason why the file is none of its own; the next one is tried."""


@dataclass(frozen=True)
class Marker:
    """An event that was marked while the recording was made."""

    sample: int
    time_s: float
    comment: str = ""


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a table, or one channel of an instrument.

    Parameters
    ----------
    name, unit
        As the file gives them; ``""`` where it does not.
    values
        The numbers, shape (n,); NaN where the file has none.
    fault
        Row and text of the first cell that should be a number and is not.
    number
        Its place in the file, from 1.
    time_s
        The channel's own time base, where the instrument gives one.
    resolution
        Step of the converter in `unit`, where the file gives it.
    limits
        The lowest and the highest value that the converter can give.
    """

    name: str
    unit: str
    values: FloatArray
    number: int
    fault: tuple[int, str] | None = None
    time_s: FloatArray | None = None
    resolution: float | None = None
    limits: tuple[float, float] | None = None

    @property
    def label(self) -> str:
        """Its name, or its number where it has none."""
        return self.name or f"column {self.number}"


@dataclass(frozen=True, eq=False)
class Table:
    """All that a reader found in a file.

    Parameters
    ----------
    place
        The file.
    format
        The name that ``inspect`` prints.
    columns
        Every column that holds numbers.
    lines
        The line (or row) of the file that each row came from, shape (n,); ``None`` where
        the format has no lines.
    interval_s
        Time between samples, where the file gives it apart from a time column.
    markers, metadata, notes
        Events; what stood beside the numbers; what was guessed or repaired.
    """

    place: Path
    format: str
    columns: tuple[Column, ...]
    lines: IntArray | None = None
    interval_s: float | None = None
    markers: tuple[Marker, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def where(self, row: int) -> str:
        """Name a row for a message."""
        if self.lines is None:
            return f"{self.place}, sample {row}"
        return f"{self.place}, line {self.lines[row]}"
