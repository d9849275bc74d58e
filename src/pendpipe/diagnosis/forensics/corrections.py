"""What is corrected in the readings: lost samples, slips of whole units, a mark that wanders.

Samples that were lost without a trace in the time stamps are tested before any fit: one of them
changes chi^2 more than most physics.

Slips come time and again: an encoder loses whole counts, a clock misses whole samples. They are a
staircase in what is left of the readings: of the level in counts Q, or of the time in sampling
intervals dt, which moves a reading by v dt. No motion of the pendulum does that. So whatever varies
slowly is fitted beside the steps (level, amplitude, phase and harmonics, over ten cycles), their
sizes are free, and that they come out *whole* is the test.

Of a tracked mark what its wander does to the distance from the pivot it does to the angle.
"""

import itertools
import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from scipy.special import stdtr

from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray, IntArray, scaled_qr
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.tails import upper_tail
from pendpipe.diagnosis.refine import Fit
from pendpipe.diagnosis.result import Confirmation, Finding, Location, nothing
from pendpipe.diagnosis.unwrapped import alignment
from pendpipe.effects.model import jacobian
from pendpipe.estimate import Estimate

_SIGNIFICANT_SD: Final = 7.0
"""Standard deviations from which a phase step is significant."""
_WHOLE_WITHIN: Final = 0.03
"""Largest distance of a step from a whole number of intervals, in intervals."""
_LARGEST_ERROR: Final = 0.12
"""Standard deviation in intervals above which any step would count as whole."""
_MOST_STEPS: Final = 40
_TREND_STEPS: Final = 6
"""Neighbouring steps on each side whose median is the misfit of the model."""
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
_SLOW_CYCLES: Final = 10.0
_HARMONICS: Final = 3
_NUMBERS: Final = 1 << 22
"""Numbers in the basis of what varies slowly, at most."""
_MOST: Final = 150
"""Slips at most."""
_CHOICE: Final = 6.0
"""Price of a slip beside the places where it may have been (2 ln n)."""
_FEWEST: Final = 4
_NEIGHBOURS: Final = 11
_IN_A_HALF_SWING: Final = 12
_BESIDE: Final = 0.055
"""Length of a side about a step of the time, in periods: what a polynomial of the fourth degree
leaves of a swing there, 1e-6 of it, is less than the noise."""
_OF_A_STEP: Final = 4
_BESIDE_A_STEP: Final = 2
"""Readings left out on each side: a step is placed within one reading or two."""
_FEWEST_BESIDE: Final = 8
_ROUNDS: Final = 3
TRACKING_NOISE: Final = "tracking-noise"
_SMOOTH: Final = 5
"""Degree in the angle of what the camera's geometry makes of the distance from the pivot."""
_OF_A_THIRD: Final = 5
"""Degree in time that follows the motion over a third of a period: to 1e-4 of it."""
_FEWEST_ROWS: Final = 9


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
    """

    time_s: float
    number: int
    measured: float


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
    _, phase, centre = alignment(data, fit.at, data.residual(fit.at.reading))
    if len(phase) < 8:
        return []
    interval = fit.at.sampled.motion.angular_frequency * data.interval_s / data.fold
    errors = _phase_errors(data, fit, phase, centre)
    rest = phase.copy()
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
        found.append(LostSamples(when, int(number[at]), float(step[at] / interval)))
        rest[at + 2 :] -= number[at] * interval
        # The cycle in which it happened has an intermediate phase.
        rest[at + 1] = 0.5 * (rest[at] + rest[at + 2])
    signs = sum(each.number for each in found)
    return sorted(each for each in found if each.number * signs > 0)


def _phase_errors(data: Data, fit: Fit, phase: FloatArray, centre: FloatArray) -> FloatArray:
    """Return the error of each cycle's phase, estimated from its steps, as 1/amplitude."""
    amplitude = np.interp(centre, fit.at.sampled.phase, fit.at.sampled.amplitude)
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
        return Confirmation("too few readings about the instant tell", 1.0)
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


class Slips(NamedTuple):
    """Steps of whole units.

    Parameters
    ----------
    rows
        The first reading after each, shape (k,).
    sizes
        As they were fitted, in units.
    """

    rows: IntArray
    sizes: FloatArray

    @property
    def whole(self) -> FloatArray:
        """The sizes as whole numbers."""
        return np.round(self.sizes)

    @property
    def scatter(self) -> float:
        """Of the sizes about whole numbers."""
        return float(np.sqrt(np.mean((self.sizes - self.whole) ** 2)))

    @property
    def p_value(self) -> float:
        """Probability that steps of any sizes are so near whole numbers.

        Of many, the sum of cosines is normal. Of few, the distances from whole numbers are as near
        as that in a ball within the cube of side 1 in which they lie (at most: it may stick out).
        """
        half = 0.5 * len(self.sizes)
        near = float(np.sum(np.cos(2.0 * math.pi * self.sizes)))
        squares = max(2.0 * half * self.scatter**2, 1e-300)
        ball = half * math.log(math.pi * squares) - math.lgamma(half + 1.0)
        return min(upper_tail(near / math.sqrt(half)), math.exp(min(ball, 0.0)))

    def joined(self) -> "Slips":
        """Join steps in neighbouring readings: one within a reading, which is a mean, makes two."""
        groups = np.split(np.arange(len(self.rows)), 1 + np.flatnonzero(np.diff(self.rows) > 3))
        first = [group[np.argmax(np.abs(self.sizes[group]))] for group in groups]
        sizes = np.array([np.sum(self.sizes[group]) for group in groups])
        kept = np.abs(sizes) > 0.5
        return Slips(self.rows[first][kept], sizes[kept])

    def staircase(self, count: int) -> FloatArray:
        """Return the sum of the whole steps at each of `count` readings."""
        steps = np.zeros(count)
        np.add.at(steps, self.rows, self.whole)
        return np.cumsum(steps)


def whole_steps(data: Data, fit: Fit, unit: FloatArray) -> Slips | None:
    """Find steps of whole units; None where there are too few.

    Parameters
    ----------
    data, fit
        The readings, and a model that keeps their phase.
    unit
        What a step of one changes in each reading, rad, shape (n,).
    """
    whole_left, slow = data.residual(fit.at.reading) * data.weight, _slow(data, fit)
    known = slow.shape[1]
    basis = np.empty((len(slow), known + _MOST), order="F")
    basis[:, :known] = slow
    left = whole_left - slow @ (slow.T @ whole_left)
    whole = _later(unit[:, None] ** 2 * data.weight[:, None])
    alone = whole - np.sum(_later(unit[:, None] * slow) ** 2, axis=1, keepdims=True)
    rows: list[int] = []
    for _ in range(_MOST):
        seen = alone[:, 0] > 1e-6 * whole[0]
        product = _later((unit * left)[:, None])[:, 0]
        gain = np.where(seen, product**2 / np.where(seen, alone[:, 0], 1.0), 0.0)
        row = int(np.argmax(gain))
        if gain[row] < (2.0 * math.log(len(left)) + _CHOICE) * spread(left) ** 2:
            break
        rows.append(row)
        column = _beside(_step(row, unit, data), basis[:, :known])
        if column is not None:
            left = left - column * float(column @ left)
            alone -= _later((unit * column)[:, None]) ** 2
            basis[:, known] = column
            known += 1
    return _whole(whole_left, slow, unit, data, np.sort(np.array(rows, dtype=np.int64)))


def _later(columns: FloatArray) -> FloatArray:
    """Sum each column from every reading on."""
    return np.asarray(np.cumsum(columns[::-1], axis=0)[::-1])


def spread(left: FloatArray) -> float:
    """Return the standard deviation of what is left, whatever single readings do."""
    return 1.4826 * float(np.median(np.abs(left[left != 0.0])))


def _slow(data: Data, fit: Fit) -> FloatArray:
    """Return an orthonormal basis of what varies slowly, and of the model's own values.

    Over many cycles the fastest of it is slower, or the basis would grow with their square.
    """
    sampled = fit.at.sampled
    turned = sampled.phase - sampled.phase[0]
    most = _NUMBERS // (len(turned) * (2 * _HARMONICS + 1))
    number = max(min(int(turned[-1] / (math.pi * _SLOW_CYCLES)), most), 2)
    waves = np.cos(math.pi / turned[-1] * turned[:, None] * np.arange(number))
    parts = [waves, waves * sampled.angle[:, None], waves * sampled.velocity[:, None]]
    for harmonic in range(2, _HARMONICS + 1):
        turns = harmonic * sampled.phase[:, None]
        parts += [waves * np.cos(turns), waves * np.sin(turns)]
    parts.append(jacobian(fit.model, fit.value, fit.at)[:, list(fit.free)])
    columns = np.concatenate(parts, axis=1) * data.weight[:, None]
    basis, triangle, _ = scaled_qr(columns)
    mixing, lengths, _ = np.linalg.svd(triangle)
    return np.asarray(basis @ mixing[:, lengths > 1e-6 * lengths[0]])


def _step(row: int, unit: FloatArray, data: Data) -> FloatArray:
    """Return a step's change of the readings."""
    return np.where(np.arange(len(unit)) >= row, unit, 0.0) * data.weight


def _beside(column: FloatArray, basis: FloatArray) -> FloatArray | None:
    """Return what a column has beside a basis, of unit length; None where that is nothing."""
    length = float(np.linalg.norm(column))
    for _ in range(2):
        column = column - basis @ (basis.T @ column)
    alone = float(np.linalg.norm(column))
    return None if alone < 1e-6 * length else column / alone


def _whole(
    left: FloatArray, slow: FloatArray, unit: FloatArray, data: Data, rows: IntArray
) -> Slips | None:
    """Fit all sizes together, beside what varies slowly."""
    while len(rows) >= _FEWEST:
        columns = np.column_stack([_step(row, unit, data) for row in rows.tolist()])
        columns -= slow @ (slow.T @ columns)
        sizes = np.asarray(np.linalg.lstsq(columns, left, rcond=1e-10)[0], dtype=np.float64)
        kept = np.abs(sizes) > 0.5
        if kept.all():
            return Slips(rows, sizes)
        rows = rows[kept]
    return None


def find_slips(name: str, data: Data, fit: Fit, samples: Samples) -> tuple[Data, Finding]:
    """Test for slips, and correct them.

    Returns
    -------
    Data
        The readings without the slips: an encoder's values, or a clock's times, are corrected.
    Finding
        Its p-value is that of whole numbers: steps of any sizes explain a wandering level, or
        clock, as well.
    """
    clock = name == "clock-slips"
    unit = data.interval_s / data.fold if clock else count_of(samples)
    possible = data.uniform and not data.time_noise if clock else unit > 0.0
    change = fit.at.sampled.velocity if clock else np.ones(len(data))
    slips = whole_steps(data, fit, unit * change) if possible else None
    slips = slips.joined() if slips and clock else slips
    if slips is None or len(slips.rows) < _FEWEST:
        return data, nothing(name)
    when = data.time_s[slips.rows] - 0.5 * data.interval_s
    seen = steps_of_the_time(samples, when, data.fold, fit.at.span.period_s) if clock else None
    stairs = unit * slips.staircase(len(data))
    corrected = replace(data, weight=weight_beside(data, slips.rows))
    if clock:
        corrected = replace(corrected, time_s=data.time_s + stairs, uniform=False)
    else:
        corrected = replace(corrected, values=data.values - stairs)
    squares = float(np.sum(slips.whole**2))
    size = float(slips.sizes @ slips.whole) / squares
    words = "the clock slips by whole samples" if clock else "whole counts are lost, or gained,"
    finding = Finding(
        name,
        seen.p_value if seen else slips.p_value,
        parameters={
            "dt" if clock else "step": Estimate(
                unit * size, unit * slips.scatter / math.sqrt(squares), "s" if clock else data.unit
            ),
            "number": Estimate(float(len(when)), 0.0, ""),
        },
        location=Location((float(when[0]), float(when[-1]))),
        summary=f"{words} {len(when)} times between {when[0]:.5g} and {when[-1]:.5g} s: fitted"
        f" freely, the steps are whole within {slips.scatter:.2f} (by chance 0.29)",
        confirmed=seen if clock else steps_of_the_level(samples, unit),
    )
    return corrected, finding


def weight_beside(data: Data, rows: IntArray) -> FloatArray:
    """Return the weights without the readings about each step, which may have come a few off."""
    weight = data.weight.copy()
    near = rows[:, None] + np.arange(-_BESIDE_A_STEP, _BESIDE_A_STEP)
    weight[np.clip(near, 0, len(data) - 1)] = 0.0
    return weight


def count_of(samples: Samples) -> float:
    """Return the step of the readings, rad: between rows, where there is one at each count."""
    if samples.counts:
        return float(np.median(np.abs(np.diff(samples.values))))
    return samples.step or 0.0


def steps_of_the_level(samples: Samples, count: float) -> Confirmation | None:
    """Test whether the level changes by whole counts between half swings, without any model.

    Four half swings at a time are one oscillation with slopes and a third harmonic, each at a
    level of its own; the step between the middle two counts. Above half a count it is whole,
    or not.
    """
    from scipy.ndimage import median_filter

    ends = _turns(samples.values)
    found = [
        _middle_step(samples, ends[first : first + 5]) / count for first in range(len(ends) - 4)
    ]
    steps = np.array([step for step in found if math.isfinite(step)])
    # An edge of the scale has a width, which is a step of either sign at each reversal.
    for way in (slice(0, None, 2), slice(1, None, 2)):
        steps[way] -= median_filter(steps[way], _NEIGHBOURS, mode="nearest")
    rows = np.flatnonzero(np.abs(steps) > 0.5)
    large = Slips(rows, steps[rows])
    if len(rows) < _FEWEST:
        return None
    return Confirmation(
        f"of {len(steps)} steps of the level between half swings, from four half swings each,"
        f" {len(rows)} are above half a count, and these whole within {large.scatter:.2f}"
        " (by chance 0.29)",
        large.p_value,
    )


def steps_of_the_time(
    samples: Samples, when_s: FloatArray, within: int, period_s: float
) -> Confirmation | None:
    """Test whether the time steps by whole samples at instants, without any model.

    About each instant, known to `within` samples, a polynomial in time with a step of the time is
    fitted to the raw readings: after the step it changes them as the velocity does. The row where
    the step is most significant counts.
    """
    interval, floor = np.median(np.diff(samples.time_s)), (samples.step or 0.0) / math.sqrt(12.0)
    side = max(int(_BESIDE * period_s / interval), _FEWEST_BESIDE)
    found: list[float] = []
    for row in np.searchsorted(samples.time_s, when_s).tolist():
        near = samples.values[max(row - side - within, 0) : row + side + within]
        if len(near) < 2 * side:
            continue
        windows = np.lib.stride_tricks.sliding_window_view(near, 2 * side).T
        sizes, sd = _step_of_time(windows, 0.0, floor)
        best = int(np.argmax(np.abs(sizes) / sd))
        size = float(sizes[best])
        for _ in range(_ROUNDS):
            more, sd = _step_of_time(windows[:, [best]], size, floor)
            size += float(more[0])
        if abs(size) > max(_SIGNIFICANT_SD * sd[0], 0.5):
            found.append(size)
    seen = Slips(np.arange(len(found)), np.array(found))
    if len(found) < _FEWEST:
        return None
    return Confirmation(
        f"{len(found)} steps of the time, each from a polynomial through the raw readings, are"
        f" whole within {seen.scatter:.2f} samples (by chance 0.29)",
        seen.p_value,
    )


def _step_of_time(windows: FloatArray, size: float, floor: float) -> tuple[FloatArray, FloatArray]:
    """Fit what a step of the time in the middle of each window lacks, and its sd; shape (windows,).

    In sampling intervals. Windows have the shape (rows, windows); of the step, `size` is known.
    """
    side = len(windows) // 2
    later = np.arange(2 * side) >= side
    at = (np.arange(2 * side) - side + 0.5 + size * later) / side
    powers = np.vander(at, _OF_A_STEP + 1, increasing=True)
    basis = np.linalg.qr(powers)[0]
    slopes = powers[:, :-1] * np.arange(1, _OF_A_STEP + 1) @ np.linalg.pinv(powers)[1:]
    steps = slopes @ windows * later[:, None] / side
    left, steps = (each - basis @ (basis.T @ each) for each in (windows, steps))
    square = np.maximum(np.sum(steps**2, axis=0), 1e-300)
    more = np.sum(steps * left, axis=0) / square
    rest = (np.sum(left**2, axis=0) - more**2 * square) / (2 * side - _OF_A_STEP - 2)
    return more, np.sqrt(np.maximum(rest, floor**2) / square)


def _turns(values: FloatArray) -> list[int]:
    """Return the rows of the turning points: the extremes between crossings of the middle."""
    above = values > 0.5 * (np.max(values) + np.min(values))
    crossed = np.flatnonzero(above[:-1] != above[1:]) + 1
    return [
        first + int(np.argmax(np.abs(values[first:last] - values[first])))
        for first, last in itertools.pairwise(crossed.tolist())
    ]


def _middle_step(samples: Samples, ends: list[int]) -> float:
    """Return the step of the level between the second and the third of four half swings, rad."""
    if min(np.diff(ends)) < _IN_A_HALF_SWING:
        return math.nan
    time, values = samples.time_s[ends[0] : ends[4]], samples.values[ends[0] : ends[4]]
    late = (time - time[0]) / (time[-1] - time[0]) - 0.5
    phase = 4.0 * math.pi * late
    halves = np.searchsorted(np.array(ends[1:4]) - ends[0], np.arange(len(time)), side="right")
    waves = [halves == half for half in range(4)]
    waves += [wave * late**power for wave in (np.cos(phase), np.sin(phase)) for power in (0, 1)]
    columns = np.column_stack([*waves, np.cos(3.0 * phase)]).astype(np.float64)
    fitted = np.linalg.lstsq(columns, values, rcond=None)[0]
    return float(fitted[2] - fitted[1])


def wander(samples: Samples) -> FloatArray | None:
    """Return what the distance is more than a smooth function of the angle, over the distance."""
    if samples.radius_excess is None or samples.unit != "rad":
        return None
    smooth = np.polynomial.Polynomial.fit(samples.values, samples.radius_excess, _SMOOTH)
    return np.asarray(samples.radius_excess - smooth(samples.values))


def rows_of(samples: Samples, period_s: float) -> int:
    """Return the rows within a third of a period, an odd number."""
    interval = float(np.median(np.diff(samples.time_s)))
    return max(_FEWEST_ROWS, 2 * int(period_s / (6.0 * interval)) + 1)


def wander_confirmed(samples: Samples, along: FloatArray, rows: int) -> Confirmation:
    """Test whether angle and distance scatter together within a third of a period, without a model.

    What polynomials in time leave of them is uncorrelated where the errors of the two coordinates
    are. The variance of a correlation of n values is ``sum of rho_1(k) rho_2(k)/n`` over all lags
    k (Bartlett 1935).
    """
    from scipy.signal import savgol_filter

    both = np.array(
        [each - savgol_filter(each, rows, _OF_A_THIRD) for each in (samples.values, along)]
    )
    both /= np.linalg.norm(both, axis=1)[:, None]
    together = float(both[0] @ both[1])
    lags = [(both[:, k:] * both[:, :-k]).sum(axis=1).prod() for k in range(1, 2 * rows)]
    sd = math.sqrt(max(1.0 + 2.0 * sum(lags), 1.0) / len(along))
    return Confirmation(
        "angle and distance scatter together within a third of a period (correlation"
        f" {together:.2f} ± {sd:.2f})",
        math.erfc(abs(together) / (sd * math.sqrt(2.0))),
    )


def find_wander(data: Data, fit: Fit, samples: Samples, taken: float) -> tuple[Data, Finding]:
    """Test for a wander that both coordinates show, and correct the angles in proportion.

    Parameters
    ----------
    data, fit
        The readings, and a model of them.
    samples
        As they were recorded.
    taken
        The kappa that the readings are corrected for.

    Returns
    -------
    Data
        The readings without the wander.
    Finding
        Its p-value is that of the test without the model; ``kappa`` is the change of the angle
        with the relative distance.
    """
    from scipy.ndimage import uniform_filter1d

    along, rows = wander(samples), rows_of(samples, fit.at.span.period_s)
    if along is None or not np.any(along) or len(along) < rows:
        return data, nothing(TRACKING_NOISE)
    sure = wander_confirmed(samples, along, rows)
    # The mean over as many rows: what is faster is mostly another error in each coordinate.
    slow = uniform_filter1d(along, rows, mode="nearest")
    seen = np.interp(data.time_s, samples.time_s, slow) * data.weight
    left = data.residual(fit.at.reading) * data.weight
    square = float(seen @ seen)
    kappa = float(left @ seen) / square
    # Neighbouring readings wander together: so many of them are one.
    memory = max(1.0, square / max(float(np.sum(np.diff(seen) ** 2)), 1e-300))
    rest = left - kappa * seen
    sd = math.sqrt(memory * float(rest @ rest) / max(data.used, 1) / square)
    whole, rms = taken + kappa, math.sqrt(square / data.used)
    finding = Finding(
        TRACKING_NOISE,
        sure.p_value,
        parameters={
            "kappa": Estimate(whole, sd, "rad"),
            "rms": Estimate(rms, rms / math.sqrt(2.0 * data.used / memory), ""),
        },
        location=Location((float(data.time_s[0]), float(data.time_s[-1]))),
        summary="the tracked mark wanders: the distance from the pivot, which a string keeps,"
        " changes with the angle's errors",
        confirmed=sure,
    )
    return replace(data, values=data.values - kappa * seen), finding
