"""The header of a WinDaq file: fields, checks, and what can be mended.

Layout after the CODAS data-format description: little-endian throughout, no magic at the
start; the only mark is 0x8001 in the header's last two bytes.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Final

from pendpipe.errors import InputError
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import NotThisFormatError

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
        notes.append(f"the header says {kind}, the name {place.suffix} does not: the header counts")
    return replace(header, notes=tuple(notes))


def _size(data: bytes) -> tuple[int, list[str]]:
    """Find the header's size: where it says so, or where the mark is."""
    if len(data) < 1156:
        return 0, []

    def marked(size: int) -> bool:
        return 110 < size <= len(data) and struct.unpack_from("<H", data, size - 2)[0] == _MARK

    told = struct.unpack_from("<h", data, 6)[0]
    if marked(told):
        return told, []
    for size in _SIZES:
        if marked(size) and data[4] == 110 and data[5] == 36:
            return size, [f"the header's own size ({told}) is damaged: {size} bytes by its mark"]
    return 0, []


def _channel(data: bytes, at: int, place: int) -> Channel:
    slope, intercept = struct.unpack_from("<dd", data, at + 8)
    unit = data[at + 24 : at + 30].split(b"\0")[0].decode("latin-1").strip()
    # DOS wrote the degree sign as byte 0xF8, which is another letter today.
    unit = unit.replace("ø", "°")
    return Channel(place + 1, slope, intercept, unit, max(data[at + 31], 1))
