"""What stands behind a WinDaq file's samples: events, annotations, comments; and pauses."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.formats.table import Marker
from pendpipe.formats.windaq_header import WindaqHeader

_COMMENT_FLAG: Final = -0x80000000
_PAUSE: Final = 2.0
"""Stamps are whole seconds: less than this is no pause."""
_GAP: Final = re.compile(r"gap (\d{1,9}\.\d{1,9}) s\b")
_WORD: Final = struct.Struct("<i")
_LONGEST_TEXT: Final = 1024
_LONGEST_TAIL: Final = 4096
"""Bytes behind the samples of a recording with a damaged header; more is not sought."""


def gap_comment(missing_s: float) -> str:
    """Say the length of a gap so that `scan_times` understands it: ``gap 0.350000 s``."""
    return f"gap {missing_s:.9f} s"


@dataclass(frozen=True)
class Event:
    """An event: scan, its stamp (seconds after the opening, where given), comment."""

    scan: int
    stamp_s: int | None
    comment: str


@dataclass(frozen=True)
class Trailers:
    """Events in the order of the file, and a text for each channel."""

    events: tuple[Event, ...]
    annotations: tuple[str, ...]


def parse_trailers(
    data: bytes,
    at: int,
    event_bytes: int,
    header: WindaqHeader,
    scans: int,
    *,
    rising: bool = False,
) -> Trailers | None:
    """Read the trailers from byte `at`; ``None`` if what stands there can't be trailers.

    With `rising` no two events may be at one scan: samples of zero would read as a list.

    Trailer 1 is a list of 32-bit integers: a pointer to a scan (to a sample, in HiRes
    files), then a time stamp if the pointer is not negative, then a comment's place if the
    next integer has its top bit set.
    """
    count = event_bytes // 4
    if event_bytes % 4 or at + event_bytes > len(data):
        return None
    texts_at = at + event_bytes
    per_scan = len(header.channels) if header.hires else 1
    events: list[Event] = []
    place, last = 0, -1

    def word(place: int) -> int:
        # One by one: a damaged size may promise a list as long as the file.
        return int(_WORD.unpack_from(data, at + 4 * place)[0])

    while place < count:
        pointer = word(place)
        place += 1
        scan = abs(pointer) // per_scan
        if not (last + rising <= scan <= scans):
            return None
        stamp, comment = None, ""
        if pointer >= 0:
            if place >= count:
                return None
            stamp = word(place)
            place += 1
        # Pointers end at the number of samples; what lies far below zero is a comment.
        if place < count and word(place) < _COMMENT_FLAG // 2:
            offset = word(place) & 0x7FFFFFFF
            place += 1
            if texts_at + offset >= len(data):
                return None
            comment = _text(
                data[texts_at + offset : texts_at + offset + _LONGEST_TEXT].split(b"\0", 1)[0]
            )
        events.append(Event(scan, stamp, comment))
        last = scan
    width = len(header.channels)
    names = data[texts_at : texts_at + width * _LONGEST_TEXT].split(b"\0", width)[:width]
    return Trailers(tuple(events), tuple(map(_text, names)))


def _text(text: bytes) -> str:
    """Turn a text of the file into one line."""
    return " ".join(text[:_LONGEST_TEXT].decode("latin-1").split())


def _texts_from(data: bytes) -> int:
    """Find the byte from which on there is nothing but printable signs and NULs."""
    tail = np.frombuffer(data[-_LONGEST_TAIL:], dtype=np.uint8)
    odd = np.flatnonzero((tail != 0) & (tail < 32) & ((tail < 9) | (tail > 13)) | (tail == 255))
    return len(data) - len(tail) + (int(odd[-1]) + 1 if len(odd) else 0)


def mended(data: bytes, header: WindaqHeader) -> tuple[WindaqHeader, Trailers] | None:
    """Find sizes under which a file with damaged ones makes sense from end to end.

    The data size is sought among the header's with bits taken away (a bit that was set by
    damage is the commonest fault), then among all. The trailers it implies must read as
    events, then as texts to the end of the file.
    """
    unit = 2 * len(header.channels)
    available = len(data) - header.size
    tail = available // unit * unit
    texts_from = _texts_from(data)
    sizes = [size for size in _submasks(header.data_bytes) if 0 < size <= available]
    for size in (size for size in sizes if size % unit == 0):
        found = _consistent(data, header, size, texts_from)
        if found is not None:
            return found
    # A recording without comments ends a few hundred bytes after its samples. Part of an
    # event list reads as a list too: the one that begins with the start, else the longest.
    tries = [
        _consistent(data, header, size, texts_from)
        for size in range(tail, max(tail - _LONGEST_TAIL, 0), -unit)
    ]
    found_all = [found for found in tries if found is not None]
    return max(
        found_all,
        key=lambda found: (found[1].events[0].stamp_s is not None, len(found[1].events)),
        default=None,
    )


def _submasks(value: int) -> list[int]:
    """List the numbers that have no bit which `value` has not, largest first."""
    bits = [bit for bit in range(32) if value >> bit & 1]
    if len(bits) > 12:
        return []
    masks = [0]
    for bit in bits:
        masks += [mask | 1 << bit for mask in masks]
    return sorted(masks, reverse=True)


def _consistent(
    data: bytes, header: WindaqHeader, size: int, texts_from: int
) -> tuple[WindaqHeader, Trailers] | None:
    """Try one data size: some length of the event list must leave texts to the end."""
    at = header.size + size
    rest = len(data) - at
    # The last number of the list may end in NULs, which read as empty texts.
    least = max(8, -(-(texts_from - at) // 4) * 4)
    for event_bytes in sorted({8, least, least + 4, least + 8}, reverse=True):
        if event_bytes > rest or at + event_bytes < texts_from:
            continue
        if data.count(0, at + event_bytes) < len(header.channels):
            continue
        changed = replace(header, data_bytes=size, event_bytes=event_bytes)
        scans = size // (2 * len(header.channels))
        trailers = parse_trailers(data, at, event_bytes, header, scans, rising=True)
        if trailers is not None and trailers.events:
            return changed, trailers
    return None


def scan_times(
    header: WindaqHeader, scans: int, events: Sequence[Event]
) -> tuple[FloatArray, list[str]]:
    """Give every scan its time, pauses included.

    WinDaq strings the samples together over a pause; only the stamp of the event that
    follows tells of it. A stamp that is ahead of the samples by more than two seconds (and
    more than 1 % of the time since the last event, which a rate may be off) is a pause,
    known to a second. A comment of `gap_comment` says it exactly, where the stamp agrees.
    """
    steps = np.zeros(scans)
    notes = []
    lag, since = 0.0, 0.0
    for event in events:
        if event.stamp_s is None or not 0 < event.scan < scans:
            continue
        expected = event.scan * header.interval_s + lag
        missing = event.stamp_s - expected
        told = _GAP.match(event.comment)
        if told and abs(missing - float(told[1])) <= _PAUSE:
            missing = float(told[1])
            notes.append(f"gap of {missing:.6g} s before scan {event.scan}, by its comment")
        elif missing > max(_PAUSE, 0.01 * (expected - since)):
            notes.append(f"pause of {missing:.0f} s before scan {event.scan}, by its time stamp")
        else:
            missing = 0.0
        steps[event.scan] += missing
        lag += missing
        since = event.stamp_s
    return np.arange(scans, dtype=np.float64) * header.interval_s + np.cumsum(steps), notes


def markers(events: Sequence[Event], time_s: FloatArray) -> tuple[Marker, ...]:
    """Turn events into markers of the recording."""
    last = len(time_s) - 1
    return tuple(
        Marker(event.scan, float(time_s[min(event.scan, last)]), event.comment) for event in events
    )
