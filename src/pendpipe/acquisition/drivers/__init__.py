"""Drivers, a module a protocol family; each model is entered where its class is defined."""

from __future__ import annotations

from typing import Final

from pendpipe.acquisition.drivers.base import DRIVERS, Driver, plain_name
from pendpipe.acquisition.drivers.letters import DI154RS, DI245
from pendpipe.acquisition.drivers.text import DI2108
from pendpipe.errors import InputError

__all__ = ["DRIVERS", "FAMILIES", "Driver", "find_driver"]

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
