"""The data of a simulated instrument, from its signal to its bytes, at their hour."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final, TypeAlias

import numpy as np

from pendpipe.acquire.clock import Clock
from pendpipe.acquire.devices.converter import convert
from pendpipe.acquire.devices.dialect import Dialect
from pendpipe.arrays import FloatArray, IntArray

Signal: TypeAlias = Callable[[FloatArray], FloatArray]
"""Times in s since the device was switched on to volts at the terminals, noise included."""

_BLOCKS: Final = (1 << 10, 1 << 14)
"""Scans computed at a time, ahead of their hour: few at first, then more and more, so that
neither a short nor a long recording pays for the signal twice."""
_REST_S: Final = 0.002
"""The shortest time between two pieces of data, in seconds of the host."""


class Stream:
    """The data between a start and a stop, computed in blocks and released by the clock."""

    def __init__(
        self,
        dialect: Dialect,
        signal: Signal | Mapping[int, Signal],
        rate_error: float,
        offset_s: float,
    ) -> None:
        self._offset_s = offset_s
        self._dialect = dialect
        channels = dialect.channels
        self._signals = [
            signal.get(number) if isinstance(signal, Mapping) else signal for number in channels
        ]
        self._rate_hz = dialect.scan_rate_hz * (1.0 + rate_error)
        self.scan_bytes = len(dialect.encode(np.zeros((1, len(channels)), dtype=np.int64)))
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
        size = max(0, taken * self.scan_bytes // packet * packet - self._released)
        while len(self._ready) < size:
            self._compute()
        piece, self._ready = self._ready[:size], self._ready[size:]
        self._released += size
        return piece

    def rest_s(self, clock: Clock) -> float:
        """How long, in seconds of the host, until the next packet is complete."""
        following = math.ceil((self._released + self._dialect.packet_bytes) / self.scan_bytes)
        complete_s = self._origin_s + (following - 1) / self._rate_hz
        return max(_REST_S, (complete_s - clock.now()) / clock.scale)

    def _compute(self) -> None:
        """Sample, convert and encode the next block."""
        block = min(_BLOCKS[1], max(_BLOCKS[0], self._computed))
        time_s = np.arange(self._computed, self._computed + block) / self._rate_hz
        time_s += self._offset_s
        codes: IntArray = np.zeros((block, len(self._signals)), dtype=np.int64)
        for column, signal in enumerate(self._signals):
            if signal is not None:
                volts = signal(time_s)
                codes[:, column] = convert(volts, self._dialect.bits, self._dialect.range_volts)
        self._ready += self._dialect.encode(codes)
        self._computed += block
