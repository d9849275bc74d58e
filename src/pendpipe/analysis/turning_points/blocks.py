"""Records of many millions of readings: a piece at a time, in bounded memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.noise import quantisation_rms
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.analysis.turning_points.shape import loss_rates
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.analysis.turning_points.tracking import LEVEL_BLOCK, track
from pendpipe.arrays import FloatArray
from pendpipe.errors import NotAnalysableError

BLOCK: Final = 1 << 21
"""Readings in a piece; its working memory is some MB."""
_OVERLAP: Final = 3.0
"""Half cycles that neighbouring pieces share, so that none is cut in two."""
_PIECEWISE: Final = "a long record: the level is one number within a piece only"
_PLAIN: Final = 1.03
_LARGEST: Final = 0.2
"""Noise about the fitted half cycles over that of neighbours, and amplitude (rad or m): where
both are small, the half cycles are cosines with their losses, and one pass will do."""
_SLIGHT: Final = 3e-4
"""Losses over omega below which the half cycles are cosines (Q above 1700)."""


def in_blocks(
    samples: Samples, measure_block: Callable[[Samples], TurningPoints], block: int = BLOCK
) -> TurningPoints:
    """Measure a long record piece by piece, and join the tables.

    Parameters
    ----------
    samples
        The readings.
    measure_block
        Measures one piece.
    block
        Readings in a piece.

    Returns
    -------
    TurningPoints
        As of the whole; the level is constant within a piece, so it is said to wander.
        The record ends with the last piece whose motion is seen.
    """
    tracked = _tracked(samples, measure_block, block)
    if tracked is None:
        return _joined(list(_pieces(samples, measure_block, block)), samples)
    half_period = 0.5 / tracked.apparent_frequency_hz
    if samples.time_s[-1] - tracked.time_s[-1] < 16.0 * half_period:
        return replace(
            tracked,
            stop_s=float(samples.time_s[-1]),
            samples=len(samples),
            wanders=True,
            notes=(*tracked.notes, _PIECEWISE),
        )
    return _joined([tracked, *_pieces(samples, measure_block, block, tracked)], samples)


def _tracked(
    samples: Samples, measure_block: Callable[[Samples], TurningPoints], block: int
) -> TurningPoints | None:
    """Follow a plain, evenly sampled record in one pass; None if it isn't one."""
    interval = even_interval(samples.time_s)
    head = None if interval is None else _start(samples, measure_block, block // 64)
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
    count, square, freedom = track(samples.values, np.array(begin), columns)
    if count < 16:
        return None
    noise = max(float(np.sqrt(square / freedom)), quantisation_rms(samples.step))
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
    )


def _start(
    samples: Samples, measure_block: Callable[[Samples], TurningPoints], length: int
) -> TurningPoints | None:
    """The turning points from which a record is followed; None if it isn't plain there."""
    first = measure_block(
        replace(samples, time_s=samples.time_s[:length], values=samples.values[:length])
    )
    plain = first.noise_rms_rad < _PLAIN * max(samples.noise_rms, 1e-300)
    amplitude = float(first.amplitude_rad[0])
    if not plain or amplitude > _LARGEST or len(first) < 16:
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


def _pieces(
    samples: Samples,
    measure_block: Callable[[Samples], TurningPoints],
    block: int,
    before: TurningPoints | None = None,
) -> Iterator[TurningPoints]:
    """Measure each piece; of the overlap, each keeps its own half."""
    start, overlap, last = 0, 0, -np.inf
    if before is not None:
        half_period = float(np.median(np.diff(before.time_s[-64:])))
        last = float(before.time_s[-1]) + 0.5 * half_period
        start = int(np.searchsorted(samples.time_s, last))
    while start < len(samples):
        stop = min(start + block, len(samples))
        piece = slice(max(start - overlap, 0), stop)
        try:
            points = measure_block(
                replace(samples, time_s=samples.time_s[piece], values=samples.values[piece])
            )
        except NotAnalysableError:
            if start == 0 and before is None:
                raise
            return
        half_period = float(np.median(np.diff(points.time_s)))
        end = float(samples.time_s[stop - 1])
        final = stop == len(samples)
        keep = (points.time_s > last) & (final | (points.time_s < end - half_period))
        kept = points.chosen(keep)
        if len(kept) == 0:
            return
        yield kept
        last = float(kept.time_s[-1]) + 0.5 * half_period
        overlap = int(_OVERLAP * half_period / (end - float(samples.time_s[piece][0])) * block)
        start = stop


def _joined(pieces: list[TurningPoints], samples: Samples) -> TurningPoints:
    """Join tables, and number their half cycles on."""
    numbers, last = [], 0
    for k, piece in enumerate(pieces):
        own = piece.half_cycle - piece.half_cycle[0]
        if k:
            before = pieces[k - 1]
            half_period = float(np.median(np.diff(piece.time_s)))
            gap = float(piece.time_s[0] - before.time_s[-1]) / half_period
            odd = piece.side[0] != before.side[-1]
            # The nearest whole number that agrees with the sides.
            step = 2 * round(0.5 * (gap - odd)) + int(odd)
            own = own + last + max(step, 2 - int(odd))
        numbers.append(own)
        last = int(own[-1])
    weights = [len(piece) for piece in pieces]

    def mean(name: str) -> float:
        return float(np.average([getattr(p, name) for p in pieces], weights=weights))

    return replace(
        pieces[0],
        half_cycle=np.concatenate(numbers),
        time_s=np.concatenate([piece.time_s for piece in pieces]),
        time_sd_s=np.concatenate([piece.time_sd_s for piece in pieces]),
        angle_rad=np.concatenate([piece.angle_rad for piece in pieces]),
        angle_sd_rad=np.concatenate([piece.angle_sd_rad for piece in pieces]),
        level_rad=np.concatenate([piece.level_rad for piece in pieces]),
        level_sd_rad=mean("level_sd_rad"),
        level_coupling=mean("level_coupling"),
        noise_rms_rad=mean("noise_rms_rad"),
        stop_s=float(samples.time_s[-1]),
        samples=len(samples),
        wanders=True,
        notes=(*pieces[0].notes, _PIECEWISE),
    )
