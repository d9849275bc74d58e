"""What every reader of a file returns: named columns of numbers, before any is chosen."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import refuse_if
from pendpipe.formats.samples import Swing, swing_of
from pendpipe.formats.words import Role


class NotThisFormatError(Exception):
    """A reader's reason why the file is none of its own; the next one is tried."""


def next_reader_if(wrong: object, reason: str) -> None:
    """Leave the file to the next reader where something says that it is none of this one's.

    Raises
    ------
    NotThisFormatError
        Where `wrong` is true.
    """
    if wrong:
        raise NotThisFormatError(reason)


def damaged_if(wrong: object, problem: str) -> None:
    """Refuse what contradicts itself, or would fill the memory, as a library would.

    Raises
    ------
    ValueError
        Where `wrong` is true; who has the file's name turns it into a user error.
    """
    if wrong:
        raise ValueError(problem)


def most_unpacked(size: int) -> int:
    """How many bytes a packed file of so many may hold; what holds more is no recording."""
    return max(256 << 20, 100 * size)


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
    role
        What it holds, once that is settled.
    """

    name: str
    unit: str
    values: FloatArray
    number: int
    fault: tuple[int, str] | None = None
    time_s: FloatArray | None = None
    resolution: float | None = None
    limits: tuple[float, float] | None = None
    role: Role = "unknown"

    @cached_property
    def swing(self) -> Swing:
        """Its strongest oscillation."""
        return swing_of(self.values)

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
        return f"{self.place}, " + (
            f"sample {row}" if self.lines is None else f"line {self.lines[row]}"
        )


@dataclass(frozen=True)
class ReadOptions:
    """Overrides of a reader's guesses; ``None`` everywhere means: guess, and report the guess.

    Parameters
    ----------
    channel
        One of the channels that ``pendpipe inspect`` lists, by name or by number from 1
        (a table's time column is no channel).
    column
        A column of a table by its name or its number from 1: ``"theta"`` or ``"3"``. A
        pair ``"x,y"`` is a position seen from the pivot. Before a colon stands the time
        column: ``"t:theta"``, ``"1:x,y"``.
    unit
        The unit of the readings (``rad``, ``mrad``, ``deg``, ``V``, ``mV``, ``m``, ``cm``,
        ``mm``, ``rad/s``, ...). Before a colon stands the unit of the time column:
        ``"ms:deg"``, ``"us:"``.
    sample_rate
        Samples a second; times are then counted from the first row, and a time column is
        not used.
    decimal
        ``"."`` or ``","``.
    delimiter
        What stands between the cells: a character, or ``tab``, ``space``, ``comma``,
        ``semicolon``.
    volts_per_radian
        The sensor's constant, kept in the recording's metadata.
    start_s, stop_s
        The part of the recording to read, on the file's own clock, seconds.
    """

    channel: str | None = None
    column: str | None = None
    unit: str | None = None
    sample_rate: float | None = None
    decimal: str | None = None
    delimiter: str | None = None
    volts_per_radian: float | None = None
    start_s: float | None = None
    stop_s: float | None = None

    def __post_init__(self) -> None:
        for option, value in (
            ("--sample-rate", self.sample_rate),
            ("--volts-per-radian", self.volts_per_radian),
        ):
            refuse_if(
                value is not None
                and not (value == value and abs(value) not in (0.0, float("inf"))),
                option,
                f"{value} can't be used",
                "give a finite number, not 0",
            )
        refuse_if(
            self.sample_rate is not None and self.sample_rate < 0,
            "--sample-rate",
            "it is negative",
            "give samples a second",
        )
        refuse_if(
            self.start_s is not None and self.stop_s is not None and self.stop_s <= self.start_s,
            "--stop",
            "it does not lie after --start",
            "swap the two",
        )

    @property
    def columns(self) -> tuple[str | None, str | None]:
        """The column of times and that of the readings."""
        return _halves(self.column)

    @property
    def units(self) -> tuple[str | None, str | None]:
        """The unit of times and that of the readings."""
        return _halves(self.unit)


def _halves(text: str | None) -> tuple[str | None, str | None]:
    """What stands before a colon, where there is one; and what stands behind it."""
    parts = [part.strip() or None for part in (text or "").split(":")]
    return (parts[0] if len(parts) > 1 else None), parts[-1]
