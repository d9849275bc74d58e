"""Simulated DI-149, DI-155 (dataq-facts A5, A6), DI-1100 to DI-4718B (A8): commands are text."""

from abc import abstractmethod
from typing import ClassVar, Final

import numpy as np

from pendpipe.acquisition.devices.simulated import Dialect, marked
from pendpipe.acquisition.models import CDC
from pendpipe.arrays import IntArray


class TextDialect(Dialect):
    """Commands of text, ended by CR; while data flow only ``stop`` is obeyed."""

    full_scales: ClassVar[tuple[float, ...]] = (10.0,)
    information: ClassVar[dict[str, str]]
    """Answers to ``info N``; 0 and 1 are the maker and the model."""
    unknown: ClassVar[bytes] = b""
    """Answer to a command that the box does not know."""
    echoes_start: ClassVar[bool] = True

    def __init__(self) -> None:
        super().__init__()
        self._line = b""

    @property
    def range_volts(self) -> float:
        """Full scale, by the code in the first word of the list."""
        return self.full_scales[min(len(self.full_scales) - 1, self._list[0] >> 8 & 0x0F)]

    def respond(self, data: bytes) -> bytes:
        """Take bytes from the host; return the echoes and answers."""
        *complete, self._line = (self._line + data).split(b"\r")
        return b"".join(self._execute(line.decode("latin-1").strip("\0\n ")) for line in complete)

    def _execute(self, text: str) -> bytes:
        """Execute one command and return its echo."""
        name, *arguments = text.split() or [""]
        if self.streaming and name != "stop":
            return b""
        answer = ""
        match name, arguments:
            case (("start" | "stop"), _):
                self.streaming = name == "start"
                self.starts += self.streaming
                if self.streaming and not self.echoes_start:
                    return b""
            case "info", [number, *_]:
                known = {"0": "DATAQ", "1": self.model.removeprefix("DI-"), **self.information}
                answer = " " + known.get(number, "")
            case "slist", [place, word]:
                value = int(word[1:], 16) if word[0] == "x" else int(word)
                # A list is written from its first place on, and ends with its last.
                self._list[int(place) :] = [] if value == _END_OF_LIST else [value]
            case _ if not self._set(name, arguments):
                return self.unknown
        return f"{text}{answer}\r".encode("latin-1")

    @abstractmethod
    def _set(self, name: str, arguments: list[str]) -> bool:
        """Make a setting; return whether the box knows the command."""


_END_OF_LIST: Final = 0xFFFF
"""What ends the list of channels."""


class SimulatedDI149(TextDialect, model="DI-149", bits=12):
    """Eight channels of 12 bits, +-10 V. Every command is echoed, ``start`` too."""

    information: ClassVar[dict[str, str]] = {"2": "65", "6": "0012345601"}

    def __init__(self) -> None:
        super().__init__()
        self._divisor = 7500

    @property
    def scan_rate_hz(self) -> float:
        """Scans a second: 750 kHz over srate."""
        return 750e3 / self._divisor

    def _set(self, name: str, arguments: list[str]) -> bool:
        """Make a setting; return whether the box knows the command."""
        if name == "srate" and arguments:
            self._divisor = min(65535, max(75 * len(self._list), int(arguments[0])))
        return name in ("srate", "asc", "bin", "float", "din", "dout", "reset", "R1")

    def encode(self, codes: IntArray) -> bytes:
        """Two bytes a sample, 14 bits with a frame mark."""
        return marked(np.asarray(codes) * 2 ** (14 - self.bits), 14)


class SimulatedDI155(
    SimulatedDI149,
    model="DI-155",
    bits=14,
    full_scales=tuple(50 / gain for gain in (1, 2, 4, 5, 8, 10, 16, 20)),
):
    """Four channels of 14 bits, +-50 V over eight gains."""


class SimulatedDI2108(
    TextDialect, model="DI-2108", bits=16, unknown=b"Command not found\r", echoes_start=False
):
    """Eight channels of 16 bits, +-10 V; data leave in packets (``ps``).

    Commands are echoed, but for ``start``.
    """

    information: ClassVar[dict[str, str]] = {"2": "0.141", "6": "5F2A9C01", "9": "60000000"}
    limits: ClassVar[dict[str, tuple[int, int]]] = {
        "srate": (375, 65535),
        "dec": (1, 512),
        "deca": (1, 40000),
        "ps": (0, 7),
        "encode": (0, 1),
    }

    def __init__(self) -> None:
        super().__init__()
        self._setting = {"srate": 60000, "dec": 1, "deca": 1, "ps": 0, "encode": 0}

    @property
    def scan_rate_hz(self) -> float:
        """Scans a second: 60 MHz over the three divisors."""
        return 60e6 / (self._setting["srate"] * self._setting["dec"] * self._setting["deca"])

    @property
    def packet_bytes(self) -> int:
        """16, 32, ... 2048 bytes for ``ps`` 0 to 7."""
        return 16 << self._setting["ps"]

    def _set(self, name: str, arguments: list[str]) -> bool:
        """Make a setting; return whether the box knows the command."""
        if name in self._setting and arguments:
            low, high = self.limits[name]
            self._setting[name] = min(high, max(low, int(arguments[0])))
            return True
        return name in ("filter", "eol", "led", "din", "reset")

    def encode(self, codes: IntArray) -> bytes:
        """One signed 16-bit word a sample, low byte first, its bits at the top."""
        return (np.asarray(codes) * (1 << (16 - self.bits))).astype("<i2").tobytes()


for _model, _figures in CDC.items():
    _limits = SimulatedDI2108.limits | {
        "srate": _figures.get("divisors", (375, 65535)),
        "dec": (1, _figures.get("decimations", 512)),
        "deca": (1, _figures.get("further_decimations", 40000)),
    }
    type(
        f"Simulated{_model}",
        (SimulatedDI2108,),
        {},
        model=_model,
        bits=_figures.get("bits", 16),
        full_scales=_figures.get("ranges", (10.0,)),
        limits=_limits,
    )
