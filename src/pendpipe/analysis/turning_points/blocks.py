"""Records of many millions of readings: a piece at a time, in bounded memory."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.noise import quantisation_rms
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.analysis.turning_points.shape import LossRates, loss_rates
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.analysis.turning_points.tracking import LEVEL_BLOCK, track
from pendpipe.arrays import FloatArray
from pendpipe.errors import NotAnalysableError

BLOCK: Final = 1 << 21
"""Readings in a piece; its working memory is some MB."""
_OVERLAP: Final = 3.0
"""Half cycles that neighbouring pieces share, so that none is cut in two."""
_CORES: Final = 4
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
            tracked, stop_s=float(samples.time_s[-1]), samples=len(samples), wanders=True,
            notes=(*tracked.notes, _PIECEWISE),
        )  # fmt: skip
    return _joined([tracked, *_pieces(samples, measure_block, block, tracked)], samples)


def _tracked(
    samples: Samples, measure_block: Callable[[Samples], TurningPoints], block: int
) -> TurningPoints | None:
    """Follow a plain, evenly sampled record in one pass; None if it isn't one.

    Every core takes a part of the record; all write into one table.
    """
    interval = even_interval(samples.time_s)
    if interval is None:
        return None
    cores = min(_cores(), _CORES, max(1, len(samples) // (2 * block)))
    starts = [len(samples) * k // cores for k in range(cores)]
    heads = [_start(samples, start, measure_block, block // 64) for start in starts]
    known = [head for head in heads if head is not None]
    if len(known) < cores:
        return None
    half_period = 0.5 / known[0].apparent_frequency_hz
    overlap = int(8.0 * half_period / interval)
    room = int(1.02 * len(samples) * interval / half_period / cores) + 64
    columns = np.empty((5, cores * room))

    def follow(k: int) -> tuple[int, float, float]:
        head, start = known[k], starts[k]
        stop = (*starts, len(samples))[k + 1] + overlap
        begin = [
            float(samples.time_s[start]), interval, float(head.time_s[1]),
            0.5 / head.apparent_frequency_hz, float(head.side[1]), float(head.level_rad[0]),
            known[0].noise_rms_rad, *_rates(head),
        ]  # fmt: skip
        return track(samples.values[start:stop], np.array(begin), columns, k * room, room)

    with ThreadPoolExecutor(cores) as pool:
        parts = list(pool.map(follow, range(cores)))
    count = _closed_up(columns, room, [part[0] for part in parts], half_period)
    if count < 16:
        return None
    square, freedom = (sum(part[j] for part in parts) for j in (1, 2))
    noise = max(float(np.sqrt(square / freedom)), quantisation_rms(samples.step))
    for row in (1, 3):
        columns[row, :count] *= noise / known[0].noise_rms_rad
    time, time_sd, angle, angle_sd, level = columns[:, :count]
    # A half cycle alone tells 0.19 of what its readings would say of a level alone.
    told = 0.19 * half_period / interval * min(LEVEL_BLOCK, count)
    return replace(
        known[0], half_cycle=np.arange(count), time_s=time, time_sd_s=time_sd, angle_rad=angle,
        angle_sd_rad=angle_sd, level_rad=level, level_sd_rad=noise / math.sqrt(told),
        noise_rms_rad=noise,
    )  # fmt: skip


def _cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _start(
    samples: Samples,
    start: int,
    measure_block: Callable[[Samples], TurningPoints],
    length: int,
) -> TurningPoints | None:
    """The turning points from which a part is followed; None if it isn't plain there."""
    head = slice(start, start + length)
    try:
        first = measure_block(
            replace(samples, time_s=samples.time_s[head], values=samples.values[head])
        )
    except NotAnalysableError:
        if start == 0:
            raise
        return None
    plain = first.noise_rms_rad < _PLAIN * max(samples.noise_rms, 1e-300)
    amplitude = float(first.amplitude_rad[0])
    if not plain or amplitude > _LARGEST or len(first) < 16:
        return None
    losses = float(np.array(_rates(first)) @ [amplitude, 1.0, 1.0 / amplitude])
    return first if losses / (2.0 * np.pi * first.apparent_frequency_hz) < _SLIGHT else None


def _rates(points: TurningPoints) -> LossRates:
    return loss_rates(points.time_s, points.amplitude_rad, points.angle_sd_rad)


def _closed_up(columns: FloatArray, room: int, counts: list[int], half_period: float) -> int:
    """Move the parts together, without what they share; return how many there are in all.

    Where a part ends early (its lock is lost), the table ends.
    """
    total = counts[0]
    for k in range(1, len(counts)):
        part = columns[:, k * room : k * room + counts[k]]
        last_s, side = columns[0, total - 1], math.copysign(1.0, columns[2, total - 1])
        skip = int(np.searchsorted(part[0], last_s + 0.5 * half_period))
        if skip == counts[k] or abs(part[0, skip] - last_s - half_period) > 0.2 * half_period:
            break
        if part[2, skip] * side > 0.0:
            break
        added = counts[k] - skip
        for row in range(len(columns)):
            columns[row, total : total + added] = part[row, skip:].copy()
        total += added
    return total


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
