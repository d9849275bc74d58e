"""A simulated DI-154RS and DI-194RS (dataq-facts A1)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from pendpipe.arrays import IntArray


class SimulatedDI154RS:
    """Four channels of 12 bits, +-10 V, behind a line of 4800 or 9600 baud.

    A command is NUL, letter, argument; letter and argument are echoed as they come. Bytes
    outside a command, and unknown letters, are ignored. A sample takes two bytes, 20 bit
    times of the line, so that n channels are scanned at most baud/(20 n) times a second;
    the rate counter adds that many bit times to a scan.
    """

    model: ClassVar[str] = "DI-154RS"
    bits: ClassVar[int] = 12
    range_volts: float = 10.0
    packet_bytes: ClassVar[int] = 1
    answer_to_identify: ClassVar[bytes] = b"0000000001"

    def __init__(self) -> None:
        self.starts = 0
        self.streaming = False
        self._state = "idle"  # or "letter" after NUL, or the letter that wants its argument
        self._mask = 0b0001
        self._counter = 0
        self._baud = 4800

    @property
    def channels(self) -> tuple[int, ...]:
        """The enabled channels, from 1, in the order of the scan."""
        return tuple(number + 1 for number in range(4) if self._mask >> number & 1)

    @property
    def scan_rate_hz(self) -> float:
        """Scans a second: the bit times of a scan, plus the counter's."""
        return self._baud / (20 * max(1, len(self.channels)) + self._counter)

    def respond(self, data: bytes) -> bytes:
        """Take bytes from the host; return the echoes and answers."""
        out = bytearray()
        for value in data:
            byte = bytes([value])
            if self._state == "idle":
                if value == 0:
                    self._state = "letter"
            elif self._state == "letter":
                known = byte in (b"S", b"N", b"C", b"D", b"L", b"M", b"B", b"E", b"R")
                self._state = byte.decode("latin-1") if known else "idle"
                out += byte if known else b""
            else:
                letter, self._state = self._state, "idle"
                out += byte + self._execute(letter, value)
        return bytes(out)

    def _execute(self, letter: str, argument: int) -> bytes:
        """Do what a complete command says; return what follows the echo."""
        if letter == "S":
            self.streaming = argument == ord("1")
            self.starts += self.streaming
        elif letter == "N":
            return self.answer_to_identify
        elif letter == "C":
            self._mask = argument & 0x0F
        elif letter == "L":
            self._counter = self._counter & 0xFF00 | argument
        elif letter == "M":
            self._counter = self._counter & 0x00FF | argument << 8
        elif letter == "B":
            self._baud = {1: 4800, 4: 9600}.get(argument, self._baud)
        elif letter == "R":
            self.streaming = False
        return b""

    def encode(self, codes: IntArray) -> bytes:
        """Two bytes a sample, offset binary, bit 0 clear on the first byte of a scan only."""
        offset = (np.asarray(codes) + 2048).astype(np.uint16)
        out = np.empty((*offset.shape, 2), dtype=np.uint8)
        out[..., 0] = (offset % 32) * 8 + 1
        out[..., 1] = (offset // 32) * 2 + 1
        out[:, 0, 0] -= 1
        return out.tobytes()


class SimulatedDI194RS(SimulatedDI154RS):
    """The same box with 10 bits: three in the first byte, of which bit 4 means nothing."""

    model: ClassVar[str] = "DI-194RS"
    bits: ClassVar[int] = 10
    answer_to_identify: ClassVar[bytes] = b"0000000000"

    def encode(self, codes: IntArray) -> bytes:
        """Two bytes a sample, offset binary, bit 0 clear on the first byte of a scan only."""
        offset = (np.asarray(codes) + 512).astype(np.uint16)
        out = np.empty((*offset.shape, 2), dtype=np.uint8)
        out[..., 0] = (offset % 8) * 32 + 1
        out[..., 1] = (offset // 8) * 2 + 1
        out[:, 0, 0] -= 1
        return out.tobytes()
