"""A line that plays a script: pairs of bytes expected from the driver and bytes to answer."""
# ruff: noqa: ARG002 - a line that plays a script has no use for time limits

from collections.abc import Callable
from typing import TypeAlias

import pytest

from pendpipe.acquisition.line import Line


class ScriptedLine(Line):
    """Pairs ``(sent, received)`` in order; an answer is there as soon as its pair is complete."""

    def __init__(self, *pairs: tuple[bytes, bytes]) -> None:
        self.port = "SCRIPT"
        self.baudrates: list[int] = []
        self._pairs = list(pairs)
        self._sent = b""
        self._arrived = b""

    @property
    def finished(self) -> bool:
        """Whether everything was sent and everything received."""
        return not self._pairs and not self._sent and not self._arrived

    def set_baudrate(self, baudrate: int) -> None:
        self.baudrates.append(baudrate)

    def write(self, data: bytes) -> None:
        for byte in data:
            self._sent += bytes([byte])
            assert self._pairs, f"{self._sent!r} was not expected"
            sent, received = self._pairs[0]
            assert sent.startswith(self._sent), f"{self._sent!r} instead of {sent!r}"
            if sent == self._sent:
                self._pairs.pop(0)
                self._sent = b""
                self._arrived += received

    def receive(self, limit_s: float) -> bytes:
        data, self._arrived = self._arrived, b""
        return data

    def read(self, size: int, limit_s: float) -> bytes:
        data, self._arrived = self._arrived[:size], self._arrived[size:]
        return data

    def read_until(self, end: bytes, limit_s: float) -> bytes:
        before, found, after = self._arrived.partition(end)
        self._arrived = after
        return before + found

    def discard(self, quiet_s: float, limit_s: float = 1.0) -> bytes:
        return self.receive(0.0)[-64:]

    def close(self) -> None:
        pass


Script: TypeAlias = Callable[..., ScriptedLine]


@pytest.fixture
def script() -> Script:
    """Make a line from pairs of bytes sent and received."""
    return ScriptedLine
