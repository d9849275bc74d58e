"""The families whose commands are letters, echoed one by one: DI-154RS, DI-194RS and DI-245.

A command is NUL, a letter, an argument. The NUL is not echoed; letter and argument are,
and the next byte is sent after the echo of the last (dataq-facts A1). The DI-245 takes longer
commands as text, which ends in CR and is echoed there (A7).
"""

from typing import Final

from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.drivers.base import Driver, Identity
from pendpipe.acquisition.line import Line

_JUNK: Final = b"\xff\xfe\x7f"
"""Seen while the device's supply comes up; never an answer to a command."""
_IDENTITIES: Final = {b"0000000000": "DI-194RS", b"0000000001": "DI-154RS"}
_BAUD_CODES: Final = {4800: b"\x01", 9600: b"\x04"}
"""By the rate of the line, in 1/s."""
_BITS_PER_SAMPLE: Final = 20
"""Two bytes of ten bits on the line; it is the line that limits the rate."""
_SLOWEST_COUNT: Final = 32767
"""Largest of 15 bits."""


class LetterDriver(Driver):
    """Commands of NUL, letter and argument."""

    def _start_stream(self) -> None:
        self._command(b"S", b"1", undo=True)

    def _command(self, letter: bytes, argument: bytes, reply: int = 0, undo: bool = False) -> bytes:
        """Send NUL, a letter and its argument, each after the echo of the last; return the reply.

        A wrong or missing echo is tried again after half a second; with `undo` the device
        is stopped first, since it may have started although its echo was lost.
        """
        echo = b""
        for attempt in range(self.attempts):
            if attempt:
                self._doubt = True
                self._clock.sleep(0.5)
                if undo:
                    super().stop()
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
        raise self._no_answer(letter.decode(), echo)

    def _echo(self) -> bytes:
        """Return the next byte that is no start-up junk."""
        while (byte := self.line.read(1, self.patience_s)) and byte in _JUNK:
            pass
        return byte


class DI154RS(LetterDriver, model="DI-154RS", baudrate=4800, bits=12, channels=4):
    """The DI-154RS: 4 channels, 12 bits, +-10 V, powered by DTR and RTS.

    The device waits `count` bit times between scans, so that the rate is baud/(20 n + count) for n
    channels. The formula rests on two programs of others, not on the vendor's word: the rate is
    measured as well. 9600 baud is taken only when 4800 can't carry the rate.
    """

    def __init__(self, line: Line, clock: ScaledClock) -> None:
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
        scan_bits = _BITS_PER_SAMPLE * len(channels)
        slowest, fastest = 4800 / (scan_bits + _SLOWEST_COUNT), 9600 / scan_bits
        self._refuse_rate(rate_hz, slowest, fastest, f"{len(channels)} channel(s) ")
        baudrate = 4800 if rate_hz <= 4800 / scan_bits else 9600
        count = round(baudrate / rate_hz) - scan_bits
        self._set_baudrate(baudrate)
        self._command(b"C", bytes([sum(1 << (channel - 1) for channel in channels)]))
        self._command(b"L", bytes([count & 0xFF]))
        self._command(b"M", bytes([count >> 8]))
        return baudrate / (scan_bits + count)

    def stop(self) -> None:
        """End the stream, throw away what still arrives, and go back to 4800 baud."""
        super().stop()
        self._set_baudrate(self.baudrate)

    def _set_baudrate(self, baudrate: int) -> None:
        """Change the speed of both ends; the device answers at the old one."""
        if baudrate != self._baudrate:
            self._command(b"B", _BAUD_CODES[baudrate])
            self.line.set_baudrate(baudrate)
            self._baudrate = baudrate


class DI194RS(DI154RS, model="DI-194RS", bits=10):
    """The DI-194RS: the same line and commands, 10 bits."""


_RANGE_CODES: Final = dict(
    zip((50.0, 25.0, 10.0, 5.0, 2.5, 1.0), range(8, 14), strict=True)
) | dict(zip((0.5, 0.25, 0.1, 0.05, 0.025, 0.01), range(6), strict=True))
"""By the full scale in volts."""
_BURST_HZ: Final = 8000.0
"""Clock that the divisors and averages divide."""
_FILTERS: Final = range(1, 16)
"""Numbers of readings that it averages."""
_DIVISORS: Final = range(256)
"""Of one byte."""


class DI245(LetterDriver, model="DI-245", bits=14, channels=4, ranges=tuple(_RANGE_CODES)):
    """The DI-245: 4 channels, 14 bits, +-10 mV to +-50 V, 2 kHz in all.

    The burst rate is 8000/((SF + 1)(AF + 3)) Hz and is held to be shared by the channels; of
    several pairs as near, the shortest average AF is taken.
    """

    def hello(self) -> Identity:
        """End a stream of an earlier run and ask the device who it is."""
        self.stop()
        number = self._ask(b"A", b"1")
        return Identity(
            self.model if number == "2450" else f"device that calls itself {number!r}",
            self._ask(b"A", b"2"),
            self._ask(b"N", b"Z"),
        )

    def _set(self, channels: tuple[int, ...], rate_hz: float, range_volts: float) -> float:
        count = len(channels)
        wanted = rate_hz * count
        slowest, fastest = _burst_hz(_DIVISORS[-1], _FILTERS[-1]), _burst_hz(0, 1)
        self._refuse_rate(rate_hz, slowest / count, fastest / count, f"{count} channel(s) ")
        divisor, average = min(
            ((divisor, average) for average in _FILTERS for divisor in _DIVISORS),
            key=lambda pair: (abs(_burst_hz(*pair) - wanted), pair[1]),
        )
        burst_hz = _burst_hz(divisor, average)
        for position, channel in enumerate(channels):
            self._send_line(f"chn {position} {_RANGE_CODES[range_volts] << 8 | channel - 1}")
        self._send_line(f"xrate {divisor + 256 * average} {max(1, round(burst_hz))}")
        return burst_hz / count

    def _ask(self, letter: bytes, argument: bytes) -> str:
        """Send a short command and return its answer, which ends in CR or in silence."""
        self._command(letter, argument, undo=True)
        answer = self.line.read_until(b"\r", max(0.05, self.quiet_s))
        return answer.decode("ascii", "replace").strip("\0\r\n ")


def _burst_hz(divisor: int, average: int) -> float:
    """Samples a second for SF and AF."""
    return _BURST_HZ / ((divisor + 1) * (average + 3))
