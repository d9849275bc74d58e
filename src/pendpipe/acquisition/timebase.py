"""What the recorder's clock shows: the true scan rate, and whole scans that were lost.

Bytes arrive late, never early: by how much changes with every piece. The pieces that were
least late lie on a straight line whose slope is the true interval between scans.

In a stream without marks lost scans leave no trace but one: everything after them arrives late,
and stays so. Other delays (a busy host) pass, and the pieces that were not held up are as early
as before.
"""

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from pendpipe.arrays import FloatArray

_HOST_S: Final = 0.010
"""Seconds by which a busy host's delays may step or drift within a record: less is not believed."""
_RATE_STRETCHES: Final = 12
_FEWEST_IN_STRETCH: Final = 3
_RATE_TRUST: Final = 6.0
"""How many standard deviations the measured rate must differ from the nominal one before
it is believed: by chance alone (ten degrees of freedom) once in 8000 records."""

_IN_STRETCH: Final = 8
"""Arrivals in a stretch, at least; the least late of them counts."""
_LOSS_STRETCHES: Final = 256
"""At most."""
_BESIDE: Final = 3
"""Stretches on either side that must bear a step out: nearer to the ends it can't be distinguished
from a busy host."""
_NEAR: Final = 5
"""Stretches on either side whose median tells the height of a step."""
_FEWEST_SCANS: Final = 1.5
_SPREADS: Final = 8.0


@dataclass(frozen=True)
class TimeBase:
    """The scan rate of a recording, by the device's word and by the recorder's clock.

    Parameters
    ----------
    nominal_hz
        What the device's divisors say.
    measured_hz, measured_sd_hz
        As measured by the recorder's clock, with its standard deviation; NaN when too little
        arrived to tell.
    """

    nominal_hz: float
    measured_hz: float = math.nan
    measured_sd_hz: float = math.nan

    @property
    def chosen(self) -> Literal["nominal", "measured"]:
        """Which of the two the times are made with.

        The nominal one, unless the measured one differs from it by more than six of its own
        standard deviations: a quartz is better than a host's time stamps over one record,
        but a wrong divisor or a false formula is seen by them at once.
        """
        away = abs(self.measured_hz - self.nominal_hz)
        return "measured" if away > _RATE_TRUST * self.measured_sd_hz else "nominal"

    @property
    def rate_hz(self) -> float:
        """The rate that the times are made with."""
        return self.measured_hz if self.chosen == "measured" else self.nominal_hz


def measure_rate(
    arrival_s: FloatArray, scans: FloatArray, nominal_hz: float, clock_scale: float = 1.0
) -> TimeBase:
    """Measure the scan rate from times of arrival.

    Parameters
    ----------
    arrival_s
        Times by the recorder's clock, in s, shape (n,).
    scans
        How many scans had arrived by then, shape (n,).
    nominal_hz
        The device's own word, kept beside.
    clock_scale
        Seconds of the recorder's clock in one of the host's.

    Returns
    -------
    TimeBase
        The measured rate is NaN for fewer than 36 arrivals, or all at one time.

    Notes
    -----
    The arrivals are cut into twelve stretches with equally many; in each the least late one
    counts (late relative to the straight line through the ends). A least-squares line through
    the twelve gives the interval, its scatter the standard deviation: a constant delay
    changes nothing, and a stretch in which the host slept throughout shows up as scatter.
    Delays that drift do not scatter: a rate is believed only where it puts the last arrival more
    than 10 ms of the host off (10 s of a clock a thousand times as fast). Nor is a count believed
    to better than one scan.
    """
    fresh = np.flatnonzero(np.diff(scans, prepend=-1.0) > 0)
    arrival_s, scans = arrival_s[fresh], scans[fresh]
    nothing = TimeBase(nominal_hz)
    if len(scans) < _RATE_STRETCHES * _FEWEST_IN_STRETCH or arrival_s[-1] <= arrival_s[0]:
        return nothing
    slope = (arrival_s[-1] - arrival_s[0]) / (scans[-1] - scans[0])
    late = arrival_s - slope * scans
    first = [
        stretch[np.argmin(late[stretch])]
        for stretch in np.array_split(np.arange(len(scans)), _RATE_STRETCHES)
    ]
    (interval, _), covariance = np.polyfit(scans[first], arrival_s[first], 1, cov=True)
    if interval <= 0:
        return nothing
    floor = math.hypot(interval / math.sqrt(12.0), _HOST_S / _RATE_TRUST * clock_scale)
    sd = math.hypot(math.sqrt(covariance[0, 0]), floor / (scans[-1] - scans[0]))
    return TimeBase(nominal_hz, float(1.0 / interval), float(sd / interval**2))


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
    stretches = min(_LOSS_STRETCHES, len(scans) // _IN_STRETCH)
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
    limit_s = max(_FEWEST_SCANS * interval_s, _HOST_S * clock_scale, _SPREADS * spread)
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
    least_after = np.minimum.accumulate(late[begin : end + 1][::-1])[::-1]
    return begin + 1 + int(np.argmax(np.diff(least_after)))
