"""The device's end of a line: a pseudo-terminal, or a loopback socket."""

from __future__ import annotations

import os
import select
import socket
from contextlib import suppress
from typing import TypeAlias


def _wait(read: int, write: int | None, timeout_s: float) -> None:
    """Wait until there is something to read, or room to write."""
    select.select([read], [] if write is None else [write], [], max(0.0, timeout_s))


class PseudoTerminal:
    """A pseudo-terminal, which the driver opens as it opens any serial port."""

    def __init__(self) -> None:
        self._open()
        self.port = os.ttyname(self._host)

    def _open(self) -> None:
        import tty

        self._device, self._host = os.openpty()
        # Raw before anyone opens it, else the terminal itself echoes and translates. The
        # host's end stays open here: were it closed between two drivers, reads would fail.
        tty.setraw(self._host)
        os.set_blocking(self._device, False)
        self._connected = True

    def wait(self, timeout_s: float, *, sending: bool) -> None:
        """Wait until there is something to read (or room to write)."""
        _wait(self._device, self._device if sending else None, timeout_s)

    def receive(self) -> bytes:
        """Return what the host has sent; nothing when it has sent nothing."""
        try:
            return os.read(self._device, 4096)
        except BlockingIOError:
            return b""

    def send(self, data: memoryview) -> int:
        """Send what there is room for; return how many bytes that was."""
        try:
            return os.write(self._device, data)
        except BlockingIOError:
            return 0

    def unplug(self) -> None:
        """Pull the plug: the host's next read fails."""
        if self._connected:
            self._connected = False
            os.close(self._device)
            os.close(self._host)


class LoopbackSocket:
    """A socket on 127.0.0.1, for pyserial's ``socket://``; one host at a time."""

    def __init__(self) -> None:
        self._host: socket.socket | None = None
        self._listen(0)
        self.port = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def _listen(self, port: int) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self._listener.setblocking(False)

    def wait(self, timeout_s: float, *, sending: bool) -> None:
        """Wait until there is something to read (or room to write)."""
        end = self._host or self._listener
        writing = self._host is not None and sending
        _wait(end.fileno(), end.fileno() if writing else None, timeout_s)

    def receive(self) -> bytes:
        """Return what the host has sent; accept a host that has come, drop one that left."""
        if self._host is None:
            with suppress(BlockingIOError):
                self._host, _ = self._listener.accept()
                self._host.setblocking(False)
                self._host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b""
        try:
            data = self._host.recv(4096)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._host.close()
            self._host = None
        return data

    def send(self, data: memoryview) -> int:
        """Send what there is room for; what nobody listens to is gone."""
        if self._host is None:
            return len(data)
        try:
            return self._host.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            return len(data)

    def unplug(self) -> None:
        """Pull the plug: the host's next read fails."""
        if self._host is not None:
            self._host.close()
            self._host = None
        self._listener.close()


Link: TypeAlias = PseudoTerminal | LoopbackSocket
"""The device's end; every call returns at once, except `wait`."""


def open_link(kind: str | None = None) -> Link:
    """Return a ``"pty"`` or a ``"socket"``; by default a pty where the system has them."""
    if kind is None:
        kind = "pty" if hasattr(os, "openpty") else "socket"
    return PseudoTerminal() if kind == "pty" else LoopbackSocket()
