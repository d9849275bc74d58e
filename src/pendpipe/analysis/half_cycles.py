"""The half cycles of a record, read off coarsely: when, how far, from where to where.

This is for finding out which part of a record is one free decay, not for measuring:
turning points are read off a thinned record, without a fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.noise import noise_rms
from pendpipe.arrays import FloatArray, IntArray, median, quantiles
from pendpipe.dynamics.kernel import kernel
from pendpipe.levels import deviations

_PER_HALF_CYCLE: Final = 40
"""Samples a half cycle that are kept: a turning point is then low by 0.03 %."""

_ASIDE: Final = 0.5 * (math.sqrt(5.0) - 1.0)
"""Cells by which their edges lie beside even readings, so that no rounding error decides."""
LEAST_HALF_CYCLES: Final = 3
"""Half cycles that show a decay: two amplitudes of one side, and one of the other."""
_SOME: Final = 4096
"""Readings, spread over the record, that tell its range and its usual interval."""


@dataclass(frozen=True)
class HalfCycles:
    """Swings from one turning point to the next.

    Parameters
    ----------
    turn_time_s, turn
        Times and values of the m + 1 turning points.
    swing
        Distances between neighbouring turning points, shape (m,), > 0.
    middle_s
        When the middle between the two turning points is passed, shape (m,).
    step
        The least reversal that was counted, in the unit of the values.
    ending
        How far the motion went after the last turning point, without turning again.
    """

    turn_time_s: FloatArray
    turn: FloatArray
    swing: FloatArray
    middle_s: FloatArray
    step: float
    ending: float

    def __len__(self) -> int:
        return len(self.swing)


def find_extremes(values: FloatArray, least: float) -> IntArray:
    """Find alternating extremes: each is followed by a return of more than a threshold.

    Nothing need be known of level or period. The first reading can be an extreme; and how far the
    motion went after the last one is an extreme too, though no return follows.

    Parameters
    ----------
    values
        Readings, shape (n,).
    least
        The threshold.

    Returns
    -------
    numpy.ndarray
        Their positions.
    """
    found = np.empty(len(values) + 1, dtype=np.int64)
    count = _find_extremes(np.ascontiguousarray(values, dtype=np.float64), least, found)
    return found[:count].copy()


@kernel()
def _find_extremes(values: FloatArray, least: float, found: IntArray) -> int:
    """Fill `found`; return how many there are."""
    count, direction, high, low = 0, 0, 0, 0
    top, bottom = -np.inf, np.inf
    for i in range(values.size):
        x = values[i]
        if x > top:
            high, top = i, x
        if x < bottom:
            low, bottom = i, x
        if direction >= 0 and top - x > least:
            found[count], direction = high, -1
        elif direction <= 0 and x - bottom > least:
            found[count], direction = low, 1
        else:
            continue
        count += 1
        high, low, top, bottom = i, i, x, x
    if direction != 0:
        found[count] = high if direction > 0 else low
        count += 1
    return count


SEEN: Final = deviations(1e8)
"""Standard deviations of the noise from which a swing is seen: the largest of 10^8 readings."""
_STEPS: Final = 1.6
"""Steps of the readings from which a swing is seen: at rest between two they swing by one."""
_OF_THREE: Final = 4
"""Turning points of a swing and its two neighbours."""
_SMALL: Final = 0.15
"""Of both neighbours: a swing below is a ripple."""


def least_swing(noise: float, step: float | None) -> float:
    """The least swing that is seen over the noise of a reading, and over its step."""
    return max(SEEN * noise, _STEPS * (step or 0.0))


def without_ripples(values: FloatArray, turns: IntArray) -> IntArray:
    """Take out swings that are small beside both neighbours.

    In a free decay each swing is at least as large as the next, so none is small beside
    both; a wiggle within a swing is.
    """
    swing = np.abs(np.diff(values[turns]))
    if np.all(swing[1:-1] >= _SMALL * np.minimum(swing[:-2], swing[2:])):
        return turns
    kept: list[int] = []
    for turn in turns.tolist():
        kept.append(turn)
        while len(kept) >= _OF_THREE:
            a, b, c, d = (float(values[at]) for at in kept[-_OF_THREE:])
            if abs(c - b) >= _SMALL * min(abs(b - a), abs(d - c)):
                break
            del kept[-3:-1]
    return np.array(kept, dtype=np.int64)


def running_median(values: FloatArray, reach: int) -> FloatArray:
    """The median of each value and of so many to each side, fewer at the ends; NaN do not count."""
    found = np.empty(len(values))
    _running_median(np.ascontiguousarray(values), reach, np.empty(2 * reach + 1), found)
    return found


@kernel()
def _running_median(values: FloatArray, reach: int, window: FloatArray, found: FloatArray) -> None:
    """Fill `found`; in `window` the values about each are put in order."""
    for i in range(values.size):
        count = 0
        for j in range(max(i - reach, 0), min(i + reach + 1, values.size)):
            place = count
            while place > 0 and window[place - 1] > values[j]:
                window[place] = window[place - 1]
                place -= 1
            window[place] = values[j]
            count += 0 if math.isnan(values[j]) else 1
        low, high = window[max(count - 1, 0) // 2], window[count // 2 if count else 0]
        found[i] = 0.5 * (low + high)


def _range(values: FloatArray) -> float:
    """Tell the range of most readings: of all, a wild one would hide every swing."""
    some = values[:: max(1, len(values) // _SOME)]
    return float(np.ptp(quantiles(some, 0.005, 0.995)))


def usual_half_period(time_s: FloatArray, values: FloatArray) -> float | None:
    """Estimate the half period from the large swings; ``None`` if there are not two."""
    span = _range(values) or float(np.ptp(values))
    for share in (0.2, 0.05, 0.02):
        turns = without_ripples(values, find_extremes(values, share * span))
        if len(turns) > LEAST_HALF_CYCLES:
            return float(median(np.diff(time_s[turns])))
    return None


def thinned(
    time_s: FloatArray, values: FloatArray, half_period_s: float
) -> tuple[FloatArray, FloatArray]:
    """Put the record on an even grid of about 40 points a half cycle.

    Single wild readings go first (a median of three), then dense samples into means; a cell
    without samples, as between the counts of an encoder, is left out.
    """
    step = half_period_s / _PER_HALF_CYCLE
    every = max(1, len(time_s) // _SOME)
    interval = float(median(time_s[1::every] - time_s[:-1:every]))
    if interval > 0.5 * step:
        return time_s, _without_wild(values, math.pi * interval / half_period_s)
    # The grid hangs on the first sample's clock, not on its place: rest before changes nothing.
    thin_time, thin_values = np.empty(len(values)), np.empty(len(values))
    count = _thin(time_s, values, step, thin_time, thin_values)
    thin_time, thin_values = thin_time[:count].copy(), thin_values[:count].copy()
    gaps = np.flatnonzero(np.diff(thin_time) > half_period_s) + 1
    parts = zip(np.split(thin_time, gaps), np.split(thin_values, gaps), strict=True)
    return thin_time, np.concatenate([_even(*part, step) for part in parts])


def _even(time: FloatArray, values: FloatArray, step: float) -> FloatArray:
    """Smooth cells that no gap parts, unless readings come with counts and leave some out.

    Means over an eighth of a half cycle take mains hum out, and 0.6 % of a crest.
    """
    if len(time) <= 0.99 * (time[-1] - time[0]) / step:
        return values
    ends = values[[0, 0]], values, values[[-1, -1]]
    return np.convolve(np.concatenate(ends), np.full(5, 0.2), mode="valid")


@kernel()
def _thin(
    time_s: FloatArray,
    values: FloatArray,
    step: float,
    thin_time: FloatArray,
    thin_values: FloatArray,
) -> int:
    """Write the means of times, and of medians of three, in cells of a grid; return how many."""
    count, readings, cell, last = 0, 0, 0, values.size - 1
    when, total = 0.0, 0.0
    for i in range(values.size):
        x = values[i]
        if 0 < i < last:
            before, after = values[i - 1], values[i + 1]
            x = max(min(before, x), min(max(before, x), after))
        here = math.floor(time_s[i] / step + _ASIDE)
        if i > 0 and here != cell:
            thin_time[count], thin_values[count] = when / readings, total / readings
            count, readings, when, total = count + 1, 0, 0.0, 0.0
        cell, readings, when, total = here, readings + 1, when + time_s[i], total + x
    thin_time[count], thin_values[count] = when / readings, total / readings
    return count + 1


def _without_wild(values: FloatArray, turn: float) -> FloatArray:
    """Replace readings that stand out of their neighbours by more than a turning point can.

    Where a cycle has few samples, `turn` rad apart, the topmost stands out of the next by up
    to A (1 - cos turn), A the motion's amplitude: it is no wild reading.
    """
    edged = np.concatenate([values[:1], values, values[-1:]])
    # The median of three, in a tenth of the time that np.median takes.
    lower, upper = np.minimum(edged[:-2], values), np.maximum(edged[:-2], values)
    middle = np.maximum(lower, np.minimum(upper, edged[2:]))
    # The range of each cycle; a cycle that is cut at its edges turns in one beside it.
    starts = np.arange(0, len(values), math.ceil(2.0 * math.pi / turn))
    swing = np.maximum.reduceat(middle, starts) - np.minimum.reduceat(middle, starts)
    edged = np.concatenate([swing[:1], swing, swing[-1:]])
    amplitude = 0.5 * np.maximum(np.maximum(edged[:-2], edged[2:]), swing)
    lasts = np.diff(np.append(starts, len(values)))
    allowed = 1.5 * np.repeat(amplitude, lasts) * (1.0 - math.cos(min(turn, math.pi)))
    return np.where(np.abs(values - middle) > allowed, middle, values)


def half_cycles(
    time_s: FloatArray, values: FloatArray, least: float, half_period_s: float
) -> HalfCycles:
    """Read off the half cycles whose swing exceeds `least`."""
    time, smooth = thinned(time_s, values, half_period_s)
    # Mains hum may be left, which is slow beside the readings and no noise of theirs.
    least = max(least, SEEN * noise_rms(smooth, quieter=0.1))
    turns = without_ripples(smooth, find_extremes(smooth, least))
    # The last one found is where the record happens to end, or any point of the final rest.
    ending = float(np.abs(np.diff(smooth[turns[-2:]])).sum())
    turns = turns[:-1]
    extremes, middle_s = np.empty(len(turns)), np.empty(max(len(turns) - 1, 0))
    _read_off(np.ascontiguousarray(time), smooth, turns, extremes, middle_s)
    return HalfCycles(
        turn_time_s=time[turns],
        turn=extremes,
        swing=np.abs(np.diff(extremes)),
        middle_s=middle_s,
        step=least,
        ending=ending,
    )


@kernel()
def _read_off(
    time: FloatArray, values: FloatArray, turns: IntArray, crest: FloatArray, middle_s: FloatArray
) -> None:
    """Fill in values at the turning points, and when each swing passes its middle the last time.

    The values are from the parabola through three samples about each: with 16 samples a cycle the
    largest sample lies up to 2 % below the turning point, and now more, now less, as if the
    amplitude were held up.
    """
    for k in range(turns.size):
        at = min(max(turns[k], 1), values.size - 2)
        before, after = values[at - 1] - values[at], values[at + 1] - values[at]
        bend = before + after
        crest[k] = values[turns[k]]
        # No farther than the parabola of a turning point between even samples can go.
        if at == turns[k] and bend != 0.0:
            limit = 0.125 * abs(bend)
            rise = -((after - before) ** 2) / (8.0 * bend)
            crest[k] += min(max(rise, -limit), limit)
    for k in range(middle_s.size):
        start, stop = turns[k], turns[k + 1]
        middle = 0.5 * (values[start] + values[stop])
        # Noise alone ends where it began, and passes nothing.
        middle_s[k] = 0.5 * (time[start] + time[stop])
        for i in range(start, stop):
            if (values[i] > middle) != (values[i + 1] > middle):
                share = (middle - values[i]) / (values[i + 1] - values[i])
                middle_s[k] = time[i] + share * (time[i + 1] - time[i])


_LARGER: Final = 0.1
"""Of the range, from which a swing counts among the larger ones: a tenth of the largest."""


def larger_half_cycles(time_s: FloatArray, values: FloatArray) -> HalfCycles | None:
    """Read off the half cycles of any column of readings; ``None`` where there are few."""
    good = np.isfinite(values) & np.isfinite(time_s)
    time_s, values = time_s[good], values[good]
    least = _LARGER * _range(values) if len(values) else 0.0
    half = usual_half_period(time_s, values) if least > 0.0 else None
    if not half or len(cycles := half_cycles(time_s, values, least, half)) <= LEAST_HALF_CYCLES:
        return None
    if cycles.turn_time_s[0] - time_s[0] >= half / _PER_HALF_CYCLE:
        return cycles
    # A swing that was cut off at the first reading is no half cycle.
    turn_time_s, turn = cycles.turn_time_s[1:], cycles.turn[1:]
    swing, middle_s = cycles.swing[1:], cycles.middle_s[1:]
    return HalfCycles(turn_time_s, turn, swing, middle_s, cycles.step, cycles.ending)


def periods(time_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Find the periods and the amplitudes of the larger cycles of any column of readings.

    Returns
    -------
    periods, amplitudes
        From each passage of the middle to the next but one, shape (n,); empty where there are few.
    """
    if (cycles := larger_half_cycles(time_s, values)) is None:
        return np.empty(0), np.empty(0)
    lasted = cycles.middle_s[2:] - cycles.middle_s[:-2]
    size = 0.25 * (cycles.swing[:-2] + cycles.swing[1:-1])
    usual = np.abs(lasted - np.median(lasted)) < 0.6 * np.median(lasted)
    return lasted[usual], size[usual]
