"""The RS-232 family of the DI-154RS and DI-194RS: commands of three bytes, echoed.

A command is NUL, a letter, an argument. The NUL is not echoed; letter and argument are,
one by one, and the next byte is sent after the echo of the last (dataq-facts A1).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Final

from pendpipe.acquire.clock import Clock
from pendpipe.acquire.drivers.base import Identity, Setup, StreamReader
from pendpipe.acquire.drivers.choice import choose_channels, choose_range, refuse_another
from pendpipe.acquire.drivers.decoders import SyncBitDecoder
from pendpipe.acquire.line import Line
from pendpipe.errors import InputError

_JUNK: Final = b"\xff\xfe\x7f"
"""Seen while the device's supply comes up; never an answer to a command."""
_IDENTITIES: Final = {b"0000000000": "DI-194RS", b"0000000001": "DI-154RS"}
_BAUD_CODES: Final = {4800: b"\x01", 9600: b"\x04"}
_BITS_PER_SAMPLE: Final = 20
"""Two bytes of ten bits on the line; it is the line that limits the rate."""
_SLOWEST_COUNT: Final = 32767


class DI154RS(StreamReader):
    """The DI-154RS: 4 channels, 12 bits, +-10 V, powered by DTR and RTS.

    Parameters
    ----------
    line
        An open line at 4800 baud.
    clock
        The recorder's clock, in which the waits for the device are counted.
    """

    model: ClassVar[str] = "DI-154RS"
    baudrate: ClassVar[int] = 4800
    bits: ClassVar[int] = 12
    range_volts: ClassVar[float] = 10.0
    channels: ClassVar[int] = 4
    patience_s: ClassVar[float] = 2.0
    """How long an echo may take, in seconds of the host (the vendor's host waits 2 s)."""
    attempts: int = 3

    def __init__(self, line: Line, clock: Clock) -> None:
        super().__init__(line, clock)
        self._baudrate = self.baudrate

    def hello(self) -> Identity:
        """Wake the device, end a stream of an earlier run, and ask who it is.

        Raises
        ------
        InputError
            If nothing answers.
        """
        # The supply comes up over the modem lines, raised when the port was opened.
        self._clock.sleep(0.1)
        self.stop()
        name = self._command(b"N", b"Z", reply=10)
        return Identity(_IDENTITIES.get(name) or f"device that calls itself {name!r}")

    def identify(self) -> Identity:
        """Wake the device and ask who it is; refuse another model.

        Raises
        ------
        InputError
            If nothing answers, or another model does.
        """
        return refuse_another(self.line.port, self.hello(), self.model)

    def configure(
        self, channels: Sequence[int], rate_hz: float, range_volts: float | None = None
    ) -> Setup:
        """Choose channels (1 to 4) and scan rate; the range is +-10 V.

        The device waits `count` bit times between scans, so that the rate is
        baud/(20 n + count) for n channels. The formula rests on two programs of others, not
        on the vendor's word: the rate is measured as well. 9600 baud is taken only when
        4800 can't carry the rate.

        Raises
        ------
        InputError
            On a channel that the box does not have, or a rate that the line can't carry.
        """
        chosen = choose_channels(self.line.port, self.model, channels, self.channels)
        choose_range(self.line.port, self.model, (self.range_volts,), range_volts, 0.0)
        samples = len(chosen) * rate_hz
        baudrate = 4800 if samples <= 4800 / _BITS_PER_SAMPLE else 9600
        count = round(baudrate / rate_hz) - _BITS_PER_SAMPLE * len(chosen) if rate_hz > 0 else -1
        if samples > baudrate / _BITS_PER_SAMPLE or not 0 <= count <= _SLOWEST_COUNT:
            raise InputError(
                self.line.port,
                f"the {self.model} can't scan {len(chosen)} channel(s) at {rate_hz:g} Hz",
                f"choose a rate between 0.15 and {480 / len(chosen):g} Hz",
            )
        self._set_baudrate(baudrate)
        mask = sum(1 << (channel - 1) for channel in chosen)
        self._command(b"C", bytes([mask]))
        self._command(b"L", bytes([count & 0xFF]))
        self._command(b"M", bytes([count >> 8]))
        self.setup = Setup(chosen, baudrate / (_BITS_PER_SAMPLE * len(chosen) + count), 10.0)
        return self.setup

    def start(self) -> None:
        """Begin the stream; the next byte received belongs to the first scan.

        Raises
        ------
        InputError
            If the device was not configured or does not answer.
        """
        if self.setup is None:
            raise RuntimeError("configure() comes before start()")
        self._decoder = self.decoder(len(self.setup.channels))
        self._clear_the_line(self.patience_s)
        self._command(b"S", b"1", undo=True)

    def stop(self) -> None:
        """End the stream, throw away what still arrives, and go back to 4800 baud."""
        self._end_stream()
        self._set_baudrate(self.baudrate)

    def _end_stream(self) -> None:
        """Send the stop command until its echo is followed by silence.

        While data flow the echo is buried among them, and bytes of data may look like it.
        """
        for _ in range(self.attempts):
            self.line.write(b"\0S")
            self._clock.sleep(0.01)
            self.line.write(b"0")
            if b"S0" in self.line.discard(self.quiet_s):
                break
            self._doubt = True
            self._clock.sleep(0.5)

    @classmethod
    def decoder(cls, channels: int) -> SyncBitDecoder:
        """Return a fresh decoder for scans of so many channels."""
        return SyncBitDecoder(channels, cls.bits)

    def _set_baudrate(self, baudrate: int) -> None:
        """Change the speed of both ends; the device answers at the old one."""
        if baudrate != self._baudrate:
            self._command(b"B", _BAUD_CODES[baudrate])
            self.line.set_baudrate(baudrate)
            self._baudrate = baudrate

    def _command(self, letter: bytes, argument: bytes, reply: int = 0, undo: bool = False) -> bytes:
        """Send a command, each byte after the echo of the last; return the reply.

        A wrong or missing echo is tried again after half a second; with `undo` the device
        is stopped first, since it may have started although its echo was lost.
        """
        fault = "does not answer"
        for attempt in range(self.attempts):
            if attempt:
                self._doubt = True
                self._clock.sleep(0.5)
                if undo:
                    self._end_stream()
                self.line.discard(self.quiet_s)
            self.line.write(b"\0" + letter)
            echo = self._echo()
            if echo == letter:
                self.line.write(argument)
                echo = self.line.read(1, self.patience_s)
                if echo == argument:
                    answer = self.line.read(reply, self.patience_s) if reply else b""
                    if len(answer) == reply:
                        return answer
            fault = f"answers {echo!r} to command {letter.decode()}" if echo else "does not answer"
        raise InputError(
            self.line.port,
            f"the device {fault}",
            f"check cable, power and --model (asked for a {self.model})",
        )

    def _echo(self) -> bytes:
        """Return the next byte that is no start-up junk."""
        while (byte := self.line.read(1, self.patience_s)) and byte in _JUNK:
            pass
        return byte


class DI194RS(DI154RS):
    """The DI-194RS: the same line and commands, 10 bits."""

    model: ClassVar[str] = "DI-194RS"
    bits: ClassVar[int] = 10
