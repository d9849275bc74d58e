"""Simulated instruments that speak the real ones' bytes, each entered where its class is defined.

They share no code with the drivers: an error made on both sides alike would not show.
"""

from pendpipe.acquire.devices import letters, text
from pendpipe.acquire.devices.simulated import DEVICES

__all__ = ["DEVICES", "letters", "text"]
