"""Slips of whole units: an encoder loses counts, a clock misses samples, once or time and again.

They are a staircase in what is left of the readings: of the level in counts Q, or of the time in
sampling intervals dt, which moves a reading by v dt. No motion of the pendulum does that. So
whatever varies slowly is fitted beside the steps (level, amplitude, phase and harmonics, over ten
cycles), their sizes are free, and that they come out *whole* is the test.

After n samples that were lost without a trace in the time stamps the readings are n intervals ahead
of these, so that the phase between readings and model, cycle by cycle, steps by omega n interval.
One changes chi^2 more than physics.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from scipy.special import ndtr, stdtr

from pendpipe.analysis.noise import quantisation_rms
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.diagnosis.data import Data
from pendpipe.diagnosis.forensics.evidence import Evidence
from pendpipe.diagnosis.found import Confirmation, Finding, Location
from pendpipe.diagnosis.refine import CLEAN, Fit, alignment, span_of
from pendpipe.estimate import Estimate
from pendpipe.levels import FALSE_ALARM

_SIGNIFICANT_SD: Final = 7.0
"""Standard deviations from which a step is significant."""
_SLOW_CYCLES: Final = 10.0
"""Cycles in which a level, or a rate, may turn once: slips are single, a drift is slow."""
_HARMONICS: Final = 3
"""Of the motion that may drift: a pendulum at 60 degrees has 6e-5 of its swing in the fifth."""
_SAME: Final = 1e-12
"""Singular value of steps' products over the largest, below which two steps are one: rounding
errors of ten thousand readings."""
_NUMBERS: Final = 1 << 22
"""Numbers in the basis of what varies slowly, at most."""
_MOST: Final = 150
"""Slips at most."""
_CHOICE: Final = 6.0
"""Price of a slip beside the places where it may have been (2 ln n)."""
_LENGTHS: Final = 16
"""Of stretches between two slips, from 2 readings to half of them: each twice the last or less."""
_FEWEST: Final = 4
"""Slips: that four are whole by chance, each within a quarter, has a probability of 1/16."""
_NEIGHBOURS: Final = 11
"""Steps whose median is what reversals have in common; a slip in five is still an exception."""
_IN_A_HALF_SWING: Final = 12
"""Readings that tell the level and the size of a half swing, four and more a number."""
_COUNTS: Final = 3.0
"""Counts that a swing has at least."""
_BESIDE: Final = 0.055
"""Length of a side about a step of the time, in periods: what a polynomial of the fourth degree
leaves of a swing there, 1e-6 of it, is less than the noise."""
_OF_A_STEP: Final = 4
"""Degree of the polynomial on both sides: see `_BESIDE`."""
_BESIDE_A_STEP: Final = 2
"""Readings left out on each side: a step is placed within one reading or two."""
_FEWEST_BESIDE: Final = 8
"""Readings on a side: twice the four numbers of its polynomial."""
_ROUNDS: Final = 3
"""Newton steps of one size: each squares an error of a tenth of a sample."""


class Slips(NamedTuple):
    """Steps of whole units.

    Parameters
    ----------
    rows
        The first reading after each, shape (k,).
    sizes
        As they were fitted, in units.
    free
        The same before any was placed as if it were whole, where some were: their test.
    """

    rows: IntArray
    sizes: FloatArray
    free: Slips | None = None

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
        if self.free is not None:
            return self.free.p_value
        half = 0.5 * len(self.sizes)
        near = float(np.sum(np.cos(2.0 * math.pi * self.sizes)))
        squares = max(2.0 * half * self.scatter**2, 1e-300)
        ball = half * math.log(math.pi * squares) - math.lgamma(half + 1.0)
        return min(float(ndtr(-near / math.sqrt(half))), math.exp(min(ball, 0.0)))

    def when_s(self, data: Data) -> FloatArray:
        """The instants of the steps."""
        return np.asarray(data.time_s[self.rows] - 0.5 * data.interval_s)

    def joined(self) -> Slips:
        """Join steps in neighbouring readings: one within a reading, which is a mean, makes two."""
        groups = np.split(np.arange(len(self.rows)), 1 + np.flatnonzero(np.diff(self.rows) > 3))
        first = [group[np.argmax(np.abs(self.sizes[group]))] for group in groups]
        sizes = np.array([np.sum(self.sizes[group]) for group in groups])
        kept = np.abs(sizes) > 0.5
        return Slips(self.rows[first][kept], sizes[kept], self.free and self.free.joined())

    def staircase(self, count: int) -> FloatArray:
        """Return the sum of the whole steps at each of `count` readings."""
        steps = np.zeros(count)
        np.add.at(steps, self.rows, self.whole)
        return np.cumsum(steps)


def whole_steps(evidence: Evidence, unit: FloatArray) -> Slips | None:
    """Find steps of whole units; None where there are too few, or only white noise is left.

    Slips that go on and on are as steady as noise, but never white.

    Parameters
    ----------
    evidence
        The readings, and a model that keeps their phase.
    unit
        What a step of one changes in each reading, rad, shape (n,).
    """
    data, fit = evidence.data, evidence.fit
    if fit.chi2 <= CLEAN * data.used and not evidence.noise.coloured:
        return None
    unit, whole_left = unit * data.weight, evidence.error * data.weight
    steps = _Steps(unit, _slow(data, fit), _later(unit**2))
    first = left = whole_left - steps.slow @ (steps.slow.T @ whole_left)
    alone = steps.alone([len(left)])[len(left)]
    found = np.zeros(0, dtype=np.int64)
    for _ in range(_MOST):
        seen = alone > 1e-6 * steps.squares[0]
        gain = np.where(seen, _later(unit * left) ** 2 / np.where(seen, alone, 1.0), 0.0)
        row = int(np.argmax(gain))
        if gain[row] < (2.0 * math.log(len(left)) + _CHOICE) * spread(left) ** 2:
            break
        found = np.append(found, row)
        # What the steps before leave of it.
        products = steps.products(found)
        sizes = np.append(-np.linalg.solve(products[:-1, :-1], products[:-1, -1]), 1.0)
        column = steps.beside(found, sizes)
        column /= np.linalg.norm(column)
        left = left - column * float(column @ left)
        alone -= _later(unit * column) ** 2
    rows = np.sort(found)
    # All sizes together, beside what varies slowly; again where each has its best place.
    free = None
    while len(rows) >= _FEWEST:
        right = _later(unit * first)[rows]
        sizes = np.asarray(np.linalg.lstsq(steps.products(rows), right, rcond=_SAME)[0])
        kept, slips = np.abs(sizes) > 0.5, Slips(rows, sizes.astype(np.float64), free)
        if not kept.all():
            rows = rows[kept]
        elif free or slips.p_value > FALSE_ALARM:
            return slips
        else:
            rows, free = _at_best_places(slips, steps, first), slips
    return None


class _Steps(NamedTuple):
    """Steps of a unit beside what varies slowly.

    A step is its unit from one reading on, so that products of steps are sums over the unit from
    the later one on, and no step need be kept as a column.

    Parameters
    ----------
    unit
        What a step of one changes in each reading, shape (n,).
    slow
        An orthonormal basis of what varies slowly, shape (n, k).
    squares
        Sums of the squares of the unit from each reading on, shape (n,).
    """

    unit: FloatArray
    slow: FloatArray
    squares: FloatArray

    def alone(self, lengths: Sequence[int]) -> dict[int, FloatArray]:
        """Return the squares of what is left of a unit over some lengths from each reading on."""
        found = {length: _between(self.squares, length) for length in lengths}
        for column in self.slow.T:
            later = _later(self.unit * column)
            for length, squares in found.items():
                squares -= _between(later, length) ** 2
        return found

    def products(self, rows: IntArray) -> FloatArray:
        """Return the inner products of what is left of steps at some readings."""
        order = np.argsort(rows)
        edges = rows[order]
        slow = np.empty((len(rows), self.slow.shape[1]))
        total = np.zeros(self.slow.shape[1])
        for place, start, stop in zip(
            order[::-1], edges[::-1], [len(self.unit), *edges[:0:-1]], strict=True
        ):
            total = total + self.unit[start:stop] @ self.slow[start:stop]
            slow[place] = total
        return np.asarray(self.squares[np.maximum.outer(rows, rows)] - slow @ slow.T)

    def beside(self, rows: IntArray, sizes: FloatArray) -> FloatArray:
        """Return what is left of the sum of steps, shape (n,)."""
        stairs = np.zeros(len(self.unit))
        np.add.at(stairs, rows, sizes)
        steps = self.unit * np.cumsum(stairs)
        return np.asarray(steps - self.slow @ (self.slow.T @ steps))


def _at_best_places(slips: Slips, steps: _Steps, left: FloatArray) -> IntArray:
    """Return where whole steps leave least, and units that are lost and soon regained.

    A search that adds one step after the other has placed the first ones without the last, and sees
    no two that make good for each other.
    """
    rows, sizes, unit, beside = slips.rows, slips.whole, steps.unit, steps.beside
    count = len(unit)
    lengths = np.unique(np.geomspace(2, count // 2, _LENGTHS).astype(np.int64)).tolist()
    alone = steps.alone([count, *lengths])

    def gain(size: float, length: int) -> FloatArray:
        """By how much it lowers the squares, shape (n,), from each reading on."""
        return 2.0 * size * _between(_later(unit * left), length) - size**2 * alone[length]

    left = left - beside(rows, sizes)
    price = 2.0 * (2.0 * math.log(count) + _CHOICE) * spread(left) ** 2
    for _ in range(_MOST - len(rows)):
        tried = [(gain(s, length)[:-length], s, length) for s in (-1.0, 1.0) for length in lengths]
        gains, size, length = max(tried, key=lambda each: float(each[0].max()))
        if gains.max() < price:
            break
        edges = np.argmax(gains) + np.array([0, length])
        left = left - beside(edges, size * np.array([1.0, -1.0]))
        rows, sizes = np.append(rows, edges), np.append(sizes, (size, -size))
    for number in [*range(len(rows)), *range(len(rows))]:
        one = slice(number, number + 1)
        left = left + beside(rows[one], sizes[one])
        rows = rows.copy()
        rows[one] = np.argmax(gain(float(sizes[number]), count))
        left = left - beside(rows[one], sizes[one])
    return np.sort(rows)


def _later(column: FloatArray) -> FloatArray:
    """Sum a column from every reading on."""
    return np.asarray(np.cumsum(column[::-1])[::-1])


def _between(later: FloatArray, length: int) -> FloatArray:
    """Sum over `length` readings from every reading on, from sums to the end."""
    return np.concatenate([later[:-length] - later[length:], later[-length:]])


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
    parts.append(fit.at.jacobian[:, list(fit.free)])
    columns = np.concatenate(parts, axis=1)
    columns *= data.weight[:, None]
    return span_of(columns, 1e-6)


def find_counts(evidence: Evidence) -> Finding | None:
    """Test whether an encoder loses counts: steps of any sizes are a wandering level as well."""
    data, count = evidence.data, count_of(evidence.samples)
    slips = whole_steps(evidence, np.full(len(data), count)) if count else None
    if slips is None:
        return None
    finding = _described(data, slips, count, steps_of_the_level(evidence, count))
    return replace(finding, taken=count * slips.staircase(len(data)))


def find_clock(evidence: Evidence) -> Finding | None:
    """Test whether a clock misses samples: steps of any sizes are a wandering clock as well."""
    data, interval = evidence.data, evidence.data.interval_s / evidence.data.fold
    if not data.uniform or data.time_noise:
        return None
    slips = whole_steps(evidence, interval * evidence.sampled.velocity)
    slips = slips and slips.joined()
    if slips is None or len(slips.rows) < _FEWEST:
        return None
    period_s = evidence.fit.at.span.period_s
    seen = steps_of_the_time(evidence.samples, slips.when_s(data), data.fold, period_s)
    finding = _described(data, slips, interval, seen, clock=True)
    time_s = data.time_s + interval * slips.staircase(len(data))
    return replace(finding, p_value=seen.p_value if seen else slips.p_value, time_s=time_s)


def _described(
    data: Data, slips: Slips, unit: float, seen: Confirmation | None, *, clock: bool = False
) -> Finding:
    when, squares = slips.when_s(data), float(np.sum(slips.whole**2))
    size = float(slips.sizes @ slips.whole) / squares
    words = "the clock slips by whole samples" if clock else "whole counts are lost, or gained,"
    return Finding(
        "clock-slips" if clock else "count-slips",
        slips.p_value,
        parameters={
            "dt" if clock else "step": Estimate(
                unit * size, unit * slips.scatter / math.sqrt(squares), "s" if clock else data.unit
            ),
            "number": Estimate(float(len(when)), 0.0, ""),
        },
        location=Location((float(when[0]), float(when[-1]))),
        mask=beside(data, slips.rows),
        summary=f"{words} {len(when)} times between {when[0]:.5g} and {when[-1]:.5g} s: fitted"
        f" freely, the steps are whole within {slips.scatter:.2f} (by chance 0.29)",
        confirmed=seen,
    )


def beside(data: Data, rows: IntArray) -> BoolArray:
    """Return the readings about each step, which may have come a few off."""
    out = np.zeros(len(data), dtype=bool)
    near = rows[:, None] + np.arange(-_BESIDE_A_STEP, _BESIDE_A_STEP)
    out[np.clip(near, 0, len(data) - 1)] = True
    return out


def count_of(samples: Samples) -> float:
    """Return the step of the readings, rad: between rows, where there is one at each count."""
    if samples.counts:
        return float(np.median(np.abs(np.diff(samples.values))))
    return samples.step or 0.0


def steps_of_the_level(evidence: Evidence, count: float) -> Confirmation | None:
    """Test whether the level changes by whole counts between half swings, whatever the model's is.

    The model tells where they end. Four half swings at a time are one oscillation with slopes and a
    third harmonic, each at a level of its own; the step between the middle two counts. Above half a
    count it is whole, or not.
    """
    from scipy.ndimage import median_filter

    samples, sampled = evidence.samples, evidence.sampled
    swings = sampled.amplitude > 0.5 * _COUNTS * count
    last = np.max(sampled.phase[swings], initial=sampled.phase[0])
    turns = np.pi * np.arange(np.ceil(sampled.phase[0] / np.pi), last / np.pi)
    turns_s = np.interp(turns, sampled.phase, sampled.time_s)
    ends = np.searchsorted(samples.time_s, turns_s).tolist()
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
    interval, floor = np.median(np.diff(samples.time_s)), quantisation_rms(samples.step)
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


def find_lost(evidence: Evidence) -> Finding | None:
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
    floor = quantisation_rms(data.step) / math.sqrt(max(0.5 * readings, 1.0))
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
