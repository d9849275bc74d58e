"""A simulated instrument on a line, in a thread of its own."""

import math
import os
import select
import socket
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, ClassVar, Final, Self, TypeAlias

import numpy as np

from pendpipe.acquisition.clock import ScaledClock
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import refuse_if

DEVICES: Final[dict[str, "type[Dialect]"]] = {}
"""The simulated instruments: what may follow ``simulated:``."""


class Dialect(ABC):
    """An instrument without its line and its clock: commands in, replies and data out.

    Attributes
    ----------
    starts
        How often the stream was started: a change means that it begins anew.
    streaming
        Whether data flow.
    """

    model: ClassVar[str]
    bits: ClassVar[int]

    def __init_subclass__(cls, **figures: Any) -> None:
        """Register a model by its specifications."""
        for name, value in figures.items():
            setattr(cls, name, value)
        if "model" in figures:
            name = "".join(letter for letter in cls.model.lower() if letter.isalnum())
            # The RS-232 boxes go by their number, too: di154.
            DEVICES[name] = DEVICES[name.removesuffix("rs")] = cls

    def __init__(self) -> None:
        self.starts = 0
        self.streaming = False
        self._list = [0]  # of what is scanned: channels less 1 in the low bits, ranges above

    @property
    @abstractmethod
    def range_volts(self) -> float:
        """Full scale, as the host has chosen it."""

    @property
    def channels(self) -> tuple[int, ...]:
        """The enabled channels as printed on the box (from 1), in the order of the scan."""
        return tuple((word & 0x0F) + 1 for word in self._list)

    @property
    @abstractmethod
    def scan_rate_hz(self) -> float:
        """Scans a second by the device's own clock."""

    @property
    def packet_bytes(self) -> int:
        """Bytes in each packet of data."""
        return 1

    @abstractmethod
    def respond(self, data: bytes) -> bytes:
        """Take bytes from the host; return the echoes and answers."""

    def encode(self, codes: IntArray) -> bytes:
        """Put signed codes, shape (scans, channels), into the bytes of the stream.

        Two bytes a sample with a frame mark, where a family has no other form.
        """
        return marked(codes, self.bits)


def convert(volts: FloatArray, bits: int, range_volts: float) -> IntArray:
    """Round volts at the terminals to the converter's codes.

    Parameters
    ----------
    volts
        The signal, any shape, in V.
    bits
        Resolution; the step is ``2 range_volts / 2**bits``.
    range_volts
        Full scale is plus and minus it.

    Returns
    -------
    IntArray
        Signed codes, ``-2**(bits-1)`` to ``2**(bits-1) - 1``, 0 at 0 V; a signal beyond
        the range gives the end code.
    """
    half = 1 << (bits - 1)
    codes = np.rint(np.asarray(volts, dtype=np.float64) * (half / range_volts))
    return np.clip(codes, -half, half - 1).astype(np.int64)


def marked(codes: IntArray, bits: int) -> bytes:
    """Write signed codes, shape (scans, channels), as two bytes a sample with a frame mark.

    Offset binary: the upper seven bits of a sample in the second byte, the others at the top of the
    first. Bit 0 is clear on the first byte of a scan only.
    """
    offset = np.asarray(codes) + 2 ** (bits - 1)
    low = 2 ** (bits - 7)
    out = np.stack([offset % low * (256 // low) + 1, offset // low * 2 + 1], axis=-1)
    out[:, 0, 0] -= 1
    return out.astype(np.uint8).tobytes()


Signal: TypeAlias = Callable[[FloatArray], FloatArray]
"""Times in s since the device was switched on to volts at the terminals, noise included."""

_BLOCKS: Final = (1 << 10, 1 << 14)
"""Scans computed at a time, ahead of schedule: few at first, then more and more, so that
neither a short nor a long recording pays for the signal twice."""
_REST_S, _LONGEST_REST_S = 0.002, 0.02
"""The shortest time between two pieces of data, and the longest for which an unplugged device
lives on; in seconds of the host."""


class Stream:
    """The data between a start and a stop, computed in blocks and released by the clock."""

    def __init__(
        self,
        dialect: Dialect,
        signal: Signal | Mapping[int, Signal],
        rate_error: float,
        clock: ScaledClock,
    ) -> None:
        self._dialect, self._clock = dialect, clock
        channels = dialect.channels
        self._signals = [
            signal.get(number) if isinstance(signal, Mapping) else signal for number in channels
        ]
        self._rate_hz = dialect.scan_rate_hz * (1.0 + rate_error)
        self.scan_bytes = len(dialect.encode(np.zeros((1, len(channels)), dtype=np.int64)))
        self._computed = 0  # scans
        self._ready = b""  # bytes of scans computed, not yet released
        self._released = 0  # bytes since the start
        # Scan 0 is taken when the first block has been computed, so that it is not late.
        self._compute()
        self._origin_s = clock.now()

    def due(self) -> bytes:
        """Return the whole packets that are complete by now."""
        taken = math.floor((self._clock.now() - self._origin_s) * self._rate_hz) + 1
        packet = self._dialect.packet_bytes
        size = max(0, taken * self.scan_bytes // packet * packet - self._released)
        while len(self._ready) < size:
            self._compute()
        piece, self._ready = self._ready[:size], self._ready[size:]
        self._released += size
        return piece

    def rest_s(self) -> float:
        """How long, in seconds of the host, until the next packet is complete."""
        following = math.ceil((self._released + self._dialect.packet_bytes) / self.scan_bytes)
        complete_s = self._origin_s + (following - 1) / self._rate_hz
        return max(_REST_S, (complete_s - self._clock.now()) / self._clock.scale)

    def _compute(self) -> None:
        """Sample, convert and encode the next block."""
        block = min(_BLOCKS[1], max(_BLOCKS[0], self._computed))
        time_s = np.arange(self._computed, self._computed + block) / self._rate_hz
        codes: IntArray = np.zeros((block, len(self._signals)), dtype=np.int64)
        for column, signal in enumerate(self._signals):
            if signal is not None:
                codes[:, column] = convert(
                    signal(time_s), self._dialect.bits, self._dialect.range_volts
                )
        self._ready += self._dialect.encode(codes)
        self._computed += block


class PseudoTerminal:
    """A pseudo-terminal, which the driver opens as it opens any serial port."""

    def __init__(self) -> None:
        self._open()
        self.port = os.ttyname(self._host)

    def _open(self) -> None:
        import tty

        self._device, self._host = os.openpty()
        # Raw before anyone opens it, else the terminal itself echoes and translates. The
        # host's end stays open here: were it closed between two drivers, reads would fail.
        tty.setraw(self._host)
        os.set_blocking(self._device, False)
        self._connected = True

    def wait(self, timeout_s: float, *, sending: bool) -> None:
        """Wait until there is something to read (or room to write)."""
        select.select([self._device], [self._device] * sending, [], max(0.0, timeout_s))

    def receive(self) -> bytes:
        """Return what the host has sent; nothing when it has sent nothing."""
        try:
            return os.read(self._device, 4096)
        except BlockingIOError:
            return b""

    def send(self, data: memoryview) -> int:
        """Send what there is room for; return how many bytes that was."""
        try:
            return os.write(self._device, data)
        except BlockingIOError:
            return 0

    def unplug(self) -> None:
        """Pull the plug: the host's next read fails."""
        if self._connected:
            self._connected = False
            os.close(self._device)
            os.close(self._host)


class LoopbackSocket:
    """A socket on 127.0.0.1, for pyserial's ``socket://``; one host at a time."""

    def __init__(self) -> None:
        self._host: socket.socket | None = None
        self._listen(0)
        self.port = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def _listen(self, port: int) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self._listener.setblocking(False)

    def wait(self, timeout_s: float, *, sending: bool) -> None:
        """Wait until there is something to read (or room to write)."""
        end, sending = self._host or self._listener, self._host is not None and sending
        select.select([end], [end] * sending, [], max(0.0, timeout_s))

    def receive(self) -> bytes:
        """Return what the host has sent; accept a host that has come, drop one that left."""
        if self._host is None:
            with suppress(BlockingIOError):
                self._host, _ = self._listener.accept()
                self._host.setblocking(False)
                self._host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b""
        try:
            data = self._host.recv(4096)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._host.close()
            self._host = None
        return data

    def send(self, data: memoryview) -> int:
        """Send what there is room for; without a host, data are lost."""
        if self._host is None:
            return len(data)
        try:
            return self._host.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            return len(data)

    def unplug(self) -> None:
        """Pull the plug: the host's next read fails."""
        if self._host is not None:
            self._host.close()
            self._host = None
        self._listener.close()


Link: TypeAlias = PseudoTerminal | LoopbackSocket
"""The device's end; every call returns at once, except `wait`."""


class SimulatedDevice:
    """An instrument behind a pseudo-terminal or socket: a context manager.

    Within the context it lives in a thread of its own; who has its own link and clock may
    call `step` instead.

    Parameters
    ----------
    kind
        A key of `DEVICES`.
    signal
        Times to volts, for every enabled channel, or a mapping from channel number; a
        channel without one reads 0 V. It is called with rising times, block after block, so
        noise drawn from one generator does not depend on the pace of the host.
    clock_scale
        How many seconds of the device pass in one of wall-clock time.
    link
        ``"pty"``, ``"socket"``, or ``None`` for what the system has; or a device's end itself.
    rate_error
        The device's clock is fast by this fraction: scans come ``1 + rate_error`` times as
        often as it claims.
    clock
        The clock of its world; by default wall-clock time, `clock_scale` times as fast.

    Examples
    --------
    >>> import numpy as np
    >>> from pendpipe.acquisition.recorder import record
    >>> with SimulatedDevice("di2108", np.cos, clock_scale=1000) as device:
    ...     recording = record(
    ...         device.port, "di2108", rate_hz=100, duration_s=10, clock=device.clock
    ...     )
    >>> len(recording)
    1000
    """

    def __init__(
        self,
        kind: str,
        signal: Signal | Mapping[int, Signal],
        *,
        clock_scale: float = 1.0,
        link: str | Link | None = None,
        rate_error: float = 0.0,
        clock: ScaledClock | None = None,
    ) -> None:
        refuse_if(
            kind not in DEVICES,
            f"device simulated:{kind}",
            "there is no such simulated device",
            f"choose from {', '.join(f'simulated:{name}' for name in DEVICES)}",
        )
        self.kind = kind
        self.dialect = DEVICES[kind]()
        self.clock = clock or ScaledClock(clock_scale)
        self.failure: BaseException | None = None
        self._signal = signal
        self._rate_error = rate_error
        if link is None or isinstance(link, str):
            usual = "pty" if hasattr(os, "openpty") else "socket"
            link = PseudoTerminal() if (link or usual) == "pty" else LoopbackSocket()
        self._link = link
        self._stream: Stream | None = None
        self._starts = self.dialect.starts  # of streams, that were seen
        self._ending = threading.Event()
        self._outbox = bytearray()
        self._thread = threading.Thread(target=self._live, name=f"simulated {kind}", daemon=True)

    @property
    def port(self) -> str:
        """The port to give to a driver."""
        return self._link.port

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_fault: object) -> None:
        self.unplug()
        if self.failure is not None:
            raise self.failure

    def unplug(self) -> None:
        """End the device and its line: the host's next read fails."""
        if not self._ending.is_set():
            self._ending.set()
            self._thread.join()
            self._link.unplug()

    def _live(self) -> None:
        """Serve the line until the end; an exception of the signal silences the device."""
        try:
            while not self._ending.is_set():
                rest_s = self._stream.rest_s() if self._stream else _LONGEST_REST_S
                self._link.wait(min(rest_s, _LONGEST_REST_S), sending=bool(self._outbox))
                self.step()
        except BaseException as fault:
            self.failure = fault

    def step(self) -> None:
        """Read what the host has sent, and send what is due by now."""
        if data := self._link.receive():
            self._outbox += self.dialect.respond(data)
        self._follow()
        if self._stream and not self._outbox:
            self._outbox += self._stream.due()
        self._send()

    def _follow(self) -> None:
        """Begin or end a stream as the host has commanded."""
        if self.dialect.starts != self._starts:
            self._starts = self.dialect.starts
            self._begin()
        if not self.dialect.streaming:
            self._stream = None

    def _begin(self) -> None:
        """Begin a stream, whose first scan reads the signal at 0 s."""
        self._stream = Stream(self.dialect, self._signal, self._rate_error, self.clock)

    def _send(self) -> None:
        """Send what the line takes; while it is full, simulated time stands still."""
        if self._outbox:
            with memoryview(self._outbox) as view:
                sent = self._link.send(view)
            del self._outbox[:sent]
        if self._outbox:
            self.clock.hold()
        else:
            self.clock.release()
