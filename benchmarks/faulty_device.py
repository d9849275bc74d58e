"""A simulated device with a fault on demand, for tests and benchmarks.

A fault of the stream is set off once, when its place is reached; places count the bytes
of data that the device has made since it was switched on, over all its streams. A fault
of the answers meets the first answers that hold its `command`.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pendpipe.acquisition.devices import DEVICES
from pendpipe.acquisition.devices.simulated import (
    Link,
    LoopbackSocket,
    PseudoTerminal,
    Signal,
    SimulatedDevice,
)
from pendpipe.acquisition.recorder import record_from
from pendpipe.recording import Recording

FAULTS: Final[Mapping[str, str]] = {
    "junk": "bytes FF FE 7F of a rising supply before the first answer",
    "no echo": "an answer is lost",
    "wrong echo": "the first byte of an answer is another one",
    "late echo": "an answer comes `duration_s` late",
    "padded echo": "`count` NULs follow an answer",
    "stale stream": "data of an earlier run flow before the host has said a word",
    "drop": "`count` bytes of the stream are lost",
    "duplicate": "`count` bytes of the stream come twice",
    "flip": "bit `bit` of a byte of the stream is wrong",
    "lost scans": "`count` whole scans are lost from the given byte on",
    "overflow": "the text 'stop 0`code`' stands in the stream, and nothing follows",
    "stall": "the stream pauses for `duration_s`, then what was kept comes at once",
    "unplug": "the line is gone for `duration_s`; the device then starts anew, idle",
    "wrong rate": "scans come `factor` times as often as the device says",
    "silence": "no byte comes for `duration_s`, neither data nor answers",
}
"""What a `Fault` may be, by its kind."""

OF_ANSWERS: Final = ("no echo", "wrong echo", "late echo", "padded echo", "junk")


@dataclass(frozen=True)
class Fault:
    """One fault.

    Parameters
    ----------
    kind
        A key of `FAULTS`.
    at
        The byte of the stream at which it happens; for ``"silence"`` a negative one means
        from the beginning.
    count
        How many bytes, scans or NULs.
    bit
        Which bit is flipped, 0 to 7.
    code
        What a device says when it overflows: 1, 2 or 3.
    duration_s
        How long it lasts, in seconds of the device's clock.
    command
        A piece of the answers that are to be spoilt; empty for any.
    times
        How many answers.
    factor
        Of the rate.
    """

    kind: str
    at: int = 0
    count: int = 1
    bit: int = 0
    code: int = 1
    duration_s: float = 1e9
    command: bytes = b""
    times: int = 1
    factor: float = 1.0

    def __post_init__(self) -> None:
        if self.kind not in FAULTS:
            raise ValueError(f"no fault is called {self.kind!r}; choose from {', '.join(FAULTS)}")


class FaultyPath:
    """What stands between a device and its line, and does the harm once."""

    def __init__(self, fault: Fault) -> None:
        self.fault = fault
        self.condition = ""
        self._answers = fault.times if fault.kind in OF_ANSWERS else 0
        self._waits = fault.kind not in {*OF_ANSWERS, "wrong rate", "stale stream"}
        self._late: list[tuple[float, bytes]] = []
        self._passed = 0  # bytes of the stream
        self._skip = 0  # bytes still to be lost
        if self._waits and fault.at < 0:
            self._waits, self.condition = False, fault.kind

    def answer(self, reply: bytes, now_s: float) -> bytes:
        """Return what comes of an answer; what comes late is kept for `due`."""
        if not reply or not self._answers or self.fault.command not in reply:
            return reply
        self._answers -= 1
        match self.fault.kind:
            case "junk":
                return b"\xff\xfe\x7f" + reply
            case "wrong echo":
                return bytes([reply[0] ^ 0x04]) + reply[1:]
            case "padded echo":
                return reply + b"\0" * self.fault.count
            case "late echo":
                self._late.append((now_s + self.fault.duration_s, reply))
        return b""

    def due(self, now_s: float) -> bytes:
        """Return the late answers that are due."""
        ready = b"".join(reply for due_s, reply in self._late if due_s <= now_s)
        self._late = [(due_s, reply) for due_s, reply in self._late if due_s > now_s]
        return ready

    def stream(self, data: bytes, scan_bytes: int) -> bytes:
        """Return what comes of the next bytes of the stream.

        After a fault that ends or delays the stream, `condition` says which: the rest of
        these bytes is lost with it (but for a stall).
        """
        fault, at = self.fault, self.fault.at - self._passed
        self._passed += len(data)
        if self._waits and at < len(data):
            self._waits = False
            head, rest = data[: max(at, 0)], data[max(at, 0) :]
            match fault.kind:
                case "drop" | "lost scans":
                    self._skip = fault.count * (scan_bytes if fault.kind == "lost scans" else 1)
                case "duplicate":
                    head += rest[: fault.count]
                case "flip":
                    head += bytes([value ^ 1 << fault.bit for value in rest[:1]])
                    rest = rest[1:]
                case _:
                    self.condition = fault.kind
                    head += b"stop 0%d\r" % fault.code * (fault.kind == "overflow")
                    rest = rest if fault.kind == "stall" else b""
        else:
            head, rest = b"", data
        gone = min(self._skip, len(rest))
        self._skip -= gone
        return head + rest[gone:]


class ReplaceableTerminal(PseudoTerminal):
    """A pseudo-terminal that keeps its name over a replug; the system numbers them anew."""

    def __init__(self) -> None:
        super().__init__()
        self._folder = Path(tempfile.mkdtemp(prefix="pendpipe-"))
        self.port = str(self._folder / "ttySIMULATED")
        Path(self.port).symlink_to(os.ttyname(self._host))

    def unplug(self) -> None:
        """Pull the plug: the host's next read fails."""
        if self._connected:
            Path(self.port).unlink()
        super().unplug()

    def replug(self) -> None:
        """Put it in again, under the same name."""
        self._open()
        Path(self.port).symlink_to(os.ttyname(self._host))

    def forget(self) -> None:
        """Remove the folder of the name."""
        with suppress(FileNotFoundError):
            self._folder.rmdir()


class ReplaceableSocket(LoopbackSocket):
    """A socket that can be put in again."""

    def replug(self) -> None:
        """Put it in again, under the same name."""
        self._listen(int(self.port.rpartition(":")[2]))


class FaultyDevice(SimulatedDevice):
    """A simulated device with faults; its signal runs on from one stream to the next.

    Parameters
    ----------
    kind, signal, **options
        See `SimulatedDevice`.
    fault
        What is to go wrong.
    link
        ``"pty"``, ``"socket"``, ``None`` for what the system has, or a device's end itself.
    """

    def __init__(
        self,
        kind: str,
        signal: Signal,
        fault: Fault,
        *,
        link: str | Link | None = None,
        **options: Any,
    ) -> None:
        self._path = FaultyPath(fault)
        self._offset_s = 0.0  # of the stream, on the signal's clock
        if link is None or isinstance(link, str):
            terminal = link == "pty" or (link is None and hasattr(os, "openpty"))
            link = ReplaceableTerminal() if terminal else ReplaceableSocket()
        super().__init__(
            kind,
            lambda time_s: signal(time_s + self._offset_s),
            link=link,
            rate_error=fault.factor - 1.0,
            **options,
        )
        self._first_start_s: float | None = None
        self._until_s = 0.0  # the end of a stall or a silence
        self._condition = ""
        if fault.kind == "stale stream":
            self.dialect.streaming = True
            self._begin()

    def unplug(self) -> None:
        """End the device and its line."""
        super().unplug()
        if isinstance(self._link, ReplaceableTerminal):
            self._link.forget()

    def step(self) -> None:
        """Read what the host has sent, and send what is due by now, as the faults allow."""
        data = self._link.receive()
        self._suffer()
        if self._condition == "silence":
            return
        if data:
            reply = self.dialect.respond(data)
            self._outbox += self._path.answer(reply, self.clock.now())
        self._outbox += self._path.due(self.clock.now())
        self._follow()
        if self._stream and not self._outbox and not self._condition:
            due = self._stream.due()
            self._outbox += self._path.stream(due, self._stream.scan_bytes)
        self._send()

    def _begin(self) -> None:
        now_s = self.clock.now()
        if self._first_start_s is None:
            self._first_start_s = now_s
        self._offset_s = now_s - self._first_start_s
        super()._begin()

    def _suffer(self) -> None:
        """Enter and leave the conditions that faults bring about."""
        condition, self._path.condition = self._path.condition, ""
        if condition == "overflow":
            self.dialect.streaming = False
        elif condition == "unplug":
            self._replug(self._path.fault.duration_s)
        elif condition:
            self._condition = condition
            self._until_s = self.clock.now() + self._path.fault.duration_s
        if self._condition == "silence":
            self._outbox.clear()
            if self._stream:
                self._stream.due()
        if self.clock.now() >= self._until_s:
            self._condition = ""

    def _replug(self, duration_s: float) -> None:
        """Be gone, and come back as if switched on."""
        assert isinstance(self._link, ReplaceableTerminal | ReplaceableSocket)
        self._send()
        self._link.unplug()
        self.clock.release()
        self._outbox.clear()
        self._stream = None
        self._ending.wait(duration_s / self.clock.scale)
        starts = self.dialect.starts
        self.dialect = DEVICES[self.kind]()
        self.dialect.starts = starts
        self._link.replug()


def acquire_faulty(
    kind: str,
    signal: Signal,
    fault: Fault,
    *,
    clock_scale: float,
    link: str | None = None,
    **options: Any,
) -> Recording:
    """Record from a simulated device with faults; `options` as for `recorder.record`."""
    with FaultyDevice(kind, signal, fault, clock_scale=clock_scale, link=link) as device:
        return record_from(device, **options)
