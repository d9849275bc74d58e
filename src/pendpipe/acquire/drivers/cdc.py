"""The USB family of the DI-1100 to DI-4718B in CDC mode: text commands, binary words.

``start`` is not echoed. A device whose buffer overflows writes ``stop 01`` (02, 03) into
its data and falls silent (dataq-facts A8).
"""

from __future__ import annotations

import math
from typing import ClassVar, Final

from pendpipe.acquire.drivers.decoders import STOP_CODE, STOP_CODE_BYTES, WordDecoder
from pendpipe.acquire.drivers.text import TextDriver

_BASE_HZ: Final = 60_000_000
_PACKETS: Final = (16, 32, 64, 128, 256, 512, 1024, 2048)
"""Bytes in a packet for ``ps 0`` to ``ps 7``."""
_PACKETS_PER_SECOND: Final = 20.0


class DI2108(TextDriver):
    """The DI-2108: 8 channels, 16 bits, +-10 V, 160 kHz, in CDC mode.

    The rate is 60 MHz/(srate dec deca); the nearest one to be had is taken. Sources disagree
    whether this is the rate of scans or of samples: it is measured as well.
    """

    model: ClassVar[str] = "DI-2108"
    bits: ClassVar[int] = 16
    divisors: ClassVar[tuple[int, int]] = (375, 65535)
    decimations: ClassVar[int] = 512
    further_decimations: ClassVar[int] = 40000
    _tail = b""

    def _set(self, channels: tuple[int, ...], rate_hz: float, range_volts: float) -> float:
        divisor, decimation, further = self._divisors(rate_hz)
        self._send_line("encode 0", needed=False)  # binary; a DI-4108 was seen not to echo it
        for position, channel in enumerate(channels):
            word = self.ranges.index(range_volts) << 8 | channel - 1
            self._send_line(f"slist {position} {word}")
        self._send_line(f"srate {divisor}")
        if self.decimations > 1:
            self._send_line(f"dec {decimation}")
        if self.further_decimations > 1:
            self._send_line(f"deca {further}")
        # The last reading, no mean: a mean would be a filter.
        self._send_line("filter * 0", needed=False)
        rate = _BASE_HZ / (divisor * decimation * further)
        self._send_line(f"ps {_packet_code(2 * len(channels) * rate)}", needed=False)
        return rate

    def _start_stream(self) -> None:
        self._tail = b""
        self.line.write(b"start\r")

    def ended(self, data: bytes) -> str:
        """Return the stop code (``"stop 01"``: overflow) if it stands in these bytes."""
        seen = self._tail + data
        self._tail = seen[1 - STOP_CODE_BYTES :]
        found = STOP_CODE.search(seen)
        return found.group().decode("ascii") if found else ""

    @classmethod
    def decoder(cls, channels: int) -> WordDecoder:
        """Return a fresh decoder for scans of so many channels."""
        return WordDecoder(channels, cls.bits)

    def _divisors(self, rate_hz: float) -> tuple[int, int, int]:
        """Find srate, dec and deca whose rate is nearest to `rate_hz`."""
        low, high = self.divisors
        slowest = _BASE_HZ / (high * self.decimations * self.further_decimations)
        if not slowest <= rate_hz <= _BASE_HZ / low:
            raise self._no_rate("", rate_hz, f"{slowest:.3g}", _BASE_HZ / low)
        product = _BASE_HZ / rate_hz
        further = math.ceil(product / (high * self.decimations))
        further = min(self.further_decimations, max(1, further))
        first = max(1, math.ceil(product / (high * further)))
        last = min(self.decimations, max(first, int(product / (low * further))))
        first = min(first, self.decimations)
        found = (
            (min(high, max(low, round(product / (decimation * further)))), decimation)
            for decimation in range(first, last + 1)
        )
        divisor, decimation = min(
            found, key=lambda pair: abs(pair[0] * pair[1] * further - product)
        )
        return divisor, decimation, further


class DI1100(DI2108):
    """The DI-1100: 4 channels, 12 bits at the top of a word, +-10 V, 40 kHz."""

    model: ClassVar[str] = "DI-1100"
    bits: ClassVar[int] = 12
    channels: ClassVar[int] = 4
    divisors: ClassVar[tuple[int, int]] = (1500, 65535)
    decimations: ClassVar[int] = 1


class DI1110(DI2108):
    """The DI-1110: 8 channels, 12 bits at the top of a word, +-10 V, 160 kHz."""

    model: ClassVar[str] = "DI-1110"
    bits: ClassVar[int] = 12
    decimations: ClassVar[int] = 1


class DI1120(DI2108):
    """The DI-1120: 4 channels, 14 bits at the top of a word, +-2 to +-100 V, 160 kHz."""

    model: ClassVar[str] = "DI-1120"
    bits: ClassVar[int] = 14
    channels: ClassVar[int] = 4
    ranges: ClassVar[tuple[float, ...]] = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0)


class DI4108(DI2108):
    """The DI-4108: 8 channels, 16 bits, +-0.2 to +-10 V, 160 kHz."""

    model: ClassVar[str] = "DI-4108"
    ranges: ClassVar[tuple[float, ...]] = (10.0, 5.0, 2.0, 1.0, 0.5, 0.2)


class DI2108P(DI2108):
    """The DI-2108-P: as the DI-2108, +-10, +-5 or +-2.5 V, no ``deca``.

    Its ranges from 0 V up are not used: a pendulum swings about its rest.
    """

    model: ClassVar[str] = "DI-2108-P"
    ranges: ClassVar[tuple[float, ...]] = (10.0, 5.0, 2.5)
    further_decimations: ClassVar[int] = 1


class DI4208(DI2108):
    """The DI-4208 over USB: 8 channels, 16 bits, +-2 to +-100 V, 160 kHz."""

    model: ClassVar[str] = "DI-4208"
    ranges: ClassVar[tuple[float, ...]] = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0)


class DI4718B(DI2108):
    """The DI-4718B: 8 channels, 16 bits, +-5 V behind its amplifiers, 160 kHz."""

    model: ClassVar[str] = "DI-4718B"
    range_volts: ClassVar[float] = 5.0
    ranges: ClassVar[tuple[float, ...]] = (5.0,)


def _packet_code(bytes_per_second: float) -> int:
    """Choose the largest packets of which about twenty come in a second, or 16 bytes."""
    wanted = bytes_per_second / _PACKETS_PER_SECOND
    return sum(size <= wanted for size in _PACKETS[1:])
