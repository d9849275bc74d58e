"""Simulated DI-154RS, DI-194RS (dataq-facts A1) and DI-245 (A7): commands are letters."""

from typing import ClassVar, Final

from pendpipe.acquisition.devices.simulated import Dialect


class SimulatedDI154RS(Dialect, model="DI-154RS", bits=12):
    """Four channels of 12 bits, +-10 V, behind a line of 4800 or 9600 baud.

    A command is NUL, letter, argument; letter and argument are echoed as they come. Bytes
    outside a command, and unknown letters, are ignored. A sample takes two bytes, 20 bit
    times of the line, so that n channels are scanned at most baud/(20 n) times a second;
    the rate counter adds that many bit times to a scan.
    """

    range_volts = 10.0
    answer_to_identify: ClassVar[bytes] = b"0000000001"

    def __init__(self) -> None:
        super().__init__()
        self._begun = b""  # NUL, or the letter that wants its argument
        self._registers = dict.fromkeys(b"SNCDLMBER", 0) | {ord("C"): 0b0001}

    @property
    def channels(self) -> tuple[int, ...]:
        """The enabled channels, from 1, in the order of the scan."""
        return tuple(number + 1 for number in range(4) if self._registers[ord("C")] >> number & 1)

    @property
    def scan_rate_hz(self) -> float:
        """Scans a second: the bit times of a scan, plus the counter's."""
        counter = self._registers[ord("L")] | self._registers[ord("M")] << 8
        baud = 9600 if self._registers[ord("B")] == 4 else 4800
        return baud / (20 * max(1, len(self.channels)) + counter)

    def respond(self, data: bytes) -> bytes:
        """Take bytes from the host; return the echoes and answers."""
        out = b""
        for value in data:
            before, self._begun, byte = self._begun, b"", bytes([value])
            if before == b"\0" and value in self._registers:
                self._begun = byte
                out += byte
            elif before and before != b"\0":
                out += byte + self._execute(before, value)
            elif not before and value == 0:
                self._begun = byte
        return out

    def _execute(self, letter: bytes, argument: int) -> bytes:
        """Execute a complete command; return what follows the echo."""
        self._registers[ord(letter)] = argument
        if letter in (b"S", b"R"):
            self.streaming = letter == b"S" and argument == ord("1")
            self.starts += self.streaming
        return self.answer_to_identify if letter == b"N" else b""


class SimulatedDI194RS(
    SimulatedDI154RS, model="DI-194RS", bits=10, answer_to_identify=b"0000000000"
):
    """The same box with 10 bits: three in the first byte, of which bit 4 means nothing."""


_FULL_SCALES: Final = [0.5, 0.25, 0.1, 0.05, 0.025, 0.01, *[0.0] * 2, 50, 25, 10, 5, 2.5, 1]
"""Volts, by the code of the range."""


class SimulatedDI245(Dialect, model="DI-245", bits=14):
    """Four channels of 14 bits, +-10 mV to +-50 V.

    NUL begins a short command, whose two characters are echoed one by one; everything else
    is text up to CR, echoed there. While data flow only the stop is obeyed.
    """

    def __init__(self) -> None:
        super().__init__()
        self._short: bytes | None = None  # what has come of a short command
        self._text = b""
        self._list = [0x0A00]
        self._rate_word = 1871

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
        """Execute a short command; return what follows the echo."""
        if command in ("S0", "S1"):
            self.streaming = command == "S1"
            self.starts += self.streaming
            return b""
        answers = {"A1": " 2450\r", "A2": " 68\r", "A7": " 5A5A5A5A\r", "NZ": "0012345601\r"}
        return b"" if self.streaming else answers.get(command, "").encode()

    def _execute(self, text: str) -> bytes:
        """Execute a long command and return its echo."""
        words = text.split()
        if self.streaming or len(words) != 3 or words[0] not in ("chn", "xrate"):
            return b""
        first, second = int(words[1]), int(words[2])
        if words[0] == "chn":
            self._list[first:] = [second]
        else:
            self._rate_word = first
        return text.encode("latin-1") + b"\r"
