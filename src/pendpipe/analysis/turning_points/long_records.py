"""Records of many millions of readings, in little time and memory.

A plain, evenly sampled record is followed in one pass by a phase-locked loop of least squares:
every half cycle is fitted with a cosine and a sine over an odd number of readings about the
one nearest to its expected turning. There the two are orthogonal, so that the fit is two
products with tables made once a block; the fraction of a reading between that one and the
turning is made up for by turning the result, cos(p + q) = cos p cos q - sin p sin q.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.noise import scatter
from pendpipe.analysis.turning_points.measure import Samples, cosine_sine, loss_rates
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.kernel import Matrix, kernel
from pendpipe.errors import NotAnalysableError

LEVEL_BLOCK = 256
"""Half cycles over which level and period are one number each."""
_LANES = 16
"""Tables are filled up with zeros to a multiple of this."""
_BATCH = 8
"""Half cycles that are measured where the loop expects them, before it looks where they were.

One by one each would wait for the one before, and the processor with them."""
_FOLLOW, _LEARN = 0.7, 0.3
"""Share of a batch's mean phase error that moves the next, and that changes the period."""
_LOST = 0.3
"""Phase error in rad at which the lock counts as lost."""
_CLEAR = 8.0
"""Standard deviations by which an amplitude must stand out for its phase to be used."""
_SAMPLED = 16
"""Every how many-th half cycle tells the noise."""


@kernel(any_order=True)
def _products(piece: FloatArray, tables: Matrix, level: float) -> tuple[float, float, float]:
    """Sums of readings less level times each of the tables."""
    even, odd, rest = 0.0, 0.0, 0.0
    cosine, sine, rests = tables[0], tables[1], tables[2]
    for i in range(piece.size):
        x = piece[i] - level
        even += x * cosine[i]
        odd += x * sine[i]
        rest += x * rests[i]
    return even, odd, rest


@kernel(any_order=True)
def _squares(piece: FloatArray, level: float) -> float:
    """Sum of the squares of readings less level."""
    total = 0.0
    for i in range(piece.size):
        total += (piece[i] - level) ** 2
    return total


@kernel(any_order=True)
def _fit_batch(
    values: FloatArray,
    first: float,
    period: float,
    reach: int,
    step: float,
    tables: Matrix,
    level: float,
    count: int,
    found: Matrix,
) -> int:
    """Fit the half cycles expected at the readings `first`, `first` + `period`, ...

    Fills `count` columns of `found` with factors of cosine and sine about the expected turning,
    and the sum of what they leave; returns how many lie among the readings.
    """
    number, length = 2 * reach + 1, _length(reach)
    for j in range(count):
        at = first + j * period
        middle = math.floor(at + 0.5)
        lo = middle - reach
        if lo < 0 or lo + number > values.size:
            return j
        last = lo + length if lo + length <= values.size else lo + number
        even, odd, rest = _products(values[lo:last], tables, level)
        cosine, sine = cosine_sine((middle - at) * step)
        found[0, j] = even * cosine - odd * sine
        found[1, j] = even * sine + odd * cosine
        found[2, j] = rest
    return count


@kernel()
def _length(reach: int) -> int:
    """Return how many numbers of a table are used: a loop over them has no rest."""
    return (2 * reach + _LANES) // _LANES * _LANES


@kernel()
def _fill_tables(reach: int, step: float, tables: Matrix) -> tuple[float, float, float]:
    """Write the weights of the readings from -reach to reach about a turning, `step` apart.

    Rows of `tables`: for the cosine's factor, the sine's, and the sum of what they leave.

    Returns
    -------
    flat, even, odd
        Sums of the cosine, its square, and the sine's square.
    """
    number = 2 * reach + 1
    flat, even, odd = 0.0, 0.0, 0.0
    for i in range(_length(reach)):
        cosine = math.cos((i - reach) * step) if i < number else 0.0
        sine = math.sin((i - reach) * step) if i < number else 0.0
        tables[0, i], tables[1, i] = cosine, sine
        flat, even, odd = flat + cosine, even + cosine * cosine, odd + sine * sine
    for i in range(_length(reach)):
        cosine = tables[0, i]
        tables[2, i] = 1.0 - cosine * (flat / even) if i < number else 0.0
        tables[0, i] = cosine / even
        tables[1, i] /= odd
    return flat, even, odd


@kernel()
def _track(
    values: FloatArray,
    start: FloatArray,
    table: Matrix,
    result: FloatArray,
    found: Matrix,
    tables: Matrix,
) -> int:
    """Fit half cycle after half cycle of evenly spaced readings, each placed by those before it.

    Parameters
    ----------
    values
        The readings.
    start
        Time of the first reading, interval; time of turning, half period, side (+1 above the
        level) and level of the first half cycle; rms of one reading; a, b, c of Eq. 13, so
        small that they shift times only (see `measure.py`).
    table
        To be filled: time, its sd, signed angle, its sd, level; shape (5, n). The level is
        estimated anew every `LEVEL_BLOCK` half cycles.
    result
        To be filled: the sum of squares about some of the fits, and its degrees of freedom.
    found, tables
        Room to work in; the loop ends if the half period outgrows its tables.

    Returns
    -------
    int
        Half cycles measured: up to the end, or to where the lock is lost.
    """
    start_s, interval_s, centre_s, half_period_s = start[0], start[1], start[2], start[3]
    side, level, noise, rates = start[4], start[5], start[6], start[7:10]
    end, count, residual, freedom = table.shape[1], 0, 0.0, 0.0
    period, locked = half_period_s, True
    while locked and count < end:
        w = math.pi / half_period_s
        reach = int(0.5 * (half_period_s / interval_s - 1.0))
        number = 2 * reach + 1
        if _length(reach) > tables.shape[1]:
            break
        flat, even, odd = _fill_tables(reach, w * interval_s, tables)
        sd, late_sd = noise / math.sqrt(even), noise / (math.sqrt(odd) * w)
        second, in_time = noise * noise / odd, 1.0 / w
        score, block = 0.0, count
        while locked and count < end and count - block < LEVEL_BLOCK:
            at = (centre_s - start_s) / interval_s
            size = _fit_batch(
                values,
                at,
                period / interval_s,
                reach,
                w * interval_s,
                tables,
                level,
                min(_BATCH, end - count),
                found,
            )
            if size > 0 and count % _SAMPLED == 0:
                lo = math.floor(at + 0.5) - reach
                residual += _squares(values[lo : lo + number], level)
                # About the reading, where cosine and sine are orthogonal: turned back.
                back = (math.floor(at + 0.5) - at) * w * interval_s
                about = found[0, 0] * math.cos(back) + found[1, 0] * math.sin(back)
                aside = found[1, 0] * math.cos(back) - found[0, 0] * math.sin(back)
                residual -= about * about * even + aside * aside * odd
                freedom += number - 2
            total, measured = 0.0, 0
            for j in range(size):
                a, b = side * found[0, j], side * found[1, j]
                inverse = 1.0 / max(a, 1e-300)
                late = b * inverse
                if not (a > _CLEAR * sd and abs(late) < _LOST):
                    break
                shift = (rates[0] * a + 0.75 * rates[1] + rates[2] * inverse) * in_time
                table[0, count] = centre_s + j * period + (late - shift) * in_time
                table[1, count] = late_sd * inverse
                table[2, count] = side * (a + 0.5 * (b * late - second * inverse))
                score += found[2, j]
                total += late
                count += 1
                measured += 1
                side = -side
            locked = measured == _BATCH
            if measured > 0:
                late = total / measured
                centre_s += measured * period + _FOLLOW * late / w
                period += _LEARN * late / (w * _BATCH)
        if count > block:
            shift = score / ((count - block) * (number - flat * flat / even))
            level += shift
            for k in range(block, count):
                table[2, k] -= flat / even * shift
                table[3, k] = sd
                table[4, k] = level
        half_period_s = period
    result[0], result[1] = residual, freedom
    return count


_PIECEWISE: Final = "a long record: the level is one number within some hundred half cycles only"
_PLAIN: Final = 1.03
"""Noise over another that counts as the same, as far as some thousand readings tell it."""
_LARGEST: Final = 0.2
"""Noise about the fitted half cycles over that of neighbours, and amplitude (rad or m): where
both are small, the half cycles are cosines with their losses, and one pass will do."""
_SLIGHT: Final = 3e-4
"""Losses over omega below which the half cycles are cosines (Q above 1700)."""
_FEWEST: Final = 16
"""Half cycles from which a record is followed, and that may be missing at its end."""


def follow(
    samples: Samples, measure: Callable[[Samples], TurningPoints], length: int
) -> TurningPoints | None:
    """Follow a plain, evenly sampled record in one pass.

    Parameters
    ----------
    samples
        The readings.
    measure
        Measures the beginning.
    length
        How many readings that has.

    Returns
    -------
    TurningPoints
        As of the whole; the level is constant over some hundred half cycles, so it is said to
        wander. None where the record isn't plain, or is not so to its end.
    """
    interval = even_interval(samples.time_s)
    head = None if interval is None else _start(samples, measure, length)
    if interval is None or head is None:
        return None
    half_period = 0.5 / head.apparent_frequency_hz
    columns = np.empty((5, int(1.02 * len(samples) * interval / half_period) + 64))
    begin = [
        float(samples.time_s[0]),
        interval,
        float(head.time_s[1]),
        half_period,
        float(head.side[1]),
        float(head.level_rad[0]),
        head.noise_rms_rad,
        *_rates(head),
    ]
    values, result = np.ascontiguousarray(samples.values, dtype=np.float64), np.empty(2)
    tables = np.empty((3, int(1.5 * half_period / interval) + 2 * _LANES))
    count = _track(values, np.array(begin), columns, result, np.empty((3, _BATCH)), tables)
    if count < _FEWEST or columns[0, count - 1] < samples.time_s[-1] - _FEWEST * half_period:
        return None
    noise = scatter(float(result[0]), float(result[1]), samples.step)
    # The beginning was measured with what harmonics it has.
    if noise > _PLAIN * head.noise_rms_rad:
        return None
    columns[[1, 3], :count] *= noise / head.noise_rms_rad
    time, time_sd, angle, angle_sd, level = columns[:, :count]
    # A half cycle alone tells 0.19 of what its readings would say of a level alone.
    told = 0.19 * half_period / interval * min(LEVEL_BLOCK, count)
    return replace(
        head,
        half_cycle=np.arange(count),
        time_s=time,
        time_sd_s=time_sd,
        angle_rad=angle,
        angle_sd_rad=angle_sd,
        level_rad=level,
        level_sd_rad=noise / math.sqrt(told),
        noise_rms_rad=noise,
        stop_s=float(samples.time_s[-1]),
        samples=len(samples),
        wanders=True,
        notes=(*head.notes, _PIECEWISE),
    )


def _start(
    samples: Samples, measure: Callable[[Samples], TurningPoints], length: int
) -> TurningPoints | None:
    """The turning points from which a record is followed; None if it isn't plain there."""
    part = replace(samples, time_s=samples.time_s[:length], values=samples.values[:length])
    try:
        first = measure(part)
    except NotAnalysableError:
        # Of few half cycles, each of very many readings, it is not told.
        return None
    plain = first.noise_rms_rad < _PLAIN * max(samples.noise_rms, 1e-300)
    amplitude = float(first.amplitude_rad[0])
    if not plain or amplitude > _LARGEST or len(first) < _FEWEST:
        return None
    losses = float(_rates(first) @ [amplitude, 1.0, 1.0 / amplitude])
    return first if losses / (2.0 * np.pi * first.apparent_frequency_hz) < _SLIGHT else None


def _rates(points: TurningPoints) -> FloatArray:
    return loss_rates(points.time_s, points.amplitude_rad, points.angle_sd_rad)


def even_interval(time_s: FloatArray) -> float | None:
    """The interval between readings; None if they are not evenly spaced throughout."""
    last = len(time_s) - 1
    interval = float(time_s[-1] - time_s[0]) / last
    every = max(1, last // 2048)
    some = time_s[::every]
    off = some - (time_s[0] + interval * every * np.arange(len(some)))
    return interval if float(np.abs(off).max()) < 0.01 * interval else None
