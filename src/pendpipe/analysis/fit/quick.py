"""A quick start of the waveform fit, for records that are plain.

Evenly sampled, many readings in a half cycle, a constant level, small losses and no tail in
the noise: one pass of the loop that measures long records (`turning_points.tracking`), one
linear solution of Eq. 13's integral, and the fit itself can begin. Whether the record was
plain, the fit shows: what Eq. 8 and white noise don't explain is measured again with care.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.period import period_excess
from pendpipe.analysis.fit.start import Start
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.blocks import even_interval
from pendpipe.analysis.turning_points.compiled import extremes
from pendpipe.analysis.turning_points.plain import decay, track
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray, IntArray

_HEADS: Final = (1 << 11, 1 << 14, 1 << 17)
"""Readings in which the first half cycles are looked for."""
_FEWEST: Final = 16
"""Half cycles."""
_SAMPLED: Final = 12.0
"""Readings in a half cycle."""
_LONGEST: Final = 1 << 20
_SLIGHT: Final = 0.05
"""Losses over omega: Q above 10."""
_SLACK: Final = 0.02
"""Of a half period, by which a turning point may lie outside the readings."""


class Quick(NamedTuple):
    """Rough turning points, and where the fit begins."""

    points: TurningPoints
    start: Start


class _First(NamedTuple):
    """The first whole half cycle, in readings."""

    at: float
    half_period: float
    side: float
    level: float


def quick_start(samples: Samples) -> Quick | None:
    """Look at a record once; None if it isn't plain."""
    if samples.counts or not 4 * _FEWEST * _SAMPLED <= len(samples) <= _LONGEST:
        return None
    interval = even_interval(samples.time_s)
    if interval is None:
        return None
    first = None
    for length in (*_HEADS, len(samples)):
        first = _first_place(samples, samples.values[:length])
        if first is not None or length >= len(samples):
            break
    if first is None or first.half_period < _SAMPLED:
        return None
    start_s, stop_s = float(samples.time_s[0]), float(samples.time_s[-1])
    columns = np.empty((5, int(1.1 * len(samples) / first.half_period) + 16))
    begin = [
        start_s, interval, start_s + first.at * interval, first.half_period * interval,
        first.side, first.level, samples.noise_rms, 0.0, 0.0, 0.0,
    ]  # fmt: skip
    count, _, _ = track(samples.values, np.array(begin), columns, 0, columns.shape[1])
    if count < _FEWEST:
        return None
    if stop_s - columns[0, count - 1] > 1.6 * first.half_period * interval:
        return None
    return _begun(samples, columns[:, :count])


def _first_place(samples: Samples, values: FloatArray) -> _First | None:
    """Find the first half cycles by their extremes; None if there are fewer than ten."""
    least = max(7.0 * samples.noise_rms, 1.5 * (samples.step or 0.0))
    index, side = extremes(values, 1, 0.15 * float(values.max() - values.min()), least)
    if len(index) < 10:
        return None
    # The last may still grow. A line through the places; the slope from halves of them.
    count = min(len(index) - 1, 24) // 2 * 2
    peak = values[index[:count]]
    level = 0.25 * float((peak[:-2] + 2.0 * peak[1:-1] + peak[2:]).sum()) / (count - 2)
    at, half_period = _halves(index[:count])
    while at < 0.5 * half_period:
        at, side = at + half_period, -side
    # The loop itself knows them better.
    columns = np.empty((5, count))
    begin = [0.0, 1.0, at, half_period, side, level, samples.noise_rms, 0.0, 0.0, 0.0]
    known, _, _ = track(values, np.array(begin), columns, 0, count)
    if known < 8:
        return None
    return _First(*_halves(columns[0, : known // 2 * 2]), float(side), float(columns[4, 0]))


def _halves(places: FloatArray | IntArray) -> tuple[float, float]:
    """First place and spacing of an even number of evenly spaced ones."""
    half = len(places) // 2
    early, late = float(places[:half].sum()) / half, float(places[half:].sum()) / half
    spacing = (late - early) / half
    return early - 0.5 * (half - 1) * spacing, spacing


def _begun(samples: Samples, columns: FloatArray) -> Quick | None:
    """Turn measured half cycles into turning points and the waveform's parameters."""
    y, noise = np.abs(columns[2]), samples.noise_rms
    start_s, stop_s = float(samples.time_s[0]), float(samples.time_s[-1])
    found = decay(columns[0], y, float(columns[3, 0]))
    a, b, c, y0, half_period, first_s = found.tolist()
    if not (math.isfinite(sum(found.tolist())) and half_period > 0.0):
        return None
    omega = math.pi / half_period
    if not a * y0 + b + c / float(y[-1]) < _SLIGHT * omega:
        return None
    # The half cycles at the ends that are not whole.
    front = max(0, math.floor((first_s - start_s) / half_period + _SLACK))
    back = max(0, math.floor((stop_s - columns[0, -1]) / half_period + _SLACK))
    before = max(1, math.ceil((first_s - start_s) / half_period + 0.05))
    angle, when, side = y0, first_s, math.copysign(1.0, float(columns[2, 0]))
    earlier: list[tuple[float, float]] = []
    for _ in range(before):
        last = angle
        for _ in range(4):
            middle = 0.5 * (last + angle)
            angle = last + half_period * ((a * middle + b) * middle + c)
        between = 0.5 * (last + angle)
        when -= half_period * (1.0 + float(period_excess(between, omega, a, b, c, 0.5)))
        side = -side
        earlier.insert(0, (when, side * angle))
    last_s, end = float(columns[0, -1]), float(columns[2, -1])
    later = [(last_s + (k + 1) * half_period, end * (-1.0) ** (k + 1)) for k in range(back)]
    ends = [earlier[before - front :], later]
    time_s, angle_rad = (
        np.array([*(pair[row] for pair in ends[0]), *inner, *(pair[row] for pair in ends[1])])
        if front or back else inner
        for row, inner in enumerate((columns[0], columns[2]))
    )  # fmt: skip
    one = np.ones(len(time_s))
    points = TurningPoints(
        np.arange(len(time_s)), time_s, (0.01 * half_period) * one, angle_rad,
        float(columns[3, 0]) * one, float(columns[4, 0]) * one, noise_rms_rad=noise,
        step_rad=samples.step or 0.0, start_s=start_s, stop_s=stop_s, samples=len(samples),
        unit=samples.unit,
    )  # fmt: skip
    level = float(columns[4].sum()) / columns.shape[1]
    value = np.array([a, b, c, omega, side * angle, when, level, 0.5])
    return Quick(points, Start(value, before - front, len(points), ()))
