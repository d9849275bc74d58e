"""Drivers, a module a protocol family; each model is entered where its class is defined."""

import importlib
import pkgutil
from contextlib import suppress
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
_CDC: Final = (
    "hold its button within 5 s of the green blinking until it is red: blinking yellow is the"
    " CDC mode, green the mode for WinDaq"
)
_UNBOUND: Final = "sudo modprobe cdc_acm, or unplug it and plug it in again"
_WITHOUT: Final = {
    number: (f"DI-{number}", f"it is in the mode for WinDaq; {_CDC}")
    for number in ("1100", "1110", "1120", "2008", "2108", "2109", "4108", "4208", "4718")
} | {
    "2450": (
        "DI-245",
        "sudo modprobe ftdi_sio, then"
        " echo 0683 2450 | sudo tee /sys/bus/usb-serial/drivers/ftdi_sio/new_id",
    )
}
"""Name and remedy by product number: in the mode for WinDaq (2109 is the DI-2108-P), or unbound."""


def without_port(devices: Path = Path("/sys/bus/usb/devices")) -> list[str]:
    """List what to do about each of the vendor's devices that has no serial port (Linux only).

    Parameters
    ----------
    devices
        Where the kernel lists USB devices; each is a folder with ``idVendor`` and
        ``idProduct``, its interfaces are folders in it, and a serial port is a ``tty`` there.
    """
    products: list[str] = []
    for device in sorted(devices.glob("*")):
        # A device may be unplugged meanwhile, and hubs and interfaces have no numbers.
        with suppress(OSError, ValueError):
            vendor = int((device / "idVendor").read_text(encoding="ascii"), 16)
            if vendor == VENDOR and not any(device.glob("*/tty*")):
                products.append((device / "idProduct").read_text(encoding="ascii").strip().lower())
    return [
        f"Dataq {name} (0683:{product}) without a serial port: {remedy}"
        for product in products
        for name, remedy in (_WITHOUT.get(product, ("device", _UNBOUND)),)
    ]


NO_PORTS: Final = (
    "no serial ports; lsusb -d 0683:, or the Device Manager, shows whether a device is seen at all;"
    f" a DI-1100 to DI-4718B must be in CDC mode: {_CDC}; to try without one:"
    " --device simulated:di2108"
)
"""Where to look when there is no port at all."""
