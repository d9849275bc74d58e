"""What all drivers have in common: one instrument on an open line.

A session is ``identify``, ``configure``, ``start``, reading the line, and ``stop``. What
is wrong with the line or the setting is an `InputError`, with the port as place. A family
defines how its commands are sent; every model is entered into `DRIVERS` where its class is defined.

From the bytes of a stream to scans there are two ways. Families that mark a scan: every sample is
two bytes. Bit 0 of the first byte of a scan is 0, bit 0 of every other byte is 1. The upper seven
bits of the second byte are the upper seven bits of the sample, its lower bits stand at the top of
the first byte (dataq-facts A1 for 8, 10 and 12 bits, A7 for 14); the code is offset binary.

The CDC family sends little-endian 16-bit words, and nothing between them (dataq-facts A8): a lost
byte shifts all that follows, and only the rate, the range or a channel of known reading show it.
A device whose buffer has overflowed sends ``stop 01`` among the words, and nothing after it.

A *scan* is one reading of every enabled channel at one instant; a *count* is the converter's
signed number, zero at 0 V.
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Final, NamedTuple, TypeAlias

import numpy as np

from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.line import Line
from pendpipe.arrays import AnyArray
from pendpipe.errors import InputError, refuse_if


@dataclass(frozen=True)
class Loss:
    """A place where the bytes did not make scans.

    Parameters
    ----------
    after_scan
        How many good scans were decoded before it (since the decoder was made).
    discarded_bytes
        The bytes that had to be thrown away to get into step again.
    lost_scans
        The scans they stand for: the least whole number that could have held them. Whole
        scans missing besides leave no trace in the bytes, only in the clock.
    suspect_before
        Whether the scan before is suspect too: bytes without a frame mark followed it, so
        that one of them may belong inside it.
    reason
        The device's message (``"stop 01"``), or ``"clock"`` where the bytes are whole
        and the recorder's clock tells of the loss.
    """

    after_scan: int
    discarded_bytes: int
    lost_scans: int
    suspect_before: bool = False
    reason: str = ""

    @property
    def is_gap(self) -> bool:
        """Whether scans are missing: bytes before the first scan are none, unless recorded."""
        return self.after_scan > 0 or self.reason == "damage"


class Scans(NamedTuple):
    """What a decoder made of some bytes.

    Parameters
    ----------
    counts
        Signed counts, shape (scans, channels), 16-bit integers.
    losses
        The losses met, in order.
    """

    counts: AnyArray
    losses: tuple[Loss, ...] = ()


class SyncBitDecoder:
    """Two bytes a sample with a frame mark in bit 0.

    Parameters
    ----------
    channels
        Samples in a scan.
    bits
        Bits of a sample, 8 to 14.

    Notes
    -----
    What breaks the pattern of the marks is noticed, and costs the scans it touches; bytes
    are thrown away up to the next byte with bit 0 = 0 that begins a whole scan. What keeps
    the pattern (flipped data bits, an even number of bytes lost at the wrong place, whole
    scans) can't be seen here.
    """

    ended = ""
    """Families with a mark send no message that their stream has ended."""

    def __init__(self, channels: int, bits: int) -> None:
        self.bytes_per_scan = 2 * channels
        self._bits = bits
        self._pending = b""  # the beginning of a scan
        self._scans = 0
        self._discarded = 0  # since the last good scan
        self._suspect = False  # the last good scan was followed by bytes without a start

    def feed(self, data: bytes) -> Scans:
        """Decode further bytes; an unfinished scan waits for the next call.

        A byte with bit 0 = 0 starts a scan; it is whole if the next start is at least a
        scan away. The bytes between the end of a whole scan and the next start, and the
        scans cut short, are thrown away.
        """
        data = self._pending + data
        size = self.bytes_per_scan
        octets = np.frombuffer(data, dtype=np.uint8)
        starts = np.flatnonzero((octets & 1) == 0)
        lead = int(starts[0]) if len(starts) else len(octets)
        length = np.diff(starts, append=len(octets))
        good = length >= size
        discard = np.where(good, length - size, length)
        self._pending = b""
        if len(starts) and not good[-1]:
            # The last scan is not broken but unfinished.
            self._pending = data[starts[-1] :]
            discard[-1] = 0
        # Thrown away before each start, since the beginning of these bytes.
        before = self._discarded + lead + np.concatenate(([0], np.cumsum(discard)))
        followed = self._suspect if self._discarded else (lead > 0 and self._scans > 0)
        index = np.flatnonzero(good)
        thrown = before[index]
        fresh = np.diff(thrown, prepend=0)
        direct = [followed, *(discard[index[:-1]] > 0).tolist()]
        losses = [
            self._loss(self._scans + n, int(fresh[n]), direct[n])
            for n in np.flatnonzero(fresh).tolist()
        ]
        self._discarded = int(before[-1] - thrown[-1]) if len(index) else int(before[-1])
        self._suspect = bool(discard[index[-1]]) if len(index) else followed
        words = np.ascontiguousarray(octets[starts[index][:, None] + np.arange(size)]).view("<u2")
        self._scans += len(index)
        return Scans(self._counts(words), tuple(losses))

    def finish(self) -> Scans:
        """Return what is left over at the end: no counts, perhaps a loss."""
        nothing = np.empty((0, self.bytes_per_scan // 2), dtype=np.int16)
        left = self._discarded
        self._discarded, self._pending = 0, b""
        return Scans(nothing, (self._loss(self._scans, left, self._suspect),) if left else ())

    def _counts(self, words: AnyArray) -> AnyArray:
        """Take the samples out of words that are in step; shape (scans, channels)."""
        code = (words & 0x00FF) >> (15 - self._bits) | (words >> 9) << (self._bits - 7)
        return np.asarray(code.astype(np.int16) - np.int16(1 << (self._bits - 1)))

    def _loss(self, after_scan: int, discarded: int, suspect: bool) -> Loss:
        return Loss(
            after_scan,
            discarded,
            -(-discarded // self.bytes_per_scan),
            suspect_before=suspect and after_scan > 0,
        )


_STOP_CODE: Final = re.compile(rb"stop 0[123]")
"""In words of chance it stands once in 2e16 bytes."""
_BEGINNINGS: Final = tuple(b"stop 0"[:size] for size in range(6, 0, -1))


class WordDecoder:
    """One signed little-endian 16-bit word a channel, scan after scan.

    Parameters
    ----------
    channels
        Words in a scan.
    bits
        Bits of a sample, at the top of its word; below may stand digital inputs.
    """

    def __init__(self, channels: int, bits: int = 16) -> None:
        self.bytes_per_scan = 2 * channels
        self._channels = channels
        self._shift = 16 - bits
        # An unfinished scan; or what may begin a stop code; or that code and all behind it.
        self._pending = b""
        self._scans = 0
        self.ended = ""  # the stop code, once it was met

    def feed(self, data: bytes) -> Scans:
        """Decode further bytes; an unfinished scan waits for the next call."""
        data = self._pending + data
        if found := _STOP_CODE.search(data):
            self.ended = found.group().decode("ascii")
            free = found.start()
        else:
            free = len(data) - next((len(b) for b in _BEGINNINGS if data.endswith(b)), 0)
        whole = free - free % self.bytes_per_scan
        self._pending = data[whole:]
        return self._scans_of(data[:whole])

    def finish(self) -> Scans:
        """Return what was held back, without an unfinished scan; or report a stop code."""
        held = self._pending
        if self.ended:
            loss = Loss(self._scans, len(held), 0, reason=self.ended)
            return Scans(self._scans_of(b"").counts, (loss,))
        self._pending = b""
        return self._scans_of(held[: len(held) - len(held) % self.bytes_per_scan])

    def _scans_of(self, data: bytes) -> Scans:
        """Turn whole scans into counts; shape (scans, channels)."""
        words: AnyArray = np.frombuffer(data, dtype="<i2").reshape(-1, self._channels)
        self._scans += len(words)
        return Scans(words >> self._shift if self._shift else words)


Decoder: TypeAlias = SyncBitDecoder | WordDecoder
"""Bytes in, scans and losses out; how the bytes are cut into pieces changes nothing."""


DRIVERS: Final[dict[str, "type[Driver]"]] = {}
"""The driver of each model, by the name used on the command line (``di154rs``, ``di2108``)."""


@dataclass(frozen=True)
class Identity:
    """A device's own description."""

    model: str
    firmware: str = ""
    serial_number: str = ""


@dataclass(frozen=True)
class Setup:
    """How a device was set to sample.

    Parameters
    ----------
    channels
        The enabled channels as printed on the box (from 1), in the order of the scan.
    rate_hz
        Scans a second that the device's documented clock gives: the nearest to what was
        asked that its divisors allow.
    range_volts
        Full scale of every channel is plus and minus it.
    """

    channels: tuple[int, ...]
    rate_hz: float
    range_volts: float


def plain_name(model: str) -> str:
    """Write a model's name as a key: small letters and digits.

    How the hyphens of a name are written ("2108P", "2108-P") is not documented.
    """
    return "".join(letter for letter in model.lower() if letter.isalnum())


class Driver(ABC):
    """One instrument on an open line.

    Parameters
    ----------
    line
        An open line at `baudrate`.
    clock
        The recorder's clock, in which the waits for the device are counted.
    """

    model: ClassVar[str]
    baudrate: ClassVar[int] = 115200
    bits: ClassVar[int]
    range_volts: ClassVar[float] = 10.0
    """Full scale when none is asked for."""
    ranges: ClassVar[tuple[float, ...]] = (10.0,)
    """Full scales; where they have codes, in their order."""
    channels: ClassVar[int] = 8
    patience_s: ClassVar[float] = 2.0
    """How long an answer may take, in seconds of the host (the vendor's host waits 2 s)."""
    attempts: int = 3
    stop_command: ClassVar[tuple[bytes, ...]] = (b"\0S", b"0")
    """Its parts, sent one after the other; joined and without NULs they are its echo."""
    checks: ClassVar[str] = "cable, power"
    """What to check where the device does not answer."""

    def __init_subclass__(cls, **figures: Any) -> None:
        """Register a model: ``class DI149(TextDriver, model="DI-149", bits=12)``."""
        for name, value in figures.items():
            setattr(cls, name, value)
        if "model" in figures:
            DRIVERS[plain_name(cls.model)] = cls

    def __init__(self, line: Line, clock: ScaledClock) -> None:
        self.line = line
        self._clock = clock
        # How long no byte must come until a stream is held to have ended. The adapters of
        # USB keep bytes back for up to 16 ms; a simulated line does not.
        self.quiet_s = max(0.05 / clock.scale, 0.01)
        # Whether an answer was missed: it may yet come, and must not come among the data.
        self._doubt = False

    @abstractmethod
    def hello(self) -> Identity:
        """End a stream of an earlier run and ask the device who it is.

        Raises
        ------
        InputError
            If nothing answers.
        """

    def identify(self) -> Identity:
        """End a stream of an earlier run and ask who it is; refuse another model.

        Raises
        ------
        InputError
            If nothing answers, or another model does.
        """
        found = self.hello()
        refuse_if(
            plain_name(found.model) != plain_name(self.model),
            self.line.port,
            f"this is a {found.model}, no {self.model}",
            "give its --model",
        )
        return found

    def configure(
        self, channels: Sequence[int], rate_hz: float, range_volts: float | None = None
    ) -> Setup:
        """Choose channels, scan rate and the smallest range that holds `range_volts`.

        Raises
        ------
        InputError
            On a channel or a range that the box does not have, or a rate out of its reach.
        """
        chosen = tuple(sorted(set(channels)))
        refuse_if(
            not chosen or chosen[0] < 1 or chosen[-1] > self.channels,
            self.line.port,
            f"the {self.model} has no channel {', '.join(map(str, channels)) or 'none'}",
            f"choose from 1 to {self.channels}",
        )
        full_scale = self.range_volts
        if range_volts is not None:
            enough = [high for high in self.ranges if high >= range_volts > 0]
            refuse_if(
                not enough,
                self.line.port,
                f"the {self.model} has no range of +-{range_volts:g} V",
                f"choose from {', '.join(f'{high:g}' for high in sorted(self.ranges))}",
            )
            full_scale = min(enough)
        return Setup(chosen, self._set(chosen, rate_hz, full_scale), full_scale)

    @abstractmethod
    def _set(self, channels: tuple[int, ...], rate_hz: float, range_volts: float) -> float:
        """Send the setting; return the rate of scans that the device's divisors give."""

    def start(self) -> None:
        """Begin the stream; the next byte received belongs to the first scan.

        Raises
        ------
        InputError
            If the device does not answer.
        """
        self._clear_the_line()
        self._start_stream()

    @abstractmethod
    def _start_stream(self) -> None:
        """Send the command, and take its echo off the line but none of the data behind it."""

    def stop(self) -> None:
        """Send the stop command until its echo is followed by silence; throw away what arrives.

        While data flow the echo is buried among them, and bytes of data may look like it.
        """
        echo = b"".join(self.stop_command).strip(b"\0\r")
        for _ in range(self.attempts):
            for number, part in enumerate(self.stop_command):
                if number:
                    self._clock.sleep(0.01)
                self.line.write(part)
            if echo in self.line.discard(self.quiet_s):
                return
            self._doubt = True
            self._clock.sleep(0.5)

    def _clear_the_line(self) -> None:
        """Before a start: throw away padding, and wait for answers that were missed.

        One byte too many before the first scan would shift every scan of a stream
        that has no marks.
        """
        self.line.discard(self.patience_s if self._doubt else self.quiet_s, 2.0 * self.patience_s)
        self._doubt = False

    @classmethod
    def decoder(cls, channels: int) -> Decoder:
        """Return a fresh decoder for scans of so many channels."""
        return SyncBitDecoder(channels, cls.bits)

    def _send_line(self, text: str, needed: bool = True) -> str:
        """Send a command of text and return what follows it in the echo.

        A missing or wrong echo is tried again; without `needed` it is then let pass.
        """
        echo = ""
        for attempt in range(self.attempts):
            if attempt:
                self._doubt = True
                self.line.discard(self.quiet_s)
            self.line.write(text.encode("ascii") + b"\r")
            answer = self.line.read_until(b"\r", self.patience_s)
            echo = answer.decode("ascii", "replace").strip("\0\r\n ")
            if answer.endswith(b"\r") and echo.startswith(text):
                return echo.removeprefix(text).strip()
        self._doubt = True
        if not needed:
            return ""
        raise self._no_answer(text, echo)

    def _no_answer(self, command: str, echo: str | bytes) -> InputError:
        problem = f"answers {echo[:40]!r} to '{command}'" if echo else "does not answer"
        return InputError(
            self.line.port,
            f"the device {problem}",
            f"check {self.checks} and --model (asked for a {self.model})",
        )

    def _refuse_rate(self, rate_hz: float, slowest: float, fastest: float, what: str = "") -> None:
        """Refuse a rate of scans (of so many channels) that is out of reach."""
        refuse_if(
            not slowest <= rate_hz <= fastest,
            self.line.port,
            f"the {self.model} can't scan {what}at {rate_hz:g} Hz",
            f"choose a rate between {slowest:.3g} and {fastest:g} Hz",
        )
