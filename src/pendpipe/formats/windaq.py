"""WinDaq recordings: .WDQ (14 bit), .WDH (HiRes), .WDC and .WHC (circular).

Layout after the CODAS data-format description: little-endian throughout, no magic at the
start; the only mark is 0x8001 in the header's last two bytes. Behind the samples stand events,
annotations and comments, which also hold pauses, and what a damaged header lost.
"""

from __future__ import annotations

import datetime as dt
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, Marker, NotThisFormatError, Table

SUFFIXES: Final = (".wdq", ".wdh", ".wdc", ".whc")
_MARK: Final = 0x8001
_SIZES: Final = (1156, 1536, 5296)
_HIRES, _PACKED = 1 << 1, 1 << 14


_LARGEST_SCALE: Final = 1e30
"""No unit makes a count worth more than this: a greater scale is a damaged one."""


@dataclass(frozen=True)
class Channel:
    """A channel's scale: value = slope * count + intercept, in `unit`; its rate divisor."""

    number: int
    slope: float
    intercept: float
    unit: str
    divisor: int


@dataclass(frozen=True)
class WindaqHeader:
    """The fields that decoding needs; sizes in bytes, times in seconds."""

    size: int
    channels: tuple[Channel, ...]
    data_bytes: int
    event_bytes: int
    annotation_bytes: int
    interval_s: float
    opened: int
    hires: bool
    packed: bool
    circular: bool
    next_write: int
    wrapped: bool
    notes: tuple[str, ...] = ()

    @property
    def scans(self) -> int:
        """Scans that the data hold (of the unpacked size, where packed)."""
        return self.data_bytes // (2 * len(self.channels))


def parse_header(place: Path, data: bytes, options: ReadOptions) -> WindaqHeader:
    """Read the header and check every field that decoding rests on.

    Raises
    ------
    NotThisFormatError
        When the mark is missing and the name does not promise a WinDaq file either.
    InputError
        When the file is a WinDaq file, and damaged beyond repair.
    """
    ours = place.suffix.lower() in SUFFIXES
    size, notes = _size(data)
    if not size:
        if not ours:
            raise NotThisFormatError("the mark 0x8001 at the end of a WinDaq header is missing")
        raise InputError(
            place,
            "this is no WinDaq file, or its header is damaged (the mark 0x8001 is missing)",
            "open and save it in WinDaq, or give another copy",
        )
    word = struct.unpack_from("<H", data, 0)[0]
    count = word & (0x1F if size <= 1536 else 0xFF)
    table, entry = data[4], data[5]
    if not count or table + count * entry > size - 2 or entry < 36:
        raise InputError(
            place,
            f"the WinDaq header is damaged ({count} channels of {entry} bytes at {table})",
            "give another copy",
        )
    interval = struct.unpack_from("<d", data, 28)[0]
    if not (isfinite(interval) and 1e-7 < interval < 1e6):
        if options.sample_rate is None:
            raise InputError(
                place,
                f"the WinDaq header is damaged (sample interval {interval:g} s)",
                "give the true rate with --sample-rate",
            )
        notes.append(f"the sample interval in the header ({interval:g} s) can't be true")
        interval = 1.0 / options.sample_rate
    compression = struct.unpack_from("<i", data, 44)[0]
    if compression < 1:
        # WinDaq itself refuses such a file, by its byte 44.
        notes.append(f"the header's compression of the display ({compression}) can't be true")
    flags = struct.unpack_from("<H", data, 100)[0]
    state = data[65] >> 6
    circular = size == 1536 or place.suffix.lower() in (".wdc", ".whc")
    low, high = struct.unpack_from("<HH", data, 56)
    header = WindaqHeader(
        size=size,
        channels=tuple(_channel(data, table + i * entry, i) for i in range(count)),
        data_bytes=struct.unpack_from("<I", data, 8)[0],
        event_bytes=struct.unpack_from("<I", data, 12)[0],
        annotation_bytes=struct.unpack_from("<H", data, 16)[0],
        interval_s=interval,
        opened=struct.unpack_from("<i", data, 36)[0],
        hires=bool(flags & _HIRES),
        packed=bool(flags & _PACKED),
        circular=circular,
        next_write=low | high << 16,
        wrapped=circular and state == 2,
    )
    for channel in header.channels:
        # (Infinities and NaN fail the comparisons as well.)
        if not (0.0 < abs(channel.slope) < _LARGEST_SCALE > abs(channel.intercept)):
            raise InputError(
                place,
                f"the scale of channel {channel.number} is damaged ({channel.slope:g})",
                "give another copy",
            )
    # A scan without a word would let a damaged header claim any number of scans.
    if header.packed and min(channel.divisor for channel in header.channels) > 1:
        raise InputError(
            place, "no channel of this packed file is in every scan", "give another copy"
        )
    promised = place.suffix.lower() in (".wdh", ".whc")
    if ours and promised != header.hires:
        kind = "HiRes" if header.hires else "14-bit"
        notes.append(
            f"the header is that of {kind}, the name {place.suffix} is not: the header is believed"
        )
    return replace(header, notes=tuple(notes))


def _size(data: bytes) -> tuple[int, list[str]]:
    """Find the header's size: as stated, or by the mark."""
    if len(data) < 1156:
        return 0, []

    def marked(size: int) -> bool:
        return 110 < size <= len(data) and struct.unpack_from("<H", data, size - 2)[0] == _MARK

    stated = struct.unpack_from("<h", data, 6)[0]
    if marked(stated):
        return stated, []
    for size in _SIZES:
        if marked(size) and data[4] == 110 and data[5] == 36:
            return size, [f"the header's own size ({stated}) is damaged: {size} bytes by its mark"]
    return 0, []


def _channel(data: bytes, at: int, place: int) -> Channel:
    slope, intercept = struct.unpack_from("<dd", data, at + 8)
    unit = data[at + 24 : at + 30].split(b"\0")[0].decode("latin-1").strip()
    # DOS wrote the degree sign as byte 0xF8, which is another letter today.
    unit = unit.replace("ø", "°")
    return Channel(place + 1, slope, intercept, unit, max(data[at + 31], 1))


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


def repaired(data: bytes, header: WindaqHeader) -> tuple[WindaqHeader, Trailers] | None:
    """Find sizes under which a file with damaged ones makes sense from end to end.

    The data size is sought among the header's with bits taken away (a bit that was set by
    damage is the commonest damage), then among all. The trailers it implies must read as
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
    known to a second. A comment of `gap_comment` gives it exactly, where the stamp agrees.
    """
    steps = np.zeros(scans)
    notes = []
    lag, since = 0.0, 0.0
    for event in events:
        if event.stamp_s is None or not 0 < event.scan < scans:
            continue
        expected = event.scan * header.interval_s + lag
        missing = event.stamp_s - expected
        match = _GAP.match(event.comment)
        if match and abs(missing - float(match[1])) <= _PAUSE:
            missing = float(match[1])
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


_ENOUGH: Final = 32


def read_table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read a WinDaq file.

    The value of a 14-bit count is (raw >> 2) m + b, of a HiRes count raw m/4 + b (m, b
    the channel's slope and intercept).

    Raises
    ------
    NotThisFormatError
        When the file is none of WinDaq's.
    InputError
        When it is one, and damaged beyond repair.
    """
    header = parse_header(place, data, options)
    header, trailers, notes = _checked(place, data, header)
    raw = np.frombuffer(data, dtype="<i2", count=_words(header), offset=header.size)
    counts = _counts(header, raw)
    scans = max(map(len, counts))
    events = trailers.events if trailers else ()
    time, pauses = scan_times(header, scans, events)
    names = trailers.annotations if trailers else ()
    columns = [
        _column(header, channel, counts[place], time, names[place] if place < len(names) else "")
        for place, channel in enumerate(header.channels)
    ]
    if header.packed:
        notes.append("packed: channels have rates of their own")
    metadata = {}
    if header.opened > 0:
        opened = dt.datetime.fromtimestamp(header.opened, dt.UTC)
        metadata["recorded_at"] = opened.isoformat()
    return Table(
        place=place,
        format="windaq" + "-hires" * header.hires + "-circular" * header.circular,
        columns=tuple(columns),
        markers=markers(events, time),
        metadata=metadata,
        notes=(*header.notes, *notes, *pauses),
    )


def _checked(
    place: Path, data: bytes, header: WindaqHeader
) -> tuple[WindaqHeader, Trailers | None, list[str]]:
    """Make the sizes in the header agree with the file, and read what follows the samples."""
    available = len(data) - header.size
    unit = 2 * len(header.channels)
    at = header.size + 2 * _words(header)
    if header.data_bytes and at <= len(data) and header.data_bytes % unit == 0:
        trailers = parse_trailers(data, at, header.event_bytes, header, header.scans)
        notes = [] if trailers else ["the list of events is damaged: no markers"]
        if trailers and at + header.event_bytes + header.annotation_bytes > len(data):
            notes.append(
                f"the header's size of the annotations ({header.annotation_bytes}) is wrong"
            )
        return header, trailers, notes
    found = repaired(data, header)
    if found is not None:
        header_found, trailers = found
        note = (
            f"the header is damaged (data size {header.data_bytes} in a file of {len(data)} bytes):"
            f" repaired to {header_found.scans} scans, which agree with the trailers"
        )
        return header_found, trailers, [note]
    if header.data_bytes > 64 * max(available, 1) or available < unit:
        raise InputError(
            place,
            f"the WinDaq header is damaged (data size {header.data_bytes} in a file of"
            f" {len(data)} bytes) and nothing in the file tells the true one",
            "repair it with the vendor's tool, or give another copy",
        )
    whole = available // unit * unit
    cause = "is still being written" if not header.data_bytes else "is cut short"
    note = f"the file {cause}: {whole // unit} whole scans are there (of {header.scans} promised)"
    left = available - whole
    return (
        replace(header, data_bytes=whole),
        None,
        [note + (f"; {left} byte(s) of a part scan left out" if left else "")],
    )


def _words(header: WindaqHeader) -> int:
    """Count the 16-bit words of the samples in the file."""
    if not header.packed:
        return header.data_bytes // 2
    return sum(-(-header.scans // channel.divisor) for channel in header.channels)


def _counts(header: WindaqHeader, raw: IntArray) -> list[IntArray]:
    """Part the interleaved words into channels, oldest first."""
    if header.packed:
        divisors = np.array([channel.divisor for channel in header.channels])
        due = np.arange(header.scans)[:, None] % divisors == 0
        owner = np.nonzero(due)[1]
        return [raw[owner == place] for place in range(len(divisors))]
    scans = raw.reshape(-1, len(header.channels))
    if header.wrapped:
        scans = np.roll(scans, -(header.next_write % len(scans)), axis=0)
    return [scans[:, place] for place in range(scans.shape[1])]


def _column(
    header: WindaqHeader, channel: Channel, raw: IntArray, time: FloatArray, name: str
) -> Column:
    """Scale one channel."""
    slope = channel.slope * (0.25 if header.hires else 1.0)
    whole = raw if header.hires else raw >> 2
    counts = whole.astype(np.float64)
    ladder = _unused_low_bits(whole)
    ends = (-32768, 32768 - ladder) if header.hires else (-8192, 8192 - ladder)
    limits = sorted(slope * end + channel.intercept for end in ends)
    return Column(
        name=name or f"channel {channel.number}",
        unit=channel.unit,
        values=counts * slope + channel.intercept,
        number=channel.number,
        time_s=time[:: channel.divisor][: len(counts)] if header.packed else time,
        resolution=abs(slope) * ladder,
        limits=(limits[0], limits[1]),
    )


def _unused_low_bits(counts: IntArray) -> int:
    """Return 2^k when the low k bits are never set: a 12-bit converter in a 16-bit word has k = 4.

    1 for a few samples, which may all be even by chance.
    """
    used = int(np.bitwise_or.reduce(counts)) if len(counts) >= _ENOUGH else 1
    return used & -used or 1
