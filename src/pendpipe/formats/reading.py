"""Any supported file to a recording: the readers in turn, then the choice of columns."""

import bz2
import lzma
import re
import stat
import sys
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.analysis.readings import find_step, pull_along_string, sizes_of, with_amplitudes
from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError, nearest, refuse_if
from pendpipe.facts import KINDS, Fact, guesses, remarks
from pendpipe.files import names_in
from pendpipe.formats.columns import choose
from pendpipe.formats.lists import SETTINGS, WAVEFORM, holds_settings, steady
from pendpipe.formats.lost import lost_readings
from pendpipe.formats.plugin import HEAD
from pendpipe.formats.saturation import clipped_samples, saturation
from pendpipe.formats.table import (
    ABSURD,
    Column,
    Gap,
    Marker,
    NotThisFormatError,
    ReadOptions,
    Table,
    find_gaps,
    most_unpacked,
)
from pendpipe.formats.times import TimeBase, refuse_text, time_base
from pendpipe.formats.units import readings
from pendpipe.formats.words import role_of, split_header, unit_of
from pendpipe.recording import (
    GOOD,
    MISSING,
    QUANTITIES,
    Recording,
    check,
    converter_step,
    is_uniform,
    read_plain,
    sample_rate,
)

_ANYTHING: Final = ReadOptions()
_LARGEST: Final = 1 << 30
"""Bytes of a file; a day at 1 kHz is 1.7e8 of WinDaq's."""

_OTHERS: Final = (
    (b"%PDF", "a PDF", "give the table as CSV or .xlsx"),
    (b"\x89PNG", "a picture", "give the table as CSV or .xlsx"),
    (b"\xff\xd8\xff", "a picture", "give the table as CSV or .xlsx"),
    (b"PAR1", "a Parquet file", "export its table as CSV"),
    (b"7z\xbc\xaf", "a 7z archive", "unpack it"),
    (b"Rar!", "a RAR archive", "unpack it"),
    (b"SQLite format 3", "a database", "export its table as CSV"),
)
"""What some give that holds no table, or none that is read; by its first bytes."""

_MOST_UNPACKING: Final = 64 << 20
"""Bytes of memory that xz may ask for: nine times what it asks for as it is usually set."""
_PACKED: Final[tuple[tuple[bytes, Callable[[], Any]], ...]] = (
    (b"\x1f\x8b", lambda: zlib.decompressobj(31)),
    (b"BZh", bz2.BZ2Decompressor),
    (b"\xfd7zXZ\0", lambda: lzma.LZMADecompressor(memlimit=_MOST_UNPACKING)),
)


def read(path: str | Path, options: ReadOptions = _ANYTHING) -> Recording:
    """Read one channel of any supported file; ``-`` is standard input.

    What is stated, shown or guessed on the way stands in the recording's ``facts``; each gives way
    to its option.

    Raises
    ------
    InputError
        When no reader knows the file, or its samples can't be true: file, line, what is
        wrong, what to do.
    """
    place = Path(path)
    data = _unpacked(place, file_bytes(place))
    plain = read_if_plain(place, data, options)
    recording = recording_of(table_of(place, data, options), options) if plain is None else plain
    metadata = {"source": place.name, **recording.metadata}
    if options.volts_per_radian is not None:
        metadata["volts_per_radian"] = repr(float(options.volts_per_radian))
    recording = replace(recording, metadata=metadata)
    if options.start_s is None and options.stop_s is None:
        return recording
    part = recording.between(options.start_s, options.stop_s)
    refuse_if(
        not len(part),
        place,
        "there is no sample between --start and --stop",
        f"the recording runs from {recording.time_s[0]:.6g} to {recording.time_s[-1]:.6g} s",
    )
    return part


def file_bytes(place: Path) -> bytes:
    """Read a file, or standard input (``-``, ``/dev/stdin``), whole.

    Raises
    ------
    InputError
        When it can't be read, holds nothing, is no regular file, or is too large.
    """
    try:
        standard = str(place) in ("-", "/dev/stdin")
        found = None if standard else place.stat()
        mode = found.st_mode if found else stat.S_IFREG
        refuse_if(stat.S_ISDIR(mode), place, "this is a folder", "give a file in it")
        refuse_if(
            not stat.S_ISREG(mode),
            place,
            "this is a device or a pipe",
            "give a file, or - for standard input",
        )
        _refuse_size(place, found.st_size if found else 0)
        data = _standard_input() if standard else place.read_bytes()
    except FileNotFoundError:
        raise InputError(
            place,
            "there is no such file",
            nearest(place.name, names_in(place.parent), "check the path"),
        ) from None
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or str(fault)
        raise InputError(place, f"the file can't be read ({reason})", "check it") from None
    refuse_if(
        not data[:1024].strip(b"\0 \t\r\n\xef\xbb\xbf")
        and not data.strip(b"\0 \t\r\n\xef\xbb\xbf"),
        place,
        "the file is empty",
        "record again, or give another file",
    )
    return data


@cache
def _standard_input() -> bytes:
    """Read standard input once: it can't be read again for its digest."""
    data = sys.stdin.buffer.read(_LARGEST + 1)
    _refuse_size(Path("-"), len(data))
    return data


def _unpacked(place: Path, data: bytes) -> bytes:
    """Unpack what gzip, bzip2 or xz has packed."""
    unpacker: Any = next((make() for mark, make in _PACKED if data.startswith(mark)), None)
    if unpacker is None:
        return data
    try:
        content = bytes(unpacker.decompress(data, most_unpacked(len(data))))
    except (OSError, ValueError, EOFError, zlib.error, lzma.LZMAError) as fault:
        raise InputError(place, f"it can't be unpacked ({fault})", "pack it again") from None
    refuse_if(
        not unpacker.eof,
        place,
        "its packed content is truncated or too large",
        "unpack it, and give the file inside",
    )
    return content


def _refuse_size(place: Path, size: int) -> None:
    refuse_if(
        size > _LARGEST,
        place,
        f"the file holds {size / 1e9:.1f} GB, more than the {_LARGEST / 1e9:.1f} GB of a recording",
        "give a part of it",
    )


def table_of(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read a file by the dialect that calls it its own; else as a plain table of text."""
    from pendpipe.formats.dialects import of_file
    from pendpipe.formats.text import read_table

    for mark, what, remedy in _OTHERS:
        refuse_if(data.startswith(mark), place, f"this is {what}", remedy)
    mine, notes = of_file(data[:HEAD], place.suffix.lower())
    reason: NotThisFormatError | None = None
    for dialect in mine:
        try:
            table = dialect.read(place, data, options)
            # The layout of a dialect is stated by the mark that it bears.
            facts = table.facts or (Fact("layout", table.format, "stated"),)
            return replace(table, notes=(*table.notes, *notes), facts=facts)
        except NotThisFormatError as fault:
            reason = fault
        except InputError:
            raise
        except ImportError:
            raise InputError(
                place,
                f"what reads the {dialect.name} is not installed",
                "pip install 'pendpipe[formats]', or export CSV",
            ) from None
        except Exception as fault:
            said = " ".join(str(fault).split())[:200]
            raise InputError(
                place, f"the {dialect.name} can't be read ({said})", "save it again, or export CSV"
            ) from None
    try:
        table = read_table(place, data, options)
    except NotThisFormatError as fault:
        refuse_if(
            holds_settings(place.name, data[:HEAD].decode("utf-8", "replace")),
            *(place, SETTINGS, WAVEFORM),
        )
        raise InputError(
            place,
            "; ".join(
                [f"no reader knows this file: {fault if reason is None else reason}", *notes]
            ),
            "export it as CSV with a time and an angle column",
        ) from None
    return replace(table, notes=(*table.notes, *notes)) if notes else table


# Infinite cells are refused in the end; until then their differences are no numbers.
@np.errstate(invalid="ignore", over="ignore")
def recording_of(table: Table, options: ReadOptions) -> Recording:
    """Choose the columns of a table and turn them into a recording."""
    choice = choose(table, options)
    for column in choice.readings:
        refuse_text(table, column, "correct the row, or leave it blank")
    base = time_base(table, choice, options)
    found = readings(table, choice, options, base)
    facts = [*table.facts, *choice.facts, *base.facts, *found.facts]
    column = choice.readings[0]
    swings = column.time_s is None and column.swing.clear
    values, lost = lost_readings(found.values[base.rows], swings=swings, factor=found.factor)
    facts += lost
    _refuse_absurd(table, base, values)
    missing, start = np.isnan(values), base.time_s[0] if base.time_s.size else 0.0
    said = f"the times begin at {start:.6g} s, before their zero"
    facts += [Fact("clock", f"from {start:.6g} s", "stated", said)] * bool(start < 0)
    quality = np.where(missing, MISSING, GOOD).astype(np.uint8)
    kept = {key: value for key, value in table.metadata.items() if key in _KEPT}
    events = {
        f"marker_{number}": f"{mark.sample}; {mark.time_s!r} s; {mark.comment}"
        for number, mark in enumerate(table.markers, start=1)
    }
    metadata = {**kept, **base.metadata, **events}
    if choice.listed is not None and choice.listed.kind == "amplitudes":
        metadata["holds"] = "amplitudes"
    elif said := steady(base.time_s, values, choice.channels):
        facts.append(Fact("drive", "steady or driven", "shown", said))
    if found.quantity == "reading":
        metadata["unit"] = found.unit
    own_step, limits = column.resolution, column.limits
    step = own_step * found.factor if own_step is not None else find_step(values)
    limits = limits and (limits[0] * found.factor, limits[1] * found.factor)
    known = guesses(found.facts) == ()
    pull = pull_along_string(base.time_s, values) if found.unit == "m/s^2" and known else None
    facts += filter(None, (pull, saturation(values, step, limits)))
    recording = Recording(
        time_s=base.time_s,
        values=values,
        quantity=found.quantity,
        quality=quality if quality.any() else None,
        metadata=metadata,
        resolution=step,
        notes=(*table.notes, *remarks(facts)),
        facts=tuple(facts),
        radius_excess=None if found.radius_excess is None else found.radius_excess[base.rows],
    )
    check(table.place, recording)
    return recording


def _refuse_absurd(table: Table, base: TimeBase, values: FloatArray) -> None:
    """Refuse readings that are infinite, and what leaves the range of numbers when squared."""
    odd = np.flatnonzero(np.isinf(values))
    if odd.size:
        where = table.where(int(base.rows[odd[0]]))
        problem = f"{odd.size} reading(s) that are infinite"
        raise InputError(where, problem, "drop the rows, or leave the cells blank")
    for name, some in (("times", base.time_s), ("readings", values[~np.isnan(values)])):
        span = np.ptp(some) if some.size else 0.0
        refuse_if(
            span and not 1.0 / ABSURD < span < ABSURD,
            table.place,
            f"the {name} span {span:.3g}, which no pendulum does",
            "check their unit",
        )


_KEPT: Final = ("volts_per_radian", "bits", "range_volts", "range_low_volts", "recorded_at")
"""Of a file's own remarks those that the plain form knows."""


_IN_PLAIN: Final = {"time column": "time_s", "unit of time": "s", "unit": ""}
"""What the header of the plain form states."""
_STEERING: Final = ("channel", "column", "unit", "sample_rate", "decimal", "delimiter")
_READINGS: Final = ("angle", "volts", "length", "velocity", "acceleration", "signal")


def read_if_plain(place: Path, data: bytes, options: ReadOptions) -> Recording | None:
    """Read the file if its header is the plain form's; ``None`` if it is not.

    Options that would change the layout turn the plain form into one CSV among others.

    Raises
    ------
    InputError
        When the header has ``time_s`` and nothing that could be a reading, or a row
        is damaged.
    """
    names = _header(data)
    if "time_s" not in names or any(getattr(options, name) is not None for name in _STEERING):
        return None
    if sum(name in names for name in QUANTITIES) != 1:
        if any(_may_be_read(*split_header(name)) for name in names):
            return None
        raise InputError(
            place,
            f"one of {', '.join(QUANTITIES)} is needed (found {', '.join(names)})",
            "name the reading's column, or choose it with --column and --unit",
        )
    recording = read_plain(place, data)
    for kind, value in _IN_PLAIN.items():
        if recording.fact(kind) is None:
            recording = recording.knowing(Fact(kind, value or recording.unit, "stated"))
    stated = recording.holds_amplitudes
    recording = with_amplitudes(recording)
    if recording.holds_amplitudes:  # as our own table of turning points
        recording = replace(recording, values=sizes_of(recording.values))
    if stated:
        recording = recording.knowing(Fact("amplitudes", recording.quantity, "stated"))
    return replace(recording, resolution=recording.resolution or find_step(recording.values))


def _may_be_read(name: str, unit: str) -> bool:
    """Whether a column's name, or its unit, is that of a reading."""
    known = unit_of(unit) if unit else None
    return role_of(name) in _READINGS or (known is not None and known.kind in ("volts", "own"))


def _header(data: bytes) -> list[str]:
    """Find the first line that is no remark, split at commas."""
    first = re.search(rb"(?:^|\n)[ \t]*([^#\s][^\n]{0,4095})", data.removeprefix(b"\xef\xbb\xbf"))
    text = first[1].decode("utf-8", errors="replace") if first else ""
    return [name.strip() for name in text.split(",")]


def table_of_plain(place: Path, recording: Recording) -> Table:
    """Show a plain recording as the table that ``inspect`` goes through."""
    high, low = recording.number("range_volts"), recording.number("range_low_volts")
    step, limits = converter_step(recording), None
    if high is not None and step is not None:
        limits = (-high if low is None else low, high - step)
    column = Column(
        *(recording.quantity, recording.unit, recording.values, 2),
        time_s=recording.time_s,
        resolution=recording.resolution,
        limits=limits,
    )
    return Table(
        place, "plain", (column,), markers=tuple(markers_of(recording)), notes=recording.notes
    )


def markers_of(recording: Recording) -> list[Marker]:
    """Read back the markers that ``convert`` has kept as metadata."""
    kept = (value for key, value in recording.metadata.items() if key.startswith("marker_"))
    found = (re.fullmatch(rf"\s*(\d+)\s*;\s*({_NUMBER}) *s?\s*(?:;(.*))?", value) for value in kept)
    return [Marker(int(m[1]), float(m[2]), (m[3] or "").strip()) for m in found if m]


_NUMBER: Final = r"[+-]?\d+(?:\.\d*)?(?:e[+-]?\d+)?"


@dataclass(frozen=True)
class Inspection:
    """A file at a glance; `samples`, `gaps`, `clipped_samples` are of the chosen channel.

    Parameters
    ----------
    format
        ``plain``, ``csv``, ``windaq``, ``windaq-hires``, ``windaq-circular``,
        ``windaq-hires-circular``, ``windaq-csv``, ``di149-ascii``, ``matlab-v5``, ``excel``.
    channels
        Name and unit of each channel.
    samples
        Samples of one channel.
    sample_rate_hz, duration_s
        Rate (gaps left out) and time from the first to the last sample.
    uniform
        Whether the samples are evenly spaced, gaps apart.
    resolution
        The step between readings, in `unit`; ``None`` where there is none.
    unit
        Of the channel that would be analysed: ``rad``, ``V``, ``m``, or the file's own.
    gaps, markers, clipped_samples
        Missing times; events; samples at the converter's end.
    warnings
        What was guessed, repaired or looks odd.
    columns
        The number of each channel's column, as --column takes it.
    chosen
        The column or columns that the readings are taken from.
    level
        The median of the readings, in `unit`: where the pendulum hangs.
    facts
        What is known of the file, and how.
    why
        How the file was understood, one line per decision.
    kind
        ``motion``, ``steady or driven``, ``amplitudes``, ``periods``, ``spectrum``, ``passages``.
    scaled
        Whether readings in volts are angles by a sensor's constant that the file gives.
    """

    format: str
    channels: tuple[tuple[str, str], ...]
    samples: int
    sample_rate_hz: float
    uniform: bool
    duration_s: float
    resolution: float | None
    unit: str
    gaps: tuple[Gap, ...]
    markers: tuple[Marker, ...]
    clipped_samples: int
    warnings: tuple[str, ...]
    columns: tuple[int, ...] = ()
    chosen: str = ""
    level: float = 0.0
    facts: tuple[Fact, ...] = ()
    why: tuple[str, ...] = ()
    kind: str = "motion"
    scaled: bool = False

    @property
    def weak_guesses(self) -> tuple[str, ...]:
        """What was guessed, with the option that overrides it."""
        return guesses(self.facts)

    def as_json(self) -> dict[str, Any]:
        """Return the object that ``inspect --json`` prints."""
        return {
            "schema_version": 1,
            "format": self.format,
            "channels": [{"name": name, "unit": unit} for name, unit in self.channels],
            "samples": self.samples,
            "sample_rate_hz": self.sample_rate_hz if isfinite(self.sample_rate_hz) else None,
            "uniform": self.uniform,
            "duration_s": self.duration_s,
            "resolution": self.resolution,
            "gaps": [
                {"after_sample": gap.after_sample, "missing_s": gap.missing_s} for gap in self.gaps
            ],
            "markers": [
                {"sample": mark.sample, "time_s": mark.time_s, "comment": mark.comment}
                for mark in self.markers
            ],
            "clipped_samples": self.clipped_samples,
            "warnings": list(self.warnings),
            "chosen": self.chosen,
            "unit": self.unit,
            "level": self.level if isfinite(self.level) else None,
            "weak_guesses": list(self.weak_guesses),
            "kind": self.kind,
            "facts": [fact.as_json() for fact in self.facts],
        }


def inspect(path: str | Path, options: ReadOptions = _ANYTHING) -> Inspection:
    """Report what a file holds, even where none of its channels could be analysed.

    Raises
    ------
    InputError
        When no reader knows the file, or it holds no readings.
    """
    place = Path(path)
    data = _unpacked(place, file_bytes(place))
    plain = read_if_plain(place, data, options)
    table = table_of_plain(place, plain) if plain is not None else table_of(place, data, options)
    choice = choose(table, options, reading=False)
    refuse_if(
        not choice.readings and not choice.channels,
        place,
        "there is no column besides the time",
        "add the readings",
    )
    choice = replace(choice, readings=choice.readings or choice.channels[:1])
    column, facts = choice.readings[0], (*table.facts, *choice.facts)
    kind, scaled = choice.listed.kind if choice.listed else "motion", False
    try:
        recording = recording_of(table, options) if plain is None else plain
        time, values = recording.time_s[recording.usable], recording.values[recording.usable]
        unit, step, facts = recording.unit, recording.resolution, recording.facts
        notes = list(recording.notes)
        scaled = unit == "V" and bool(recording.metadata.get("volts_per_radian", "").strip())
        if recording.holds_amplitudes:
            kind = "amplitudes"
        elif recording.fact("drive"):
            kind = "steady or driven"
    except InputError as fault:
        try:
            base = time_base(table, choice, options)
        except InputError:
            raise fault from None
        if not np.all(np.isfinite(base.time_s)):
            raise
        time, values = base.time_s, column.values[base.rows]
        unit, step = column.unit, column.resolution or find_step(values)
        notes = [*table.notes, *remarks(facts), f"the readings can't be analysed: {fault.problem}"]
    known = unit_of(column.unit) if column.unit else None
    scale = known.factor if known is not None and unit in ("rad", "V", "m") else 1.0
    limits = (column.limits[0] * scale, column.limits[1] * scale) if column.limits else None
    finite = values[np.isfinite(values)]
    return Inspection(
        format=table.format,
        channels=tuple((column.label, column.unit) for column in choice.channels),
        samples=len(time),
        sample_rate_hz=sample_rate(time),
        uniform=is_uniform(time),
        duration_s=float(time[-1] - time[0]) if len(time) else 0.0,
        resolution=step,
        unit=unit,
        gaps=tuple(find_gaps(time)),
        markers=table.markers,
        clipped_samples=clipped_samples(values, step, limits),
        warnings=tuple(notes),
        columns=tuple(column.number for column in choice.channels),
        chosen=", ".join(column.label for column in choice.readings),
        level=float(np.median(finite)) if len(finite) else float("nan"),
        facts=facts,
        why=(
            f"read as {table.format}",
            *(
                f"column {each.number} '{each.label}': {_ROLES.get(each.role, each.role)}, "
                + (f"in {each.unit}" if each.unit else "no unit stated")
                for each in sorted(
                    (*choice.channels, *([choice.time] if choice.time else [])),
                    key=lambda c: c.number,
                )
            ),
            *(note for note in notes if note not in {fact.said for fact in facts}),
            *(fact.row for fact in sorted(facts, key=lambda fact: [*KINDS].index(fact.kind))),
            f"so {len(time)} readings of {', '.join(c.label for c in choice.readings)}, in "
            + (unit if unit != "1" else "their own unit"),
        ),
        kind=kind,
        scaled=scaled,
    )


_ROLES: Final = {"none": "nothing that swings", "unknown": "a name that says nothing"}
"""What a column's name says, where the role's own name says it badly."""
