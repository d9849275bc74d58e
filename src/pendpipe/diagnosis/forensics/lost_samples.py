"""Samples that were lost, or doubled, without a trace in the time stamps.

This is tested before any fit: one lost sample changes chi^2 more than most physics.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.unwrapped import alignment

_SIGNIFICANT_SD: Final = 7.0
"""Standard deviations from which a phase step is significant."""
_WHOLE_WITHIN: Final = 0.03
"""Largest distance of a step from a whole number of intervals, in intervals."""
_LARGEST_ERROR: Final = 0.12
"""Standard deviation in intervals above which any step would count as whole."""
_MOST_STEPS: Final = 40
_TREND_STEPS: Final = 6
"""Neighbouring steps on each side whose median is the misfit of the model."""


class LostSamples(NamedTuple):
    """Samples lost at an instant.

    Parameters
    ----------
    time_s
        The time stamp of the first reading after the loss.
    number
        How many; negative where samples were doubled.
    measured, sd
        The step of the phase in intervals, and its standard deviation.
    """

    time_s: float
    number: int
    measured: float
    sd: float


def find_lost_samples(data: Data, fit: Fit, interval_s: float | None = None) -> list[LostSamples]:
    """Find sudden steps of the phase that are whole numbers of sampling intervals.

    After n lost samples the readings are n intervals ahead of their time stamps, so that the
    phase between readings and model, cycle by cycle, steps by omega n interval. Steps of a
    clock have one sign and are whole numbers; those of a knock need not be.

    Parameters
    ----------
    data, fit
        The readings, and a model good enough to number their cycles.
    interval_s
        Between samples, where `data` are means of several.

    Returns
    -------
    list
        In order of time; empty if there are none, or if one interval is too small a phase to
        be detected.
    """
    if not data.uniform or data.time_noise:
        return []
    _, phase, centre = alignment(data, fit.at, data.residual(fit.at.reading))
    if len(phase) < 8:
        return []
    sampled = fit.at.sampled
    interval = sampled.motion.angular_frequency * (interval_s or data.interval_s)
    spread = _spread(data, fit, phase, centre)
    rest = phase.copy()
    found: list[tuple[int, int, float, float]] = []
    for _ in range(_MOST_STEPS):
        step = rest[2:] - rest[:-2]
        step = step - _trend(step)
        error = np.maximum(np.hypot(spread[2:], spread[:-2]), _scatter(step))
        number = np.round(step / interval)
        significant = (number != 0.0) & (np.abs(step) > _SIGNIFICANT_SD * error)
        significant &= np.abs(step - number * interval) < _WHOLE_WITHIN * interval + 2.5 * error
        significant &= error < _LARGEST_ERROR * interval
        if not significant.any():
            break
        at = int(np.argmax(np.where(significant, np.abs(step) / error, 0.0)))
        found.append((at + 1, int(number[at]), float(step[at]), float(error[at])))
        rest[at + 2 :] -= number[at] * interval
        # The cycle in which it happened has an intermediate phase.
        rest[at + 1] = 0.5 * (rest[at] + rest[at + 2])
    signs = sum(number for _, number, _, _ in found)
    return sorted(
        LostSamples(
            _instant(data, fit, phase, centre, cycle), number, step / interval, error / interval
        )
        for cycle, number, step, error in found
        if number * signs > 0
    )


def _spread(data: Data, fit: Fit, phase: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the error of each cycle's phase, estimated from its steps, as 1/amplitude."""
    amplitude = np.interp(centre, fit.at.sampled.phase, fit.at.sampled.amplitude)
    second = np.diff(phase, 2)
    at = amplitude[1:-1]
    usual = 1.4826 * float(np.median(np.abs(second - np.median(second)) * at)) / math.sqrt(6.0)
    readings = len(data) / max(len(phase), 1)
    floor = data.step / math.sqrt(12.0 * max(0.5 * readings, 1.0))
    return np.asarray(max(usual, floor, 1e-9) / amplitude)


def _scatter(step: FloatArray) -> FloatArray:
    """Return the local scatter of the steps, a misfit included."""
    return np.asarray(1.4826 * _trend(np.abs(step)))


def _trend(step: FloatArray) -> FloatArray:
    """Return the running median of the steps, which go on at the ends as they are there."""
    if len(step) > _TREND_STEPS:
        padded = np.pad(step, _TREND_STEPS, mode="reflect", reflect_type="odd")
    else:
        padded = np.pad(step, _TREND_STEPS, mode="edge")
    return np.asarray(
        np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _TREND_STEPS + 1), axis=1)
    )


def _instant(data: Data, fit: Fit, phase: FloatArray, centre: FloatArray, cycle: int) -> float:
    """Return the time from which the later phase fits better than the earlier one."""
    sampled = fit.at.sampled
    inside = (sampled.phase > centre[cycle - 1]) & (sampled.phase < centre[cycle + 1])
    amplitude = sampled.motion.upwards * sampled.amplitude[inside]
    residual = data.residual(fit.at.reading) * data.weight
    readings = (residual + sampled.angle)[inside]
    before = amplitude * np.cos(sampled.phase[inside] + phase[cycle - 1])
    after = amplitude * np.cos(sampled.phase[inside] + phase[cycle + 1])
    gain = (readings - before) ** 2 - (readings - after) ** 2
    total = np.concatenate([[0.0], np.cumsum(gain)])
    # Sum of squares with the break at j: earlier phase up to j, later one from j on.
    best = int(np.argmin(total))
    rows = np.flatnonzero(inside)
    return float(data.time_s[rows[min(best, len(rows) - 1)]])
