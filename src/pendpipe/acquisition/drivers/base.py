"""What all drivers have in common: one instrument on an open line.

A session is ``identify``, ``configure``, ``start``, reading the line, and ``stop``. What
is wrong with the line or the setting is an `InputError`, with the port as place. A family
defines how its commands are sent, and which form its stream has (`streams`); every model is entered
into `DRIVERS` where its class is defined.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.drivers.streams import Scans, marked_scans, out_of_line
from pendpipe.acquisition.line import Line
from pendpipe.errors import InputError, refuse_if

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
    scans_of: ClassVar[Callable[[bytes, int, int], Scans]] = staticmethod(marked_scans)
    """The form of the stream."""
    sends_stop_codes: ClassVar[bool] = False
    """Whether a buffer that overflows ends the stream with ``stop 01``, ``02`` or ``03``."""
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
            f"this is a {found.model}, not a {self.model}",
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
    def decode(cls, data: bytes, channels: int) -> Scans:
        """Turn bytes of the stream into scans of so many channels."""
        scans = cls.scans_of(data, channels, cls.bits)
        return replace(scans, suspect=scans.suspect | out_of_line(scans.counts))

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
