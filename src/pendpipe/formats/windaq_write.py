"""The bytes of a WinDaq HiRes file (.WDH): header, samples, events, texts.

Laid out after the CODAS data-format description. What WinDaq's screen needs (windows,
keys, cursors) is set as in the files that WinDaq itself writes for one time window; nothing of
it concerns the samples.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import IntArray

MOST_SAMPLES: Final = 1 << 29
"""Pointers count samples in 31 bits, the data size bytes in 32."""
_HEADER_BYTES: Final = 1156
_TABLE, _ENTRY = 110, 36
_MARK: Final = 0x8001
_HIRES: Final = 1 << 1
_COMMENT: Final = 1 << 31
_UNIT_BYTES: Final = 6
_FULL_SCALE_MILLIVOLTS: Final = (5000, 10_000, 2500, 2048, 1280, 500_000, 1_000_000)
_GAINS: Final = (1, 2, 5, 10, 50, 100, 500, 1000, 4, 8, 20, 200, 10_000, 100_000, 40, 80)


@dataclass(frozen=True)
class WrittenChannel:
    """How a channel's counts are to be understood: value = count slope/4 + intercept.

    Parameters
    ----------
    number
        The channel as printed on the box.
    slope, intercept
        The slope is four times the step, as if the two low bits were not there.
    unit
        At most five letters of Latin-1 reach the file.
    range_volts
        Full scale of the input, for WinDaq's page of gains; ``None`` where it is no voltage.
    annotation
        A text that WinDaq shows beside the trace.
    """

    number: int
    slope: float
    intercept: float
    unit: str
    range_volts: float | None = None
    annotation: str = ""


@dataclass(frozen=True)
class WrittenEvent:
    """An event: before which scan, how many whole seconds after the opening, and its comment."""

    scan: int
    stamp_s: int
    comment: str = ""


def pack(
    counts: IntArray,
    channels: Sequence[WrittenChannel],
    interval_s: float,
    *,
    opened: int = 0,
    closed: int = 0,
    events: Sequence[WrittenEvent] = (),
) -> bytes:
    """Put a HiRes file together.

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
    texts = b"".join(_text(channel.annotation) for channel in channels)
    listed, comments = _trailer(events, width, len(texts))
    header = bytearray(_HEADER_BYTES)
    struct.pack_into("<HH", header, 0, width, 1)
    struct.pack_into("<BBh", header, 4, _TABLE, _ENTRY, _HEADER_BYTES)
    struct.pack_into("<IIH", header, 8, 2 * scans * width, len(listed), len(texts))
    # Screen in lines and points, cursor in the middle; one time window, a window a channel.
    struct.pack_into("<hhh", header, 18, 400, 640, 0)
    struct.pack_into("<4B", header, 24, 1, 1, min(width, 16), 0)
    struct.pack_into("<dii", header, 28, interval_s, opened, closed)
    struct.pack_into("<i", header, 44, 1)  # not compressed on the screen
    # Event markers shown; grid and annotations shown; no window chosen.
    struct.pack_into("<BBbB", header, 64, 0xD7, 0x07, -1, 0x30)
    header[68:100] = bytes(range(32))
    struct.pack_into("<H", header, 100, _HIRES)
    for place, channel in enumerate(channels):
        _describe(header, _TABLE + _ENTRY * place, channel)
    struct.pack_into("<H", header, _HEADER_BYTES - 2, _MARK)
    return bytes(header) + counts.astype("<i2").tobytes() + listed + texts + comments


def _describe(header: bytearray, at: int, channel: WrittenChannel) -> None:
    """Fill in a channel's entry."""
    unit = channel.unit.encode("latin-1", "replace")[: _UNIT_BYTES - 1]
    struct.pack_into("<ffdd", header, at, 1.0, 0.0, channel.slope, channel.intercept)
    header[at + 24 : at + 24 + len(unit)] = unit
    struct.pack_into("<BBB", header, at + 31, 1, channel.number, _gain(channel.range_volts))


def _gain(range_volts: float | None) -> int:
    """Say the input's full scale as a code of its millivolts (high nibble) and a gain (low)."""
    if range_volts is not None:
        for code, full_scale in enumerate(_FULL_SCALE_MILLIVOLTS):
            for gain_code, gain in enumerate(_GAINS):
                if np.isclose(full_scale / gain, 1000.0 * range_volts):
                    return code << 4 | gain_code
    return 1 << 4


def _trailer(events: Sequence[WrittenEvent], width: int, before: int) -> tuple[bytes, bytes]:
    """List the events; a comment's place counts from the annotations' first byte.

    Pointers count samples, not scans: so in the vendor's HiRes sample of two channels.
    (The vendor's own control counts scans. For one channel both are the same.)
    """
    words: list[int] = []
    comments = b""
    if not events or events[0].scan:
        words += [0, 0]
    for event in events:
        words += [event.scan * width, event.stamp_s]
        if event.comment:
            words.append(_COMMENT | before + len(comments))
            comments += _text(event.comment)
    return struct.pack(f"<{len(words)}I", *words), comments


def _text(text: str) -> bytes:
    """Encode a text as WinDaq has it: Latin-1, ended by a NUL."""
    return text.replace("\0", " ").encode("latin-1", "replace") + b"\0"
