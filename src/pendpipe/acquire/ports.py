"""The serial ports of this machine, and what is known of the devices on them."""

from __future__ import annotations

from dataclasses import dataclass

from pendpipe.acquire.clock import ScaledClock
from pendpipe.acquire.drivers import FAMILIES
from pendpipe.acquire.drivers.base import Identity
from pendpipe.acquire.line import Line, LineLostError
from pendpipe.acquire.usb import VENDOR
from pendpipe.errors import InputError


@dataclass(frozen=True)
class FoundPort:
    """A serial port.

    Parameters
    ----------
    port
        What to give as ``--port``.
    description
        What the system says of it.
    vendor, product
        USB numbers, where it is a USB device.
    """

    port: str
    description: str
    vendor: int | None = None
    product: int | None = None

    @property
    def is_dataq(self) -> bool:
        """Whether its USB number is the vendor's."""
        return self.vendor == VENDOR


def list_ports() -> list[FoundPort]:
    """List the serial ports of this machine, by name; nothing is opened or sent."""
    from serial.tools import list_ports as tools

    found = [FoundPort(p.device, p.description, p.vid, p.pid) for p in tools.comports()]
    return sorted(found, key=lambda port: port.port)


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
