"""What a user is told about ports: who holds them, who may open them, which driver is missing.

The faults are pyserial's own: on Linux and macOS it is made to raise them; those of Windows are
written as ``serialwin32.py`` writes them (its text, no number; the words in any language).
"""

import errno
import os
import sys
from pathlib import Path

import pytest
from serial import SerialException

from pendpipe.acquisition.drivers import without_port
from pendpipe.acquisition.line import Line, cannot_open
from pendpipe.errors import InputError

posix = pytest.mark.skipif(sys.platform == "win32", reason="pyserial's POSIX part")


@posix
@pytest.mark.parametrize(
    ("number", "problem"),
    [
        (errno.ENOENT, "there is no such port"),
        (errno.EACCES, "you may not open the port"),
        (errno.EPERM, "you may not open the port"),
        (errno.EBUSY, "the port is busy"),
        (errno.ENXIO, "no working device is behind the port"),
        (errno.ENODEV, "no working device is behind the port"),
        (errno.EIO, "no working device is behind the port"),
        (errno.EMFILE, "the port can't be opened"),
    ],
)
def test_every_fault_of_opening_is_named(
    number: int, problem: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: str, *_: object) -> int:
        raise OSError(number, os.strerror(number), path)

    monkeypatch.setattr("serial.serialposix.os.open", refuse)
    with pytest.raises(InputError) as caught:
        Line("/dev/ttyUSB7", 4800)
    assert caught.value.place == "/dev/ttyUSB7"
    assert problem in caught.value.problem


@posix
def test_a_port_that_another_program_has_locked_is_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    def locked(*_: object) -> None:
        raise BlockingIOError(errno.EWOULDBLOCK, "Resource temporarily unavailable")

    _, end = os.openpty()
    monkeypatch.setattr("serial.serialposix.fcntl.flock", locked)
    with pytest.raises(InputError, match=r"busy; close the program .* \(lsof /dev"):
        Line(os.ttyname(end), 4800)


@pytest.mark.parametrize(
    ("original", "problem", "remedy"),
    [
        ("PermissionError(13, 'Access is denied.', None, 5)", "the port is busy", "WinDaq"),
        ("PermissionError(13, 'Zugriff verweigert', None, 5)", "the port is busy", "terminal"),
        (
            "FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)",
            "there is no such port",
            "--list",
        ),
        (
            "OSError(22, 'A device attached to the system is not functioning.', None, 31)",
            "no working device",
            "Device Manager",
        ),
        (
            "OSError(22, 'The semaphore timeout period has expired.', None, 121)",
            "no working device",
            "plug it in again",
        ),
        # Seen with a DI-245: SetCommState fails with 87, and that is no missing port.
        ("OSError(22, 'The parameter is incorrect.', None, 87)", "driver refuses", "install its"),
    ],
)
def test_windows_says_it_in_the_text_alone(original: str, problem: str, remedy: str) -> None:
    fault = SerialException(f"could not open port 'COM3': {original}")
    said = cannot_open("COM3", fault)
    assert problem in said.problem
    assert remedy in said.remedy


def plugged(devices: Path, name: str, product: str, *parts: str) -> None:
    """A USB device as the kernel shows it."""
    folder = devices / name
    for part in parts:
        (folder / part).mkdir(parents=True)
    folder.mkdir(exist_ok=True)
    (folder / "idVendor").write_text("0683\n")
    (folder / "idProduct").write_text(product + "\n")


def test_a_device_without_a_driver_is_found_on_linux(tmp_path: Path) -> None:
    plugged(tmp_path, "1-1", "2450", "1-1:1.0")
    plugged(tmp_path, "1-2", "1110", "1-2:1.0")
    plugged(tmp_path, "1-3", "4109", "1-3:1.0/tty/ttyACM0")
    plugged(tmp_path, "1-4", "2450", "1-4:1.0/ttyUSB0/tty/ttyUSB0")
    (tmp_path / "usb1").mkdir()
    (tmp_path / "usb1" / "idVendor").write_text("1d6b\n")
    said = [str(device) for device in without_port(tmp_path)]
    assert len(said) == 2
    assert "DI-245 (0683:2450) without a serial port: sudo modprobe ftdi_sio" in said[0]
    assert "new_id" in said[0]
    assert "DI-1110" in said[1]
    assert "hold its button" in said[1]
    assert without_port(tmp_path / "nowhere") == []
