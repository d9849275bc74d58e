"""Recording in a world whose time passes only while the recorder waits.

Device, line and recorder run in one thread, so that nothing depends on how busy the machine
is: a recording comes out the same whenever it is made.
"""

from types import SimpleNamespace
from typing import Any

import pytest
from benchmarks.faulty_device import Fault, FaultyDevice

import pendpipe.acquisition.recorder
from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.devices.simulated import Signal, SimulatedDevice
from pendpipe.acquisition.line import Line
from pendpipe.acquisition.recorder import record
from pendpipe.recording import Recording

STEP_S = 0.001


class SteppedClock(ScaledClock):
    """Stands still until somebody sleeps."""

    def __init__(self) -> None:
        super().__init__()
        self._now_s = 0.0

    def now(self) -> float:
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        self._now_s += max(duration_s, 0.0)


class Wire:
    """The device's end of a line in memory; what the host's end has is `arrived`."""

    port = "MEMORY"

    def __init__(self) -> None:
        self.sent, self.arrived = b"", b""

    def wait(self, timeout_s: float, *, sending: bool) -> None:
        """Nobody waits at this end: the host's steps do."""

    def receive(self) -> bytes:
        data, self.sent = self.sent, b""
        return data

    def send(self, data: memoryview) -> int:
        self.arrived += bytes(data)
        return len(data)

    def unplug(self) -> None:
        raise NotImplementedError("a wire in memory has no plug")


class SteppedLine(Line):
    """The host's end: who waits here lets time pass and the device step."""

    def __init__(self, device: SimulatedDevice, wire: Wire) -> None:
        self.port = wire.port
        self._device, self._wire = device, wire

    @property
    def is_open(self) -> bool:
        return True

    def set_baudrate(self, baudrate: int) -> None:
        pass

    def write(self, data: bytes) -> None:
        self._wire.sent += data

    def _wait(self, limit_s: float, size: int = 1) -> None:
        until_s = self._device.clock.now() + limit_s
        self._device.step()
        while len(self._wire.arrived) < size and self._device.clock.now() < until_s:
            self._device.clock.sleep(STEP_S)
            self._device.step()

    def read(self, size: int, limit_s: float) -> bytes:
        self._wait(limit_s, size)
        data, self._wire.arrived = self._wire.arrived[:size], self._wire.arrived[size:]
        return data

    def receive(self, limit_s: float) -> bytes:
        self._wait(limit_s)
        return self.read(len(self._wire.arrived), 0.0)

    def read_until(self, end: bytes, limit_s: float) -> bytes:
        until_s = self._device.clock.now() + limit_s
        got = b""
        while not got.endswith(end) and (left := until_s - self._device.clock.now()) > 0.0:
            got += self.read(1, left)
        return got

    def discard(self, quiet_s: float, limit_s: float = 1.0) -> bytes:
        until_s, tail = self._device.clock.now() + limit_s, b""
        while (data := self.receive(quiet_s)) and self._device.clock.now() <= until_s:
            tail = (tail + data)[-64:]
        return tail

    def close(self) -> None:
        pass


def recorded_in_steps(
    kind: str, signal: Signal, fault: Fault, monkeypatch: pytest.MonkeyPatch, **wish: Any
) -> Recording:
    """Record as `acquire_simulated` does, in a time that only this recording knows."""
    clock, wire = SteppedClock(), Wire()
    device = FaultyDevice(kind, signal, fault, link=wire, clock=clock)
    time = SimpleNamespace(sleep=clock.sleep, monotonic=clock.now)
    monkeypatch.setattr(pendpipe.acquisition.recorder, "time", time)
    monkeypatch.setattr(
        pendpipe.acquisition.recorder, "Line", lambda _port, _baud: SteppedLine(device, wire)
    )
    return record(wire.port, kind, clock=clock, **wish)
