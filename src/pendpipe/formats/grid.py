"""Evenly spaced samples with pauses between: what a form without a time column can hold."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import FloatArray, IntArray
from pendpipe.errors import InputError
from pendpipe.recording import Recording

_UNEVEN: Final = 0.25
"""A sample may lie so many intervals off its place before the times are held to matter."""
_WORTH_SAYING: Final = 0.02


@dataclass(frozen=True)
class Pause:
    """Time that is missing before a scan, beyond the usual interval."""

    before_scan: int
    missing_s: float


@dataclass(frozen=True)
class Grid:
    """The rows with a reading, their interval, the pauses between; what was lost by it."""

    rows: IntArray
    interval_s: float
    pauses: tuple[Pause, ...]
    notes: tuple[str, ...]


def on_grid(place: str | Path, recording: Recording) -> Grid:
    """Put the usable samples on an even grid.

    Raises
    ------
    InputError
        When there is none, or they are not evenly spaced.
    """
    rows = np.flatnonzero(recording.usable)
    if not len(rows):
        raise InputError(place, "there are no samples", "record again, or give another file")
    time_s = recording.time_s[rows]
    if len(rows) == 1:
        return Grid(rows, recording.interval_s if len(recording) > 1 else 1.0, (), ())
    steps = np.diff(time_s)
    breaks = np.flatnonzero(steps > 1.5 * float(np.median(steps)))
    edges = np.concatenate(([0], breaks + 1, [len(rows)]))
    interval_s = _interval(time_s, edges)
    off = np.concatenate(
        [
            time_s[a:b] - time_s[a] - interval_s * np.arange(b - a)
            for a, b in pairwise(edges.tolist())
        ]
    )
    worst = float(np.abs(off).max()) / interval_s
    # A step of the times that is not seen as a break would be a silent shift.
    if worst > _UNEVEN:
        raise InputError(
            place,
            f"the samples are not evenly spaced (by up to {worst:.2g} of an interval)",
            "this form has no times: write OUT.csv instead",
        )
    pauses = tuple(Pause(int(at) + 1, float(steps[at]) - interval_s) for at in breaks)
    notes = []
    if pauses:
        notes.append(
            f"{len(pauses)} gap(s) of {sum(p.missing_s for p in pauses):.6g} s in all"
            " are pauses, each with an event that says its length"
        )
    if worst > _WORTH_SAYING:
        notes.append(f"times moved by up to {worst:.2g} of an interval, onto an even grid")
    return Grid(rows, interval_s, pauses, tuple(notes))


def _interval(time_s: FloatArray, edges: IntArray) -> float:
    """Find the interval from the ends of all stretches together, gaps left out."""
    spans = time_s[edges[1:] - 1] - time_s[edges[:-1]]
    counts = np.diff(edges) - 1
    if not counts.sum():
        return float(np.median(np.diff(time_s)))
    return float(spans.sum() / counts.sum())
