"""What every reader of a file returns: named columns of numbers, before any is chosen.

The numbers of a column show by themselves whether they swing, how far, and how evenly they were
taken.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import refuse_if
from pendpipe.facts import Fact
from pendpipe.formats.lost import without_marks
from pendpipe.formats.words import Role
from pendpipe.physics.lengthening import Coefficient, elliptic, sine_share
from pendpipe.recording import is_uniform

if TYPE_CHECKING:
    from zipfile import ZipFile

ABSURD: Final = 1e100
"""Beyond this nothing was measured; squares of it are no numbers."""
FEWEST: Final = 8
"""Readings that show a swing: of two cycles, four in each."""
FEWEST_ROWS: Final = 4
"""Rows of a table, or numbers of an array: fewer belong to a header."""
_WANDER: Final = 8.0
"""Cycles up to which what moves may as well drift: the lowest of the bins that are looked at."""
_LOOKED_AT: Final = 1 << 15
"""Samples of a long column that are transformed: means of neighbours."""
_CLEAR: Final = 0.25
"""Share of the variance that lies near one frequency; of white noise it is under 0.05."""


@dataclass(frozen=True)
class Swing:
    """How a column moves.

    Parameters
    ----------
    amplitude
        Root mean square of its strongest oscillation, in its own unit.
    clarity
        Share of the variance about the trend that lies within 15 % of one frequency.
    samples_per_cycle
        Samples in a cycle of that frequency; 0 where nothing oscillates.
    graded
        Share of the cycles whose size lies between a tenth and 85 % of the largest:
        large for a free decay, 0 for a drive that is switched on and off.
    """

    amplitude: float = 0.0
    clarity: float = 0.0
    samples_per_cycle: float = 0.0
    graded: float = 0.0

    @property
    def clear(self) -> bool:
        """Whether there is an oscillation at all."""
        return self.clarity > _CLEAR


def swing_of(values: FloatArray) -> Swing:
    """Find the strongest oscillation about the trend, from two cycles on."""
    finite = values[np.isfinite(values)]
    steps = np.diff(finite)
    # What goes one way only (a clock) turns nowhere, though its roundings do.
    if len(finite) < FEWEST or np.abs(finite).max() > ABSURD or not steps.min() < 0.0 < steps.max():
        return Swing()
    # A torn number that still is one may be a million times as large as the others.
    low, high = np.percentile(finite, (1, 99))
    finite = np.clip(finite, 2.0 * low - high, 2.0 * high - low)
    block = -(-len(finite) // _LOOKED_AT)
    some = finite[: len(finite) // block * block].reshape(-1, block).mean(axis=1)
    ramp, rest = np.linspace(-1.0, 1.0, len(some)), some - some.mean()
    rest -= float(rest @ ramp) / float(ramp @ ramp) * ramp
    power = np.abs(np.fft.rfft(rest)) ** 2
    power[:2] = 0.0
    whole = len(some) * float(rest @ rest) / 2.0
    if not whole > 0.0 or not power.any():
        return Swing()
    # The decay broadens the line, so it is looked for in bands, not in single bins.
    peak = int(np.argmax(power))
    low, high = int(0.85 * peak), int(1.15 * peak) + 2
    share = min(1.0, float(power[low:high].sum()) / whole)
    # Of a few samples a band is a good part of all there is.
    chance = min(1.0, 3.0 * (high - low) / len(power))
    return Swing(
        amplitude=float(np.sqrt(share * np.mean(rest**2))),
        clarity=share if share > chance else 0.0,
        samples_per_cycle=block * len(some) / peak,
        graded=_graded(rest, len(some) / peak),
    )


def _graded(rest: FloatArray, cycle: float) -> float:
    """Share of the cycles of middling size."""
    width = max(2, round(cycle))
    size = np.ptp(rest[: len(rest) // width * width].reshape(-1, width), axis=1)
    large = float(size.max(initial=0.0))
    return float(np.mean((size > 0.1 * large) & (size < 0.85 * large))) if large else 0.0


_TOP_RAD: Final = 2.8
"""Amplitude at which 1 % more of it lengthens the period by 3 %, and beyond by ever more."""
_FEWEST_CYCLES: Final = 8
"""Cycles: beyond the three numbers of `sine_share` with a drift they leave five for its error."""


def sine_in(lasted: FloatArray, size: FloatArray, radians: float) -> Coefficient | None:
    """How much of sin x periods of such amplitudes ask for, a reading being so many `radians`.

    Returns
    -------
    share
        ``None`` of too few cycles.
    """
    # Near the top the period has no end.
    keep = (size > 0.3 * size.max(initial=0.0)) & (radians * size < _TOP_RAD)
    lasted, angle = lasted[keep], radians * size[keep]
    if len(lasted) < _FEWEST_CYCLES:
        return None
    # A disturbed cycle is no scatter.
    powers = np.vander(angle / angle.max(), 3)[:, ::2]
    rest = np.abs(lasted - powers @ np.linalg.lstsq(powers, lasted)[0])
    near = rest <= 4.0 * np.median(rest)
    sine = 4.0 * elliptic(np.sin(0.5 * angle[near]) ** 2)[0]
    plain = np.full_like(sine, 2.0 * np.pi)
    return sine_share(lasted[near], plain, sine, np.linspace(-1.0, 1.0, len(sine)) * plain)


def derivative_slope(time: FloatArray, values: FloatArray, other: FloatArray) -> float | None:
    """Ratio of `other` to the time derivative of `values`; ``None`` if it is not that.

    Where 1, both are in the same unit; where pi/180, the one is in degrees and the
    other in radians a second.
    """
    good = np.isfinite(time) & np.isfinite(values) & np.isfinite(other)
    time, values, other = time[good], values[good], other[good]
    if len(time) < 2 * FEWEST or np.any(np.diff(time) <= 0) or np.abs(values).max() > ABSURD:
        return None
    rate = np.gradient(values, time)
    # Twice averaged over neighbours, both alike: differences of a noisy reading are noise.
    kernel = np.array([0.25, 0.5, 0.25])
    rate, other = np.convolve(rate, kernel, "valid"), np.convolve(other, kernel, "valid")
    rate, other = rate - rate.mean(), other - other.mean()
    product, size = float(rate @ other), float(rate @ rate)
    alike = abs(product) > 0.9 * np.sqrt(size * float(other @ other)) > 0.0
    return product / size if alike else None


def evenness(values: FloatArray) -> float:
    """Share of the steps within a tenth of the median step; 0 where that is 0."""
    steps = np.diff(values)
    middle = float(np.median(steps)) if len(steps) else 0.0
    return float(np.mean(np.abs(steps / middle - 1.0) <= 0.1)) if middle else 0.0


@dataclass(frozen=True)
class Gap:
    """Time that is missing after a sample."""

    after_sample: int
    missing_s: float


def find_gaps(time_s: FloatArray) -> list[Gap]:
    """Find the gaps.

    In evenly spaced samples an interval beyond 1.5 times the median; where a row stands
    for a count of an encoder, silence is natural at every turning point and grows near
    rest: there one beyond 50 times the 99th percentile.
    """
    steps = np.diff(time_s)
    if len(steps) < 2:
        return []
    middle = float(np.median(steps))
    limit = 1.5 * middle if is_uniform(time_s) else 50.0 * float(np.percentile(steps, 99))
    return [Gap(int(at), float(steps[at] - middle)) for at in np.flatnonzero(steps > limit)]


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
    """How many bytes a packed file of so many may hold; what holds more is no recording.

    Ninety-six megabytes of text are read in ten seconds and a gigabyte. Readings with noise pack to
    no less than half.
    """
    return max(96 << 20, 2 * size)


def refuse_unpacked(whole: int, packed: int) -> None:
    """Refuse a file of `packed` bytes whose parts unpack to more than a recording's, unread."""
    damaged_if(whole > most_unpacked(packed), f"it unpacks to {whole >> 20} MB")


def zip_archive(data: bytes) -> "ZipFile":
    """Open a zip whose members are as many, and unpack to as much, as a recording's may.

    Their records are counted before they are read: `zipfile` makes an object of each.
    """
    from zipfile import ZipFile

    entries = data.count(b"PK\x01\x02")
    damaged_if(entries > _MOST_ENTRIES, f"it holds {entries} files")
    archive = ZipFile(io.BytesIO(data))
    refuse_unpacked(sum(part.file_size for part in archive.infolist()), len(data))
    return archive


_MOST_ENTRIES: Final = 10_000
"""Files in a zip: a workbook has a hundred, a saved experiment a thousand."""


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
    garbled
        The cells that should be numbers and are not, by their row.
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
    of
        What it is a column of, where a line above the names says so: a tracked mass.
    made
        How its values were made of those in the file, where they are others.
    """

    name: str
    unit: str
    values: FloatArray
    number: int
    garbled: Mapping[int, str] = field(default_factory=dict)
    time_s: FloatArray | None = None
    resolution: float | None = None
    limits: tuple[float, float] | None = None
    role: Role = "unknown"
    of: str = ""
    made: str = ""

    @cached_property
    def clean(self) -> FloatArray:
        """Its values without those that stand for lost ones."""
        return without_marks(self.values)

    @cached_property
    def swing(self) -> Swing:
        """Its strongest oscillation."""
        return swing_of(self.clean)

    @property
    def wanders(self) -> bool:
        """Whether its strongest oscillation is too slow to tell from a drift."""
        return len(self.values) <= _WANDER * self.swing.samples_per_cycle

    @property
    def label(self) -> str:
        """Its name, or its number where it has none."""
        of = f"{self.name.partition(' (')[0]} of {self.of}" if self.of else ""
        return of or self.name or f"column {self.number}"


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
    facts
        What is known of the layout, apart from the notes.
    """

    place: Path
    format: str
    columns: tuple[Column, ...]
    lines: IntArray | None = None
    interval_s: float | None = None
    markers: tuple[Marker, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    facts: tuple[Fact, ...] = ()

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
            "it is not after --start",
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
