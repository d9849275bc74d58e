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

from pendpipe.analysis.fit.quick_kernels import first_places, rates_and_release
from pendpipe.analysis.fit.start import Start
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.blocks import even_interval
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.analysis.turning_points.tracking import track

_HEADS: Final = (1 << 11, 1 << 14, 1 << 17)
"""Readings in which the first half cycles are looked for."""
_FEWEST: Final = 16
"""Half cycles."""
_SAMPLED: Final = 12.0
"""Readings in a half cycle."""
_LONGEST: Final = 1 << 20
_SLIGHT: Final = 0.05
"""Losses over omega: Q above 10."""
_ZERO: Final = np.zeros(3)


class Quick(NamedTuple):
    """Rough turning points, and where the fit begins."""

    points: TurningPoints
    start: Start


def quick_start(samples: Samples) -> Quick | None:
    """Look at a record once; None if it isn't plain."""
    if samples.counts or not 4 * _FEWEST * _SAMPLED <= len(samples) <= _LONGEST:
        return None
    interval = even_interval(samples.time_s)
    if interval is None:
        return None
    values, noise, first_s = samples.values, samples.noise_rms, float(samples.time_s[0])
    least = max(7.0 * noise, 1.5 * (samples.step or 0.0))
    for length in (*_HEADS, len(samples)):
        found, at, half_period, side, level = first_places(values[:length], least, noise)
        if found or length >= len(samples):
            break
    if not found or half_period < _SAMPLED:
        return None
    # Places are whole readings so far; the loop wants them in seconds.
    columns = np.empty((5, int(1.1 * len(samples) / half_period) + 16))
    count, _, _ = track(
        values, first_s, interval, first_s + at * interval, half_period * interval, side, level,
        _ZERO, noise, columns,
    )  # fmt: skip
    if count < _FEWEST:
        return None
    last_s = float(samples.time_s[-1])
    if last_s - columns[0, count - 1] > 1.6 * half_period * interval:
        return None
    numbers, table = rates_and_release(columns[:, :count], first_s, last_s)
    a, b, c, omega = (float(number) for number in numbers[:4])
    amplitude = np.abs(table[1])
    losses = a * amplitude[0] + b + c / amplitude[-1]
    if not (np.all(np.isfinite(numbers)) and losses < _SLIGHT * omega):
        return None
    half = math.pi / omega
    points = TurningPoints(
        np.arange(table.shape[1]), table[0], np.full(table.shape[1], 0.01 * half), table[1],
        np.full(table.shape[1], float(columns[3, 0])), np.full(table.shape[1], level),
        noise_rms_rad=noise, step_rad=samples.step or 0.0, start_s=first_s, stop_s=last_s,
        samples=len(samples), unit=samples.unit,
    )  # fmt: skip
    return Quick(points, Start(numbers[:8], int(numbers[8]), len(points), ()))
