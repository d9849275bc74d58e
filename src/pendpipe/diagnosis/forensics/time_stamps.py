"""Time stamps with gaps, or less regular than the readings themselves."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.local import local_residual, residual_of
from pendpipe.diagnosis.forensics.tails import upper_tail
from pendpipe.diagnosis.noise import Noise
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Finding, Location, nothing
from pendpipe.estimate import Estimate

_LARGEST_DEVIATION: Final = 0.25
"""Largest deviation from a regular clock, in intervals."""
_IRREGULAR: Final = 1e-4
"""Deviation in intervals from which time stamps count as irregular."""
_GAP_LENGTH: Final = 1.5
"""Length of a gap, in intervals (half periods for an encoder's counts)."""


class Stamps(NamedTuple):
    """Time stamps and a regular clock; shape (n,)."""

    even_s: FloatArray
    off_s: FloatArray
    interval_s: float


def gap_note(time_s: FloatArray, half_period_s: float, counts: bool) -> str | None:
    """Describe the gaps of the time stamps in one line; None if there are none.

    Parameters
    ----------
    time_s
        All time stamps of a recording, whether the motion there is analysed or not.
    half_period_s
        Of the motion.
    counts
        Whether each row marks a count of an encoder, which is silent at rest.
    """
    intervals = np.diff(time_s)
    few, usual = np.percentile(intervals, [10, 90]).tolist()
    least = _GAP_LENGTH * (half_period_s if counts else usual)
    if usual > 1.2 * few and not counts:
        # An irregular clock.
        least = max(4.0 * usual, 0.5 * half_period_s)
    found = np.flatnonzero(intervals > least)
    if not len(found):
        return None
    lasts = intervals[found]
    longest = int(np.argmax(lasts))
    first = float(time_s[found[longest]])
    many = "a gap" if len(found) == 1 else f"{len(found)} gaps, the longest"
    note = f"the time stamps have {many} of {lasts[longest]:.4g} s after {first:.5g} s"
    return f"{note} (an encoder that writes its counts is silent at rest)" if counts else note


def find_irregular(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test whether the readings were taken more regularly than their time stamps say.

    Time stamps that are rounded or written late differ by d_j from a regular clock. If the
    readings were taken by that clock, the residual contains -v d_j:

        r_j = -k v_j d_j + noise,

    with k = 1 for wrong time stamps and 0 for true ones. The regular times are returned if they
    are better.
    """
    identifier = "time-stamps"
    stamps = None if data.time_noise else regular_clock(data.time_s)
    if stamps is None or data.used < 60:
        return nothing(identifier)
    sampled, used = fit.at.sampled, data.weight > 0.0
    local = local_residual(sampled.phase, residual_of(data, fit), used)
    wave = local_residual(sampled.phase, -sampled.velocity * stamps.off_s, used).left
    size = float(wave @ wave)
    if size <= 1e-6 * local.rms**2:
        return nothing(identifier)
    share, sd = float(wave @ local.left) / size, local.rms / math.sqrt(size)
    rms = float(np.std(stamps.off_s))
    return Finding(
        identifier,
        upper_tail(share / sd),
        max(share / sd, 0.0) ** 2,
        {
            "share": Estimate(share, sd, ""),
            "unevenness": Estimate(rms, rms / math.sqrt(2.0 * len(data)), "s"),
            "interval": Estimate(stamps.interval_s, rms / len(data), "s"),
        },
        Location.over(data.time_s, sampled.amplitude, (0.25 * math.pi, 0.75 * math.pi)),
        time_s=stamps.even_s if share > 3.0 * sd and share > 0.5 else None,
        summary=f"the time stamps are irregular by {rms:.2g} s and the readings are not: they were"
        f" taken every {stamps.interval_s:.6g} s",
    )


def regular_clock(time_s: FloatArray) -> Stamps | None:
    """Fit a regular clock to time stamps; None if there is none, or no difference."""
    intervals = np.diff(time_s)
    usual = float(np.median(intervals))
    if usual <= 0.0:
        return None
    number = np.concatenate([[0.0], np.cumsum(np.maximum(np.round(intervals / usual), 1.0))])
    for _ in range(2):
        slope, start = np.polyfit(number, time_s, 1)
        number = np.round((time_s - start) / slope)
    if np.any(np.diff(number) < 1.0):
        return None
    off = time_s - (start + slope * number)
    if (
        float(np.mean(np.abs(off) > _LARGEST_DEVIATION * slope)) > 0.05
        or float(np.std(off)) < _IRREGULAR * slope
    ):
        return None
    return Stamps(np.asarray(start + slope * number), np.asarray(off), float(slope))
