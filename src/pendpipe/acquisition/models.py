"""The figures of the boxes of the CDC family, for their drivers and their simulated twins.

They differ from the DI-2108 (8 channels of 16 bits, +-10 V) in these alone (dataq-facts A8).
"""

from typing import Any, Final

_RANGES: Final = (100.0, 50.0, 20.0, 10.0, 5.0, 2.0)
"""Full scales in volts."""
CDC: Final[dict[str, dict[str, Any]]] = {
    "DI-1100": {"bits": 12, "channels": 4, "divisors": (1500, 65535), "decimations": 1},
    "DI-1110": {"bits": 12, "decimations": 1},
    "DI-1120": {"bits": 14, "channels": 4, "ranges": _RANGES},
    "DI-4108": {"ranges": (10.0, 5.0, 2.0, 1.0, 0.5, 0.2)},
    # Its ranges from 0 V up are not used: a pendulum swings about its rest. It knows no deca.
    "DI-2108-P": {"ranges": (10.0, 5.0, 2.5), "further_decimations": 1},
    "DI-4208": {"ranges": _RANGES},
    "DI-4718B": {"range_volts": 5.0, "ranges": (5.0,)},  # behind its amplifiers
}
"""12 and 14 bits stand at the top of a word; where a box has one range, it has no code."""
