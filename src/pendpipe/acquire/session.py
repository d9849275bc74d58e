"""A session with an instrument: from its start to its end, over breaks of the line."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Final, Protocol

from pendpipe.acquire.clock import Clock
from pendpipe.acquire.drivers.base import Decoder, Driver, Identity, Setup
from pendpipe.acquire.line import Line, LineLostError
from pendpipe.acquire.noise import NoiseWatch
from pendpipe.acquire.raw import COMPLETE, RawWriter
from pendpipe.errors import InputError

_POLLS: Final = 256
"""Time stamps of a recording, at least, so that its rate can be measured."""
_SHORTEST_POLL_S, _LONGEST_POLL_S = 0.001, 0.02
_BACKLOG: Final = 2048
"""So many bytes at once say that more wait: a pseudo-terminal hands out 4 kB at a time."""
_SILENCE_S: Final = 3.0
"""Seconds of the host without a byte (beyond the time of a few scans) that are a break."""
_PATIENCE_S: Final = 5.0
"""Seconds of the host, beyond a tenth more than asked, that a slow device is waited for."""
_RETRY_S: Final = 0.2
"""Seconds of the host between two attempts to find the device again."""


class Progress(Protocol):
    """Somebody who wants to see how a recording goes on."""

    def begin(self, driver: type[Driver], setup: Setup) -> None:
        """Take notice of what is recorded; again after a break."""

    def update(self, elapsed_s: float, data: bytes) -> None:
        """Take notice of further bytes, by `elapsed_s` of the recorder's clock."""

    def end(self) -> None:
        """Take leave."""


@dataclass(frozen=True)
class Wish:
    """What is to be recorded.

    Parameters
    ----------
    channels
        Channels as printed on the box, from 1.
    rate_hz
        Scans a second; the nearest that the device can do is taken.
    duration_s
        Seconds of the recorder's clock.
    range_volts
        The signal stays within plus and minus it; the box's usual range when not given.
    until_noise
        End also when the amplitude (of the first channel) has reached the noise.
    reconnect_s
        Seconds of the host for which a lost or silent device is waited for.
    """

    channels: tuple[int, ...]
    rate_hz: float
    duration_s: float
    range_volts: float | None = None
    until_noise: bool = False
    reconnect_s: float = 30.0

    def __post_init__(self) -> None:
        for name in ("rate_hz", "duration_s", "range_volts"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise InputError(name, f"{value:g} is no positive number", "give one above 0")


class Session:
    """One recording with one instrument, kept as it comes.

    Parameters
    ----------
    line
        The open line; the session closes it, and opens it again after a break.
    driver
        The model.
    wish
        What is to be recorded.
    clock
        The recorder's clock.
    progress
        Somebody to keep informed.
    """

    def __init__(
        self,
        line: Line,
        driver: type[Driver],
        wish: Wish,
        clock: Clock,
        progress: Progress | None = None,
    ) -> None:
        self._line = line
        self._driver = driver
        self._wish = wish
        self._clock = clock
        self._progress = progress
        self._received = 0
        self._by_clock = False  # the end is told by the clock, not by the count of scans
        self._watch: NoiseWatch | None = None
        self._decoder: Decoder | None = None
        self.identity, self.setup = self._introduce()

    def close(self) -> None:
        """Close the line."""
        self._line.close()

    def run(self, writer: RawWriter) -> None:
        """Keep everything from start to end, with its time; a break ends or resumes it."""
        # Taken before the start, so that a device can only seem late, never early.
        self._origin_s = self._clock.now()
        reason = ""
        try:
            self._instrument.start()
            reason = self._listen(writer)
            while reason not in COMPLETE and self._resume(reason, writer):
                reason = self._listen(writer)
            self._instrument.stop()
        except LineLostError as fault:
            reason = reason or fault.problem
        except KeyboardInterrupt:
            reason = "interrupted by the user"
            self._stop()
        except OSError:
            # The disk, not the line: the device need not fill its buffer meanwhile.
            self._stop()
            raise
        finally:
            if self._progress:
                self._progress.end()
        keep = {"keep_scans": self._scans} if reason == "scans" else {}
        writer.event(self._elapsed_s(), event="stopped", reason=reason, **keep)

    @property
    def _scans(self) -> int:
        """How many scans the wish amounts to at the device's own rate."""
        return max(1, round(self._wish.duration_s * self.setup.rate_hz))

    def _elapsed_s(self) -> float:
        return self._clock.now() - self._origin_s

    def _stop(self) -> None:
        try:
            self._instrument.stop()
        except InputError:
            self._line.close()

    def _introduce(self) -> tuple[Identity, Setup]:
        """Ask the device who it is, and set it."""
        self._instrument = self._driver(self._line, self._clock)
        wish = self._wish
        identity = self._instrument.identify()
        setup = self._instrument.configure(wish.channels, wish.rate_hz, wish.range_volts)
        if wish.until_noise:
            self._watch = self._watch or NoiseWatch(setup.rate_hz)
            self._decoder = self._driver.decoder(len(setup.channels))
        if self._progress:
            self._progress.begin(self._driver, setup)
        return identity, setup

    def _listen(self, writer: RawWriter) -> str:
        """Keep what comes until it is enough or breaks off; return which."""
        scans, wish, scale = self._scans, self._wish, self._clock.scale
        wanted = scans * self._driver.decoder(len(self.setup.channels)).bytes_per_scan
        poll_s = min(_LONGEST_POLL_S, max(_SHORTEST_POLL_S, wish.duration_s / scale / _POLLS))
        latest_s = 1.1 * wish.duration_s + _PATIENCE_S * scale
        # A packet may gather many scans before it is sent.
        silence_s = _SILENCE_S + 64 / self.setup.rate_hz / scale
        while True:
            try:
                data = self._instrument.receive(silence_s)
            except LineLostError as fault:
                return fault.problem
            elapsed_s = self._elapsed_s()
            if data:
                writer.data(elapsed_s, data)
                self._received += len(data)
            if self._progress:
                self._progress.update(elapsed_s, data)
            enough = self._received >= wanted
            if enough and elapsed_s < 0.9 * (scans - 1) / self.setup.rate_hz:
                self._by_clock = True
            if elapsed_s >= (wish.duration_s if self._by_clock else latest_s):
                return "time"
            if not data:
                return f"the device fell silent after {elapsed_s:.6g} s"
            if said := self._instrument.ended(data):
                return f"the device ended its stream with '{said}'"
            if enough and not self._by_clock:
                return "scans"
            if self._watch and self._decoder:
                counts = self._decoder.feed(data).counts
                if self._watch.feed(counts[:, 0]):
                    return "noise"
            if len(data) < _BACKLOG:
                time.sleep(poll_s)

    def _resume(self, reason: str, writer: RawWriter) -> bool:
        """Find the device again and start it; return whether that was possible in time."""
        writer.event(self._elapsed_s(), event="broken", reason=reason)
        self._by_clock = True
        until_s = time.monotonic() + self._wish.reconnect_s
        while time.monotonic() < until_s and self._elapsed_s() < self._wish.duration_s:
            try:
                if not self._line.is_open:
                    self._line = Line(self._line.port, self._driver.baudrate)
                self._line.set_baudrate(self._driver.baudrate)
                identity, setup = self._introduce()
                if (identity, setup) != (self.identity, self.setup):
                    # Another device, or an answer that was damaged: it is asked again.
                    self._line.close()
                    time.sleep(_RETRY_S)
                    continue
                writer.event(self._elapsed_s(), event="restarted", reason=reason)
                self._instrument.start()
            except InputError:
                self._line.close()
                time.sleep(_RETRY_S)
            else:
                return True
        return False
