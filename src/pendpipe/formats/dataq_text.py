"""Dataq's own texts: spreadsheet exports of WinDaq, and captures of a DI-149 in its ASCII mode."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError
from pendpipe.formats.layout import Layout, column_of_clock_times
from pendpipe.formats.table import Column, Marker, NotThisFormatError, ReadOptions, Table
from pendpipe.formats.text import decode, table_of_text

_CLOCKS: Final = ("time stamp", "timestamp", "clock")
_CLOCK_HZ: Final = 750_000.0
_SLOWEST: Final = 65535
_VOLTS_PER_COUNT: Final = 10.0 / 2048.0
_SCAN: Final = re.compile(r"sc(\s+[+-]?\d{1,9})+")


def read_export(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read an export; its columns are named by their units, so they go by their place.

    Relative Time is rounded to microseconds: times are the index over the rate, where the
    rounding allows. The last column holds ``Resume`` or a comment at an event; what the
    clock columns gained over Relative Time there is the pause.
    """
    text = decode(data) if b"elative Time" in data[:4096].replace(b"\0", b"") else ""
    head = re.search(r"^\W*relative time.*", text, re.I | re.M)
    if head is None:
        raise NotThisFormatError("there is no line that begins with 'Relative Time'")
    table = table_of_text(place, text, options, "windaq-csv")
    layout = Layout(next((sign for sign in ";\t" if sign in head[0]), ","), ".", 0)
    names, lines = layout.split(head[0].strip()), text.split("\n")
    time = next((column for column in table.columns if column.number == 1), None)
    if time is None or time.fault is not None or not np.isfinite(time.values).all():
        return table
    rows = [layout.split(lines[n - 1]) for n in (table.lines if table.lines is not None else ())]

    def cells(*words: str) -> list[str]:
        """Give the first column, but for Relative Time, whose name has one of the words."""
        found = (n for n, name in enumerate(names) if n and any(w in name.lower() for w in words))
        place_of = next(found, len(names))
        return [row[place_of] if place_of < len(row) else "" for row in rows]

    events, clock, date = cells("event"), cells(*_CLOCKS), cells("date")
    seconds, pauses = _with_pauses(_evened(time.values), events, clock)
    columns: list[Column] = []
    for column in table.columns:
        label = names[column.number - 1] if column.number <= len(names) else ""
        told = label.lower()
        if column is not time and not told.startswith(("date", *_CLOCKS)) and "event" not in told:
            name = f"channel {len(columns) + 1}"
            columns.append(replace(column, name=name, unit=label, time_s=seconds))
    began = f"{date[0]} {clock[0]}" if date and date[0] and clock[0] else ""
    return replace(
        table,
        columns=tuple(columns),
        markers=tuple(
            Marker(row, float(seconds[row]), text) for row, text in enumerate(events) if text
        ),
        metadata={**table.metadata, **({"recorded_at": began} if began else {})},
        notes=(*table.notes, *pauses),
    )


def _evened(time: FloatArray) -> FloatArray:
    """Take the rate for exact where times rounded to microseconds agree; a whole one first."""
    rate = (len(time) - 1) / (time[-1] - time[0]) if time[-1] > time[0] else 0.0
    for candidate in (float(round(rate)), rate):
        even: FloatArray = time[0] + np.arange(len(time), dtype=np.float64) / (candidate or np.nan)
        if np.abs(even - time).max() <= 1.5e-6:
            return even
    return time


def _with_pauses(
    time: FloatArray, events: Sequence[str], clock: Sequence[str]
) -> tuple[FloatArray, list[str]]:
    """Put the pauses back at rows marked ``Resume``, from the clock column's seconds."""
    clock_s = column_of_clock_times(clock)
    time, notes = time.copy(), []
    for row, event in enumerate(events):
        if row == 0 or clock_s is None or event.lower() != "resume":
            continue
        missing = (clock_s[row] - clock_s[row - 1]) - (time[row] - time[row - 1])
        if missing > 1.0:
            time[row:] += missing
            notes.append(f"pause of {missing:.0f} s before row {row + 1}, by the clock column")
    return time, notes


def read_capture(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read ``start``, ``sc 12 13`` ..., ``stop``: volts are 10 counts/2048, 750 kHz over ``srate``.

    Raises
    ------
    NotThisFormatError
        When there is no ``sc`` line.
    InputError
        When a scan is damaged.
    """
    if not re.search(rb"(^|[\r\n])sc\s+[+-]?\d", data[:65536]):
        raise NotThisFormatError("there is no line 'sc' with counts")
    text = decode(data).replace("\0", "")
    first, last = 0 if text.startswith("sc") else text.find("\nsc") + 1, text.rfind("\nsc") + 1
    end = text.find("\n", max(first, last)) % (len(text) + 1)
    counts, notes = _unbroken(text[first:end]), list[str]()
    if counts is not None:
        numbers = text.count("\n", 0, first) + 1 + np.arange(len(counts))
        rest = text[:first] + text[end:]
    else:
        rest, numbers, counts, notes = text, *_line_by_line(place, text.split("\n"))
    srate = 0
    for digits in re.findall(r"srate\s+(x[0-9a-f]{1,8}|\d{1,9})", rest):
        srate = int(digits[1:], 16) if digits[0] == "x" else int(digits)
    if not srate and options.sample_rate is None:
        srate = _SLOWEST
        notes.append("the capture does not give its srate: 65535 (11.44 Hz) is taken")
    metadata = {"bits": "12", "range_volts": "10"}
    for second in re.findall(r"^\s*(1\d{9}(?:\.\d+)?)\s*$", rest, re.M):
        metadata["recorded_at"] = f"{second} s since 1970"
    columns = tuple(
        Column(
            name=f"channel {number}",
            unit="V",
            values=channel * _VOLTS_PER_COUNT,
            number=number,
            resolution=_VOLTS_PER_COUNT,
            limits=(-10.0, 2047 * _VOLTS_PER_COUNT),
        )
        for number, channel in enumerate(counts.T, start=1)
    )
    return Table(
        place=place,
        format="di149-ascii",
        columns=columns,
        lines=numbers,
        interval_s=srate / _CLOCK_HZ if srate else None,
        metadata=metadata,
        notes=tuple(notes),
    )


def _unbroken(body: str) -> IntArray | None:
    """Read a block of nothing but whole scans at once; ``None`` if it is anything else."""
    if not body.isascii() or not _SCAN.fullmatch(body.partition("\n")[0].rstrip()):
        return None
    letters = np.frombuffer(body.encode("ascii") + b"\n", dtype=np.uint8)
    begins = letters > ord(" ")
    begins[1:] &= letters[:-1] <= ord(" ")
    words = np.diff(np.cumsum(begins)[letters == ord("\n")], prepend=0)
    # Every line begins with sc and has as many words as the first.
    if np.any(words != words[0]) or body.count("\nsc ") != len(words) - 1:
        return None
    with warnings.catch_warnings(), suppress(ValueError, DeprecationWarning):
        warnings.simplefilter("error")
        counts = np.fromstring(body.replace("sc ", " "), dtype=np.int64, sep=" ")
        return counts.reshape(len(words), words[0] - 1)
    return None


def _line_by_line(place: Path, lines: list[str]) -> tuple[IntArray, IntArray, list[str]]:
    """Read the scans one by one, with their lines; name the line of a damaged one."""
    scans = {n: line.strip() for n, line in enumerate(lines, 1) if line.lstrip().startswith("sc")}
    rows = {n: scan.split()[1:] if _SCAN.fullmatch(scan) else [] for n, scan in scans.items()}
    width, last, notes = len(next(iter(rows.values()), [])), max(rows, default=0), []
    if rows and (not width or len(rows[last]) != width):
        notes.append(f"the last scan (line {last}) is cut short and left out")
        del rows[last]
    for number, row in rows.items():
        if not row or len(row) != width:
            raise InputError(
                f"{place}, line {number}",
                f"'{scans[number][:60]}' is no whole scan",
                "drop the row",
            )
    if not rows:
        raise InputError(place, "there is no whole scan", "record again, or give another file")
    return np.array(list(rows)), np.array(list(rows.values()), dtype=np.int64), notes
