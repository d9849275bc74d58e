"""A first look: alternating extremes, numbered, with no model of the motion."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.turning_points.loops import count_half_cycles, find_extremes
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray, IntArray

_ENOUGH: Final = 24
"""Readings in a half cycle that a first look needs."""
_LOOK: Final = 200_000


class Rough(NamedTuple):
    """Extremes of the readings: their half cycle's number, time, side and value."""

    number: IntArray
    time_s: FloatArray
    side: IntArray
    value: FloatArray
    level: float


def rough_half_cycles(samples: Samples) -> tuple[Rough, int]:
    """Find and number the extremes of a decay.

    Returns
    -------
    rough, stride
        The extremes, and the stride between readings that is enough for a first look.
    """
    least = max(7.0 * samples.noise_rms, 1.5 * (samples.step or 0.0))
    if samples.counts:
        least = 40.0 * samples.noise_rms
    piece = samples.values[:_LOOK]
    start = 0.15 * float(piece.max() - piece.min())
    stride = 1
    if not samples.counts:
        index, _ = find_extremes(piece[: len(piece) // 8], least, start=start)
        if len(index) > 3:
            stride = max(1, int(np.median(np.diff(index))) // _ENOUGH)
    index, first = find_extremes(samples.values, least, start=start, stride=stride)
    time, value = samples.time_s[index], samples.values[index]
    side = first * (1 - 2 * (np.arange(len(index)) % 2))
    if len(index) < 3:
        return Rough(np.arange(len(index)), time, side, value, float(np.median(piece))), stride
    whole, gap_before = _beside_gaps(samples.time_s, index)
    time, value, side, gap_before = time[whole], value[whole], side[whole], gap_before[whole]
    number = np.zeros(len(time), dtype=np.int64)
    usual = float(np.median(np.diff(time[:6])))
    cut = slice(0, count_half_cycles(time, side, gap_before, usual, number))
    return Rough(number[cut], time[cut], side[cut], value[cut], _level(value[cut])), stride


def _beside_gaps(time: FloatArray, index: IntArray) -> tuple[np.ndarray, IntArray]:
    """Which extremes stand clear of gaps in the data; and which have one before them."""
    half_period = float(np.median(np.diff(time[index[: min(12, len(index))]])))
    # In pieces: the differences of all times would be another record in memory.
    piece = 1 << 20
    gaps = np.concatenate(
        [
            np.flatnonzero(np.diff(time[i : i + piece + 1]) > 0.4 * half_period) + i
            for i in range(0, len(time), piece)
        ]
    )
    clear = (index > 1) & (index < len(time) - 2)
    for gap in gaps:
        # An extreme at the very edge of a gap is where the data end, not where they turn.
        clear &= (index != gap) & (index != gap + 1)
    before = np.searchsorted(gaps, index)
    return clear, (np.diff(before, prepend=before[:1]) > 0).astype(np.int64)


def _level(value: FloatArray) -> float:
    """Middle of the swings, free of a steady decay: (e + 2 e' + e'')/4."""
    if len(value) < 3:
        return float(np.mean(value))
    return float(np.median(0.25 * (value[:-2] + 2.0 * value[1:-1] + value[2:])))
