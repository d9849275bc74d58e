"""One swing, and how it is written into files of every dialect."""

import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pendpipe.arrays import FloatArray
from pendpipe.formats import ReadOptions, read
from pendpipe.recording import Recording

SHARED = Path(__file__).resolve().parents[3] / "shared" / "recordings"


def swing(
    samples: int = 800, rate: float = 50.0, amplitude: float = 0.5
) -> tuple[FloatArray, FloatArray]:
    """Times and angles of a pendulum of 0.8 Hz with a logarithmic decrement of 0.0625.

    Its period is longer by a sixteenth of the amplitude squared, as sin x has it.
    """
    time = np.arange(samples) / rate
    late = amplitude**2 / 16 * (1 - np.exp(-0.1 * time)) / 0.1
    return time, amplitude * np.exp(-0.05 * time) * np.cos(2 * np.pi * 0.8 * (time - late))


@dataclass
class WindaqFile:
    """The fields of a WinDaq file to be put together, byte by byte."""

    counts: NDArray[np.int64]
    hires: bool = False
    interval_s: float = 0.004
    slope: float = 10 / 16384
    intercept: float = 0.0
    unit: bytes = b"Volt"
    header_size: int = 1156
    opened: int = 1_700_000_000
    events: list[int] = field(default_factory=lambda: [0, 0])
    annotations: list[bytes] = field(default_factory=list)
    comments: bytes = b""
    divisors: list[int] = field(default_factory=list)
    state: int = 0
    next_write: int = 0
    data_bytes: int | None = None

    def pack(self) -> bytes:
        """Return the file's bytes."""
        scans, channels = self.counts.shape
        header = bytearray(self.header_size)
        words = self.counts if self.hires else self.counts * 4
        due = np.ones((scans, channels), dtype=bool)
        if self.divisors:
            due = np.arange(scans)[:, None] % np.array(self.divisors) == 0
        data = words[due].astype("<i2").tobytes()
        events = struct.pack(f"<{len(self.events)}i", *self.events)
        texts = b"".join(text + b"\0" for text in (self.annotations or [b""] * channels))
        struct.pack_into("<HH", header, 0, channels, 0)
        header[4], header[5] = 110, 36
        struct.pack_into("<h", header, 6, self.header_size)
        size = 2 * scans * channels if self.data_bytes is None else self.data_bytes
        struct.pack_into("<IIH", header, 8, size, len(events), len(texts))
        struct.pack_into("<d", header, 28, self.interval_s)
        struct.pack_into("<ii", header, 36, self.opened, self.opened + 60)
        struct.pack_into("<i", header, 44, 1)
        struct.pack_into("<HH", header, 56, self.next_write & 0xFFFF, self.next_write >> 16)
        header[65] = self.state << 6
        flags = 2 * self.hires | (bool(self.divisors) << 14) | 0x100
        struct.pack_into("<H", header, 100, flags)
        for channel in range(channels):
            at = 110 + 36 * channel
            struct.pack_into("<dd", header, at + 8, self.slope, self.intercept)
            header[at + 24 : at + 24 + len(self.unit)] = self.unit
            header[at + 31] = self.divisors[channel] if self.divisors else 1
            header[at + 32] = channel + 1
        struct.pack_into("<H", header, self.header_size - 2, 0x8001)
        return bytes(header) + data + events + texts + self.comments


AS_FOUND = ReadOptions()
TIME, ANGLE = swing(1000, 50.0, 0.5)
RATE, DEGREES = np.gradient(ANGLE, TIME), np.degrees(ANGLE)


def text(
    *columns: FloatArray, sign: str = ",", decimal: str = ".", digits: int = 6, head: str = ""
) -> str:
    """A table of columns below a header."""
    rows = (sign.join(f"{x:.{digits}f}" for x in row) for row in zip(*columns, strict=True))
    return head + "".join(row.replace(".", decimal) + "\n" for row in rows)


def each(form: str, *columns: FloatArray | Sequence[object]) -> str:
    """Rows of the form, which may hold several lines."""
    return "".join(form.format(*row) for row in zip(*columns, strict=True))


def clock(form: str, seconds: FloatArray) -> list[str]:
    """Times of day by the form's h, m and s."""
    return [form.format(h=int(t // 3600), m=int(t // 60) % 60, s=t % 60) for t in seconds]


def with_lines(content: str, changed: dict[int, str]) -> str:
    """A text with some of its lines put otherwise."""
    lines = content.splitlines()
    return "\n".join(changed.get(number, line) for number, line in enumerate(lines)) + "\n"


def read_as(
    folder: Path, content: str | bytes, name: str = "a.txt", options: ReadOptions = AS_FOUND
) -> Recording:
    """What is read from a file of this content and name."""
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read(path, options)


def same(
    recording: Recording,
    values: FloatArray = ANGLE,
    time_s: FloatArray = TIME,
    within_s: float = 2e-3,
) -> None:
    """Times from the first one on and readings are those."""
    assert len(recording) == len(values), len(recording)
    found_s = recording.time_s - recording.time_s[0]
    np.testing.assert_allclose(found_s, (time_s - time_s[0])[: len(values)], atol=within_s)
    good, size = recording.usable, float(np.ptp(values))
    np.testing.assert_allclose(recording.values[good], values[good], atol=3e-4 * size)


class Case(NamedTuple):
    """A file, and what has to be read from it."""

    content: str | bytes
    values: FloatArray = ANGLE
    unit: str = "rad"
    said: str = ""
    """Part of a note or of a weak guess."""
    doubted: str | None = None
    """Part of the weak guesses; "" if there has to be none."""
    lost: Sequence[int] = ()
    time_s: FloatArray = TIME
    within_s: float = 2e-3
    name: str = "a.txt"
    options: ReadOptions = AS_FOUND


def check(folder: Path, case: Case) -> None:
    """Read a case's file."""
    recording = read_as(folder, case.content, case.name, case.options)
    same(recording, case.values, case.time_s, case.within_s)
    doubts = " / ".join(recording.weak_guesses)
    assert recording.unit == case.unit, recording.unit
    assert np.flatnonzero(~recording.usable).tolist() == list(case.lost)
    said = " / ".join(recording.notes) + doubts
    assert re.search(case.said, said), said
    if case.doubted is not None:
        assert case.doubted in doubts, doubts
        assert bool(case.doubted) == bool(doubts), doubts
