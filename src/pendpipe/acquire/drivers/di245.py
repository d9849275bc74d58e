"""The DI-245: short commands as of old, long ones as text, samples with a frame mark.

A short command is NUL and two characters, echoed one by one; a long one ends in CR and is
echoed there (dataq-facts A7).
"""

from __future__ import annotations

from typing import ClassVar, Final

from pendpipe.acquire.drivers.base import Driver, Identity

_RANGE_CODES: Final = dict(
    zip((50.0, 25.0, 10.0, 5.0, 2.5, 1.0), range(8, 14), strict=True)
) | dict(zip((0.5, 0.25, 0.1, 0.05, 0.025, 0.01), range(6), strict=True))
_BURST_HZ: Final = 8000.0
_FILTERS: Final = range(1, 16)
_DIVISORS: Final = range(256)


class DI245(Driver):
    """The DI-245: 4 channels, 14 bits, +-10 mV to +-50 V, 2 kHz in all.

    The burst rate is 8000/((SF + 1)(AF + 3)) Hz and is held to be shared by the channels; of
    several pairs as near, the shortest average AF is taken.
    """

    model: ClassVar[str] = "DI-245"
    bits: ClassVar[int] = 14
    ranges: ClassVar[tuple[float, ...]] = tuple(_RANGE_CODES)
    channels: ClassVar[int] = 4

    def hello(self) -> Identity:
        """End a stream of an earlier run and ask the device who it is."""
        self.stop()
        number = self._ask(b"A", b"1")
        model = self.model if number == "2450" else f"device that calls itself {number!r}"
        return Identity(model, self._ask(b"A", b"2"), self._ask(b"N", b"Z"))

    def _set(self, channels: tuple[int, ...], rate_hz: float, range_volts: float) -> float:
        count = len(channels)
        wanted = rate_hz * count
        slowest, fastest = _burst_hz(_DIVISORS[-1], _FILTERS[-1]), _burst_hz(0, 1)
        if not slowest <= wanted <= fastest:
            what = f"{count} channel(s) "
            raise self._no_rate(what, rate_hz, f"{slowest / count:.3g}", fastest / count)
        divisor, average = min(
            ((divisor, average) for average in _FILTERS for divisor in _DIVISORS),
            key=lambda pair: (abs(_burst_hz(*pair) - wanted), pair[1]),
        )
        burst_hz = _burst_hz(divisor, average)
        for position, channel in enumerate(channels):
            self._send_line(f"chn {position} {_RANGE_CODES[range_volts] << 8 | channel - 1}")
        self._send_line(f"xrate {divisor + 256 * average} {max(1, round(burst_hz))}")
        return burst_hz / count

    def _start_stream(self) -> None:
        self._short(b"S", b"1")

    def _ask(self, letter: bytes, argument: bytes) -> str:
        """Send a short command and return its answer, which ends in CR or in silence."""
        self._short(letter, argument)
        answer = self.line.read_until(b"\r", max(0.05, self.quiet_s))
        return answer.decode("ascii", "replace").strip("\0\r\n ")

    def _short(self, letter: bytes, argument: bytes) -> None:
        """Send NUL and two characters."""
        echo = b""
        for attempt in range(self.attempts):
            if attempt:
                # It may have started although its echo was lost.
                self._doubt = True
                self.stop()
            echoed, echo = self._send_letters(letter, argument)
            if echoed:
                return
        raise self._no_answer(letter.decode() + argument.decode(), echo)


def _burst_hz(divisor: int, average: int) -> float:
    """Samples a second for SF and AF."""
    return _BURST_HZ / ((divisor + 1) * (average + 3))
