"""The families whose commands are lines of text: DI-149 and DI-155, and the CDC family's base.

Commands end in CR and are echoed with it, perhaps with NULs behind; ``stop`` is echoed among
the data (dataq-facts A5, A8). The DI-149 and DI-155 echo ``start`` too, and the data follow at
once; their samples have a frame mark (A6).
"""

from __future__ import annotations

from typing import ClassVar, Final

from pendpipe.acquire.drivers.base import Driver, Identity
from pendpipe.errors import InputError

_BASE_HZ: Final = 750_000
_FASTEST_DIVISOR: Final = 75
"""For each channel: the box takes 10 000 samples a second."""
_SLOWEST_DIVISOR: Final = 65535
_END_OF_LIST: Final = "xffff"


class TextDriver(Driver):
    """Commands of text ended by CR; the speed of the line does not matter."""

    stop_command: ClassVar[tuple[bytes, ...]] = (b"stop\r",)
    checks: ClassVar[str] = "cable, power, CDC mode"

    def hello(self) -> Identity:
        """End a stream of an earlier run and ask the device who it is."""
        self.stop()
        maker = self._send_line("info 0")
        number = self._send_line("info 1")
        if maker != "DATAQ":
            return Identity(f"{maker} {number}")
        return Identity(f"DI-{number}", self._send_line("info 2"), self._send_line("info 6"))


class DI149(TextDriver):
    """The DI-149: 8 channels, 12 bits, +-10 V, 10 kHz in all; scans at 750 kHz/srate."""

    model: ClassVar[str] = "DI-149"
    bits: ClassVar[int] = 12

    def _set(self, channels: tuple[int, ...], rate_hz: float, range_volts: float) -> float:
        slowest, fastest = _BASE_HZ / _SLOWEST_DIVISOR, _BASE_HZ / _FASTEST_DIVISOR / len(channels)
        if not slowest <= rate_hz <= fastest:
            what = f"{len(channels)} channel(s) "
            raise self._no_rate(what, rate_hz, f"{slowest:.4g}", fastest)
        divisor = round(_BASE_HZ / rate_hz)
        self._send_line("asc")  # the scan list is written in this mode
        for position, channel in enumerate(channels):
            word = self.ranges.index(range_volts) << 8 | channel - 1
            self._send_line(f"slist {position} x{word:04x}")
        self._send_line(f"slist {len(channels)} {_END_OF_LIST}")
        self._send_line(f"srate {divisor}")
        self._send_line("bin")
        return _BASE_HZ / divisor

    def _start_stream(self) -> None:
        for attempt in range(self.attempts):
            if attempt:
                self._clear_the_line()
            self.line.write(b"start\r")
            # Byte by byte: the data behind the echo are not to be touched.
            if self.line.read_until(b"start\r", self.patience_s).endswith(b"start\r"):
                return
            # It may have started although its echo was lost.
            self.stop()
        raise InputError(self.line.port, "the device does not start", "check cable and power")


class DI155(DI149):
    """The DI-155: 4 channels, frames of 14 bits, +-2.5 to +-50 V, 10 kHz in all.

    How many of the 14 bits carry a signal is not settled: 13 or 14.
    """

    model: ClassVar[str] = "DI-155"
    bits: ClassVar[int] = 14
    ranges: ClassVar[tuple[float, ...]] = (50.0, 25.0, 12.5, 10.0, 6.25, 5.0, 3.125, 2.5)
    channels: ClassVar[int] = 4
