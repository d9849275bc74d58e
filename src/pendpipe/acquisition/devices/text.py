"""Simulated DI-149, DI-155 (dataq-facts A5, A6), DI-1100 to DI-4718B (A8): commands are text."""

from __future__ import annotations

import struct
import sys
from typing import ClassVar

import numpy as np

from pendpipe.acquisition.devices.simulated import Dialect
from pendpipe.arrays import IntArray


class SimulatedDI149(Dialect):
    """Eight channels of 12 bits, +-10 V, text commands ended by CR.

    Every command is echoed with its CR, ``start`` too. While data flow only ``stop`` is
    obeyed. The scan list ends where ``xffff`` is written.
    """

    model: ClassVar[str] = "DI-149"
    bits: ClassVar[int] = 12
    full_scales: ClassVar[tuple[float, ...]] = (10.0,)

    def __init__(self) -> None:
        super().__init__()
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
        """Execute one command and return its echo."""
        name, *arguments = text.split() or [""]
        if self.streaming and name != "stop":
            return b""
        answer = ""
        if name in ("start", "stop"):
            self.streaming = name == "start"
            self.starts += self.streaming
        elif name == "info" and arguments:
            number = self.model.split("-")[1]
            answers = {"0": "DATAQ", "1": number, "2": "65", "6": "0012345601"}
            answer = " " + answers.get(arguments[0], "")
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


class SimulatedDI2108(Dialect):
    """Eight channels of 16 bits, +-10 V, text commands ended by CR.

    Commands are echoed with their CR; ``start`` is not, and ``info N`` is followed by the
    answer. While data flow only ``stop`` is obeyed. Data leave in packets (``ps``).
    """

    model: ClassVar[str] = "DI-2108"
    bits: ClassVar[int] = 16
    full_scales: ClassVar[tuple[float, ...]] = (10.0,)
    limits: ClassVar[dict[str, tuple[int, int]]] = {
        "srate": (375, 65535),
        "dec": (1, 512),
        "deca": (1, 40000),
        "ps": (0, 7),
        "encode": (0, 1),
    }

    def __init__(self) -> None:
        super().__init__()
        self._line = b""
        self._list: dict[int, int] = {0: 0}
        self._setting = {"srate": 60000, "dec": 1, "deca": 1, "ps": 0, "encode": 0}

    @property
    def channels(self) -> tuple[int, ...]:
        """The enabled channels, from 1, in the order of the scan."""
        return tuple((self._list[place] & 0x0F) + 1 for place in sorted(self._list))

    @property
    def range_volts(self) -> float:
        """Full scale, by the range code of the first word of the list."""
        return self.full_scales[min(len(self.full_scales) - 1, self._list[0] >> 8 & 0x0F)]

    @property
    def information(self) -> dict[str, str]:
        """The answers to ``info``."""
        number = self.model.removeprefix("DI-")
        return {"0": "DATAQ", "1": number, "2": "0.141", "6": "5F2A9C01", "9": "60000000"}

    @property
    def scan_rate_hz(self) -> float:
        """Scans a second: 60 MHz over the three divisors."""
        return 60e6 / (self._setting["srate"] * self._setting["dec"] * self._setting["deca"])

    @property
    def packet_bytes(self) -> int:
        """16, 32, ... 2048 bytes for ``ps`` 0 to 7."""
        return 16 << self._setting["ps"]

    def respond(self, data: bytes) -> bytes:
        """Take bytes from the host; return the echoes and answers."""
        self._line += data
        out = b""
        while b"\r" in self._line:
            line, _, self._line = self._line.partition(b"\r")
            out += self._execute(line.decode("latin-1").strip("\0\n "))
        return out

    def _execute(self, text: str) -> bytes:
        """Execute one command and return its echo."""
        name, *arguments = text.split()[:3] or [""]
        if self.streaming and name != "stop":
            return b""
        if name == "start":
            self.streaming = True
            self.starts += 1
            return b""
        if name == "stop":
            self.streaming = False
        elif name == "info" and arguments:
            return f"{text} {self.information.get(arguments[0], '')}\r".encode()
        elif name == "slist" and len(arguments) == 2:
            place = int(arguments[0])
            # A list is written from its first place on, and ends with its last.
            kept = {key: word for key, word in self._list.items() if key < place}
            self._list = {**kept, place: int(arguments[1])}
        elif name in self._setting and arguments:
            low, high = self.limits[name]
            self._setting[name] = min(high, max(low, int(arguments[0])))
        elif name not in ("filter", "eol", "led", "din", "reset"):
            return b"Command not found\r"
        return f"{text}\r".encode()

    def encode(self, codes: IntArray) -> bytes:
        """One signed 16-bit word a sample, low byte first, its bits at the top."""
        scale: int = 1 << (16 - self.bits)
        words = (np.asarray(codes).ravel() * scale).astype(np.int16)
        if words.size < 32:
            return struct.pack(f"<{words.size}h", *words.tolist())
        return (words if sys.byteorder == "little" else words.byteswap()).tobytes()


class SimulatedDI1100(SimulatedDI2108):
    """Four channels of 12 bits; no ``dec``."""

    model: ClassVar[str] = "DI-1100"
    bits: ClassVar[int] = 12
    limits: ClassVar[dict[str, tuple[int, int]]] = {
        **SimulatedDI2108.limits,
        "srate": (1500, 65535),
        "dec": (1, 1),
    }


class SimulatedDI1110(SimulatedDI2108):
    """Eight channels of 12 bits; no ``dec``."""

    model: ClassVar[str] = "DI-1110"
    bits: ClassVar[int] = 12
    limits: ClassVar[dict[str, tuple[int, int]]] = {**SimulatedDI2108.limits, "dec": (1, 1)}


class SimulatedDI1120(SimulatedDI2108):
    """Four channels of 14 bits in six ranges."""

    model: ClassVar[str] = "DI-1120"
    bits: ClassVar[int] = 14
    full_scales: ClassVar[tuple[float, ...]] = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0)


class SimulatedDI4108(SimulatedDI2108):
    """Eight channels of 16 bits in six ranges."""

    model: ClassVar[str] = "DI-4108"
    full_scales: ClassVar[tuple[float, ...]] = (10.0, 5.0, 2.0, 1.0, 0.5, 0.2)


class SimulatedDI2108P(SimulatedDI2108):
    """Eight channels of 16 bits in three ranges; no ``deca``."""

    model: ClassVar[str] = "DI-2108-P"
    full_scales: ClassVar[tuple[float, ...]] = (10.0, 5.0, 2.5)
    limits: ClassVar[dict[str, tuple[int, int]]] = {**SimulatedDI2108.limits, "deca": (1, 1)}


class SimulatedDI4208(SimulatedDI2108):
    """Eight channels of 16 bits in six ranges."""

    model: ClassVar[str] = "DI-4208"
    full_scales: ClassVar[tuple[float, ...]] = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0)


class SimulatedDI4718B(SimulatedDI2108):
    """Eight channels of 16 bits, +-5 V."""

    model: ClassVar[str] = "DI-4718B"
    full_scales: ClassVar[tuple[float, ...]] = (5.0,)
