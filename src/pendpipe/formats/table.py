"""What every reader of a file returns: named columns of numbers, before any is chosen.

The numbers of a column show by themselves whether they swing, and how far; how evenly they were
taken, in what steps, and whether the converter's end was reached.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.errors import refuse_if
from pendpipe.facts import Fact
from pendpipe.formats.words import Role
from pendpipe.physics.lengthening import Coefficient, elliptic, sine_share
from pendpipe.recording import is_uniform

if TYPE_CHECKING:
    from zipfile import ZipFile

ABSURD: Final = 1e100
"""Beyond this nothing was measured; squares of it are no numbers."""
FEWEST: Final = 8
"""Readings that show a swing: of two cycles, four in each."""
_WANDER: Final = 8.0
"""Cycles up to which what moves may as well drift: the lowest of the bins that are looked at."""
_LOOKED_AT: Final = 1 << 15
"""Samples of a long column that are transformed: means of neighbours."""
_CLEAR: Final = 0.25
"""Share of the variance that lies near one frequency; of white noise it is under 0.05."""


_BESIDE: Final = 5
"""Readings to each side of one that may stand for a lost one."""
_LEAST: Final = 0.05
"""Of the span, by which it stands out at least."""
_SPARSE: Final = 0.3
"""Share of readings beyond both their neighbours by that much, from which all may be turning
points: there are seven or fewer in a cycle."""


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


@np.errstate(invalid="ignore", over="ignore")
def without_marks(values: FloatArray) -> FloatArray:
    """Make NaN of readings that a sensor, or a program, gives in place of a lost one.

    What instruments that speak SCPI write for an overload (9.9E+37), and sentinels.
    """
    overload = (np.abs(values) >= _OVERLOAD) & (np.abs(values) < 1.1 * _OVERLOAD)
    return _without_codes(np.where(overload, np.nan, values) if overload.any() else values)


def _without_codes(values: FloatArray) -> FloatArray:
    """Make NaN of readings far from the others.

    Such a reading leaves the range of its neighbours, and comes back, by more than that range. It
    is lost where the same number (``0``, ``-999``) does so three times, or where it is also beyond
    all others by more than they span. What jumps over the whole span of the others has wrapped.
    """
    good, starts, level = _levels(values)
    if len(level) < 2 * _BESIDE:
        return values
    step = np.diff(level)
    turns = 1 + np.flatnonzero(step[:-1] * step[1:] < 0.0)
    rest = np.delete(level, turns)
    span, middle = float(np.ptp(rest)), 0.5 * float(rest.min() + rest.max())
    floor = max(_LEAST * span, 3.0 * np.abs(step).min())
    at = turns[np.minimum(np.abs(step[turns - 1]), np.abs(step[turns])) > floor]
    if len(at) > _SPARSE * len(level):
        return values
    around = sliding_window_view(np.pad(level, _BESIDE, mode="edge"), 2 * _BESIDE + 1)[at]
    own = level[at]
    other = around != own[:, None]
    low = np.min(around, axis=1, where=other, initial=np.inf)
    high = np.max(around, axis=1, where=other, initial=-np.inf)
    beyond = np.maximum(low - own, own - high)
    clear = beyond / np.maximum(high - low, floor)
    off = np.abs(own - middle)
    odd = (clear > 1.0) & ((off > 0.75 * span) | (beyond < 0.75 * span))
    number, often = np.unique(own[odd], return_counts=True)
    lost = np.zeros(len(level), dtype=bool)
    lost[at[np.isin(own, number[often > 2]) | (odd & (off > 1.5 * span))]] = True
    left = _left(values, good, starts, lost)
    if not 0 < np.isnan(left).sum() - np.isnan(values).sum() < 0.2 * len(values):
        return values
    # One beside another is seen when that is gone.
    return _without_codes(left)


def _levels(values: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Give the finite rows; of these the first of each number that stands on end; the numbers."""
    good = np.flatnonzero(np.isfinite(values))
    starts = np.flatnonzero(np.diff(values[good], prepend=np.nan) != 0.0)
    return good, starts, values[good[starts]]


def _left(values: FloatArray, good: IntArray, starts: IntArray, lost: BoolArray) -> FloatArray:
    """Make NaN of all rows of the numbers that are lost."""
    left = values.copy()
    left[good[np.repeat(lost, np.diff(np.append(starts, len(good))))]] = np.nan
    return left


_OVERLOAD: Final = 9.89e37
"""What instruments that speak SCPI write for infinity is 9.9E+37, for no number 9.91E+37."""
_LONGEST_SPIKE: Final = 8
_SPIKE: Final = 0.02
"""Of the span, by which a spike is off at least: less costs a fit no more than its noise."""
_NEAR: Final = 10
_FASTER: Final = 6.0
"""Times what a cubic misses of the ten readings before and behind, by which a spike is off."""
_SPIKE_SD: Final = 8.0
"""Of what a cubic between the neighbours misses, by which the rows of a spike are all off: of
10^6 readings with noise none is by chance."""


def without_spikes(values: FloatArray) -> FloatArray:
    """Make NaN of up to eight rows on end that leave a smooth swing and come back to it.

    They all lie on one side of the cubic through two rows before and two behind, by more than
    `_SPIKE` of the span and `_SPIKE_SD` of what such a cubic usually misses; and they come back
    by as much as they left.
    """
    left, before = values, None
    while left is not before:  # one beside another is seen when that is gone
        left, before = _without_clear_spikes(left), left
    return (
        left
        if np.isnan(left).sum() - np.isnan(values).sum() < _MOST_SPIKES * len(values)
        else values
    )


def _without_clear_spikes(values: FloatArray) -> FloatArray:
    good, starts, x = _levels(values)
    if len(x) < 8 * _LONGEST_SPIKE:
        return values
    low, high = np.percentile(x, (0.5, 99.5))
    steps = np.abs(np.diff(x))
    # A converter's step is no spike.
    least = max(_SPIKE * float(high - low), 4.0 * float(steps.min()))
    begin = np.flatnonzero(steps > least) + 1
    usual = np.linspace(2, len(x) - _LONGEST_SPIKE - 3, 4000).astype(int)
    missed = np.abs(_off_cubic(x, np.arange(2, len(x) - 2), 1)[0]) if begin.size else steps
    beyond = np.pad(missed, _NEAR, mode="reflect")
    found: list[tuple[float, int, int]] = []
    for rows in range(1, _LONGEST_SPIKE + 1) if begin.size else ():
        at = begin[(begin > 1) & (begin + rows + 1 < len(x))]
        off = _off_cubic(x, at, rows)
        noise = float(np.median(np.abs(_off_cubic(x, usual, rows)))) / 0.6745
        side = np.abs(np.sign(off).sum(axis=0)) == rows
        size = np.abs(off).min(axis=0)
        # Beyond the step before it, and the one behind: those of the swing.
        step = np.diff(x)
        away, back = step[at - 1] - step[at - 2], step[at + rows - 1] - step[at + rows]
        least_step, most_step = np.sort(np.abs([away, back]), axis=0)
        returns = (away * back < 0.0) & (least_step > np.maximum(0.5 * size, 0.25 * most_step))
        # What lies between two spikes has a step before it, or behind.
        beside = np.maximum(steps[at - 2], steps[at + rows]) < 0.5 * size
        odd = side & returns & beside & (size > max(least, _SPIKE_SD * noise))
        odd &= np.abs(off).max(axis=0) < 0.75 * float(high - low)
        # Where few readings make a cycle, or noise comes in bursts, a cubic misses all of them.
        at, size, sides = at[odd], size[odd], np.arange(_NEAR)[:, None]
        near = [beyond[np.clip(at + k + sides, 0, len(beyond) - 1)] for k in (-4, rows + 1 + _NEAR)]
        odd = size > _FASTER * np.percentile(near, 80, axis=1).max(axis=0)
        found += [(big, first, rows) for big, first in zip(size[odd], at[odd], strict=True)]
    lost = np.zeros(len(x), dtype=bool)
    for _, first, rows in sorted(found, reverse=True):
        if not lost[first - 2 : first + rows + 2].any():
            lost[first : first + rows] = True
    return _left(values, good, starts, lost) if lost.any() else values


_MOST_SPIKES: Final = 0.02
"""Share of lost echoes beyond which nobody knows which of the readings are the swing."""


def _off_cubic(x: FloatArray, at: IntArray, rows: int) -> FloatArray:
    """How far some rows from each place on lie off the cubic about them, shape (rows, n)."""
    nodes, inside = np.array([-2, -1, rows, rows + 1]), np.arange(rows)
    weights = np.vander(inside, 4) @ np.linalg.inv(np.vander(nodes, 4))
    return np.asarray(x[at + inside[:, None]] - weights @ x[at + nodes[:, None]])


def _graded(rest: FloatArray, cycle: float) -> float:
    """Share of the cycles of middling size."""
    width = max(2, round(cycle))
    size = np.ptp(rest[: len(rest) // width * width].reshape(-1, width), axis=1)
    large = float(size.max(initial=0.0))
    return float(np.mean((size > 0.1 * large) & (size < 0.85 * large))) if large else 0.0


def periods(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find the periods and the amplitudes of the larger cycles.

    The level is crossed when the reading has gone from a tenth of the largest amplitude on
    one side to as much on the other, so noise near the level is no crossing.

    Returns
    -------
    periods, amplitudes
        From each crossing to the next but one, shape (n,); empty where there are few.
    """
    good, none = np.isfinite(values) & np.isfinite(time), np.empty(0)
    time, values = time[good], values[good]
    if len(values) < FEWEST or np.abs(values).max() > ABSURD:
        return none, none
    low, middle, high = np.percentile(values, (0.5, 50, 99.5))
    rest = values - middle
    outside = np.flatnonzero(np.abs(rest) > 0.1 * max(high - middle, middle - low))
    turns = np.flatnonzero(np.diff(np.signbit(rest[outside]).astype(np.int8)))
    if not high > low or len(outside) < FEWEST or len(turns) < 5:
        return none, none
    before, after = outside[turns], outside[turns + 1]
    part = rest[before] / (rest[before] - rest[after])
    crossings = time[before] + part * (time[after] - time[before])
    high, low = (
        sign * np.maximum.reduceat(sign * rest, before)[:-1] for sign in (1.0, -1.0)
    )  # of half cycles
    largest = np.maximum(high[:-1], high[1:]) - np.minimum(low[:-1], low[1:])
    lasted = crossings[2:] - crossings[:-2]
    usual = np.abs(lasted - np.median(lasted)) < 0.6 * np.median(lasted)
    return lasted[usual], 0.5 * largest[usual]


_TOP_RAD: Final = 2.8
"""Amplitude at which 1 % more of it lengthens the period by 3 %, and beyond by ever more."""
_FEWEST_CYCLES: Final = 8
"""Cycles: beyond the three numbers of `sine_share` with a drift they leave five for its error."""


def sine_in(time: FloatArray, values: FloatArray, radians: float) -> Coefficient | None:
    """How much of sin x the periods of larger cycles ask for, a reading being so many `radians`.

    Returns
    -------
    share
        ``None`` of too few cycles.
    """
    lasted, size = periods(time, values)
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
    if len(time) < 16 or np.any(np.diff(time) <= 0) or np.abs(values).max() > ABSURD:
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


@np.errstate(invalid="ignore", over="ignore")  # a span beyond all numbers; a NaN that signals
def clipped_samples(
    values: FloatArray, step: float | None, limits: tuple[float, float] | None = None
) -> int:
    """Count samples that stand at the end of the converter's range.

    Either at its known limits; or in flat tops: at least two runs of three or more equal
    readings at the very extremes, whose neighbours lie more than four steps off, as no
    smooth motion would have it. (Where readings are held for several rows, three times as many.)
    """
    if limits is not None:
        low, high = np.array(limits) + 0.5 * (step or 0.0) * np.array([1.0, -1.0])
        return int(np.sum((values <= low) | (values >= high)))
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if len(finite) else 0.0
    off = max(4.0 * (step or 0.0), 1e-3 * span)
    starts = np.flatnonzero(np.diff(finite, prepend=np.nan) != 0.0)
    least = 3.0 * float(np.median(np.diff(starts))) if span else 0.0
    ends = [_flat_tops(sign * values, off, least) for sign in (1.0, -1.0)] if span else []
    return sum(count for count, _ in ends) if sum(flat for _, flat in ends) >= 2 else 0


def _flat_tops(values: FloatArray, off: float, least: float) -> tuple[int, int]:
    """Count the samples at the maximum, if flat runs there fall off steeply, and those runs."""
    top = np.nanmax(values)
    at = np.concatenate(([False], values == top, [False]))
    edges = np.flatnonzero(np.diff(at.astype(np.int8)))
    steep = 0
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        sides = values[max(start - 1, 0) : start].tolist() + values[stop : stop + 1].tolist()
        steep += stop - start >= least and bool(sides) and top - min(sides) > off
    return int(at.sum()) if steep else 0, steep


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
