"""A serial line: pyserial's ports, with user errors in one line each.

`serial.serial_for_url` opens device files, COM ports and ``socket://HOST:PORT`` alike. It knows
more forms, one of which writes a file of any name, so that only what is named in `check_port` is
opened.
All limits here are seconds of the host's clock: how long a byte takes from one process to
another does not depend on the scale of a simulated clock.
"""

import errno
import re
import stat
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Final

import serial

from pendpipe.errors import InputError, refuse_if

try:
    from termios import error as termios_error
except ImportError:  # not on Windows
    termios_error = OSError  # type: ignore[misc,assignment]


class LineLostError(InputError):
    """The line broke while it was in use: a cable pulled, a device switched off."""

    status = 1


_URL: Final = re.compile(r"(socket|rfc2217)://[^/?#@\s]+:\d+/?")
_COM: Final = re.compile(r"(\\\\\.\\)?COM\d+", re.IGNORECASE)


def check_port(port: str) -> None:
    """Refuse what is no name of a port: nothing but a device is ever opened.

    Raises
    ------
    InputError
        Unless it is a COM port, ``socket://HOST:PORT``, ``rfc2217://HOST:PORT``, or a device
        file (a link to one as well).
    """
    if _URL.fullmatch(port) or _COM.fullmatch(port):
        return
    try:
        mode = Path(port).stat().st_mode
    except (OSError, ValueError):
        mode = 0
    refuse_if(
        "://" in port or port.startswith("simulated:"),
        port,
        "this is not the port of an instrument",
        "give /dev/ttyUSB0, COM3, socket://HOST:PORT or rfc2217://HOST:PORT"
        " (a simulated one has --device)",
    )
    # Whether there is one at all is told by opening it.
    refuse_if(mode and not stat.S_ISCHR(mode), port, "this is not a serial port", _LIST)


_LIST: Final = "pendpipe acquire --list shows the ports"


class Line(AbstractContextManager["Line"]):
    """An open serial line.

    Parameters
    ----------
    port
        A device file, a COM port, ``socket://HOST:PORT`` or ``rfc2217://HOST:PORT``.
    baudrate
        Bits a second; 8 data bits, no parity, one stop bit, no flow control. USB devices
        and sockets take any.

    Raises
    ------
    InputError
        If the port does not exist, is busy, may not be opened, or is no serial port.
    """

    def __init__(self, port: str, baudrate: int) -> None:
        self.port = port
        self.open(baudrate)

    def open(self, baudrate: int) -> None:
        """Open it, or open it again."""
        check_port(self.port)
        try:
            self._serial = serial.serial_for_url(self.port, do_not_open=True)
            self._serial.baudrate = baudrate
            self._serial.timeout = 0
            self._serial.write_timeout = 2.0
            # DTR and RTS feed the RS-232 models, which have no other supply.
            self._serial.dtr = self._serial.rts = True
            if "://" not in self.port:
                self._serial.exclusive = True
            self._serial.open()
        except (OSError, ValueError) as fault:
            raise cannot_open(self.port, fault) from None

    def __exit__(self, *_fault: object) -> None:
        self.close()

    @property
    def is_open(self) -> bool:
        """Whether it was not closed; a broken line is open until then."""
        return bool(self._serial.is_open)

    def set_baudrate(self, baudrate: int) -> None:
        """Change the speed of the open line."""
        with self._watched():
            self._serial.baudrate = baudrate

    def write(self, data: bytes) -> None:
        """Send all of `data`."""
        with self._watched():
            self._serial.write(data)

    def receive(self, limit_s: float) -> bytes:
        """Return what has arrived; if nothing has, wait for it at most `limit_s`."""
        first = self.read(1, limit_s)
        # With no time to wait, pyserial's read makes one system call and returns.
        return first + self.read(1 << 16, 0.0) if first else b""

    def read(self, size: int, limit_s: float) -> bytes:
        """Return `size` bytes, or the fewer that came within `limit_s`."""
        with self._watched(limit_s):
            return bytes(self._serial.read(size))

    def read_until(self, end: bytes, limit_s: float) -> bytes:
        """Return everything up to and with `end`, or what came within `limit_s`."""
        with self._watched(limit_s):
            return bytes(self._serial.read_until(end))

    def discard(self, quiet_s: float, limit_s: float = 1.0) -> bytes:
        """Throw away what arrives until nothing has come for `quiet_s`; return its end."""
        stop = time.monotonic() + limit_s
        tail = b""
        while data := self.receive(quiet_s):
            tail = (tail + data)[-64:]
            if time.monotonic() > stop:
                break
        return tail

    def close(self) -> None:
        """Close the line."""
        # pyserial forgets the socket of a broken connection without closing it.
        connection = getattr(self._serial, "_socket", None)
        self._serial.close()
        if connection is not None:
            connection.close()

    @contextmanager
    def _watched(self, limit_s: float = 0.0) -> Iterator[None]:
        """Let a read take so long, and turn a fault of the line into one line."""
        try:
            self._serial.timeout = limit_s
            yield
        except (OSError, termios_error) as fault:
            # pyserial's messages wrap one another.
            raise LineLostError(
                self.port,
                f"the line was lost ({' '.join(str(fault).split())[:160]})",
                "check cable and power, and that no other program uses the port",
            ) from None


_WINDOWS: Final = re.compile(r"Error\(\d+, .*, None, (\d+)\)")


def cannot_open(port: str, fault: Exception) -> InputError:
    """Turn pyserial's fault into where, what and what to do."""
    text = " ".join(str(fault).split())[:160]
    number = getattr(fault, "errno", None)
    found = _WINDOWS.search(text)
    windows = int(found[1]) if found else None
    cases = (
        (number == errno.ENOENT or windows in (2, 3), "there is no such port", _LIST),
        (
            # Windows lets one program at a time have a port, and calls that a denied access.
            number in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK) or windows in (5, 32),
            "the port is busy",
            f"close the program that uses it: WinDaq, a terminal (lsof {port} names it;"
            " ModemManager tries new ports for some seconds)",
        ),
        (
            number in (errno.EACCES, errno.EPERM),
            "you may not open the port",
            f"join its group, which ls -l {port} shows (sudo usermod -aG dialout $USER), log out"
            " and in again; on macOS give the /dev/cu.* name",
        ),
        (
            number in (errno.ENXIO, errno.ENODEV, errno.EIO) or windows in (31, 121, 433, 995),
            "no working device is behind the port",
            "unplug the device and plug it in again; dmesg, or the Device Manager, shows what"
            " became of it",
        ),
        (
            windows == 87,
            "the port's driver refuses the setting of the line",
            "check that it is the instrument's port; if so, install its driver anew",
        ),
        ("refused" in text, "nothing listens there", "start the device, or correct the address"),
        ("configure port" in text, "this is not a serial port", _LIST),
        (True, f"the port can't be opened ({text})", _LIST),
    )
    return next(InputError(port, problem, remedy) for met, problem, remedy in cases if met)
