"""What the simulated line asks of every simulated instrument."""

from __future__ import annotations

from typing import ClassVar, Protocol

from pendpipe.arrays import IntArray


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
