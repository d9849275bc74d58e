"""Simulated instruments that speak the real ones' bytes, a module a protocol family.

They share no code with the drivers: an error made on both sides alike would not show.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from pendpipe.acquire.devices.di149 import SimulatedDI149, SimulatedDI155
from pendpipe.acquire.devices.di154rs import SimulatedDI154RS, SimulatedDI194RS
from pendpipe.acquire.devices.di245 import SimulatedDI245
from pendpipe.acquire.devices.di2108 import (
    SimulatedDI1100,
    SimulatedDI1110,
    SimulatedDI1120,
    SimulatedDI2108,
    SimulatedDI2108P,
    SimulatedDI4108,
    SimulatedDI4208,
    SimulatedDI4718B,
)
from pendpipe.acquire.devices.stream import Dialect

DEVICES: Final[Mapping[str, Callable[[], Dialect]]] = {
    "di154": SimulatedDI154RS,
    "di154rs": SimulatedDI154RS,
    "di194": SimulatedDI194RS,
    "di194rs": SimulatedDI194RS,
    "di149": SimulatedDI149,
    "di155": SimulatedDI155,
    "di245": SimulatedDI245,
    "di1100": SimulatedDI1100,
    "di1110": SimulatedDI1110,
    "di1120": SimulatedDI1120,
    "di2108": SimulatedDI2108,
    "di2108p": SimulatedDI2108P,
    "di4108": SimulatedDI4108,
    "di4208": SimulatedDI4208,
    "di4718b": SimulatedDI4718B,
}
"""What may follow ``simulated:``."""
