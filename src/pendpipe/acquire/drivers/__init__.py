"""Drivers, one small module a protocol family."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from pendpipe.acquire.drivers.base import Driver
from pendpipe.acquire.drivers.cdc import DI2108
from pendpipe.acquire.drivers.legacy import DI154RS
from pendpipe.errors import InputError

DRIVERS: Final[Mapping[str, type[Driver]]] = {"di154rs": DI154RS, "di2108": DI2108}
"""The driver of each model, by the name used on the command line."""


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
