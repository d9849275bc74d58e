"""Drivers, one small module a protocol family."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pendpipe.acquire.drivers.base import Driver
from pendpipe.acquire.drivers.cdc import (
    DI1100,
    DI1110,
    DI1120,
    DI2108,
    DI2108P,
    DI4108,
    DI4208,
    DI4718B,
)
from pendpipe.acquire.drivers.di149 import DI149, DI155
from pendpipe.acquire.drivers.di245 import DI245
from pendpipe.acquire.drivers.legacy import DI154RS, DI194RS
from pendpipe.errors import InputError

DRIVERS: Final[Mapping[str, type[Driver]]] = {
    "di154rs": DI154RS,
    "di194rs": DI194RS,
    "di149": DI149,
    "di155": DI155,
    "di245": DI245,
    "di1100": DI1100,
    "di1110": DI1110,
    "di1120": DI1120,
    "di2108": DI2108,
    "di2108p": DI2108P,
    "di4108": DI4108,
    "di4208": DI4208,
    "di4718b": DI4718B,
}
"""The driver of each model, by the name used on the command line."""

FAMILIES: Final[tuple[type[Driver], ...]] = (DI2108, DI245, DI154RS)
"""One driver for each language in which a device can be asked who it is."""


def find_driver(model: str) -> type[Driver]:
    """Return the driver of a model, however its name is written (``DI-154RS``, ``di154``).

    Raises
    ------
    InputError
        If there is none.
    """
    plain = "".join(letter for letter in model.lower() if letter.isalnum())
    for name, driver in DRIVERS.items():
        if plain in (name, name.removesuffix("rs")):
            return driver
    raise InputError(
        f"model {model}", "there is no driver for it", f"choose from {', '.join(DRIVERS)}"
    )
