"""The USB family of the DI-149 and DI-155: text commands, samples with a frame mark.

Commands are lower case, ended by CR and echoed with it; ``start`` is echoed too, and the
data follow at once (dataq-facts A5, A6).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Final

from pendpipe.acquire.drivers.base import Setup
from pendpipe.acquire.drivers.choice import choose_channels, choose_range
from pendpipe.acquire.drivers.decoders import SyncBitDecoder
from pendpipe.acquire.drivers.text import TextDriver
from pendpipe.errors import InputError

_BASE_HZ: Final = 750_000
_FASTEST_DIVISOR: Final = 75
"""For each channel: the box takes 10 000 samples a second."""
_SLOWEST_DIVISOR: Final = 65535
_END_OF_LIST: Final = "xffff"


class DI149(TextDriver):
    """The DI-149: 8 channels, 12 bits, +-10 V, 10 kHz in all."""

    model: ClassVar[str] = "DI-149"
    bits: ClassVar[int] = 12
    range_volts: ClassVar[float] = 10.0
    ranges: ClassVar[tuple[float, ...]] = (10.0,)
    """Full scales in the order of their codes in bits 8 to 10 of a word of the scan list."""
    channels: ClassVar[int] = 8

    def configure(
        self, channels: Sequence[int], rate_hz: float, range_volts: float | None = None
    ) -> Setup:
        """Choose channels, scan rate (750 kHz/srate) and range.

        Raises
        ------
        InputError
            On a channel or a range that the box does not have, or a rate out of its reach.
        """
        port = self.line.port
        chosen = choose_channels(port, self.model, channels, self.channels)
        high = choose_range(port, self.model, self.ranges, range_volts, self.range_volts)
        slowest, fastest = _BASE_HZ / _SLOWEST_DIVISOR, _BASE_HZ / _FASTEST_DIVISOR / len(chosen)
        if not slowest <= rate_hz <= fastest:
            raise InputError(
                port,
                f"the {self.model} can't scan {len(chosen)} channel(s) at {rate_hz:g} Hz",
                f"choose a rate between {slowest:.4g} and {fastest:g} Hz",
            )
        divisor = round(_BASE_HZ / rate_hz)
        self._command("asc")  # the scan list is written in this mode
        for position, channel in enumerate(chosen):
            word = self.ranges.index(high) << 8 | channel - 1
            self._command(f"slist {position} x{word:04x}")
        self._command(f"slist {len(chosen)} {_END_OF_LIST}")
        self._command(f"srate {divisor}")
        self._command("bin")
        self.setup = Setup(chosen, _BASE_HZ / divisor, high)
        return self.setup

    def start(self) -> None:
        """Begin the stream; the next byte received belongs to the first scan.

        Raises
        ------
        InputError
            If the device does not answer.
        """
        if self.setup is None:
            raise RuntimeError("configure() comes before start()")
        self._decoder = self.decoder(len(self.setup.channels))
        for _ in range(self.attempts):
            self._clear_the_line(self.patience_s)
            self.line.write(b"start\r")
            # Byte by byte: the data behind the echo are not to be touched.
            if self.line.read_until(b"start\r", self.patience_s).endswith(b"start\r"):
                return
            # It may have started although its echo was lost.
            self.stop()
        raise InputError(self.line.port, "the device does not start", "check cable and power")

    @classmethod
    def decoder(cls, channels: int) -> SyncBitDecoder:
        """Return a fresh decoder for scans of so many channels."""
        return SyncBitDecoder(channels, cls.bits)


class DI155(DI149):
    """The DI-155: 4 channels, frames of 14 bits, +-2.5 to +-50 V, 10 kHz in all.

    How many of the 14 bits carry a signal is not settled: 13 or 14.
    """

    model: ClassVar[str] = "DI-155"
    bits: ClassVar[int] = 14
    ranges: ClassVar[tuple[float, ...]] = (50.0, 25.0, 12.5, 10.0, 6.25, 5.0, 3.125, 2.5)
    channels: ClassVar[int] = 4
