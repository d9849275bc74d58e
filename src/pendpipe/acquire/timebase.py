"""The true scan rate, measured against the recorder's clock.

Bytes arrive late, never early: by how much changes with every piece. The pieces that were
least late lie on a straight line whose slope is the true interval between scans.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from pendpipe.arrays import FloatArray

_STRETCHES: Final = 12
_FEWEST_IN_STRETCH: Final = 3
_STAMP_S: Final = 1e-4
"""Standard deviation, in seconds of the host, below which no time stamp is believed."""
_TRUST: Final = 6.0
"""How many standard deviations the measured rate must differ from the nominal one before
it is believed: by chance alone (ten degrees of freedom) once in 8000 records."""


@dataclass(frozen=True)
class TimeBase:
    """The scan rate of a recording, by the device's word and by the recorder's clock.

    Parameters
    ----------
    nominal_hz
        What the device's divisors say.
    measured_hz, measured_sd_hz
        What the recorder's clock says, with its standard deviation; NaN when too little
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
        return "measured" if away > _TRUST * self.measured_sd_hz else "nominal"

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
    Delays that drift do not scatter, so a time stamp is never believed to better than 0.1 ms of
    the host (0.1 s of a clock a thousand times as fast), nor a count to better than one scan.
    """
    fresh = np.flatnonzero(np.diff(scans, prepend=-1.0) > 0)
    arrival_s, scans = arrival_s[fresh], scans[fresh]
    nothing = TimeBase(nominal_hz)
    if len(scans) < _STRETCHES * _FEWEST_IN_STRETCH or arrival_s[-1] <= arrival_s[0]:
        return nothing
    slope = (arrival_s[-1] - arrival_s[0]) / (scans[-1] - scans[0])
    late = arrival_s - slope * scans
    first = [
        stretch[np.argmin(late[stretch])]
        for stretch in np.array_split(np.arange(len(scans)), _STRETCHES)
    ]
    x, y = scans[first], arrival_s[first]
    x_mean, y_mean = x.mean(), y.mean()
    spread = float(np.sum((x - x_mean) ** 2))
    interval = float(np.sum((x - x_mean) * (y - y_mean))) / spread
    if interval <= 0:
        return nothing
    residual = y - y_mean - interval * (x - x_mean)
    variance = float(np.sum(residual**2)) / (_STRETCHES - 2) / spread
    floor = math.hypot(interval / math.sqrt(12.0), _STAMP_S * clock_scale)
    sd = math.hypot(math.sqrt(variance), floor / (scans[-1] - scans[0]))
    return TimeBase(nominal_hz, 1.0 / interval, sd / interval**2)
