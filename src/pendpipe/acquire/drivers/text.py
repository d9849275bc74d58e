"""The part of a driver that is alike wherever commands are lines of text.

Commands end in CR and are echoed with it, perhaps with NULs behind; ``stop`` is echoed in
the midst of the data (dataq-facts A5, A8).
"""

from __future__ import annotations

from typing import ClassVar

from pendpipe.acquire.drivers.base import Identity, StreamReader
from pendpipe.acquire.drivers.choice import refuse_another
from pendpipe.errors import InputError


class TextDriver(StreamReader):
    """Commands of text ended by CR.

    Parameters
    ----------
    line
        An open line; the speed does not matter.
    clock
        The recorder's clock, in which the waits for the device are counted.
    """

    model: ClassVar[str]
    baudrate: ClassVar[int] = 115200
    patience_s: ClassVar[float] = 2.0
    """How long an answer may take, in seconds of the host; ``stop`` may stall for one."""
    attempts: int = 3

    def hello(self) -> Identity:
        """End a stream of an earlier run and ask the device who it is.

        Raises
        ------
        InputError
            If nothing answers.
        """
        self.stop()
        maker = self._command("info 0")
        number = self._command("info 1")
        if maker != "DATAQ":
            return Identity(f"{maker} {number}")
        return Identity(f"DI-{number}", self._command("info 2"), self._command("info 6"))

    def identify(self) -> Identity:
        """End a stream of an earlier run and ask who it is; refuse another model.

        Raises
        ------
        InputError
            If nothing answers, or another model does.
        """
        return refuse_another(self.line.port, self.hello(), self.model)

    def stop(self) -> None:
        """End the stream and throw away what still arrives, the echo among it."""
        for _ in range(self.attempts):
            self.line.write(b"stop\r")
            if b"stop" in self.line.discard(self.quiet_s):
                return
            self._doubt = True
            self._clock.sleep(0.5)

    def _command(self, text: str, needed: bool = True) -> str:
        """Send a command and return what its echo says beyond it.

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
        fault = f"answers {echo[:40]!r} to '{text}'" if echo else "does not answer"
        raise InputError(
            self.line.port,
            f"the device {fault}",
            f"check cable, power, CDC mode and --model (asked for a {self.model})",
        )
