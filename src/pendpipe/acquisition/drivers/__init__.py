"""Drivers, a module a protocol family; each model is entered where its class is defined."""

import importlib
import pkgutil
import sys
from pathlib import Path
from typing import Final

from pendpipe.acquisition.clock import ScaledClock
from pendpipe.acquisition.drivers.base import DRIVERS, Driver, Identity, plain_name
from pendpipe.acquisition.drivers.letters import DI154RS, DI245
from pendpipe.acquisition.drivers.text import DI2108
from pendpipe.acquisition.line import Line, LineLostError
from pendpipe.errors import InputError

__all__ = ["DRIVERS", "FAMILIES", "Driver", "find_driver"]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")

FAMILIES: Final[tuple[type[Driver], ...]] = (DI2108, DI245, DI154RS)
"""One driver for each language in which a device can be asked who it is."""


def find_driver(model: str) -> type[Driver]:
    """Return the driver of a model, however its name is written (``DI-154RS``, ``di154``).

    Raises
    ------
    InputError
        If there is none.
    """
    plain = plain_name(model)
    found = DRIVERS.get(plain) or DRIVERS.get(f"{plain}rs")
    if found is None:
        listed = ", ".join(sorted(DRIVERS))
        raise InputError(f"model {model}", "there is no driver for it", f"choose from {listed}")
    return found


def identify(port: str) -> Identity:
    """Ask the device on a port who it is, in the language of each family in turn.

    This sends bytes: do it only to ports on which such a device may be.

    Raises
    ------
    InputError
        If the port can't be opened, or no known device answers.
    """
    clock = ScaledClock()
    for family in FAMILIES:
        with Line(port, family.baudrate) as line:
            instrument = family(line, clock)
            instrument.attempts = 1
            try:
                return instrument.hello()
            except LineLostError:
                raise
            except InputError:
                continue
    raise InputError(
        port, "no known device answers", "check cable, power and CDC mode, or give --model"
    )


VENDOR: Final = 0x0683
"""The vendor's USB number."""
_DI245: Final = 0x2450
_OF_WINDAQ: Final = {
    0x1100: "DI-1100",
    0x1110: "DI-1110",
    0x1120: "DI-1120",
    0x2008: "DI-2008",
    0x2108: "DI-2108",
    0x2109: "DI-2108-P",
    0x4108: "DI-4108",
    0x4208: "DI-4208",
    0x4718: "DI-4718B",
}
"""Product numbers in the mode for WinDaq (LibUSB)."""
_CDC: Final = (
    "hold its button within 5 s of the green blinking until it is red: blinking yellow is the"
    " CDC mode, green the mode for WinDaq"
)


def without_port(devices: Path = Path("/sys/bus/usb/devices")) -> list[str]:
    """List what to do about each of the vendor's devices that has no serial port (Linux only).

    Parameters
    ----------
    devices
        Where the kernel lists USB devices; each is a folder with ``idVendor`` and
        ``idProduct``, its interfaces are folders in it, and a serial port is a ``tty`` there.
    """
    numbers = {
        device: (_number(device / "idVendor"), _number(device / "idProduct"))
        for device in sorted(devices.glob("*"))
        if not any(device.glob("*/tty*"))
    }
    return [
        f"Dataq {_OF_WINDAQ.get(product, 'DI-245' if product == _DI245 else 'device')}"
        f" (0683:{product:04x}) without a serial port: {_remedy(product)}"
        for vendor, product in numbers.values()
        if vendor == VENDOR and product is not None
    ]


def no_ports(platform: str = sys.platform) -> str:
    """Explain where to look when there is no port at all."""
    try_this = "to try without one: --device simulated:di2108"
    hints = {
        "win32": "a device with a warning in the Device Manager lacks its driver (Dataq's page"
        f" has it); a DI-1100 to DI-4718B must be in CDC mode: {_CDC}",
        "darwin": f"a DI-1100 to DI-4718B needs no driver but must be in CDC mode: {_CDC};"
        " a DI-245 needs a driver of FTDI's that knows 0683:2450",
    }
    hint = hints.get(platform, "lsusb -d 0683: shows whether a device is seen at all")
    return f"no serial ports; {hint}; {try_this}"


def _remedy(product: int) -> str:
    if product == _DI245:
        return (
            "sudo modprobe ftdi_sio, then"
            " echo 0683 2450 | sudo tee /sys/bus/usb-serial/drivers/ftdi_sio/new_id"
        )
    in_windaq = f"it is in the mode for WinDaq; {_CDC}"
    unbound = "sudo modprobe cdc_acm, or unplug it and plug it in again"
    return in_windaq if product in _OF_WINDAQ else unbound


def _number(path: Path) -> int | None:
    try:
        return int(path.read_text(encoding="ascii").strip(), 16)
    except (OSError, ValueError):
        return None
