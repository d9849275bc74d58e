"""Simulated instruments that speak the real ones' bytes, each entered where its class is defined.

They share no code with the drivers: an error made on both sides alike would not show.
"""

import importlib
import pkgutil

from pendpipe.acquisition.devices.simulated import DEVICES

__all__ = ["DEVICES"]

for _module in pkgutil.iter_modules(__path__):
    importlib.import_module(f"{__name__}.{_module.name}")
