"""WinDaq recordings: .WDQ (14 bit), .WDH (HiRes), .WDC and .WHC (circular)."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, Table
from pendpipe.formats.windaq_events import (
    Trailers,
    markers,
    mended,
    parse_trailers,
    scan_times,
)
from pendpipe.formats.windaq_header import Channel, WindaqHeader, parse_header

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
        said = [] if trailers else ["the list of events is damaged: no markers"]
        if trailers and at + header.event_bytes + header.annotation_bytes > len(data):
            said.append(
                f"the header's size of the annotations ({header.annotation_bytes}) is wrong"
            )
        return header, trailers, said
    found = mended(data, header)
    if found is not None:
        header_found, trailers = found
        note = (
            f"the header is damaged (data size {header.data_bytes} in a file of {len(data)} bytes):"
            f" mended to {header_found.scans} scans, which agree with the trailers"
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
    from dataclasses import replace

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
