"""A HiRes reader of its own, after dataq-facts B1 to B4, to check what is written.

It shares no line with the package: slices of bytes and plain loops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass
class BookEvent:
    scan: int
    stamp_s: int
    comment: str


@dataclass
class Book:
    values: NDArray[np.float64]
    interval_s: float
    events: list[BookEvent]
    annotations: list[str]
    opened: int
    closed: int

    @property
    def times_s(self) -> list[float]:
        """Times with the gaps that the comments tell of."""
        told = {
            event.scan: float(event.comment.split()[1])
            for event in self.events
            if event.comment.startswith("gap ")
        }
        lag = 0.0
        times = []
        for scan in range(len(self.values)):
            lag += told.get(scan, 0.0)
            times.append(scan * self.interval_s + lag)
        return times


def number(data: bytes, at: int, size: int, signed: bool = False) -> int:
    return int.from_bytes(data[at : at + size], "little", signed=signed)


def float64(data: bytes, at: int) -> float:
    return float(np.frombuffer(data[at : at + 8], "<f8")[0])


def book(data: bytes) -> Book:
    """Read a HiRes file as the description says it, and check what it promises."""
    channels = number(data, 0, 2) & 0x1F
    size = number(data, 6, 2)
    assert (data[4], data[5], size) == (110, 36, 36 * 29 + 112)
    assert number(data, size - 2, 2) == 0x8001
    flags = number(data, 100, 2)
    assert flags >> 1 & 1 == 1
    assert flags >> 14 & 1 == 0
    data_bytes, event_bytes = number(data, 8, 4), number(data, 12, 4)
    annotation_bytes = number(data, 16, 2)
    scans = data_bytes // (2 * channels)
    assert data_bytes == 2 * channels * scans
    raw = np.frombuffer(data[size : size + data_bytes], "<i2").reshape(scans, channels)
    values = np.empty((scans, channels))
    for place in range(channels):
        at = 110 + 36 * place
        values[:, place] = raw[:, place] * 0.25 * float64(data, at + 8) + float64(data, at + 16)
    at = size + data_bytes
    texts = data[at + event_bytes :]
    words = [number(data, at + 4 * i, 4, signed=True) for i in range(event_bytes // 4)]
    events = []
    while words:
        pointer = words.pop(0)
        stamp = words.pop(0) if pointer >= 0 else -1
        comment = ""
        if words and words[0] <= -(data_bytes // 2):
            offset = words.pop(0) & 0x7FFFFFFF
            assert offset >= annotation_bytes
            comment = texts[offset : texts.index(0, offset)].decode("latin-1")
        events.append(BookEvent(abs(pointer) // channels, stamp, comment))
    annotations = texts[:annotation_bytes].split(b"\0")
    assert len(annotations) == channels + 1
    return Book(
        values,
        float64(data, 28),
        events,
        [text.decode("latin-1") for text in annotations[:-1]],
        number(data, 36, 4, signed=True),
        number(data, 40, 4, signed=True),
    )
