"""Records of many millions of readings: a piece at a time, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.errors import NotAnalysableError

BLOCK: Final = 1 << 21
"""Readings in a piece; its working memory is some MB."""
_OVERLAP: Final = 3.0
"""Half cycles that neighbouring pieces share, so that none is cut in two."""


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
    return _joined(list(_pieces(samples, measure_block, block)), samples)


def _pieces(
    samples: Samples, measure_block: Callable[[Samples], TurningPoints], block: int
) -> Iterator[TurningPoints]:
    """Measure each piece; of the overlap, each keeps its own half."""
    start, overlap, last = 0, 0, -np.inf
    while start < len(samples):
        stop = min(start + block, len(samples))
        piece = slice(max(start - overlap, 0), stop)
        try:
            points = measure_block(
                replace(samples, time_s=samples.time_s[piece], values=samples.values[piece])
            )
        except NotAnalysableError:
            if start == 0:
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
    names = ("time_s", "time_sd_s", "angle_rad", "angle_sd_rad", "level_rad")
    columns = {name: np.concatenate([getattr(p, name) for p in pieces]) for name in names}
    weights = [len(piece) for piece in pieces]

    def mean(name: str) -> float:
        return float(np.average([getattr(p, name) for p in pieces], weights=weights))

    return replace(
        pieces[0],
        half_cycle=np.concatenate(numbers),
        **columns,
        level_sd_rad=mean("level_sd_rad"),
        level_coupling=mean("level_coupling"),
        noise_rms_rad=mean("noise_rms_rad"),
        stop_s=float(samples.time_s[-1]),
        samples=len(samples),
        wanders=len(pieces) > 1,
        notes=(*pieces[0].notes, f"measured in {len(pieces)} pieces, each with its own level"),
    )
