"""The RS-232 family of the DI-154RS and DI-194RS: commands of three bytes, echoed.

A command is NUL, a letter, an argument. The NUL is not echoed; letter and argument are,
one by one, and the next byte is sent after the echo of the last (dataq-facts A1).
"""

from __future__ import annotations

from typing import ClassVar, Final

from pendpipe.acquire.clock import Clock
from pendpipe.acquire.drivers.base import Driver, Identity
from pendpipe.acquire.line import Line

_JUNK: Final = b"\xff\xfe\x7f"
"""Seen while the device's supply comes up; never an answer to a command."""
_IDENTITIES: Final = {b"0000000000": "DI-194RS", b"0000000001": "DI-154RS"}
_BAUD_CODES: Final = {4800: b"\x01", 9600: b"\x04"}
_BITS_PER_SAMPLE: Final = 20
"""Two bytes of ten bits on the line; it is the line that limits the rate."""
_SLOWEST_COUNT: Final = 32767


class DI154RS(Driver):
    """The DI-154RS: 4 channels, 12 bits, +-10 V, powered by DTR and RTS.

    The device waits `count` bit times between scans, so that the rate is baud/(20 n + count) for n
    channels. The formula rests on two programs of others, not on the vendor's word: the rate is
    measured as well. 9600 baud is taken only when 4800 can't carry the rate.
    """

    model: ClassVar[str] = "DI-154RS"
    baudrate: ClassVar[int] = 4800
    bits: ClassVar[int] = 12
    channels: ClassVar[int] = 4

    def __init__(self, line: Line, clock: Clock) -> None:
        super().__init__(line, clock)
        self._baudrate = self.baudrate

    def hello(self) -> Identity:
        """Wake the device, end a stream of an earlier run, and ask who it is."""
        # The supply comes up over the modem lines, raised when the port was opened.
        self._clock.sleep(0.1)
        self.stop()
        name = self._command(b"N", b"Z", reply=10)
        return Identity(_IDENTITIES.get(name) or f"device that calls itself {name!r}")

    def _set(self, channels: tuple[int, ...], rate_hz: float, range_volts: float) -> float:  # noqa: ARG002 - it has one range
        samples = len(channels) * rate_hz
        baudrate = 4800 if samples <= 4800 / _BITS_PER_SAMPLE else 9600
        count = round(baudrate / rate_hz) - _BITS_PER_SAMPLE * len(channels) if rate_hz > 0 else -1
        if samples > baudrate / _BITS_PER_SAMPLE or not 0 <= count <= _SLOWEST_COUNT:
            what = f"{len(channels)} channel(s) "
            raise self._no_rate(what, rate_hz, "0.15", 480 / len(channels))
        self._set_baudrate(baudrate)
        mask = sum(1 << (channel - 1) for channel in channels)
        self._command(b"C", bytes([mask]))
        self._command(b"L", bytes([count & 0xFF]))
        self._command(b"M", bytes([count >> 8]))
        return baudrate / (_BITS_PER_SAMPLE * len(channels) + count)

    def _start_stream(self) -> None:
        self._command(b"S", b"1", undo=True)

    def stop(self) -> None:
        """End the stream, throw away what still arrives, and go back to 4800 baud."""
        self._end_stream()
        self._set_baudrate(self.baudrate)

    def _set_baudrate(self, baudrate: int) -> None:
        """Change the speed of both ends; the device answers at the old one."""
        if baudrate != self._baudrate:
            self._command(b"B", _BAUD_CODES[baudrate])
            self.line.set_baudrate(baudrate)
            self._baudrate = baudrate

    def _command(self, letter: bytes, argument: bytes, reply: int = 0, undo: bool = False) -> bytes:
        """Send a command; return the reply.

        A wrong or missing echo is tried again after half a second; with `undo` the device
        is stopped first, since it may have started although its echo was lost.
        """
        echo = b""
        for attempt in range(self.attempts):
            if attempt:
                self._doubt = True
                self._clock.sleep(0.5)
                if undo:
                    self._end_stream()
                self.line.discard(self.quiet_s)
            echoed, echo = self._send_letters(letter, argument)
            if echoed:
                answer = self.line.read(reply, self.patience_s) if reply else b""
                if len(answer) == reply:
                    return answer
        raise self._no_answer(letter.decode(), echo)

    def _echo(self) -> bytes:
        """Return the next byte that is no start-up junk."""
        while (byte := super()._echo()) and byte in _JUNK:
            pass
        return byte


class DI194RS(DI154RS):
    """The DI-194RS: the same line and commands, 10 bits."""

    model: ClassVar[str] = "DI-194RS"
    bits: ClassVar[int] = 10
