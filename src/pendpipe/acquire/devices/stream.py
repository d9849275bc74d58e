"""What a simulated instrument sends: its signal, converted, encoded, and released on schedule."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import ClassVar, Final, Protocol, TypeAlias

import numpy as np

from pendpipe.acquire.clock import Clock
from pendpipe.arrays import FloatArray, IntArray


class Dialect(Protocol):
    """An instrument without its line and its clock: commands in, replies and data out."""

    model: ClassVar[str]
    bits: ClassVar[int]
    starts: int
    """How often the stream was started: a change means that it begins anew."""
    streaming: bool
    """Whether data flow."""

    @property
    def range_volts(self) -> float:
        """Full scale, as the host has chosen it."""

    @property
    def channels(self) -> tuple[int, ...]:
        """The enabled channels as printed on the box (from 1), in the order of the scan."""

    @property
    def scan_rate_hz(self) -> float:
        """Scans a second by the device's own clock."""

    @property
    def packet_bytes(self) -> int:
        """Data leave in pieces of so many bytes."""

    def respond(self, data: bytes) -> bytes:
        """Take bytes from the host; return the echoes and answers."""

    def encode(self, codes: IntArray) -> bytes:
        """Put signed codes, shape (scans, channels), into the bytes of the stream."""


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
