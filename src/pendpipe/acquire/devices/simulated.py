"""A simulated instrument on a line, in a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from types import TracebackType
from typing import Self

from pendpipe.acquire.clock import SimulatedClock
from pendpipe.acquire.devices import DEVICES
from pendpipe.acquire.devices.links import Link, open_link
from pendpipe.acquire.devices.stream import Signal, Stream
from pendpipe.errors import InputError

__all__ = ["DEVICES", "Signal", "SimulatedDevice"]


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
        often as it says.
    clock
        The clock of its world; by default wall-clock time, `clock_scale` times as fast.

    Examples
    --------
    >>> import numpy as np
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
        link: str | Link | None = None,
        rate_error: float = 0.0,
        clock: SimulatedClock | None = None,
    ) -> None:
        if kind not in DEVICES:
            raise InputError(
                f"device simulated:{kind}",
                "there is no such simulated device",
                f"choose from {', '.join(f'simulated:{name}' for name in DEVICES)}",
            )
        self.kind = kind
        self.dialect = DEVICES[kind]()
        self.clock = clock or SimulatedClock(clock_scale)
        self.failure: BaseException | None = None
        self._signal = signal
        self._rate_error = rate_error
        self._link = open_link(link) if link is None or isinstance(link, str) else link
        self._stream: Stream | None = None
        self._starts = self.dialect.starts  # of streams, that were seen
        self._ending = threading.Event()
        self._outbox = bytearray()
        self._thread = threading.Thread(target=self._live, name=f"simulated {kind}", daemon=True)

    @property
    def port(self) -> str:
        """The port to give to a driver."""
        return self._link.port

    @property
    def clock_scale(self) -> float:
        """How many seconds of the device pass in one of wall-clock time."""
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
        """Serve the line until the end; an exception of the signal silences the device."""
        try:
            while not self._ending.is_set():
                self._link.wait(self._rest_s(), sending=bool(self._outbox))
                self.step()
        except BaseException as fault:
            self.failure = fault

    def step(self) -> None:
        """Read what the host has sent, and send what is due by now."""
        if data := self._link.receive():
            self._outbox += self.dialect.respond(data)
        self._follow()
        if self._stream and not self._outbox:
            self._outbox += self._stream.due(self.clock)
        self._send()

    def _follow(self) -> None:
        """Begin or end a stream as the host has commanded."""
        if self.dialect.starts != self._starts:
            self._starts = self.dialect.starts
            self._begin()
        if not self.dialect.streaming:
            self._stream = None

    def _begin(self, offset_s: float = 0.0) -> None:
        """Begin a stream, whose first scan reads the signal at `offset_s`."""
        self._stream = Stream(self.dialect, self._signal, self._rate_error, offset_s)
        self._stream.begin(self.clock)

    def _rest_s(self) -> float:
        """How long there is nothing to do, in seconds of the host, if the host is silent."""
        return self._stream.rest_s(self.clock) if self._stream else 60.0

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
