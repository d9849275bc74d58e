"""Time stamps with gaps, or that are coarser or less even than the readings."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import BoolArray, FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.forensics.finding import Finding, nothing
from pendpipe.diagnose.forensics.local import local_residual, residual_of
from pendpipe.diagnose.noise import Noise
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.result import Location
from pendpipe.estimate import Estimate

_EVEN: Final = 0.25
"""Part of an interval within which stamps belong to an even clock."""
_SEEN: Final = 1e-4
"""Part of an interval from which stamps are uneven at all."""
_GAP: Final = 1.5
"""Intervals (half periods for an encoder's counts) from which it is a gap."""


class Stamps(NamedTuple):
    """Stamps against an even clock; shape (n,)."""

    even_s: FloatArray
    off_s: FloatArray
    interval_s: float


def find_gaps(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Say where the stamps show that samples are missing.

    That is no fault of the motion, and needs no repair: the model is read at the stamps
    that there are.
    """
    inside = (samples.time_s >= data.time_s[0]) & (samples.time_s <= data.time_s[-1])
    time = samples.time_s[inside]
    gaps = _gaps(time, math.pi / fit.at.sampled.motion.angular_frequency, samples.counts)
    if not gaps.any():
        return Finding("dropped-samples", 1.0, summary="the stamps have no gap", kind="property")
    intervals = np.diff(time)
    usual = float(np.median(intervals))
    missing = intervals[gaps] - usual
    longest = int(np.argmax(missing))
    begin, end = time[:-1][gaps], time[1:][gaps]
    number = int(np.count_nonzero(gaps))
    parameters = {
        "gaps": Estimate(float(number), 0.0, ""),
        "longest": Estimate(float(intervals[gaps][longest]), 0.0, "s"),
        "missing_time": Estimate(float(missing.sum()), 0.0, "s"),
    }
    if not samples.counts:
        parameters["missing_samples"] = Estimate(float(np.round(missing / usual).sum()), 0.0, "")
    amplitude = np.interp(begin, data.time_s, fit.at.sampled.amplitude)
    return Finding(
        "dropped-samples",
        0.0,
        0.0,
        parameters,
        Location(
            (float(begin[0]), float(end[-1])), (float(amplitude.min()), float(amplitude.max()))
        ),
        summary=f"{number} gap(s) in the time stamps, the longest of"
        f" {intervals[gaps][longest]:.4g} s at {begin[longest]:.5g} s",
        kind="property",
    )


def gap_note(time_s: FloatArray, half_period_s: float, counts: bool) -> str | None:
    """Say in a line where stamps leave a gap; None where they don't.

    Parameters
    ----------
    time_s
        All stamps of a recording, whether the motion there is analysed or not.
    half_period_s
        Of the motion.
    counts
        Whether each row marks a count of an encoder, which is silent at rest.
    """
    found = np.flatnonzero(_gaps(time_s, half_period_s, counts))
    if not len(found):
        return None
    lasts = np.diff(time_s)[found]
    longest = int(np.argmax(lasts))
    first = float(time_s[found[longest]])
    many = "a gap" if len(found) == 1 else f"{len(found)} gaps, the longest"
    note = f"the time stamps have {many} of {lasts[longest]:.4g} s behind {first:.5g} s"
    return f"{note} (an encoder that writes its counts is silent at rest)" if counts else note


def _gaps(time: FloatArray, half_period_s: float, counts: bool) -> BoolArray:
    intervals = np.diff(time)
    if counts:
        return np.asarray(intervals > _GAP * half_period_s)
    usual = float(np.percentile(intervals, 90))
    if usual > 1.2 * float(np.percentile(intervals, 10)):
        # A clock that runs unevenly by itself.
        return np.asarray(intervals > max(4.0 * usual, 0.5 * half_period_s))
    return np.asarray(intervals > _GAP * usual)


def find_uneven(data: Data, fit: Fit, noise: Noise, samples: Samples) -> Finding:
    """Test whether the readings are evener in time than their stamps.

    Stamps that are rounded, or written late, differ by d_j from an even clock. Were the
    readings taken by the clock, the residual would hold -v d_j:

        r_j = -k v_j d_j + noise,

    k = 1 for false stamps, 0 for true ones. The score is that of k; the even times are
    handed back where they are the better ones.
    """
    identifier = "time-stamps"
    stamps = None if data.time_noise else against_even_clock(data.time_s)
    if stamps is None or data.used < 60:
        return nothing(identifier)
    sampled, used = fit.at.sampled, data.weight > 0.0
    local = local_residual(sampled.phase, residual_of(data, fit), used)
    wave = local_residual(sampled.phase, -sampled.velocity * stamps.off_s, used).left
    size = float(wave @ wave)
    if size <= 1e-6 * local.rms**2:
        return nothing(identifier)
    share, sd = float(wave @ local.left) / size, local.rms / math.sqrt(size)
    p_value = 0.5 * math.erfc(share / sd / math.sqrt(2.0))
    rms = float(np.std(stamps.off_s))
    amplitude = sampled.amplitude
    return Finding(
        identifier,
        p_value,
        max(share / sd, 0.0) ** 2,
        {
            "share": Estimate(share, sd, ""),
            "unevenness": Estimate(rms, rms / math.sqrt(2.0 * len(data)), "s"),
            "interval": Estimate(stamps.interval_s, rms / len(data), "s"),
        },
        Location(
            (float(data.time_s[0]), float(data.time_s[-1])),
            (float(amplitude.min()), float(amplitude.max())),
            (0.25 * math.pi, 0.75 * math.pi),
        ),
        time_s=stamps.even_s if share > 3.0 * sd and share > 0.5 else None,
        summary=f"the time stamps are uneven by {rms:.2g} s and the readings are not: they were"
        f" taken every {stamps.interval_s:.6g} s",
    )


def against_even_clock(time_s: FloatArray) -> Stamps | None:
    """Lay an even clock through stamps; None where there is none, or no difference."""
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
    if float(np.mean(np.abs(off) > _EVEN * slope)) > 0.05 or float(np.std(off)) < _SEEN * slope:
        return None
    return Stamps(np.asarray(start + slope * number), np.asarray(off), float(slope))
