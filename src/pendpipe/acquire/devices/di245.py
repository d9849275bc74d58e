"""A simulated DI-245 (dataq-facts A7)."""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np

from pendpipe.arrays import IntArray

_FULL_SCALES: Final = [0.5, 0.25, 0.1, 0.05, 0.025, 0.01, *[0.0] * 2, 50, 25, 10, 5, 2.5, 1]


class SimulatedDI245:
    """Four channels of 14 bits, +-10 mV to +-50 V.

    NUL begins a short command, whose two characters are echoed one by one; everything else
    is text up to CR, echoed there. While data flow only the stop is obeyed.
    """

    model: ClassVar[str] = "DI-245"
    bits: ClassVar[int] = 14
    packet_bytes: ClassVar[int] = 1

    def __init__(self) -> None:
        self.starts = 0
        self.streaming = False
        self._short: bytes | None = None  # what has come of a short command
        self._text = b""
        self._list = [0x0A00]
        self._rate_word = 1871

    @property
    def channels(self) -> tuple[int, ...]:
        """The enabled channels, from 1, in the order of the scan."""
        return tuple((word & 0x0F) + 1 for word in self._list)

    @property
    def range_volts(self) -> float:
        """Full scale, by the range code of the first word of the list."""
        return float(_FULL_SCALES[self._list[0] >> 8])

    @property
    def scan_rate_hz(self) -> float:
        """Scans a second: the burst rate, shared by the channels."""
        average, divisor = divmod(self._rate_word & 0x0FFF, 256)
        return 8000.0 / (divisor + 1) / (average + 3) / len(self._list)

    def respond(self, data: bytes) -> bytes:
        """Take bytes from the host; return the echoes and answers."""
        out = b""
        for value in data:
            byte = bytes([value])
            if value == 0:
                self._short = b""
            elif self._short is not None:
                self._short += byte
                out += byte
                if len(self._short) == 2:
                    out += self._obey(self._short.decode("latin-1"))
                    self._short = None
            elif byte == b"\r":
                out += self._execute(self._text.decode("latin-1"))
                self._text = b""
            else:
                self._text += byte
        return out

    def _obey(self, command: str) -> bytes:
        """Do what a short command says; return what follows the echo."""
        if command in ("S0", "S1"):
            self.streaming = command == "S1"
            self.starts += self.streaming
            return b""
        told = {"A1": " 2450\r", "A2": " 68\r", "A7": " 5A5A5A5A\r", "NZ": "0012345601\r"}
        return b"" if self.streaming else told.get(command, "").encode()

    def _execute(self, text: str) -> bytes:
        """Do what a long command says and return its echo."""
        words = text.split()
        if self.streaming or len(words) != 3 or words[0] not in ("chn", "xrate"):
            return b""
        first, second = int(words[1]), int(words[2])
        if words[0] == "chn":
            self._list[first:] = [second]
        else:
            self._rate_word = first
        return text.encode("latin-1") + b"\r"

    def encode(self, codes: IntArray) -> bytes:
        """Two bytes a sample, offset binary, bit 0 clear on the first byte of a scan only."""
        offset = (np.asarray(codes) + 0x2000).astype(np.uint16)
        low, high = (offset & 0x7F) << 1, offset >> 7 << 1
        out = (np.stack([low, high], axis=-1) | 1).astype(np.uint8)
        out[:, 0, 0] ^= 1
        return out.tobytes()
