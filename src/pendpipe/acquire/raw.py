"""The bytes off the wire, kept as they came, with the time at which they came.

A file is one line of JSON that describes it, then frames::

    kind (1 byte)  length (u32)  time_s (f64)  CRC-32 (u32)  content

little-endian, the CRC over the rest of the frame. ``D`` frames hold data of the stream,
``E`` frames an event as JSON. A file is only appended to; where it ends in the midst of a
frame (power lost, process killed, disk full), what stands before is good.
"""

from __future__ import annotations

import json
import os
import struct
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, Literal

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError

_FRAME: Final = struct.Struct("<cIdI")
_CHECKED: Final = struct.Struct("<cId")
_FORMAT: Final = "pendpipe-raw"
_BEGINNING: Final = b'{"format": "pendpipe-raw"'
_LONGEST_HEADER: Final = 1 << 16


COMPLETE: Final = ("scans", "time", "noise")
"""Reasons for which a recording ends when it has what was asked for."""


class NothingRecordedError(InputError):
    """The raw file is sound so far, but holds no scan."""


class RawWriter:
    """Append a recording's bytes to an open binary file.

    Parameters
    ----------
    stream
        The file, unbuffered; `BytesIO` for a recording kept in memory.
    header
        The description: JSON's types only.
    sync_s
        The bytes are handed to the system at every frame, so that a killed process loses
        nothing, and to the disk at least every `sync_s` seconds, so that a lost supply
        loses no more than that.
    """

    def __init__(
        self, stream: IO[bytes], header: Mapping[str, Any], *, sync_s: float = 1.0
    ) -> None:
        self._stream = stream
        self._sync_s = sync_s
        self._synced = time.monotonic()
        self._on_disk = hasattr(stream, "fileno") and not hasattr(stream, "getbuffer")
        line = json.dumps({"format": _FORMAT, "version": 1, **header}, ensure_ascii=True)
        self._write(line.encode("ascii") + b"\n")
        self.sync()

    def data(self, time_s: float, content: bytes) -> None:
        """Keep bytes of the stream that had arrived by `time_s` of the recorder's clock."""
        self._frame(b"D", time_s, content)

    def event(self, time_s: float, **event: Any) -> None:
        """Keep what happened, and bring it to the disk."""
        self._frame(b"E", time_s, json.dumps(event).encode("ascii"))
        self.sync()

    def sync(self) -> None:
        """Bring everything to the disk."""
        self._stream.flush()
        if self._on_disk:
            os.fsync(self._stream.fileno())
        self._synced = time.monotonic()

    def _frame(self, kind: bytes, time_s: float, content: bytes) -> None:
        self._write(_packed(kind, time_s, content))
        if time.monotonic() - self._synced > self._sync_s:
            self.sync()

    def _write(self, content: bytes) -> None:
        """Hand all of it to the system; a disk that takes a part only is full."""
        left = memoryview(content)
        while left:
            left = left[self._stream.write(left) :]


def _packed(kind: bytes, time_s: float, content: bytes) -> bytes:
    """Make a frame."""
    check = zlib.crc32(content, zlib.crc32(_CHECKED.pack(kind, len(content), time_s)))
    return _FRAME.pack(kind, len(content), time_s, check) + content


def append_event(path: Path, **event: Any) -> None:
    """Note in a finished raw file what happened to it later: all of it, or nothing."""
    frame = _packed(b"E", 0.0, json.dumps(event).encode("ascii"))
    with path.open("r+b", buffering=0) as stream:
        end = stream.seek(0, os.SEEK_END)
        if stream.write(frame) != len(frame):
            stream.truncate(end)


def lock(stream: IO[bytes]) -> bool:
    """Hold a raw file for as long as it is open; return whether nobody else holds it.

    The system lets go of it when the process ends, however it ends. Windows has no such lock.
    """
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def is_being_recorded(path: Path) -> bool:
    """Whether a process is writing to a raw file at this moment."""
    with path.open("rb") as stream:
        return not lock(stream)


@dataclass(frozen=True)
class RawRecording:
    """What stands in a raw file.

    Parameters
    ----------
    header
        The description.
    data
        The bytes of the stream, joined.
    arrival_s, arrived_bytes
        By ``arrival_s[i]`` the first ``arrived_bytes[i]`` of them had arrived.
    events
        The events, each with its ``time_s`` and the bytes that had arrived (``at_byte``).
    damaged_bytes
        Bytes at the end of the file that are no whole frame.
    """

    header: Mapping[str, Any]
    data: bytes
    arrival_s: FloatArray
    arrived_bytes: IntArray
    events: tuple[Mapping[str, Any], ...]
    damaged_bytes: int

    def event(self, kind: str) -> Mapping[str, Any]:
        """Return the last event of a kind; empty when there was none."""
        return next((e for e in reversed(self.events) if e.get("event") == kind), {})


def read_raw(source: str | Path | bytes) -> RawRecording:
    """Read a raw file, or what of it is whole.

    Raises
    ------
    InputError
        If there is no such file, or it is no raw recording.
    """
    place = "raw recording" if isinstance(source, bytes) else str(source)
    try:
        content = source if isinstance(source, bytes) else Path(source).read_bytes()
    except OSError as fault:
        raise InputError(place, f"can't be read ({fault.strerror})", "check the path") from None
    header, place_of_frame = _header(place, content)
    pieces: list[bytes] = []
    stamps: list[tuple[float, int]] = []
    events: list[Mapping[str, Any]] = []
    total = 0
    while (frame := _frame(content, place_of_frame)) is not None:
        kind, time_s, body = frame
        place_of_frame += _FRAME.size + len(body)
        if kind == b"D":
            total += len(body)
            pieces.append(body)
            stamps.append((time_s, total))
        elif kind == b"E":
            events.append({**_event(place, body), "time_s": time_s, "at_byte": total})
    return RawRecording(
        header,
        b"".join(pieces),
        np.array([time_s for time_s, _ in stamps], dtype=np.float64),
        np.array([count for _, count in stamps], dtype=np.int64),
        tuple(events),
        len(content) - place_of_frame,
    )


def _header(place: str, content: bytes) -> tuple[Mapping[str, Any], int]:
    """Return the description and where the frames begin."""
    end = content.find(b"\n", 0, _LONGEST_HEADER)
    if end < 0 and (content.startswith(_BEGINNING) or _BEGINNING.startswith(content)):
        problem = "this is no raw recording of pendpipe, or only its beginning"
        raise NothingRecordedError(place, problem, "give another file")
    try:
        header = json.loads(content[: max(end, 0)])
    except (ValueError, RecursionError):
        header = None
    if not isinstance(header, dict) or header.get("format") != _FORMAT:
        raise InputError(place, "this is no raw recording of pendpipe", "give another file")
    if header.get("version") != 1:
        raise InputError(place, "it was made by a newer version", "install a newer pendpipe")
    return header, end + 1


def _event(place: str, body: bytes) -> Mapping[str, Any]:
    """Return an event's content."""
    try:
        event = json.loads(body)
    except (ValueError, RecursionError):
        event = None
    if not isinstance(event, dict):
        raise InputError(place, "an event in it is damaged", "give another copy")
    return event


def _frame(content: bytes, place: int) -> tuple[Literal[b"D", b"E"] | bytes, float, bytes] | None:
    """Return kind, time and content of the frame there, if it is whole."""
    if place + _FRAME.size > len(content):
        return None
    kind, length, time_s, check = _FRAME.unpack_from(content, place)
    begin = place + _FRAME.size
    body = content[begin : begin + length]
    if len(body) < length:
        return None
    if zlib.crc32(body, zlib.crc32(_CHECKED.pack(kind, length, time_s))) != check:
        return None
    return kind, time_s, body
