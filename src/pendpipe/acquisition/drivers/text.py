"""The families whose commands are lines of text: DI-149, DI-155, and the DI-1100 to DI-4718B.

Commands end in CR and are echoed with it, perhaps with NULs behind; ``stop`` is echoed among
the data (dataq-facts A5, A8). The DI-149 and DI-155 echo ``start`` too, and the data follow at
once; their samples have a frame mark (A6). The others, in CDC mode, don't echo ``start`` and send
binary words; one whose buffer overflows writes ``stop 01`` (02, 03) into its data and falls silent.
"""

import math
from typing import ClassVar, Final

from pendpipe.acquisition.drivers.base import Driver, Identity
from pendpipe.acquisition.drivers.streams import plain_scans
from pendpipe.acquisition.models import CDC
from pendpipe.errors import InputError

_DI149_HZ: Final = 750_000
"""Clock of the DI-149 and DI-155."""
_FASTEST_DIVISOR: Final = 75
"""For each channel: the box takes 10 000 samples a second."""
_SLOWEST_DIVISOR: Final = 65535
"""Of 16 bits."""
_END_OF_LIST: Final = "xffff"
_CDC_HZ: Final = 60_000_000
"""Clock of the newer ones."""
_PACKETS: Final = (16, 32, 64, 128, 256, 512, 1024, 2048)
"""Bytes in a packet for ``ps 0`` to ``ps 7``."""
_PACKETS_PER_SECOND: Final = 20.0
"""Wanted, so that what has been read is there within a twentieth of a second."""


class TextDriver(Driver, stop_command=(b"stop\r",), checks="cable, power, CDC mode"):
    """Commands of text ended by CR; the speed of the line does not matter."""

    def hello(self) -> Identity:
        """End a stream of an earlier run and ask the device who it is."""
        self.stop()
        maker = self._send_line("info 0")
        number = self._send_line("info 1")
        if maker != "DATAQ":
            return Identity(f"{maker} {number}")
        return Identity(f"DI-{number}", self._send_line("info 2"), self._send_line("info 6"))


class DI149(TextDriver, model="DI-149", bits=12):
    """The DI-149: 8 channels, 12 bits, +-10 V, 10 kHz in all; scans at 750 kHz/srate."""

    def _set(self, channels: tuple[int, ...], rate_hz: float, range_volts: float) -> float:
        slowest, fastest = (
            _DI149_HZ / _SLOWEST_DIVISOR,
            _DI149_HZ / _FASTEST_DIVISOR / len(channels),
        )
        self._refuse_rate(rate_hz, slowest, fastest, f"{len(channels)} channel(s) ")
        divisor = round(_DI149_HZ / rate_hz)
        self._send_line("asc")  # the scan list is written in this mode
        for position, channel in enumerate(channels):
            word = self.ranges.index(range_volts) << 8 | channel - 1
            self._send_line(f"slist {position} x{word:04x}")
        self._send_line(f"slist {len(channels)} {_END_OF_LIST}")
        self._send_line(f"srate {divisor}")
        self._send_line("bin")
        return _DI149_HZ / divisor

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


class DI155(
    DI149,
    model="DI-155",
    bits=14,
    ranges=(50.0, 25.0, 12.5, 10.0, 6.25, 5.0, 3.125, 2.5),
    channels=4,
):
    """The DI-155: 4 channels, frames of 14 bits, +-2.5 to +-50 V, 10 kHz in all.

    How many of the 14 bits carry a signal is not settled: 13 or 14.
    """


class DI2108(
    TextDriver,
    model="DI-2108",
    bits=16,
    scans_of=staticmethod(plain_scans),
    sends_stop_codes=True,
):
    """The DI-2108: 8 channels, 16 bits, +-10 V, 160 kHz, in CDC mode.

    The rate is 60 MHz/(srate dec deca); the nearest one to be had is taken. Sources disagree
    whether this is the rate of scans or of samples: it is measured as well.
    """

    divisors: ClassVar[tuple[int, int]] = (375, 65535)
    decimations: ClassVar[int] = 512
    further_decimations: ClassVar[int] = 40000

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
        rate = _CDC_HZ / (divisor * decimation * further)
        # The largest packets of which about twenty come in a second, or 16 bytes.
        wanted = 2 * len(channels) * rate / _PACKETS_PER_SECOND
        self._send_line(f"ps {sum(size <= wanted for size in _PACKETS[1:])}", needed=False)
        return rate

    def _start_stream(self) -> None:
        self.line.write(b"start\r")

    def _divisors(self, rate_hz: float) -> tuple[int, int, int]:
        """Find srate, dec and deca whose rate is nearest to `rate_hz`."""
        low, high = self.divisors
        self._refuse_rate(
            rate_hz, _CDC_HZ / (high * self.decimations * self.further_decimations), _CDC_HZ / low
        )
        product = _CDC_HZ / rate_hz
        further = math.ceil(product / (high * self.decimations))
        further = min(self.further_decimations, max(1, further))
        found = (
            (min(high, max(low, round(product / (decimation * further)))), decimation)
            for decimation in range(1, self.decimations + 1)
        )
        divisor, decimation = min(
            found, key=lambda pair: abs(pair[0] * pair[1] * further - product)
        )
        return divisor, decimation, further


for _model, _figures in CDC.items():
    type(_model.replace("-", ""), (DI2108,), {}, model=_model, **_figures)
