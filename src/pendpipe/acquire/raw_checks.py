"""Is what a raw file says of itself possible? Its description has no check sum."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from pendpipe.acquire.raw import RawRecording
from pendpipe.errors import InputError

_NUMBERS: Final[Mapping[str, tuple[float, float]]] = {
    "rate_hz": (1e-6, 1e9),
    "range_volts": (1e-6, 1e6),
    "clock_scale": (1e-3, 1e9),
    "volts_per_radian": (-1e9, 1e9),
}
"""What can be true of any instrument."""
_NEEDED: Final = ("model", "port", "channels", "rate_hz", "recorded_at")
_TEXTS: Final = ("model", "port", "recorded_at")
_MOST_CHANNELS: Final = 64


def check_description(place: str, raw: RawRecording) -> None:
    """Refuse a raw recording whose description can't be true.

    Raises
    ------
    InputError
        On a missing or impossible entry, or time stamps that fall.
    """
    header = raw.header
    for key in _NEEDED:
        if key not in header:
            raise _damaged(place, f"{key} is missing")
    for key in _TEXTS:
        if not isinstance(header[key], str):
            raise _damaged(place, f"{key} is no text")
    for key, (low, high) in _NUMBERS.items():
        value = header.get(key, low)
        # A comparison with NaN is false.
        if not (_is_number(value) and low <= value <= high):
            raise _damaged(place, f"{key} is {value!r:.40}")
    channels = header["channels"]
    if (
        not isinstance(channels, list)
        or not 0 < len(channels) <= _MOST_CHANNELS
        or not all(type(channel) is int and channel > 0 for channel in channels)
        or len(set(channels)) != len(channels)
    ):
        raise _damaged(place, f"channels are {channels!r:.40}")
    kept = raw.event("stopped").get("keep_scans")
    if kept is not None and not (type(kept) is int and kept > 0):
        raise _damaged(place, f"keep_scans is {kept!r:.40}")
    if not np.isfinite(raw.arrival_s).all() or np.any(np.diff(raw.arrival_s) < 0):
        raise _damaged(place, "time stamps that fall")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _damaged(place: str, what: str) -> InputError:
    return InputError(
        place, f"the description of the recording is damaged ({what})", "give another copy"
    )
