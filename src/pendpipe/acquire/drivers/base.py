"""What every driver and every decoder of the package can do.

A *scan* is one reading of every enabled channel at one instant; a *count* is the
converter's signed number, zero at 0 V.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

from pendpipe.acquire.clock import Clock
from pendpipe.acquire.line import Line
from pendpipe.arrays import AnyArray


@dataclass(frozen=True)
class Loss:
    """A place where the bytes did not make scans.

    Parameters
    ----------
    after_scan
        How many good scans were decoded before it (since the decoder was made).
    discarded_bytes
        The bytes that had to be thrown away to get into step again.
    lost_scans
        The scans they stand for: the least whole number that could have held them. Whole
        scans missing besides leave no trace in the bytes, only in the clock.
    suspect_before
        Whether the scan before is suspect too: bytes without a frame mark followed it, so
        that one of them may belong inside it.
    reason
        What the device said of it (``"stop 01"``), or ``"clock"`` where the bytes are whole
        and the recorder's clock tells of the loss.
    """

    after_scan: int
    discarded_bytes: int
    lost_scans: int
    suspect_before: bool = False
    reason: str = ""


@dataclass(frozen=True)
class Scans:
    """What a decoder made of some bytes.

    Parameters
    ----------
    counts
        Signed counts, shape (scans, channels), 16-bit integers.
    losses
        The losses met, in order.
    """

    counts: AnyArray
    losses: tuple[Loss, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.counts)


class Decoder(Protocol):
    """Bytes in, scans and losses out; how the bytes are cut into pieces changes nothing."""

    @property
    def bytes_per_scan(self) -> int:
        """How many bytes an undamaged scan takes."""

    def feed(self, data: bytes) -> Scans:
        """Decode further bytes; an unfinished scan waits for the next call."""

    def finish(self) -> Scans:
        """Say what is left over at the end: scans held back till now, perhaps a loss."""


@dataclass(frozen=True)
class Identity:
    """What a device says of itself."""

    model: str
    firmware: str = ""
    serial_number: str = ""


@dataclass(frozen=True)
class Setup:
    """How a device was told to sample.

    Parameters
    ----------
    channels
        The enabled channels as printed on the box (from 1), in the order of the scan.
    rate_hz
        Scans a second that the device's documented clock gives: the nearest to what was
        asked that its divisors allow.
    range_volts
        Full scale of every channel is plus and minus it.
    """

    channels: tuple[int, ...]
    rate_hz: float
    range_volts: float = 10.0


class Driver(Protocol):
    """One instrument on an open line.

    A session is ``identify``, ``configure``, ``start``, any number of ``receive``, and
    ``stop``. Faults of the line or of the setting are `InputError`, with the port as place.
    """

    model: ClassVar[str]
    baudrate: ClassVar[int]
    bits: ClassVar[int]
    range_volts: ClassVar[float]
    attempts: int

    def __init__(self, line: Line, clock: Clock) -> None: ...

    def hello(self) -> Identity:
        """Make the device quiet and ask it who it is, in the language of the family."""

    def identify(self) -> Identity:
        """Make the device quiet and ask it who it is; refuse another model."""

    def configure(
        self, channels: Sequence[int], rate_hz: float, range_volts: float | None = None
    ) -> Setup:
        """Choose channels, scan rate and the smallest range that holds `range_volts`."""

    def start(self) -> None:
        """Begin the stream; the next byte received belongs to the first scan."""

    def receive(self, limit_s: float) -> bytes:
        """Return what has arrived, waiting at most `limit_s` (of the host's clock)."""

    def read(self, limit_s: float) -> Scans:
        """Receive and decode, for a use without the recorder."""

    def ended(self, data: bytes) -> str:
        """Return what the device says of the end of its stream, if it does in these bytes."""

    def stop(self) -> None:
        """End the stream and throw away what still arrives."""

    @classmethod
    def decoder(cls, channels: int) -> Decoder:
        """Return a fresh decoder for scans of so many channels."""


class StreamReader:
    """The part of a driver that is alike in every family: bytes off the line, decoded.

    Parameters
    ----------
    line
        An open line.
    clock
        The recorder's clock, in which the waits for the device are counted.
    """

    def __init__(self, line: Line, clock: Clock) -> None:
        self.line = line
        self.setup: Setup | None = None
        self._clock = clock
        self._decoder: Decoder | None = None
        # How long no byte must come until a stream is held to have ended. The adapters of
        # USB keep bytes back for up to 16 ms; a simulated line does not.
        self.quiet_s = max(0.05 / clock.scale, 0.01)
        # Whether an answer was missed: it may yet come, and must not come among the data.
        self._doubt = False

    def _clear_the_line(self, patience_s: float) -> None:
        """Before a start: throw away padding, and wait for answers that were missed.

        One byte too many before the first scan would shift every scan of a stream
        that has no marks.
        """
        self.line.discard(patience_s if self._doubt else self.quiet_s, 2.0 * patience_s)
        self._doubt = False

    def receive(self, limit_s: float) -> bytes:
        """Return what has arrived, waiting at most `limit_s` (of the host's clock)."""
        return self.line.receive(limit_s)

    def ended(self, data: bytes) -> str:  # noqa: ARG002 - the legacy families tell nothing
        """Return what the device says of the end of its stream: by default nothing."""
        return ""

    def read(self, limit_s: float) -> Scans:
        """Receive and decode, for a use without the recorder."""
        if self._decoder is None:
            raise RuntimeError("start() comes before read()")
        return self._decoder.feed(self.receive(limit_s))
