"""Serial captures of a DI-149 in its ASCII mode: ``start``, ``sc 12 13`` ..., ``stop``."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import IntArray
from pendpipe.errors import InputError
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, NotThisFormatError, Table
from pendpipe.formats.text import decode

_CLOCK_HZ: Final = 750_000.0
_SLOWEST: Final = 65535
_VOLTS_PER_COUNT: Final = 10.0 / 2048.0
_SCAN: Final = re.compile(r"sc((?:\s+[+-]?\d{1,9})+)\s*")
_BLANK, _NEW_LINE = 32, 10


@dataclass(frozen=True)
class _Scans:
    """Counts, shape (scans, channels), the line of each scan, and what was left out."""

    counts: IntArray
    numbers: IntArray
    notes: tuple[str, ...] = ()


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read a capture; the volts are 10 counts/2048, the scan rate 750 kHz over ``srate``.

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
    first, end = _block(text)
    scans = _unbroken(text, first, end)
    if scans is None:
        scans = _line_by_line(place, text.split("\n"))
        metadata, srate = _told(text.split("\n"))
    else:
        metadata, srate = _told((text[:first] + text[end:]).split("\n"))
    notes = [*scans.notes]
    if not srate and options.sample_rate is None:
        srate = _SLOWEST
        notes.append("the capture does not give its srate: 65535 (11.44 Hz) is taken")
    columns = tuple(
        Column(
            name=f"channel {channel + 1}",
            unit="V",
            values=scans.counts[:, channel].astype(np.float64) * _VOLTS_PER_COUNT,
            number=channel + 1,
            resolution=_VOLTS_PER_COUNT,
            limits=(-10.0, 2047 * _VOLTS_PER_COUNT),
        )
        for channel in range(scans.counts.shape[1])
    )
    return Table(
        place=place,
        format="di149-ascii",
        columns=columns,
        lines=scans.numbers,
        interval_s=srate / _CLOCK_HZ if srate else None,
        metadata={**metadata, "bits": "12", "range_volts": "10"},
        notes=tuple(notes),
    )


def _block(text: str) -> tuple[int, int]:
    """Find where the scans begin, and where the line of the last one ends."""
    first = 0 if text.startswith("sc") else text.find("\nsc") + 1
    last = max(text.rfind("\nsc") + 1, first)
    end = text.find("\n", last)
    return first, end if end >= 0 else len(text)


def _unbroken(text: str, first: int, end: int) -> _Scans | None:
    """Read a block of nothing but whole scans at once; ``None`` if it is anything else."""
    body = text[first:end]
    if not body.isascii() or not _SCAN.fullmatch(body.partition("\n")[0]):
        return None
    letters = np.frombuffer(body.encode("ascii") + b"\n", dtype=np.uint8)
    begins = letters > _BLANK
    begins[1:] &= letters[:-1] <= _BLANK
    words = np.diff(np.cumsum(begins)[letters == _NEW_LINE], prepend=0)
    # Every line begins with sc and has as many words as the first.
    if np.any(words != words[0]) or body.count("\nsc ") != len(words) - 1:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            counts = np.fromstring(body.replace("sc ", " "), dtype=np.int64, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
    if len(counts) != len(words) * (words[0] - 1):
        return None
    line = text.count("\n", 0, first) + 1
    return _Scans(counts.reshape(len(words), -1), np.arange(line, line + len(words)))


def _line_by_line(place: Path, lines: Sequence[str]) -> _Scans:
    """Read the scans one by one, and name the line of a damaged one."""
    scans: list[list[int]] = []
    numbers: list[int] = []
    notes: list[str] = []
    last = max((n for n, line in enumerate(lines, 1) if line.strip().startswith("sc")), default=0)
    for number, line in enumerate(lines, start=1):
        text = line.strip()
        if not text.startswith("sc"):
            continue
        match = _SCAN.fullmatch(text)
        row = [int(count) for count in match[1].split()] if match else []
        if not row or (scans and len(row) != len(scans[0])):
            if number == last:
                notes.append(f"the last scan (line {number}) is cut short and left out")
                break
            raise InputError(
                f"{place}, line {number}", f"'{text[:60]}' is no whole scan", "drop the row"
            )
        scans.append(row)
        numbers.append(number)
    if not scans:
        raise InputError(place, "there is no whole scan", "record again, or give another file")
    return _Scans(np.array(scans, dtype=np.int64), np.array(numbers), tuple(notes))


def _told(lines: Sequence[str]) -> tuple[dict[str, str], int | None]:
    """Take the time of the recording and the divisor from the lines that are no scans."""
    metadata: dict[str, str] = {}
    srate = None
    for line in lines:
        text = line.strip()
        if match := re.search(r"srate\s+(x[0-9a-f]{1,8}|\d{1,9})", text):
            srate = int(match[1][1:], 16) if match[1][0] == "x" else int(match[1])
        if re.fullmatch(r"1\d{9}(\.\d+)?", text):
            metadata["recorded_at"] = f"{text} s since 1970"
    return metadata, srate
