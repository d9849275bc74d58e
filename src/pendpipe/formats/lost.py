"""The fact of lost readings: what stands in their place, and spikes."""

from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pendpipe.arrays import BoolArray, FloatArray, IntArray
from pendpipe.facts import Fact, How

_BESIDE: Final = 5
"""Readings to each side of one that may stand for a lost one."""
_LEAST: Final = 0.05
"""Of the span, by which it stands out at least."""
_SPARSE: Final = 0.3
"""Share of readings beyond both their neighbours by that much, from which all may be turning
points: there are seven or fewer in a cycle."""


def lost_readings(
    given: FloatArray, *, swings: bool, factor: float = 1.0
) -> tuple[FloatArray, list[Fact]]:
    """Make NaN of readings that were lost, and say which these are.

    Parameters
    ----------
    given
        As the file has them, shape (n,); NaN of empty cells.
    swings
        Whether they are a swing that a sensor may lose: a converter of an instrument loses no
        echo, nor does what is no swing.
    factor
        The size of the file's unit.
    """
    values = without_spikes(without_marks(given)) if swings else without_marks(given)
    missing = np.isnan(values)
    lost, many = given[missing & ~np.isnan(given)] / factor, int(missing.sum())
    marks = ", ".join(f"{mark:.6g}" for mark in np.unique(lost)[:3])
    how: How = "shown" if lost.size else "stated"
    told = (
        (lost.size, marks, f"{lost.size} reading(s) that stand out ({marks}): taken as lost"),
        (many, f"{many}", f"{many} row(s) without a reading, marked missing"),
    )
    return values, [Fact("lost readings", value, how, said) for some, value, said in told if some]


@np.errstate(invalid="ignore", over="ignore")
def without_marks(values: FloatArray) -> FloatArray:
    """Make NaN of readings that a sensor, or a program, gives in place of a lost one.

    What instruments that speak SCPI write for an overload (9.9E+37), and sentinels.
    """
    overload = (np.abs(values) >= _OVERLOAD) & (np.abs(values) < 1.1 * _OVERLOAD)
    return _without_codes(np.where(overload, np.nan, values) if overload.any() else values)


def _without_codes(values: FloatArray) -> FloatArray:
    """Make NaN of readings far from the others.

    Such a reading leaves the range of its neighbours, and comes back, by more than that range. It
    is lost where the same number (``0``, ``-999``) does so three times, or where it is also beyond
    all others by more than they span. What jumps over the whole span of the others has wrapped.
    """
    good, starts, level = _levels(values)
    if len(level) < 2 * _BESIDE:
        return values
    step = np.diff(level)
    turns = 1 + np.flatnonzero(step[:-1] * step[1:] < 0.0)
    rest = np.delete(level, turns)
    span, middle = float(np.ptp(rest)), 0.5 * float(rest.min() + rest.max())
    floor = max(_LEAST * span, 3.0 * np.abs(step).min())
    at = turns[np.minimum(np.abs(step[turns - 1]), np.abs(step[turns])) > floor]
    if len(at) > _SPARSE * len(level):
        return values
    around = sliding_window_view(np.pad(level, _BESIDE, mode="edge"), 2 * _BESIDE + 1)[at]
    own = level[at]
    other = around != own[:, None]
    low = np.min(around, axis=1, where=other, initial=np.inf)
    high = np.max(around, axis=1, where=other, initial=-np.inf)
    beyond = np.maximum(low - own, own - high)
    clear = beyond / np.maximum(high - low, floor)
    off = np.abs(own - middle)
    odd = (clear > 1.0) & ((off > 0.75 * span) | (beyond < 0.75 * span))
    number, often = np.unique(own[odd], return_counts=True)
    lost = np.zeros(len(level), dtype=bool)
    lost[at[np.isin(own, number[often > 2]) | (odd & (off > 1.5 * span))]] = True
    left = _left(values, good, starts, lost)
    if not 0 < np.isnan(left).sum() - np.isnan(values).sum() < 0.2 * len(values):
        return values
    # One beside another is seen when that is gone.
    return _without_codes(left)


def _levels(values: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Give the finite rows; of these the first of each number that stands on end; the numbers."""
    good = np.flatnonzero(np.isfinite(values))
    starts = np.flatnonzero(np.diff(values[good], prepend=np.nan) != 0.0)
    return good, starts, values[good[starts]]


def _left(values: FloatArray, good: IntArray, starts: IntArray, lost: BoolArray) -> FloatArray:
    """Make NaN of all rows of the numbers that are lost."""
    left = values.copy()
    left[good[np.repeat(lost, np.diff(np.append(starts, len(good))))]] = np.nan
    return left


_OVERLOAD: Final = 9.89e37
"""What instruments that speak SCPI write for infinity is 9.9E+37, for no number 9.91E+37."""
_LONGEST_SPIKE: Final = 8
_SPIKE: Final = 0.02
"""Of the span, by which a spike is off at least: less costs a fit no more than its noise."""
_NEAR: Final = 10
_FASTER: Final = 6.0
"""Times what a cubic misses of the ten readings before and behind, by which a spike is off."""
_SPIKE_SD: Final = 8.0
"""Of what a cubic between the neighbours misses, by which the rows of a spike are all off: of
10^6 readings with noise none is by chance."""


def without_spikes(values: FloatArray) -> FloatArray:
    """Make NaN of up to eight rows on end that leave a smooth swing and come back to it.

    They all lie on one side of the cubic through two rows before and two behind, by more than
    `_SPIKE` of the span and `_SPIKE_SD` of what such a cubic usually misses; and they come back
    by as much as they left.
    """
    left, before = values, None
    while left is not before:  # one beside another is seen when that is gone
        left, before = _without_clear_spikes(left), left
    return (
        left
        if np.isnan(left).sum() - np.isnan(values).sum() < _MOST_SPIKES * len(values)
        else values
    )


def _without_clear_spikes(values: FloatArray) -> FloatArray:
    good, starts, x = _levels(values)
    if len(x) < 8 * _LONGEST_SPIKE:
        return values
    low, high = np.percentile(x, (0.5, 99.5))
    steps = np.abs(np.diff(x))
    # A converter's step is no spike.
    least = max(_SPIKE * float(high - low), 4.0 * float(steps.min()))
    begin = np.flatnonzero(steps > least) + 1
    usual = np.linspace(2, len(x) - _LONGEST_SPIKE - 3, 4000).astype(int)
    missed = np.abs(_off_cubic(x, np.arange(2, len(x) - 2), 1)[0]) if begin.size else steps
    beyond = np.pad(missed, _NEAR, mode="reflect")
    found: list[tuple[float, int, int]] = []
    for rows in range(1, _LONGEST_SPIKE + 1) if begin.size else ():
        at = begin[(begin > 1) & (begin + rows + 1 < len(x))]
        off = _off_cubic(x, at, rows)
        noise = float(np.median(np.abs(_off_cubic(x, usual, rows)))) / 0.6745
        side = np.abs(np.sign(off).sum(axis=0)) == rows
        size = np.abs(off).min(axis=0)
        # Beyond the step before it, and the one behind: those of the swing.
        step = np.diff(x)
        away, back = step[at - 1] - step[at - 2], step[at + rows - 1] - step[at + rows]
        least_step, most_step = np.sort(np.abs([away, back]), axis=0)
        returns = (away * back < 0.0) & (least_step > np.maximum(0.5 * size, 0.25 * most_step))
        # What lies between two spikes has a step before it, or behind.
        beside = np.maximum(steps[at - 2], steps[at + rows]) < 0.5 * size
        odd = side & returns & beside & (size > max(least, _SPIKE_SD * noise))
        odd &= np.abs(off).max(axis=0) < 0.75 * float(high - low)
        # Where few readings make a cycle, or noise comes in bursts, a cubic misses all of them.
        at, size, sides = at[odd], size[odd], np.arange(_NEAR)[:, None]
        near = [beyond[np.clip(at + k + sides, 0, len(beyond) - 1)] for k in (-4, rows + 1 + _NEAR)]
        odd = size > _FASTER * np.percentile(near, 80, axis=1).max(axis=0)
        found += [(big, first, rows) for big, first in zip(size[odd], at[odd], strict=True)]
    lost = np.zeros(len(x), dtype=bool)
    for _, first, rows in sorted(found, reverse=True):
        if not lost[first - 2 : first + rows + 2].any():
            lost[first : first + rows] = True
    return _left(values, good, starts, lost) if lost.any() else values


_MOST_SPIKES: Final = 0.02
"""Share of lost echoes beyond which nobody knows which of the readings are the swing."""


def _off_cubic(x: FloatArray, at: IntArray, rows: int) -> FloatArray:
    """How far some rows from each place on lie off the cubic about them, shape (rows, n)."""
    nodes, inside = np.array([-2, -1, rows, rows + 1]), np.arange(rows)
    weights = np.vander(inside, 4) @ np.linalg.inv(np.vander(nodes, 4))
    return np.asarray(x[at + inside[:, None]] - weights @ x[at + nodes[:, None]])
