"""The USB family of the DI-2108: text commands, binary words.

Commands end in CR and are echoed with it, perhaps with NULs behind; ``start`` is not
echoed, ``stop`` is, in the midst of the data (dataq-facts A8).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Final

from pendpipe.acquire.drivers.base import Identity, Setup, StreamReader
from pendpipe.acquire.drivers.words import WordDecoder
from pendpipe.errors import InputError

_BASE_HZ: Final = 60_000_000
_PACKETS: Final = (16, 32, 64, 128, 256, 512, 1024, 2048)
"""Bytes in a packet for ``ps 0`` to ``ps 7``."""
_PACKETS_PER_SECOND: Final = 20.0


class DI2108(StreamReader):
    """The DI-2108: 8 channels, 16 bits, +-10 V, 160 kHz, in CDC mode.

    Parameters
    ----------
    line
        An open line; the speed does not matter.
    clock
        The recorder's clock, in which the waits for the device are counted.
    """

    model: ClassVar[str] = "DI-2108"
    baudrate: ClassVar[int] = 115200
    bits: ClassVar[int] = 16
    range_volts: ClassVar[float] = 10.0
    channels: ClassVar[int] = 8
    divisors: ClassVar[tuple[int, int]] = (375, 65535)
    decimations: ClassVar[int] = 512
    further_decimations: ClassVar[int] = 40000
    patience_s: ClassVar[float] = 2.0
    """How long an answer may take, in seconds of the host; ``stop`` may stall for one."""
    attempts: ClassVar[int] = 3

    def identify(self) -> Identity:
        """End a stream of an earlier run and ask the device who it is.

        Raises
        ------
        InputError
            If nothing answers, or another model does.
        """
        self.stop()
        maker = self._command("info 0")
        number = self._command("info 1")
        if maker != "DATAQ" or number != self.model.removeprefix("DI-"):
            raise InputError(
                self.line.port,
                f"this is a {maker} {number}, no {self.model}",
                "give its --model",
            )
        return Identity(self.model, self._command("info 2"), self._command("info 6"))

    def configure(self, channels: Sequence[int], rate_hz: float) -> Setup:
        """Choose channels (1 to 8) and scan rate.

        The rate is 60 MHz/(srate dec deca); the nearest one to be had is taken. Sources
        disagree whether this is the rate of scans or of samples: it is measured as well.

        Raises
        ------
        InputError
            On a channel that the box does not have, or a rate out of its range.
        """
        chosen = tuple(sorted(set(channels)))
        if not chosen or chosen[0] < 1 or chosen[-1] > self.channels:
            raise InputError(
                self.line.port,
                f"the {self.model} has no channel {', '.join(map(str, channels)) or 'none'}",
                f"choose from 1 to {self.channels}",
            )
        divisor, decimation, further = self._divisors(rate_hz)
        self._command("encode 0", needed=False)  # binary; a DI-4108 was seen not to echo it
        for position, channel in enumerate(chosen):
            self._command(f"slist {position} {channel - 1}")
        self._command(f"srate {divisor}")
        self._command(f"dec {decimation}")
        self._command(f"deca {further}")
        self._command("filter * 0")  # the last reading, no mean: a mean would be a filter
        rate = _BASE_HZ / (divisor * decimation * further)
        self._command(f"ps {_packet_code(2 * len(chosen) * rate)}")
        self.setup = Setup(chosen, rate)
        return self.setup

    def start(self) -> None:
        """Begin the stream; the next byte received belongs to the first scan."""
        if self.setup is None:
            raise RuntimeError("configure() comes before start()")
        self._decoder = self.decoder(len(self.setup.channels))
        self.line.write(b"start\r")

    def stop(self) -> None:
        """End the stream and throw away what still arrives, the echo among it."""
        for _ in range(self.attempts):
            self.line.write(b"stop\r")
            if b"stop" in self.line.discard(self.quiet_s):
                return
            self._clock.sleep(0.5)

    @classmethod
    def decoder(cls, channels: int) -> WordDecoder:
        """Return a fresh decoder for scans of so many channels."""
        return WordDecoder(channels)

    def _divisors(self, rate_hz: float) -> tuple[int, int, int]:
        """Find srate, dec and deca whose rate is nearest to `rate_hz`."""
        low, high = self.divisors
        slowest = _BASE_HZ / (high * self.decimations * self.further_decimations)
        if not slowest <= rate_hz <= _BASE_HZ / low:
            raise InputError(
                self.line.port,
                f"the {self.model} can't scan at {rate_hz:g} Hz",
                f"choose a rate between {slowest:.3g} and {_BASE_HZ / low:g} Hz",
            )
        product = _BASE_HZ / rate_hz
        further = min(self.further_decimations, max(1, math.ceil(product / (high * 512))))
        first = max(1, math.ceil(product / (high * further)))
        last = min(self.decimations, max(first, int(product / (low * further))))
        found = (
            (min(high, max(low, round(product / (decimation * further)))), decimation)
            for decimation in range(first, last + 1)
        )
        divisor, decimation = min(
            found, key=lambda pair: abs(pair[0] * pair[1] * further - product)
        )
        return divisor, decimation, further

    def _command(self, text: str, needed: bool = True) -> str:
        """Send a command and return what its echo says beyond it.

        A missing or wrong echo is tried again; without `needed` it is then let pass.
        """
        echo = ""
        for attempt in range(self.attempts):
            if attempt:
                self.line.discard(self.quiet_s)
            self.line.write(text.encode("ascii") + b"\r")
            answer = self.line.read_until(b"\r", self.patience_s)
            echo = answer.decode("ascii", "replace").strip("\0\r\n ")
            if answer.endswith(b"\r") and echo.startswith(text):
                return echo.removeprefix(text).strip()
        if not needed:
            return ""
        fault = f"answers {echo[:40]!r} to '{text}'" if echo else "does not answer"
        raise InputError(
            self.line.port,
            f"the device {fault}",
            f"check cable, power, CDC mode and --model (asked for a {self.model})",
        )


def _packet_code(bytes_per_second: float) -> int:
    """Choose the largest packets of which about twenty come in a second, or 16 bytes."""
    wanted = bytes_per_second / _PACKETS_PER_SECOND
    return sum(size <= wanted for size in _PACKETS[1:])
