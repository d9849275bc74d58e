"""A simulated instrument on a line, in a thread of its own."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Final, Self, TypeAlias

import numpy as np

from pendpipe.acquire.clock import Clock, SimulatedClock
from pendpipe.acquire.devices.converter import convert
from pendpipe.acquire.devices.di154rs import SimulatedDI154RS
from pendpipe.acquire.devices.di2108 import SimulatedDI2108
from pendpipe.acquire.devices.dialect import Dialect
from pendpipe.acquire.devices.links import open_link
from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError

Signal: TypeAlias = Callable[[FloatArray], FloatArray]
"""Times in s since the start of the stream to volts at the terminals, noise included."""

DEVICES: Final[Mapping[str, Callable[[], Dialect]]] = {
    "di154": SimulatedDI154RS,
    "di154rs": SimulatedDI154RS,
    "di2108": SimulatedDI2108,
}
_BLOCKS: Final = (1 << 10, 1 << 14)
"""Scans computed at a time, ahead of their hour: few at first, then more and more, so that
neither a short nor a long recording pays for the signal twice."""
_REST_S: Final = 0.002
"""The shortest time between two pieces of data, in seconds of the host."""


class SimulatedDevice:
    """An instrument behind a pseudo-terminal or socket: a context manager.

    Parameters
    ----------
    kind
        ``"di154"`` or ``"di2108"``.
    signal
        Times to volts, for every enabled channel, or a mapping from channel number; a
        channel without one reads 0 V. It is called with rising times, block after block, so
        noise drawn from one generator does not depend on the pace of the host.
    clock_scale
        How many seconds of the device pass in one of the wall's.
    link
        ``"pty"``, ``"socket"``, or ``None`` for what the system has.
    rate_error
        The device's clock is fast by this fraction: scans come ``1 + rate_error`` times as
        often as it says.

    Examples
    --------
    >>> from pendpipe.acquire.recorder import record
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
        link: str | None = None,
        rate_error: float = 0.0,
    ) -> None:
        if kind not in DEVICES:
            raise InputError(
                f"device simulated:{kind}",
                "there is no such simulated device",
                f"choose from {', '.join(f'simulated:{name}' for name in DEVICES)}",
            )
        self.dialect = DEVICES[kind]()
        self.clock = SimulatedClock(clock_scale)
        self.failure: BaseException | None = None
        self._signal = signal
        self._rate_error = rate_error
        self._link = open_link(link)
        self._ending = threading.Event()
        self._outbox = bytearray()
        self._thread = threading.Thread(target=self._live, name=f"simulated {kind}", daemon=True)

    @property
    def port(self) -> str:
        """The port to give to a driver."""
        return self._link.port

    @property
    def clock_scale(self) -> float:
        """How many seconds of the device pass in one of the wall's."""
        return self.clock.scale

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        fault: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.unplug()
        if self.failure is not None:
            raise self.failure

    def unplug(self) -> None:
        """End the device and its line: the host's next read fails."""
        if not self._ending.is_set():
            self._ending.set()
            self._link.wake()
            self._thread.join()
            self._link.close()

    def _live(self) -> None:
        """Serve the line until the end; a fault of the signal silences the device."""
        try:
            stream: _Stream | None = None
            starts = self.dialect.starts
            while not self._ending.is_set():
                self._link.wait(
                    stream.rest_s(self.clock) if stream else 60.0, sending=bool(self._outbox)
                )
                if data := self._link.receive():
                    self._outbox += self.dialect.respond(data)
                if self.dialect.starts != starts:
                    starts = self.dialect.starts
                    stream = _Stream(self.dialect, self._signal, self._rate_error)
                    stream.begin(self.clock)
                if not self.dialect.streaming:
                    stream = None
                elif stream and not self._outbox:
                    self._outbox += stream.due(self.clock)
                self._send()
        except BaseException as fault:
            self.failure = fault

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


class _Stream:
    """The data between a start and a stop, computed in blocks and released by the clock."""

    def __init__(
        self, dialect: Dialect, signal: Signal | Mapping[int, Signal], rate_error: float
    ) -> None:
        self._dialect = dialect
        channels = dialect.channels
        self._signals = [
            signal.get(number) if isinstance(signal, Mapping) else signal for number in channels
        ]
        self._rate_hz = dialect.scan_rate_hz * (1.0 + rate_error)
        self._scan_bytes = len(dialect.encode(np.zeros((1, len(channels)), dtype=np.int64)))
        self._computed = 0  # scans
        self._ready = b""  # bytes of scans computed, not yet released
        self._released = 0  # bytes since the start
        self._origin_s = 0.0

    def begin(self, clock: Clock) -> None:
        """Let scan 0 be taken now; the first block is computed before, and not late."""
        self._compute()
        self._origin_s = clock.now()

    def due(self, clock: Clock) -> bytes:
        """Return the whole packets that are complete by now."""
        elapsed = clock.now() - self._origin_s
        taken = math.floor(elapsed * self._rate_hz) + 1
        packet = self._dialect.packet_bytes
        size = max(0, taken * self._scan_bytes // packet * packet - self._released)
        while len(self._ready) < size:
            self._compute()
        piece, self._ready = self._ready[:size], self._ready[size:]
        self._released += size
        return piece

    def rest_s(self, clock: Clock) -> float:
        """How long, in seconds of the host, until the next packet is complete."""
        following = math.ceil((self._released + self._dialect.packet_bytes) / self._scan_bytes)
        complete_s = self._origin_s + (following - 1) / self._rate_hz
        return max(_REST_S, (complete_s - clock.now()) / clock.scale)

    def _compute(self) -> None:
        """Sample, convert and encode the next block."""
        block = min(_BLOCKS[1], max(_BLOCKS[0], self._computed))
        time_s = np.arange(self._computed, self._computed + block) / self._rate_hz
        codes: IntArray = np.zeros((block, len(self._signals)), dtype=np.int64)
        for column, signal in enumerate(self._signals):
            if signal is not None:
                volts = signal(time_s)
                codes[:, column] = convert(volts, self._dialect.bits, self._dialect.range_volts)
        self._ready += self._dialect.encode(codes)
        self._computed += block
