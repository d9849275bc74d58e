"""The bytes off the wire, kept as they came, with the time at which they came.

A file (version 2) is one line of JSON that describes it, then frames::

    mark (4 bytes)  kind (1 byte)  length (u32)  stream (u16)  at_byte (u64)  time_s (f64)
    CRC-32 (u32)  content

little-endian, the CRC over the rest of the frame but the mark. ``D`` frames hold data, at most
a second of it; ``E`` frames an event as JSON; an ``H`` frame repeats the description, whose line
ends with a CRC-32 of its own. `stream` counts the starts of the device before the frame, and
`at_byte` the bytes of data. So a damaged frame costs no more than itself: the next one is found
by its mark, and what is missing between them is known to the byte. The event that ends a
recording is written twice.

A file is only appended to; where it ends in the midst of a frame (power lost, process killed,
disk full), what stands before is good. In version 1 frames have neither mark, stream nor
at_byte and the description no check sum; it is read up to the first damage.
"""

import json
import mmap
import os
import struct
import time
import zlib
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError, refuse_if

_FORMAT: Final = "pendpipe-raw"
_BEGINNING: Final = b'{"format": "pendpipe-raw"'
_LONGEST_HEADER: Final = 1 << 16
"""Bytes of the first line: what goes on longer is no description."""
_LONGEST_FRAME: Final = 1 << 22
"""What claims to be longer is damaged; no device sends as much in a second."""
_LARGEST_HOLE: Final = 1 << 40
"""No recording misses more bytes than that: a frame that claims so is not believed."""
_MARK: Final = b"\xf5\x0aPp"
_HEAD: Final = struct.Struct("<4scIHQd")
_HEAD_1: Final = struct.Struct("<0scId")
"""What stands before the check sum of a frame, in version 2 and in version 1."""
_CHECK: Final = struct.Struct("<I")
_SYNC_S: Final = 1.0
"""Seconds of a recording that a loss of power may take."""
COMPLETE: Final = ("scans", "time", "noise")
"""Reasons for which a recording ends when it has what was asked for (the last of older files)."""

INTERRUPTED: Final = "interrupted by the user"


class NothingRecordedError(InputError):
    """The raw file is sound so far, but holds no scan."""


class Frame(NamedTuple):
    """A piece of a raw file."""

    kind: bytes
    time_s: float
    content: bytes
    stream: int = 0
    at_byte: int = 0

    def packed(self) -> bytes:
        """The frame with its mark and check sum."""
        place = self.stream, self.at_byte
        head = _HEAD.pack(_MARK, self.kind, len(self.content), *place, self.time_s)
        check = zlib.crc32(self.content, zlib.crc32(head[len(_MARK) :]))
        return head + _CHECK.pack(check) + self.content


def description_line(header: Mapping[str, Any]) -> bytes:
    """The description as the first line of a file, without its line feed."""
    text = json.dumps({"format": _FORMAT, "version": 2, **header}, ensure_ascii=True)[:-1]
    return f'{text}, "crc32": "{zlib.crc32(text.encode()):08x}"}}'.encode()


class RawWriter:
    """Append a recording's bytes to an open binary file.

    Parameters
    ----------
    stream
        The file, unbuffered; `BytesIO` for a recording kept in memory.
    header
        The description: JSON's types only.
    bytes_per_s
        Of the data; a frame holds no more.

    Notes
    -----
    The bytes are handed to the system at every frame, so that a killed process loses nothing,
    and to the disk at least every second, so that a lost supply loses no more than that.
    """

    def __init__(
        self, stream: IO[bytes], header: Mapping[str, Any], *, bytes_per_s: float = 1 << 16
    ) -> None:
        self._stream = stream
        self._most_bytes = min(max(1, int(bytes_per_s)), _LONGEST_FRAME)
        self._on_disk = hasattr(stream, "fileno") and not hasattr(stream, "getbuffer")
        self._starts = self._bytes = 0
        line = description_line(header)
        self._write(line + b"\n" + Frame(b"H", 0.0, line).packed())
        self.sync()

    def data(self, time_s: float, content: bytes) -> None:
        """Keep bytes of the stream that had arrived by `time_s` of the recorder's clock."""
        for begin in range(0, len(content), self._most_bytes):
            piece = content[begin : begin + self._most_bytes]
            self._frame(b"D", time_s, piece)
            self._bytes += len(piece)

    def event(self, time_s: float, **event: Any) -> None:
        """Keep what happened, and bring it to the disk."""
        content = json.dumps(event).encode("ascii")
        for _ in range(2 if event.get("event") == "stopped" else 1):
            self._frame(b"E", time_s, content)
        self._starts += event.get("event") == "restarted"
        self.sync()

    def sync(self) -> None:
        """Bring everything to the disk."""
        self._stream.flush()
        if self._on_disk:
            os.fsync(self._stream.fileno())
        self._synced = time.monotonic()

    def _frame(self, kind: bytes, time_s: float, content: bytes) -> None:
        self._write(Frame(kind, time_s, content, self._starts, self._bytes).packed())
        if time.monotonic() - self._synced > _SYNC_S:
            self.sync()

    def _write(self, content: bytes) -> None:
        """Hand all of it to the system; a disk that takes a part only is full."""
        left = memoryview(content)
        while left:
            left = left[self._stream.write(left) :]


def append_event(path: Path, **event: Any) -> None:
    """Note in a finished raw file what happened to it later: all of it, or nothing."""
    frame = Frame(b"E", 0.0, json.dumps(event).encode("ascii")).packed()
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

        fcntl.flock(stream.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except (ImportError, OSError):  # Windows; a file system without locks
        return True
    return True


def is_being_recorded(path: Path) -> bool:
    """Whether a process is writing to a raw file at this moment."""
    with path.open("rb") as stream:
        return not lock(stream)


class Hole(NamedTuple):
    """Bytes of a stream that were recorded, and whose frames are damaged.

    Parameters
    ----------
    stream
        How many times the device was started anew before.
    at_byte
        Where in `RawRecording.data` they are missing.
    bytes_missing
        How many.
    """

    stream: int
    at_byte: int
    bytes_missing: int


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
        By ``arrival_s[i]`` of the recorder's clock ``arrived_bytes[i]`` of `data` had
        arrived, shape (n,).
    events
        What happened: each a mapping with ``time_s``, ``at_byte`` (of `data`) and whatever
        was noted with it.
    damaged_bytes
        Bytes of the file that are part of no sound frame.
    holes
        What is missing in `data`, in order.
    path
        The file.
    """

    header: Mapping[str, Any]
    data: bytes
    arrival_s: FloatArray
    arrived_bytes: IntArray
    events: tuple[Mapping[str, Any], ...]
    damaged_bytes: int
    holes: tuple[Hole, ...] = ()
    path: Path = Path()

    @property
    def is_complete(self) -> bool:
        """Whether it ended with all that was asked for."""
        return self.event("stopped").get("reason") in COMPLETE

    @property
    def lost_line(self) -> str:
        """Why the line was lost, where that ended it and nobody has accepted what there is.

        A recording that the user ended, or whose process was killed, is what the user has.
        """
        if self.event("accepted"):
            return ""
        stopped = self.event("stopped")
        if stopped:
            reason = str(stopped.get("reason"))
            return "" if reason in (*COMPLETE, INTERRUPTED) else reason
        last = [e for e in self.events if e.get("event") in ("broken", "restarted")][-1:]
        return "".join(str(e.get("reason")) for e in last if e["event"] == "broken")

    def since(self, time_s: float) -> "RawRecording":
        """Return what has arrived since `time_s` of the recorder's clock."""
        first = int(np.searchsorted(self.arrival_s, time_s))
        before = int(self.arrived_bytes[first - 1]) if first else 0
        begin = [0, *(int(e["at_byte"]) for e in self.events if e.get("event") == "restarted")]
        begin = [at for at in begin if at <= before]
        # From a whole scan on.
        size = 2 * len(self.header["channels"])
        before -= (before - begin[-1]) % size
        events = [
            {**e, "at_byte": e["at_byte"] - before}
            | ({"keep_scans": e["keep_scans"] - before // size} if e.get("keep_scans") else {})
            for e in self.events
            if e["at_byte"] > before
        ]
        holes = [each for each in self.holes if each.at_byte >= before]
        return replace(
            self,
            data=self.data[before:],
            arrival_s=self.arrival_s[first:],
            arrived_bytes=self.arrived_bytes[first:] - before,
            events=tuple(events),
            holes=tuple(Hole(h.stream - len(begin) + 1, h.at_byte - before, *h[2:]) for h in holes),
        )

    def event(self, kind: str) -> Mapping[str, Any]:
        """Return the last event of a kind; empty when there was none."""
        return next((e for e in reversed(self.events) if e.get("event") == kind), {})


def read_raw(source: str | Path | bytes) -> RawRecording:
    """Read a raw file, or what of it is whole.

    Raises
    ------
    InputError
        If there is no such file, it is no raw recording, or its description is damaged in both
        places.
    """
    return RawReader(source).read()


class RawReader:
    """Read a raw file that grows: each `read` goes on behind the last sound frame.

    Parameters
    ----------
    source
        A file, or its content.
    """

    def __init__(self, source: str | Path | bytes) -> None:
        self._source = source
        self._header: Mapping[str, Any] = {}
        # Days of frames: no object is kept of any.
        self._data, self._arrival_s, self._arrived_bytes = bytearray(), array("d"), array("q")
        self._events: list[Mapping[str, Any]] = []
        self._holes: list[Hole] = []
        self._arrival: tuple[int, float] | None = None
        self._begin = self._end = self._missing = self._starts = self._sound = 0

    def read(self) -> RawRecording:
        """Return what has been written so far; errors as of `read_raw`."""
        source = self._source
        place = "raw recording" if isinstance(source, bytes) else str(source)
        try:
            content = source if isinstance(source, bytes) else _content(Path(source))
        except OSError as fault:
            raise InputError(place, f"can't be read ({fault.strerror})", "check the path") from None
        if not self._header:
            self._header, self._begin = _header(place, content)
            self._end = self._begin
        form = _HEAD if self._header["version"] > 1 else _HEAD_1
        for end, size, frame in _frames(content, self._end, form):
            self._take(place, size, frame)
            self._end = end
        return RawRecording(
            self._header,
            bytes(self._data),
            np.array(self._arrival_s, dtype=np.float64),
            np.array(self._arrived_bytes, dtype=np.int64),
            tuple(self._events),
            len(content) - self._begin - self._sound,
            tuple(self._holes),
            Path() if isinstance(source, bytes) else Path(source),
        )

    def _take(self, place: str, size: int, frame: Frame) -> None:
        """Add a sound frame that takes so many bytes."""
        total = len(self._data)
        hole = frame.at_byte - total - self._missing
        if hole > _LARGEST_HOLE:
            return
        self._sound += size
        if frame.kind == b"D" and frame.stream > self._starts:
            # The event that recorded the restart is damaged.
            self._starts = frame.stream
            reason = "the raw file is damaged here"
            found = {"event": "restarted", "reason": reason}
            self._events.append({**found, "time_s": frame.time_s, "at_byte": total})
        if hole > 0:
            self._holes.append(Hole(self._starts, total, hole))
            self._missing += hole
        if frame.kind == b"D":
            self._data += frame.content
            if self._arrival == (arrival := (self._starts, frame.time_s)):
                # What arrived at once may fill several frames.
                self._arrived_bytes[-1] = len(self._data)
            else:
                self._arrival_s.append(frame.time_s)
                self._arrived_bytes.append(len(self._data))
            self._arrival = arrival
        elif frame.kind == b"E":
            event = _json(frame.content) or {}
            refuse_if(not event, place, "an event in it is damaged", "give another copy")
            self._starts += event.get("event") == "restarted"
            self._events.append({**event, "time_s": frame.time_s, "at_byte": total})


def _content(path: Path) -> "bytes | mmap.mmap":
    """Map a file, so that it need not be in memory as a whole."""
    with path.open("rb") as stream:
        if not os.fstat(stream.fileno()).st_size:
            return b""
        return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)


_NUMBERS: Final[Mapping[str, tuple[float, float]]] = {
    "rate_hz": (1e-6, 1e9),
    "range_volts": (1e-6, 1e6),
    "clock_scale": (1e-3, 1e9),
    "volts_per_radian": (-1e9, 1e9),
}
"""What can be true of any instrument."""
_NEEDED: Final = ("model", "port", "channels", "rate_hz", "recorded_at")
_TEXTS: Final = ("model", "port", "recorded_at")
_MOST_CHANNELS: Final = 64
"""No instrument here has as many: a description that says more is damaged."""


def check_description(place: str, raw: RawRecording) -> None:
    """Refuse a raw recording whose description can't be true.

    Raises
    ------
    InputError
        On a missing or impossible entry, or time stamps that fall.
    """
    header, channels = raw.header, raw.header.get("channels")
    kept = raw.event("stopped").get("keep_scans")
    faults = (
        *((key not in header, f"{key} is missing") for key in _NEEDED),
        *((not isinstance(header.get(key), str), f"{key} is no text") for key in _TEXTS),
        *(
            # (A comparison with NaN is false; and True is not a number.)
            (not (type(value) in (int, float) and low <= value <= high), f"{key} is {value!r:.40}")
            for key, (low, high) in _NUMBERS.items()
            for value in (header.get(key, low),)
        ),
        (
            not isinstance(channels, list)
            or not 0 < len(channels) <= _MOST_CHANNELS
            or not all(type(channel) is int and channel > 0 for channel in channels)
            or len(set(channels)) != len(channels),
            f"channels are {channels!r:.40}",
        ),
        (kept is not None and not (type(kept) is int and kept > 0), f"keep_scans is {kept!r:.40}"),
        (
            not np.isfinite(raw.arrival_s).all() or np.any(np.diff(raw.arrival_s) < 0),
            "time stamps that fall",
        ),
    )
    for wrong, fault in faults:
        refuse_if(
            wrong,
            place,
            f"the description of the recording is damaged ({fault})",
            "give another copy",
        )


def _header(place: str, content: "bytes | mmap.mmap") -> tuple[Mapping[str, Any], int]:
    """Return the description, from the first line or its copy, and where the frames begin."""
    end = content.find(b"\n", 0, _LONGEST_HEADER)
    first = content[: len(_BEGINNING)]
    if end < 0 and _BEGINNING.startswith(first):
        problem = "this is not a raw recording of pendpipe, or only its beginning"
        raise NothingRecordedError(place, problem, "give another file")
    header = _description(content[: max(end, 0)])
    if header is None:
        copies = (frame.content for *_, frame in _frames(content, 0) if frame.kind == b"H")
        header, end = _description(next(copies, b"")), -1
    if header is None:
        problem = (
            "the description of the recording is damaged"
            if first == _BEGINNING
            else "this is not a raw recording of pendpipe"
        )
        raise InputError(place, problem, "give another copy")
    refuse_if(
        header.get("version") not in (1, 2),
        place,
        "it was made by a newer version",
        "install a newer pendpipe",
    )
    return header, end + 1


def _description(line: bytes) -> dict[str, Any] | None:
    """Read a line that describes a recording; ``None`` if it is none, or damaged."""
    header = _json(line)
    if header is None or header.get("format") != _FORMAT:
        return None
    check = header.pop("crc32", None)
    text, _, _ = line.rpartition(b', "crc32": "')
    unchecked = check is None and header.get("version") == 1
    return header if unchecked or check == f"{zlib.crc32(text):08x}" else None


def _json(body: bytes) -> dict[str, Any] | None:
    """Read a line of JSON; ``None`` if it is no mapping."""
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


def _frames(
    content: "bytes | mmap.mmap", begin: int, form: struct.Struct = _HEAD
) -> Iterator[tuple[int, int, Frame]]:
    """Find where sound frames end, how many bytes they take, and what they are.

    Whatever may stand between them.

    Those of version 1 have no mark by which the next one could be found behind a damaged one.
    """
    while 0 <= begin <= len(content) - form.size - _CHECK.size:
        mark, kind, length, *place, time_s = form.unpack_from(content, begin)
        start = begin + form.size + _CHECK.size
        body = content[start : start + min(length, _LONGEST_FRAME)]
        known = zlib.crc32(content[begin + len(mark) : begin + form.size])
        check = _CHECK.pack(zlib.crc32(body, known))
        if len(body) == length and content[start - len(check) : start] == check:
            # A damaged mark does no harm, but is noticed.
            unmarked = 0 if mark == _MARK else len(mark)
            end = start + length
            yield end, end - begin - unmarked, Frame(kind, time_s, body, *place)
            begin = end
        else:
            begin = content.find(_MARK, begin + 1) if mark else -1
