"""Simulated DI-149 and DI-155 (dataq-facts A5, A6)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pendpipe.arrays import IntArray


class SimulatedDI149:
    """Eight channels of 12 bits, +-10 V, text commands ended by CR.

    Every command is echoed with its CR, ``start`` too. While data flow only ``stop`` is
    obeyed. The scan list ends where ``xffff`` is written.
    """

    model: ClassVar[str] = "DI-149"
    bits: ClassVar[int] = 12
    full_scales: ClassVar[tuple[float, ...]] = (10.0,)
    packet_bytes: ClassVar[int] = 1

    def __init__(self) -> None:
        self.starts = 0
        self.streaming = False
        self._line = b""
        self._list = [0]
        self._divisor = 7500

    @property
    def channels(self) -> tuple[int, ...]:
        """The enabled channels, from 1, in the order of the scan."""
        return tuple(word % 16 + 1 for word in self._list)

    @property
    def range_volts(self) -> float:
        """Full scale, by the gain code of the first word of the list."""
        return self.full_scales[self._list[0] // 256 % 8 % len(self.full_scales)]

    @property
    def scan_rate_hz(self) -> float:
        """Scans a second: 750 kHz over srate."""
        return 750e3 / self._divisor

    def respond(self, data: bytes) -> bytes:
        """Take bytes from the host; return the echoes and answers."""
        self._line += data
        *complete, self._line = self._line.split(b"\r")
        return b"".join(self._execute(line.decode("latin-1").strip("\0\n ")) for line in complete)

    def _execute(self, text: str) -> bytes:
        """Do what one command says and return its echo."""
        name, *arguments = text.split() or [""]
        if self.streaming and name != "stop":
            return b""
        answer = ""
        if name in ("start", "stop"):
            self.streaming = name == "start"
            self.starts += self.streaming
        elif name == "info" and arguments:
            number = self.model.split("-")[1]
            told = {"0": "DATAQ", "1": number, "2": "65", "6": "0012345601"}
            answer = " " + told.get(arguments[0], "")
        elif name == "slist" and len(arguments) == 2:
            place, word = int(arguments[0]), arguments[1]
            value = int(word[1:], 16) if word[0] == "x" else int(word)
            self._list[place:] = [] if value == 0xFFFF else [value]
        elif name == "srate" and arguments:
            self._divisor = min(65535, max(75 * len(self._list), int(arguments[0])))
        elif name not in ("asc", "bin", "float", "din", "dout", "reset", "R1"):
            return b""
        return f"{text}{answer}\r".encode("latin-1")

    def encode(self, codes: IntArray) -> bytes:
        """Two bytes a sample, offset binary, bit 0 clear on the first byte of a scan only."""
        top = np.asarray(codes) * 2 ** (14 - self.bits) + 8192
        out = np.stack([top % 128, top // 128], axis=-1).astype(np.uint8) * 2 + 1
        out[:, 0, 0] &= 0xFE
        return out.astype(np.uint8).tobytes()


class SimulatedDI155(SimulatedDI149):
    """Four channels of 14 bits, +-50 V over eight gains."""

    model: ClassVar[str] = "DI-155"
    bits: ClassVar[int] = 14
    full_scales: ClassVar[tuple[float, ...]] = tuple(50 / g for g in (1, 2, 4, 5, 8, 10, 16, 20))
