"""Where samples seem to have been lost, or doubled, without a trace in the time stamps.

A quick look before the fit is worth anything: one lost sample outweighs all physics.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.arrays import FloatArray
from pendpipe.diagnose.data import Data
from pendpipe.diagnose.refine import Fit
from pendpipe.diagnose.unwrapped import alignment

_SURE: Final = 7.0
"""Standard deviations of a phase step."""
_WHOLE: Final = 0.03
"""Part of an interval by which a step may miss a whole number of them."""
_BLURRED: Final = 0.12
"""Standard deviation in intervals above which any step would pass for a whole number."""
_MOST: Final = 40
_TREND: Final = 6
"""Neighbouring steps on each side whose median is what the model lacks anyway."""


class LostSamples(NamedTuple):
    """Samples lost at an instant.

    Parameters
    ----------
    time_s
        The stamp of the first reading behind.
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

    Behind n lost samples the readings run n intervals ahead of their stamps, so that the
    phase between readings and model, cycle by cycle, steps by omega n interval. The steps
    of a clock have one sign; a blow has any, and is no whole number.

    Parameters
    ----------
    data, fit
        The readings, and a model near enough that its cycles are the readings'.
    interval_s
        Between samples, where `data` are means of several.

    Returns
    -------
    list
        In the order of time; empty where there are none, or where one interval is too
        small a phase to be seen.
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
    for _ in range(_MOST):
        step = rest[2:] - rest[:-2]
        step = step - _trend(step)
        error = np.maximum(np.hypot(spread[2:], spread[:-2]), _unrest(step))
        number = np.round(step / interval)
        sure = (number != 0.0) & (np.abs(step) > _SURE * error)
        sure &= np.abs(step - number * interval) < _WHOLE * interval + 2.5 * error
        sure &= error < _BLURRED * interval
        if not sure.any():
            break
        at = int(np.argmax(np.where(sure, np.abs(step) / error, 0.0)))
        found.append((at + 1, int(number[at]), float(step[at]), float(error[at])))
        rest[at + 2 :] -= number[at] * interval
        # The cycle in which it happened lies between.
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
    """Standard deviation of each cycle's phase: from its steps, and larger as the swing falls."""
    amplitude = np.interp(centre, fit.at.sampled.phase, fit.at.sampled.amplitude)
    second = np.diff(phase, 2)
    at = amplitude[1:-1]
    usual = 1.4826 * float(np.median(np.abs(second - np.median(second)) * at)) / math.sqrt(6.0)
    readings = len(data) / max(len(phase), 1)
    floor = data.step / math.sqrt(12.0 * max(0.5 * readings, 1.0))
    return np.asarray(max(usual, floor, 1e-9) / amplitude)


def _unrest(step: FloatArray) -> FloatArray:
    """How much the steps about each differ, a misfit's included."""
    return np.asarray(1.4826 * _trend(np.abs(step)))


def _trend(step: FloatArray) -> FloatArray:
    """Median of the steps about each."""
    padded = np.pad(step, _TREND, mode="reflect" if len(step) > _TREND else "edge")
    return np.asarray(
        np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * _TREND + 1), axis=1)
    )


def _instant(data: Data, fit: Fit, phase: FloatArray, centre: FloatArray, cycle: int) -> float:
    """The reading from which the later phase fits better than the earlier one."""
    sampled = fit.at.sampled
    inside = (sampled.phase > centre[cycle - 1]) & (sampled.phase < centre[cycle + 1])
    amplitude = sampled.motion.upwards * sampled.amplitude[inside]
    residual = data.residual(fit.at.reading) * data.weight
    readings = (residual + sampled.angle)[inside]
    before = amplitude * np.cos(sampled.phase[inside] + phase[cycle - 1])
    behind = amplitude * np.cos(sampled.phase[inside] + phase[cycle + 1])
    gain = (readings - before) ** 2 - (readings - behind) ** 2
    total = np.concatenate([[0.0], np.cumsum(gain)])
    # Sum of squares with the break at j: before up to j, behind from j on.
    best = int(np.argmin(total))
    place = np.flatnonzero(inside)
    return float(data.time_s[place[min(best, len(place) - 1)]])
