"""Samples that were lost without a trace in the time stamps: one changes chi^2 more than physics.

After n lost samples the readings are n intervals ahead of their time stamps, so that the phase
between readings and model, cycle by cycle, steps by omega n interval.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.special import stdtr

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.forensics.slips import beside
from pendpipe.diagnosis.found import Confirmation, Finding, Location
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.unwrapped import alignment
from pendpipe.estimate import Estimate

_SIGNIFICANT_SD: Final = 7.0
"""Standard deviations from which a phase step is significant."""
_EFFICIENCY: Final = 0.37
"""Part of the differences whose rms would be as good as the median of all of their sizes."""
_WHOLE_WITHIN: Final = 0.03
"""Largest distance of a step from a whole number of intervals, in intervals."""
_LARGEST_ERROR: Final = 0.12
"""Standard deviation in intervals above which any step would count as whole."""
_MOST_STEPS: Final = 40
"""Steps that a record may have: a clock that loses more often has no cycles between them."""
_TREND_STEPS: Final = 6
"""Neighbouring steps on each side whose median is the misfit of the model."""
_PRICE: Final = 0.1
"""Part of chi^2 by which a correction must lower it."""
_DEGREE: Final = 5
"""Of the polynomial in time on each side."""
_WITHIN: Final = 0.4
"""Length of a side, in periods: what a polynomial leaves of a swing it leaves elsewhere, too. Of
simulated losses of 10 to 110 ms nine tenths are confirmed, with 0.3 periods eight tenths."""
_INSTANTS: Final = 0.1
"""Within this part of a period the instant is sought."""
_ELSEWHERE: Final = 20
"""Places of the same phase on each side, which tell how far such steps scatter."""
_AGREE_SD: Final = 3.0
"""Standard deviations by which two measures of one loss may differ: one pair of 400 does by
chance."""


class LostSamples(NamedTuple):
    """Samples lost at an instant.

    Parameters
    ----------
    time_s
        The time stamp of the first reading after the loss.
    number
        How many; negative where samples were doubled.
    measured
        The step of the phase, in intervals.
    p_value
        Probability that chance makes the largest of all steps as large: Student's, since their
        scatter is measured by as many.
    """

    time_s: float
    number: int
    measured: float
    p_value: float = 1.0


def find(evidence: Evidence) -> Finding | None:
    """Give the readings after lost samples the times at which they were taken."""
    data, fit = evidence.data, evidence.fit
    interval, lost = data.interval_s / data.fold, find_lost_samples(data, fit)
    if not lost:
        return None
    time_s = data.time_s.copy()
    for each in lost:
        time_s[data.time_s >= each.time_s - 1e-9] += each.number * interval
    number = sum(each.number for each in lost)
    said = ", ".join(f"{each.time_s:.6g} s ({each.number})" for each in lost[:6])
    return Finding(
        "dropped-samples",
        min(each.p_value for each in lost),
        parameters={
            "d": Estimate(number * interval, 0.0, "s"),
            "samples": Estimate(float(number), 0.0, ""),
        },
        location=Location(time_s=(lost[0].time_s, lost[-1].time_s)),
        mask=beside(data, np.searchsorted(data.time_s, [each.time_s - 1e-9 for each in lost])),
        time_s=time_s,
        price=_PRICE * fit.chi2,
        summary=f"samples were lost at {said}",
    )


def find_lost_samples(data: Data, fit: Fit) -> list[LostSamples]:
    """Find sudden steps of the phase that are whole numbers of sampling intervals.

    After n lost samples the readings are n intervals ahead of their time stamps, so that the
    phase between readings and model, cycle by cycle, steps by omega n interval. Steps of a
    clock have one sign and are whole numbers; those of a knock need not be.

    Parameters
    ----------
    data, fit
        The readings, and a model good enough to number their cycles.

    Returns
    -------
    list
        In order of time; empty if there are none, or if one interval is too small a phase to
        be detected.
    """
    if not data.uniform or data.time_noise:
        return []
    log_ratio, phase, centre = alignment(data, fit.at, data.residual(fit.at.reading))
    if len(phase) < 8:
        return []
    interval = fit.at.sampled.motion.angular_frequency * data.interval_s / data.fold
    amplitude = np.interp(centre, fit.at.sampled.phase, fit.at.sampled.amplitude)
    errors = _phase_errors(data, amplitude * np.exp(log_ratio), phase)
    rest, freedom = phase.copy(), _EFFICIENCY * (len(phase) - 2)
    found: list[LostSamples] = []
    for _ in range(_MOST_STEPS):
        step = rest[2:] - rest[:-2]
        step = step - _trend(step)
        # The local scatter of the steps has a misfit in it.
        scatter = 1.4826 * _trend(np.abs(step))
        error = np.maximum(np.hypot(errors[2:], errors[:-2]), scatter)
        number = np.round(step / interval)
        significant = (number != 0.0) & (np.abs(step) > _SIGNIFICANT_SD * error)
        significant &= np.abs(step - number * interval) < _WHOLE_WITHIN * interval + 2.5 * error
        significant &= error < _LARGEST_ERROR * interval
        if not significant.any():
            break
        at = int(np.argmax(np.where(significant, np.abs(step) / error, 0.0)))
        when = _instant(data, fit, phase, centre, at + 1)
        chance = min(2.0 * len(step) * float(stdtr(freedom, -np.abs(step[at]) / error[at])), 1.0)
        found.append(LostSamples(when, int(number[at]), float(step[at] / interval), chance))
        rest[at + 2 :] -= number[at] * interval
        # The cycle in which it happened has an intermediate phase.
        rest[at + 1] = 0.5 * (rest[at] + rest[at + 2])
    signs = sum(each.number for each in found)
    return sorted(each for each in found if each.number * signs > 0)


def _phase_errors(data: Data, amplitude: FloatArray, phase: FloatArray) -> FloatArray:
    """Return the error of each cycle's phase, estimated from its steps, as 1/amplitude.

    The amplitude is that of the readings: where it vanishes, a phase says nothing.
    """
    second = np.diff(phase, 2)
    at = amplitude[1:-1]
    usual = 1.4826 * float(np.median(np.abs(second - np.median(second)) * at)) / math.sqrt(6.0)
    readings = len(data) / max(len(phase), 1)
    floor = data.step / math.sqrt(12.0 * max(0.5 * readings, 1.0))
    return np.asarray(max(usual, floor, 1e-9) / amplitude)


def _trend(step: FloatArray) -> FloatArray:
    """Return the running median of the steps, which go on at the ends as they are there."""
    padded = np.pad(step, _TREND_STEPS, mode="reflect", reflect_type="odd")
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


def loss_confirmed(samples: Samples, about_s: float, period_s: float) -> Confirmation:
    """Test without the model whether angle and velocity step by one and the same time.

    What follows a loss of time lies on the same path, farther along. A knock changes the velocity
    and no angle, an offset the angle and no velocity.

    A polynomial in time is fitted to each side of the instant that leaves least. The steps of angle
    and velocity, over their slopes, are two estimates of the lost time. What they are half periods
    before and after tells their errors; the p-value is that of one of them being none, and 1 where
    they disagree.
    """
    here = None if samples.counts else _lost_time(samples, about_s, period_s)
    places = [
        about_s + 0.5 * k * period_s for k in range(-_ELSEWHERE, _ELSEWHERE + 1) if abs(k) > 1
    ]
    others = [lost for at in places if (lost := _lost_time(samples, at, period_s)) is not None]
    if here is None or len(others) < _ELSEWHERE:
        return Confirmation("there are too few readings about the instant", 1.0)
    usual = np.median(others, axis=0)
    sd = 1.4826 * np.median(np.abs(others - usual), axis=0)
    lost = here - usual
    least = float(np.min(np.abs(lost) / sd))
    agree = abs(lost[0] - lost[1]) < _AGREE_SD * math.hypot(*sd)
    said = [
        f"{1e3 * value:.1f} ± {1e3 * error:.1f} ms" for value, error in zip(lost, sd, strict=True)
    ]
    return Confirmation(
        f"polynomials in time on both sides of it step by {said[0]} in the angle and by"
        f" {said[1]} in the velocity",
        float(2.0 * stdtr(len(others) - 1, -least)) if agree else 1.0,
    )


def _lost_time(samples: Samples, about_s: float, period_s: float) -> FloatArray | None:
    """Return the lost time by the angle, and by the velocity; None where they can't be had."""
    first, last = np.searchsorted(
        samples.time_s, [about_s - _WITHIN * period_s, about_s + _WITHIN * period_s]
    )
    time, values = samples.time_s[first:last], samples.values[first:last]
    fewest = 2 * (_DEGREE + 1)
    sides = [
        (_side(time[:row] - time[row], values[:row]), _side(time[row:] - time[row], values[row:]))
        for row in range(fewest, len(time) - fewest + 1)
        if abs(time[row] - about_s) <= _INSTANTS * period_s
    ]
    if not sides:
        return None
    (before, _), (after, _) = min(sides, key=lambda pair: pair[0][1] + pair[1][1])
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = 2.0 * (after - before)[:2] / (after + before)[1:]
    # Of a swing they are (2/omega) tan(omega tau/2).
    lost = period_s / math.pi * np.arctan(math.pi / period_s * steps)
    return np.asarray(lost) if np.all(np.isfinite(lost)) else None


def _side(time: FloatArray, values: FloatArray) -> tuple[FloatArray, float]:
    """Angle, velocity and acceleration at the instant, and the squares left."""
    scale = float(np.abs(time).max())
    columns = np.vander(time / scale, _DEGREE + 1, increasing=True)
    found = np.linalg.lstsq(columns, values, rcond=None)[0]
    left = values - columns @ found
    return found[:3] * np.array([1.0, 1.0 / scale, 2.0 / scale**2]), float(left @ left)
