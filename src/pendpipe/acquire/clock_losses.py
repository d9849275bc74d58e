"""Whole scans that were lost without a trace in the bytes, found by rate against the clock.

After k lost scans everything comes k/rate later than the count of bytes says, and stays
late; a host that was busy is late for a while and then catches up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray

_IN_STRETCH: Final = 8
"""Arrivals in a stretch, at least; the least late of them counts."""
_STRETCHES: Final = 256
"""At most."""
_BESIDE: Final = 3
"""Stretches on either side that must bear a step out: nearer to the ends it can't be told
from a busy host."""
_NEAR: Final = 5
"""Stretches on either side whose median tells the height of a step."""
_FEWEST_SCANS: Final = 1.5
_STAMP_S: Final = 0.010
"""Seconds of the host below which no step is believed."""
_SPREADS: Final = 8.0


@dataclass(frozen=True)
class ClockLoss:
    """Scans missing between two arrivals.

    Parameters
    ----------
    first_arrival
        The index of the first arrival after it.
    scans
        How many are missing, rounded.
    """

    first_arrival: int
    scans: int


def find_clock_losses(
    arrival_s: FloatArray, scans: FloatArray, nominal_hz: float, clock_scale: float = 1.0
) -> tuple[list[ClockLoss], float]:
    """Find whole-scan losses.

    Parameters
    ----------
    arrival_s
        Times by the recorder's clock, in s, shape (n,).
    scans
        Scans arrived by then, shape (n,).
    nominal_hz
        The device's own rate.
    clock_scale
        Seconds of the recorder's clock in one of the host's.

    Returns
    -------
    list of ClockLoss
        Steps of the lateness that stay, in order.
    float
        The limit: losses shorter than so many seconds, and those within three stretches
        of the ends, are not seen. Infinite for too few arrivals.

    Notes
    -----
    The lateness of an arrival is its time less scans/rate; of each stretch (8 arrivals or
    more, at most 256 stretches) the least counts. A loss is a step between neighbouring
    stretches but one, beyond their median step (a rate that is not the nominal one), by more than
    eight robust standard deviations of the steps, 10 ms of the host and 1.5 scans, which
    all later stretches keep up and no earlier one had.
    """
    stretches = min(_STRETCHES, len(scans) // _IN_STRETCH)
    if stretches < 4 * _BESIDE:
        return [], math.inf
    parts = np.array_split(np.arange(len(scans)), stretches)
    late = arrival_s - scans / nominal_hz
    first = np.array([part[np.argmin(late[part])] for part in parts])
    # The drift of a wrong rate, per scan: a median is not moved by a few steps.
    slope = float(np.median(np.diff(late[first]) / np.maximum(1.0, np.diff(scans[first]))))
    late = late - slope * scans
    level = late[first]
    steps = np.diff(level)
    spread = 1.4826 * float(np.median(np.abs(steps - np.median(steps))))
    interval_s = slope + 1.0 / nominal_hz
    limit_s = max(_FEWEST_SCANS * interval_s, _STAMP_S * clock_scale, _SPREADS * spread)
    found: list[ClockLoss] = []
    before = np.maximum.accumulate(level)
    after = np.minimum.accumulate(level[::-1])[::-1]
    index = _BESIDE - 1
    while index < stretches - _BESIDE - 1:
        # The stretch in which it happens may show a part of the step: it is passed over.
        rise = float(after[index + 2] - before[index])
        if rise <= limit_s:
            index += 1
            continue
        if float(after[index + 3] - before[index + 1]) > rise:
            index += 1
        # The detection took extremes of many levels, which exaggerate the delays.
        near = level[max(0, index - _NEAR + 1) : index + 1]
        rise = float(np.median(level[index + 2 : index + 2 + _NEAR]) - np.median(near))
        at = _place(late, int(first[index]), int(first[index + 2]))
        found.append(ClockLoss(at, max(1, round(rise / interval_s))))
        index += _BESIDE
    return found, limit_s


def _place(late: FloatArray, begin: int, end: int) -> int:
    """Return the arrival between the two after which the lateness never falls back."""
    part = late[begin : end + 1]
    least_after = np.minimum.accumulate(part[::-1])[::-1]
    return begin + 1 + int(np.argmax(np.diff(least_after)))
