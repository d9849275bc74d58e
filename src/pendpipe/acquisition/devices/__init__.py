"""Simulated instruments that speak the real ones' bytes, each entered where its class is defined.

They share no code with the drivers: an error made on both sides alike would not show.
"""

from pendpipe.acquisition.devices import letters, text
from pendpipe.acquisition.devices.simulated import DEVICES

__all__ = ["DEVICES", "letters", "text"]
