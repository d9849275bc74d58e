"""WinDaq recordings: .WDQ (14 bit), .WDH (HiRes), .WDC and .WHC (circular); a .WDH is written too.

Layout after the CODAS data-format description: little-endian throughout, no magic at the
start; the only mark is 0x8001 in the header's last two bytes. Behind the samples stand events,
annotations and comments, which also hold pauses, and what a damaged header lost. What WinDaq's
screen needs (windows, keys, cursors) is written as in the files that WinDaq itself writes for one
time window; nothing of it concerns the samples.
Dataq's own texts are here too: spreadsheet exports, and captures of a DI-149 in its ASCII mode.
"""

import datetime as dt
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import refuse_if
from pendpipe.formats.grammar import Layout
from pendpipe.formats.table import (
    Column,
    Marker,
    NotThisFormatError,
    ReadOptions,
    Table,
    next_reader_if,
)
from pendpipe.formats.text import decode, table_of_text

SUFFIXES: Final = (".wdq", ".wdh", ".wdc", ".whc")
_FIELDS: Final = {
    "channels": (0, "<u2"),
    "one": (2, "<u2"),
    "table": (4, "u1"),
    "entry": (5, "u1"),
    "size": (6, "<i2"),
    "data_bytes": (8, "<u4"),
    "event_bytes": (12, "<u4"),
    "annotation_bytes": (16, "<u2"),
    "screen": (18, "(3,)<i2"),
    "windows": (24, "(4,)u1"),
    "interval_s": (28, "<f8"),
    "opened": (36, "<i4"),
    "closed": (40, "<i4"),
    "compression": (44, "<i4"),
    "next_write": (56, "<u4"),
    "shown": (64, "(4,)u1"),
    "order": (68, "(32,)u1"),
    "flags": (100, "<u2"),
}
_ENTRY_FIELDS: Final = {
    "scale": (0, "<f4"),
    "offset": (4, "<f4"),
    "slope": (8, "<f8"),
    "intercept": (16, "<f8"),
    "unit": (24, "S6"),
    "divisor": (31, "u1"),
    "number": (32, "u1"),
    "gain": (33, "u1"),
}
_MARK: Final = b"\x01\x80"
_HEADER_BYTES, _TABLE, _ENTRY = 1156, 110, 36
_SIZES: Final = (_HEADER_BYTES, 1536, 5296)
_HIRES, _PACKED = 1 << 1, 1 << 14
_ANOTHER_COPY: Final = "give another copy"
_LARGEST_SCALE: Final = 1e30
"""No unit makes a count worth more than this: a greater scale is a damaged one."""
MOST_SAMPLES: Final = 1 << 29
"""Pointers count samples in 31 bits, the data size bytes in 32."""


def _layout(fields: dict[str, tuple[int, str]], size: int) -> np.dtype[Any]:
    offsets, formats = zip(*fields.values(), strict=True)
    return np.dtype(
        {"names": list(fields), "formats": formats, "offsets": offsets, "itemsize": size}
    )


_HEADER: Final = _layout(_FIELDS, 102)


@dataclass(frozen=True)
class Channel:
    """How a channel's counts are to be understood.

    Parameters
    ----------
    number
        The channel as printed on the box, where it is written; its place, where it was read.
    slope, intercept
        value = slope * count + intercept for counts of 14 bits; the slope of a HiRes file is four
        times the step, as if the two low bits were not there.
    unit
        At most five letters of Latin-1 reach a file.
    range_volts
        Full scale of the input, for WinDaq's page of gains; ``None`` where it is no voltage.
    annotation
        A text that WinDaq shows beside the trace.
    divisor
        The channel stands in the scans that this divides.
    """

    number: int
    slope: float
    intercept: float
    unit: str
    range_volts: float | None = None
    annotation: str = ""
    divisor: int = 1


@dataclass(frozen=True)
class Event:
    """Before which scan; how many whole seconds after the opening, where given; comment."""

    scan: int
    stamp_s: int | None
    comment: str = ""


@dataclass(frozen=True)
class WindaqHeader:
    """The fields that decoding needs, sizes in bytes; `told` holds them all as in the file."""

    told: Any
    size: int
    channels: tuple[Channel, ...]
    data_bytes: int
    event_bytes: int
    interval_s: float
    hires: bool
    packed: bool
    circular: bool
    notes: tuple[str, ...]

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
    suffix = place.suffix.lower()
    size, notes = _size(data)
    next_reader_if(
        not size and suffix not in SUFFIXES,
        "the mark 0x8001 at the end of a WinDaq header is missing",
    )
    refuse_if(
        not size,
        place,
        "this is not a WinDaq file, or its header is damaged (the mark 0x8001 is missing)",
        f"open and save it in WinDaq, or {_ANOTHER_COPY}",
    )
    told = np.frombuffer(data, _HEADER, 1)[0]
    count = int(told["channels"]) & (0x1F if size <= _SIZES[1] else 0xFF)
    table, entry = int(told["table"]), int(told["entry"])
    refuse_if(
        not count or table + count * entry > size - 2 or entry < _ENTRY,
        place,
        f"the WinDaq header is damaged ({count} channels of {entry} bytes at {table})",
        _ANOTHER_COPY,
    )
    interval = float(told["interval_s"])
    hires, packed = bool(told["flags"] & _HIRES), bool(told["flags"] & _PACKED)
    false = not 1e-7 < interval < 1e6
    refuse_if(
        false and options.sample_rate is None,
        place,
        f"the WinDaq header is damaged (sample interval {interval:g} s)",
        "give the true rate with --sample-rate",
    )
    form = "HiRes" if hires else "14-bit"
    notes += [
        note
        for odd, note in (
            (false, f"the sample interval in the header ({interval:g} s) can't be true"),
            # WinDaq itself refuses such a file, by its byte 44.
            (
                told["compression"] < 1,
                f"the header's compression of the display ({told['compression']}) can't be true",
            ),
            (
                suffix in SUFFIXES and (suffix in (".wdh", ".whc")) != hires,
                f"the header is that of {form}, the name {place.suffix} is not: the header is"
                " believed",
            ),
        )
        if odd
    ]
    entries = np.frombuffer(data, _layout(_ENTRY_FIELDS, entry), count, table)
    channels = [_channel(place, number, each) for number, each in enumerate(entries, start=1)]
    # A scan without a word would let a damaged header claim any number of scans.
    refuse_if(
        packed and min(channel.divisor for channel in channels) > 1,
        place,
        "no channel of this packed file is in every scan",
        _ANOTHER_COPY,
    )
    return WindaqHeader(
        told,
        size,
        tuple(channels),
        int(told["data_bytes"]),
        int(told["event_bytes"]),
        1.0 / options.sample_rate if false and options.sample_rate else interval,
        hires,
        packed,
        circular=size == _SIZES[1] or suffix in (".wdc", ".whc"),
        notes=tuple(notes),
    )


def _channel(place: Path, number: int, told: Any) -> Channel:
    """Read a channel's entry in the header."""
    # DOS wrote the degree sign as byte 0xF8, which is another letter today.
    unit = told["unit"].split(b"\0")[0].decode("latin-1").strip().replace("ø", "°")
    slope, intercept = float(told["slope"]), float(told["intercept"])
    # (Infinities and NaN fail the comparisons as well.)
    refuse_if(
        not 0.0 < abs(slope) < _LARGEST_SCALE > abs(intercept),
        place,
        f"the scale of channel {number} is damaged ({slope:g})",
        _ANOTHER_COPY,
    )
    return Channel(number, slope, intercept, unit, divisor=max(int(told["divisor"]), 1))


def has_mark(head: bytes) -> bool:
    """Say whether the mark stands where a header of one of WinDaq's sizes ends."""
    return bool(_size(head)[0])


def _size(data: bytes) -> tuple[int, list[str]]:
    """Find the header's size: as stated, or by the mark; 0 where there is none."""
    stated = int.from_bytes(data[6:8], "little", signed=True)
    usual = _SIZES if data[4:6] == bytes((_TABLE, _ENTRY)) else ()
    marked = [n for n in (stated, *usual) if n > _TABLE and data[n - 2 : n] == _MARK]
    size = marked[0] if marked and len(data) >= _HEADER_BYTES else 0
    why = f"the header's own size ({stated}) is damaged: {size} bytes by its mark"
    return size, [why] * (size not in (0, stated))


_COMMENT: Final = 1 << 31
_PAUSE: Final = 2.0
"""Stamps are whole seconds: less than this is no pause."""
_GAP: Final = re.compile(r"gap (\d{1,9}\.\d{1,9}) s\b")
_LONGEST_TEXT: Final = 1024
_LONGEST_TAIL: Final = 4096
"""Bytes behind the samples of a recording with a damaged header; more is not sought."""


def gap_comment(missing_s: float) -> str:
    """Say the length of a gap so that `scan_times` understands it: ``gap 0.350000 s``."""
    return f"gap {missing_s:.9f} s"


def parse_trailers(
    data: bytes, at: int, header: WindaqHeader, *, rising: bool = False
) -> tuple[list[Event], list[str]] | None:
    """Read events, and a text for each channel, from byte `at`; ``None`` if there are none.

    With `rising` no two events may be at one scan: samples of zero would read as a list.

    Trailer 1 is a list of 32-bit integers: a pointer to a scan (to a sample, in HiRes
    files), then a time stamp if the pointer is not negative, then a comment's place if the
    next integer has its top bit set.
    """
    texts_at, width = at + header.event_bytes, len(header.channels)
    if header.event_bytes % 4 or texts_at > len(data):
        return None
    # (A view: a damaged size may promise a list as long as the file.)
    words = np.frombuffer(data, "<i4", header.event_bytes // 4, at)
    events: list[Event] = []
    place, last = 0, -1
    while place < len(words):
        pointer, comment, stamped = int(words[place]), "", bool(words[place] >= 0)
        scan = abs(pointer) // (width if header.hires else 1)
        place += 1 + stamped
        if not last + rising <= scan <= header.scans or place > len(words):
            return None
        stamp, last = int(words[place - 1]) if stamped else None, scan
        # Pointers end at the number of samples; what lies far below zero is a comment.
        if place < len(words) and words[place] < -_COMMENT // 2:
            begin = texts_at + (int(words[place]) & 0x7FFFFFFF)
            place += 1
            if begin >= len(data):
                return None
            comment = _decoded(data[begin : begin + _LONGEST_TEXT].split(b"\0", 1)[0])
        events.append(Event(scan, stamp, comment))
    names = data[texts_at : texts_at + width * _LONGEST_TEXT].split(b"\0", width)[:width]
    return events, list(map(_decoded, names))


def _decoded(text: bytes) -> str:
    """Turn a text of the file into one line."""
    return " ".join(text[:_LONGEST_TEXT].decode("latin-1").split())


_NO_TEXT: Final = (*range(1, 9), *range(14, 32), 255)
"""Bytes that no text holds: controls, but for tab to carriage return, and erased memory."""


def repaired(data: bytes, header: WindaqHeader) -> WindaqHeader | None:
    """Find sizes under which a file with damaged ones makes sense from end to end.

    The trailers that a data size implies must read as events, then as texts to the end of the
    file.
    """
    # From here on there is nothing but printable signs and NULs.
    tail = np.frombuffer(data[-_LONGEST_TAIL:], dtype=np.uint8)
    odd = np.flatnonzero(np.isin(tail, _NO_TEXT))
    texts_from = len(data) - len(tail) + (int(odd[-1]) + 1 if len(odd) else 0)

    def consistent(size: int) -> tuple[bool, int, WindaqHeader] | None:
        """Try one data size: some length of the event list must leave texts to the end."""
        at = header.size + size
        # The last number of the list may end in NULs, which read as empty texts.
        least = max(8, -(-(texts_from - at) // 4) * 4)
        for events_in in sorted({8, least, least + 4, least + 8}, reverse=True):
            end = at + events_in
            if not texts_from <= end <= len(data) or data.count(0, end) < len(header.channels):
                continue
            changed = replace(header, data_bytes=size, event_bytes=events_in)
            found = parse_trailers(data, at, changed, rising=True)
            if found is not None and found[0]:
                return found[0][0].stamp_s is not None, len(found[0]), changed
        return None

    # A recording without comments ends a few hundred bytes after its samples. Part of an
    # event list reads as a list too: the one that begins with the start, else the longest.
    unit = 2 * len(header.channels)
    end = (len(data) - header.size) // unit * unit
    found = map(consistent, range(end, max(end - _LONGEST_TAIL, 0), -unit))
    return max(filter(None, found), key=lambda each: each[:2], default=(False, 0, None))[2]


def scan_times(
    header: WindaqHeader, scans: int, events: Sequence[Event]
) -> tuple[FloatArray, list[str]]:
    """Give every scan its time, pauses included.

    WinDaq strings the samples together over a pause; only the stamp of the event that
    follows tells of it. A stamp that is ahead of the samples by more than two seconds (and
    more than 1 % of the time since the last event, which a rate may be off) is a pause,
    known to a second. A comment of `gap_comment` gives it exactly, where the stamp agrees.
    """
    steps, notes = np.zeros(scans), []
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
        lag, since = lag + missing, event.stamp_s
    return np.arange(scans, dtype=np.float64) * header.interval_s + np.cumsum(steps), notes


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
    header, notes = _checked(place, data, parse_header(place, data, options))
    at = header.size + 2 * _words(header)
    events, names = (parse_trailers(data, at, header) if header.event_bytes else None) or ([], [])
    counts = _counts(header, np.frombuffer(data, "<i2", _words(header), header.size))
    time, pauses = scan_times(header, max(map(len, counts)), events)
    packed = ["packed: channels have rates of their own"] if header.packed else []
    columns = [
        _column(header, channel, raw, time, name)
        for channel, raw, name in zip(
            header.channels, counts, names or [""] * len(counts), strict=False
        )
    ]
    opened = int(header.told["opened"])
    return Table(
        place=place,
        format="windaq" + "-hires" * header.hires + "-circular" * header.circular,
        columns=tuple(columns),
        markers=tuple(
            Marker(event.scan, float(time[min(event.scan, len(time) - 1)]), event.comment)
            for event in events
        ),
        metadata={"recorded_at": dt.datetime.fromtimestamp(opened, dt.UTC).isoformat()}
        if opened > 0
        else {},
        notes=(*header.notes, *notes, *packed, *pauses),
    )


def _checked(place: Path, data: bytes, header: WindaqHeader) -> tuple[WindaqHeader, list[str]]:
    """Make the sizes in the header agree with the file; no events where they are damaged."""
    available = len(data) - header.size
    unit = 2 * len(header.channels)
    at = header.size + 2 * _words(header)
    seen = f"data size {header.data_bytes} in a file of {len(data)} bytes"
    if header.data_bytes and at <= len(data) and header.data_bytes % unit == 0:
        if parse_trailers(data, at, header) is None:
            return replace(header, event_bytes=0), ["the list of events is damaged: no markers"]
        texts = int(header.told["annotation_bytes"])
        wrong = at + header.event_bytes + texts > len(data)
        return header, [f"the header's size of the annotations ({texts}) is wrong"] * wrong
    found = repaired(data, header)
    if found is not None:
        return found, [
            f"the header is damaged ({seen}): repaired to {found.scans} scans, which agree with"
            " the trailers"
        ]
    refuse_if(
        header.data_bytes > 64 * max(available, 1) or available < unit,
        place,
        f"the WinDaq header is damaged ({seen}) and nothing in the file shows the true value",
        "repair it with the vendor's tool, or give another copy",
    )
    whole, left = available // unit * unit, available % unit
    cause = "is still being written" if not header.data_bytes else "is cut short"
    note = f"the file {cause}: {whole // unit} whole scans are there (of {header.scans} promised)"
    return (
        replace(header, data_bytes=whole, event_bytes=0),
        [note + (f"; {left} byte(s) of a part scan left out" if left else "")],
    )


def _words(header: WindaqHeader) -> int:
    """Count the 16-bit words of the samples in the file."""
    packed = sum(-(-header.scans // channel.divisor) for channel in header.channels)
    return packed if header.packed else header.data_bytes // 2


def _counts(header: WindaqHeader, raw: IntArray) -> list[IntArray]:
    """Part the interleaved words into channels, oldest first."""
    if header.packed:
        divisors = np.array([channel.divisor for channel in header.channels])
        owner = np.nonzero(np.arange(header.scans)[:, None] % divisors == 0)[1]
        return [raw[owner == place] for place in range(len(divisors))]
    scans = raw.reshape(-1, len(header.channels))
    if header.circular and header.told["shown"][1] >> 6 == 2:  # it has gone round
        scans = np.roll(scans, -(int(header.told["next_write"]) % len(scans)), axis=0)
    return list(scans.T)


def _column(
    header: WindaqHeader, channel: Channel, raw: IntArray, time: FloatArray, name: str
) -> Column:
    """Scale one channel."""
    slope = channel.slope * (0.25 if header.hires else 1.0)
    whole = raw if header.hires else raw >> 2
    # A 12-bit converter in a 16-bit word never sets the lowest four bits. (A few samples may all
    # be even by chance.)
    used = int(np.bitwise_or.reduce(whole)) if len(whole) >= 32 else 1
    ladder = used & -used or 1
    half = 32768 if header.hires else 8192
    limits = sorted(slope * end + channel.intercept for end in (-half, half - ladder))
    return Column(
        name=name or f"channel {channel.number}",
        unit=channel.unit,
        values=whole.astype(np.float64) * slope + channel.intercept,
        number=channel.number,
        time_s=time[:: channel.divisor][: len(whole)] if header.packed else time,
        resolution=abs(slope) * ladder,
        limits=(limits[0], limits[1]),
    )


_FULL_SCALE_MILLIVOLTS: Final = (5000, 10_000, 2500, 2048, 1280, 500_000, 1_000_000)
_GAINS: Final = (1, 2, 5, 10, 50, 100, 500, 1000, 4, 8, 20, 200, 10_000, 100_000, 40, 80)


def pack(
    counts: IntArray,
    channels: Sequence[Channel],
    interval_s: float,
    *,
    opened: int = 0,
    closed: int = 0,
    events: Sequence[Event] = (),
) -> bytes:
    """Put a HiRes file (.WDH) together.

    Parameters
    ----------
    counts
        Signed 16-bit counts, shape (scans, channels).
    channels
        One for each column of `counts`.
    interval_s
        Seconds between scans.
    opened, closed
        Seconds since 1970 (UTC); 0 where they are not known.
    events
        In the order of their scans; without one at scan 0, which is always there.

    Returns
    -------
    bytes
        Header (1156 bytes), interleaved little-endian words, list of events, annotations,
        comments.
    """
    scans, width = counts.shape
    texts = b"".join(_encoded(channel.annotation) for channel in channels)
    # Pointers count samples, not scans: so in the vendor's HiRes sample of two channels. (The
    # vendor's own control counts scans. For one channel both are the same.)
    words = [0, 0] if not events or events[0].scan else []
    comments = b""
    for event in events:
        words += [event.scan * width, event.stamp_s or 0]
        if event.comment:  # its place counts from the annotations' first byte
            words.append(_COMMENT | len(texts) + len(comments))
            comments += _encoded(event.comment)
    listed = np.array(words, "<u4").tobytes()
    header = bytearray(_HEADER_BYTES)
    header[-2:] = _MARK
    sizes = 2 * scans * width, len(listed), len(texts)
    # Screen in lines and points, cursor in the middle; one time window, a window a channel; not
    # compressed. Event markers, grid and annotations shown; no window chosen.
    screen, windows, shown = (400, 640, 0), (1, 1, min(width, 16), 0), (0xD7, 0x07, 0xFF, 0x30)
    moments = interval_s, opened, closed
    np.frombuffer(header, _HEADER, 1)[0] = (
        *(width, 1, _TABLE, _ENTRY, _HEADER_BYTES, *sizes, screen, windows, *moments),
        *(1, 0, shown, range(32), _HIRES),
    )
    entries = np.frombuffer(header, _layout(_ENTRY_FIELDS, _ENTRY), width, _TABLE)
    for place, channel in enumerate(channels):
        unit, gain = channel.unit.encode("latin-1", "replace")[:5], _gain(channel.range_volts)
        scale = 1.0, 0.0, channel.slope, channel.intercept
        entries[place] = (*scale, unit, 1, channel.number, gain)
    return bytes(header) + counts.astype("<i2").tobytes() + listed + texts + comments


def _gain(range_volts: float | None) -> int:
    """Say the input's full scale as a code of its millivolts (high nibble) and a gain (low)."""
    codes = (
        code << 4 | gain_code
        for code, full_scale in enumerate(_FULL_SCALE_MILLIVOLTS)
        for gain_code, gain in enumerate(_GAINS)
        if range_volts is not None and np.isclose(full_scale / gain, 1000.0 * range_volts)
    )
    return next(codes, 1 << 4)


def _encoded(text: str) -> bytes:
    """Encode a text as WinDaq has it: Latin-1, ended by a NUL."""
    return text.replace("\0", " ").encode("latin-1", "replace") + b"\0"


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
    time = table.columns[0]
    if time.number != 1 or time.garbled or not np.isfinite(time.values).all():
        return table
    labels = dict(enumerate(map(str.lower, names), start=1))
    rows = [layout.split(lines[n - 1]) for n in (table.lines if table.lines is not None else ())]
    marked = "event" in labels[len(names)]
    events = [row[-1] if marked and len(row) == len(names) else "" for row in rows]
    dated = [c for c in table.columns if labels.get(c.number, "").startswith(("date", *_CLOCKS))]
    clocks = [c.values for c in dated if not labels[c.number].startswith("date")]
    seconds, notes = _evened(time.values).copy(), list(table.notes)
    for row in [
        row for row, event in enumerate(events) if row and clocks and event.lower() == "resume"
    ]:
        missing = np.diff(clocks[0])[row - 1] - np.diff(seconds)[row - 1]
        if missing > 1.0:
            seconds[row:] += missing
            notes.append(f"pause of {missing:.0f} s before row {row + 1}, by the clock column")
    told = zip(names, rows[0], strict=False)
    began = " ".join(cell for name, cell in told if name.lower().startswith(("date", *_CLOCKS)))
    readings = [column for column in table.columns[1:] if column not in dated]
    return replace(
        table,
        columns=tuple(
            replace(
                c,
                name=f"channel {n}",
                unit=dict(enumerate(names, 1)).get(c.number, ""),
                time_s=seconds,
            )
            for n, c in enumerate(readings, start=1)
        ),
        markers=tuple(Marker(n, float(seconds[n]), said) for n, said in enumerate(events) if said),
        metadata={**table.metadata, **({"recorded_at": began} if " " in began else {})},
        notes=tuple(notes),
    )


def _evened(time: FloatArray) -> FloatArray:
    """Take the rate for exact where times rounded to microseconds agree; a whole one first."""
    rate = (len(time) - 1) / (time[-1] - time[0]) if time[-1] > time[0] else 0.0
    rows = np.arange(len(time), dtype=np.float64)
    evened = [time[0] + rows / (even_hz or np.nan) for even_hz in (float(round(rate)), rate)]
    return next((even for even in evened if np.abs(even - time).max() <= 1.5e-6), time)


def read_capture(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Read ``start``, ``sc 12 13`` ..., ``stop``: volts are 10 counts/2048, 750 kHz over ``srate``.

    Raises
    ------
    NotThisFormatError
        When there is no ``sc`` line.
    InputError
        When a scan is damaged.
    """
    scanned = re.search(rb"(^|[\r\n])sc\s+[+-]?\d", data[:65536])
    next_reader_if(not scanned, "there is no line 'sc' with counts")
    text, notes = decode(data).replace("\0", ""), list[str]()
    lines = [line.strip() for line in text.split("\n")]
    scans = {n: line for n, line in enumerate(lines, start=1) if line.startswith("sc")}
    rows = {n: scan.split()[1:] if _SCAN.fullmatch(scan) else [] for n, scan in scans.items()}
    width, last = len(next(iter(rows.values()))), max(rows)
    if not width or len(rows[last]) != width:
        notes.append(f"the last scan (line {last}) is cut short and left out")
        del rows[last]
    refuse_if(not rows, place, "there is no complete scan", "record again, or give another file")
    odd = next((number for number, row in rows.items() if not row or len(row) != width), 0)
    refuse_if(
        odd,
        f"{place}, line {odd}",
        f"'{scans.get(odd, '')[:60]}' is not a complete scan",
        "drop the row",
    )
    rates = re.findall(r"srate\s+(?:x([0-9a-f]{1,8})|(\d{1,9}))", text)
    srate = int(rates[-1][0] or rates[-1][1], 16 if rates[-1][0] else 10) if rates else 0
    if not srate and options.sample_rate is None:
        srate = _SLOWEST
        notes.append("the capture does not give its srate: 65535 (11.44 Hz) is taken")
    began = re.findall(r"^\s*(1\d{9}(?:\.\d+)?)\s*$", text, re.M)
    dated = {"recorded_at": f"{began[-1]} s since 1970"} if began else {}
    metadata = {"bits": "12", "range_volts": "10", **dated}
    limits = -10.0, 2047 * _VOLTS_PER_COUNT
    columns = tuple(
        Column(f"channel {n}", "V", volts, n, resolution=_VOLTS_PER_COUNT, limits=limits)
        for n, volts in enumerate(_VOLTS_PER_COUNT * np.array([*rows.values()], float).T, start=1)
    )
    return Table(
        place,
        "di149-ascii",
        columns,
        np.array([*rows]),
        srate / _CLOCK_HZ or None,
        (),
        metadata,
        tuple(notes),
    )
