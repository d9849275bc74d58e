"""Why a port does not open, and what to do about it on each system.

pyserial keeps the number of the fault on Linux and macOS (``SerialException.errno``). On
Windows it leaves it in the text alone: ``could not open port 'COM3': PermissionError(13,
'Access is denied.', None, 5)``, whose words are of the system's language and whose last
number is Windows' own.
"""

from __future__ import annotations

import errno
import re
import stat
import sys
from pathlib import Path
from typing import Final

from pendpipe.errors import InputError

_LIST: Final = "pendpipe acquire --list shows the ports"
_WINDOWS: Final = re.compile(r"Error\(\d+, .*, None, (\d+)\)")
_BUSY: Final = {
    "linux": "close the program that uses it (lsof {port} names it; ModemManager tries new ports"
    " for some seconds)",
    "darwin": "close the program that uses it (lsof {port} names it)",
    "win32": "close the program that uses it (WinDaq, a terminal); only one may",
}
_NO_DRIVER: Final = {
    "linux": "unplug the device and plug it in again; dmesg says what became of it",
    "darwin": "unplug the device and plug it in again, and give its /dev/cu.* name",
    "win32": "unplug the device and plug it in again; if its entry in the Device Manager bears a"
    " warning, install its driver",
}


def cannot_open(port: str, fault: Exception, platform: str = sys.platform) -> InputError:
    """Turn pyserial's fault into where, what and what to do."""
    text = " ".join(str(fault).split())[:160]
    number = getattr(fault, "errno", None)
    told = _WINDOWS.search(text)
    windows = int(told[1]) if told else None
    if number == errno.ENOENT or windows in (2, 3):
        return InputError(port, "there is no such port", _LIST)
    # Windows lets one program at a time have a port, and calls that a denied access.
    if number in (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK) or windows in (5, 32):
        remedy = _BUSY.get(platform, _BUSY["darwin"]).format(port=port)
        return InputError(port, "the port is busy", remedy)
    if number in (errno.EACCES, errno.EPERM):
        return InputError(port, "you may not open the port", _permission(port, platform))
    if number in (errno.ENXIO, errno.ENODEV, errno.EIO) or windows in (31, 121, 433, 995):
        remedy = _NO_DRIVER.get(platform, _NO_DRIVER["darwin"])
        return InputError(port, "no working device is behind the port", remedy)
    if windows == 87:
        return InputError(
            port,
            "the port's driver refuses the setting of the line",
            "check that it is the instrument's port; if so, install its driver anew",
        )
    if "refused" in text:
        return InputError(port, "nothing listens there", "start the device, or mend the address")
    if "configure port" in text:
        return InputError(port, "this is no serial port", _LIST)
    return InputError(port, f"the port can't be opened ({text})", _LIST)


def _permission(port: str, platform: str) -> str:
    """Say how to be let in."""
    if platform == "linux":
        group = _group(port) or "dialout"
        return f"join its group (sudo usermod -aG {group} $USER), log out and in again"
    if platform == "darwin":
        return "give the /dev/cu.* name of the port; its owner must be you (ls -l)"
    return "ask the owner of the machine"


def _group(port: str) -> str | None:
    """The group that may use the port (dialout, uucp, ...), if it is a group of that kind."""
    try:
        import grp

        found = Path(port).stat()
        name = grp.getgrgid(found.st_gid).gr_name
    except (ImportError, OSError, KeyError):
        return None
    return name if found.st_mode & stat.S_IWGRP and name != "root" else None
