"""The DI-245: short commands as of old, long ones as text, samples with a frame mark.

A short command is NUL and two characters, echoed one by one; a long one ends in CR and is
echoed there (dataq-facts A7).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Final

from pendpipe.acquire.drivers.base import Identity, Setup, StreamReader
from pendpipe.acquire.drivers.choice import choose_channels, choose_range, refuse_another
from pendpipe.acquire.drivers.decoders import SyncBitDecoder
from pendpipe.errors import InputError

_RANGE_CODES: Final = {
    50.0: 8, 25.0: 9, 10.0: 10, 5.0: 11, 2.5: 12, 1.0: 13,
    0.5: 0, 0.25: 1, 0.1: 2, 0.05: 3, 0.025: 4, 0.01: 5,
}  # fmt: skip
_BURST_HZ: Final = 8000.0
_FILTERS: Final = range(1, 16)
_DIVISORS: Final = range(256)


class DI245(StreamReader):
    """The DI-245: 4 channels, 14 bits, +-10 mV to +-50 V, 2 kHz in all.

    Parameters
    ----------
    line
        An open line at 115200 baud.
    clock
        The recorder's clock, in which the waits for the device are counted.
    """

    model: ClassVar[str] = "DI-245"
    baudrate: ClassVar[int] = 115200
    bits: ClassVar[int] = 14
    range_volts: ClassVar[float] = 10.0
    channels: ClassVar[int] = 4
    patience_s: ClassVar[float] = 2.0
    attempts: int = 3

    def hello(self) -> Identity:
        """End a stream of an earlier run and ask the device who it is.

        Raises
        ------
        InputError
            If nothing answers.
        """
        self.stop()
        number = self._ask(b"A", b"1")
        model = self.model if number == "2450" else f"device that calls itself {number!r}"
        return Identity(model, self._ask(b"A", b"2"), self._ask(b"N", b"Z"))

    def identify(self) -> Identity:
        """End a stream of an earlier run and ask who it is; refuse another model.

        Raises
        ------
        InputError
            If nothing answers, or another model does.
        """
        return refuse_another(self.line.port, self.hello(), self.model)

    def configure(
        self, channels: Sequence[int], rate_hz: float, range_volts: float | None = None
    ) -> Setup:
        """Choose channels, scan rate and range.

        The burst rate is 8000/((SF + 1)(AF + 3)) Hz and is held to be shared by the
        channels; of several pairs as near, the shortest average AF is taken.

        Raises
        ------
        InputError
            On a channel or a range that the box does not have, or a rate out of its reach.
        """
        port = self.line.port
        chosen = choose_channels(port, self.model, channels, self.channels)
        high = choose_range(port, self.model, tuple(_RANGE_CODES), range_volts, self.range_volts)
        wanted = rate_hz * len(chosen)
        slowest = _burst_hz(_DIVISORS[-1], _FILTERS[-1])
        if not slowest <= wanted <= _burst_hz(0, 1):
            raise InputError(
                port,
                f"the {self.model} can't scan {len(chosen)} channel(s) at {rate_hz:g} Hz",
                f"choose a rate between {slowest / len(chosen):.3g} and "
                f"{_burst_hz(0, 1) / len(chosen):g} Hz",
            )
        divisor, average = min(
            ((divisor, average) for average in _FILTERS for divisor in _DIVISORS),
            key=lambda pair: (abs(_burst_hz(*pair) - wanted), pair[1]),
        )
        burst_hz = _burst_hz(divisor, average)
        for position, channel in enumerate(chosen):
            self._tell(f"chn {position} {_RANGE_CODES[high] << 8 | channel - 1}")
        self._tell(f"xrate {divisor + 256 * average} {max(1, round(burst_hz))}")
        self.setup = Setup(chosen, burst_hz / len(chosen), high)
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
        self._clear_the_line(self.patience_s)
        self._short(b"S", b"1")

    def stop(self) -> None:
        """End the stream and throw away what still arrives, the echo among it."""
        for _ in range(self.attempts):
            self.line.write(b"\0S")
            self._clock.sleep(0.01)
            self.line.write(b"0")
            if b"S0" in self.line.discard(self.quiet_s):
                return
            self._doubt = True
            self._clock.sleep(0.5)

    @classmethod
    def decoder(cls, channels: int) -> SyncBitDecoder:
        """Return a fresh decoder for scans of so many channels."""
        return SyncBitDecoder(channels, cls.bits)

    def _ask(self, letter: bytes, argument: bytes) -> str:
        """Send a short command and return its answer, which ends in CR or in silence."""
        self._short(letter, argument)
        answer = self.line.read_until(b"\r", max(0.05, self.quiet_s))
        return answer.decode("ascii", "replace").strip("\0\r\n ")

    def _short(self, letter: bytes, argument: bytes) -> None:
        """Send NUL and two characters, each after the echo of the last."""
        echo = b""
        for attempt in range(self.attempts):
            if attempt:
                # It may have started although its echo was lost.
                self._doubt = True
                self.stop()
            self.line.write(b"\0" + letter)
            echo = self.line.read(1, self.patience_s)
            if echo == letter:
                self.line.write(argument)
                echo = self.line.read(1, self.patience_s)
                if echo == argument:
                    return
        raise self._refused(letter.decode() + argument.decode(), echo)

    def _tell(self, text: str) -> None:
        """Send a long command and wait for its echo."""
        echo = b""
        for attempt in range(self.attempts):
            if attempt:
                self._doubt = True
                self.line.discard(self.quiet_s)
            self.line.write(text.encode("ascii") + b"\r")
            echo = self.line.read_until(b"\r", self.patience_s)
            if echo.strip(b"\0\r\n ") == text.encode("ascii") and echo.endswith(b"\r"):
                return
        raise self._refused(text, echo)

    def _refused(self, text: str, echo: bytes) -> InputError:
        fault = f"answers {echo[:40]!r} to '{text}'" if echo else "does not answer"
        return InputError(
            self.line.port,
            f"the device {fault}",
            f"check cable, power and --model (asked for a {self.model})",
        )


def _burst_hz(divisor: int, average: int) -> float:
    """Samples a second for SF and AF."""
    return _BURST_HZ / ((divisor + 1) * (average + 3))
