"""Lists that are no recordings of a swing, and signals that no free decay makes: what they are."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from pendpipe.analysis.half_cycles import periods
from pendpipe.analysis.readings import only_falls
from pendpipe.arrays import FloatArray
from pendpipe.formats.table import Column
from pendpipe.formats.words import plain

_STEADY: Final = 0.02
"""Share by which the size of a steady signal may change from beginning to end."""
_STEADY_CYCLES: Final = 20
NOT_FREE: Final = "no free decay"


@dataclass(frozen=True)
class Listed:
    """What a table holds instead of a swing; `remedy` is empty where it is read all the same.

    Parameters
    ----------
    kind
        ``amplitudes``, ``periods``, ``spectrum`` or ``passages``.
    problem, remedy
        What is said of it, and what to give.
    column
        The column that shows it.
    """

    kind: str
    problem: str
    remedy: str
    column: Column


def list_in(
    columns: Sequence[Column], readings: Sequence[Column], time: Column | None, *, counts: bool
) -> Listed | None:
    """Say what list a table is; ``None`` for a recording.

    Parameters
    ----------
    columns, readings
        All columns of the run; those that would be read, if any swings or is named.
    time, counts
        The column of times; whether it only counts the rows.
    """
    named = [c for c in columns if not readings and plain(c.name).startswith("period")]
    lasting = [*named, *filter(_lasts, columns)]
    if lasting and (named or time is None or counts or time in lasting):
        return Listed(
            "periods",
            f"'{lasting[0].label}' holds periods, not a recording of the swing",
            "give the recording of the swing: periods alone do not show the loss",
            lasting[0],
        )
    clocked = time is not None and time.role == "time"
    for column in () if clocked else filter(_counts_frequencies, columns):
        return Listed(
            "spectrum",
            f"'{column.label}' counts frequencies: a spectrum, no recording of the swing",
            "give the recording that it was made from",
            column,
        )
    # What an instrument sampled by a clock of its own is no list.
    sizes = [c for c in readings or columns if c.role not in ("index", "time")]
    falling = [c for c in sizes if c is not time and c.time_s is None and only_falls(c.clean)]
    if falling and len(falling) == len(readings or falling):
        spoken = [c for c in falling if plain(c.name).startswith("ampl")]
        column = [*spoken, *falling][0]
        return Listed("amplitudes", f"'{column.label}' only falls: amplitudes", "", column)
    counted = (
        Listed(
            "passages",
            f"'{column.label}' only counts, as passages of a light gate do: no recording of"
            " the swing",
            "give the recording of the swing: times of passages do not show the amplitude",
            column,
        )
        for column in readings
        if counts_samples(column) and one_way(column.values) == 1.0
    )
    return next(counted, None)


ONE_WAY: Final = 0.95
"""Share of the steps of a clock that go the way of the whole, however torn it is."""


def one_way(values: FloatArray) -> float:
    """Share of the steps that go the way of the whole; 0 where it does not move."""
    finite = values[np.isfinite(values)]
    if len(finite) < 3 or finite[-1] == finite[0]:
        return 0.0
    steps = np.diff(finite) * np.sign(finite[-1] - finite[0])
    return float(np.mean(steps >= 0)) if np.any(steps > 0) else 0.0


def counts_samples(column: Column) -> bool:
    """Say whether a column counts 1, 2, 3, ... and is not called a time."""
    values = column.values[np.isfinite(column.values)]
    if column.role not in ("index", "unknown", "length") or len(values) < 2:
        return False
    whole = len(values) > 0.98 * len(column.values) and np.all(values == np.rint(values))
    return bool(whole and abs(np.median(np.diff(values))) == 1.0)


def _counts_frequencies(column: Column) -> bool:
    """Whether a column of frequencies rises from row to row."""
    named = plain(column.name).startswith(("freq", "f(hz")) or plain(column.unit) in ("hz", "khz")
    return named and one_way(column.values) == 1.0


def _lasts(column: Column) -> bool:
    """Whether a column of times holds durations: they go up and down, and none is near 0."""
    times = column.values[np.isfinite(column.values)]
    some = column.role == "time" and len(times) > 2 and one_way(times) < 0.9
    return bool(some and times.min() > 0.3 * np.median(times))


def steady(time_s: FloatArray, values: FloatArray, others: Sequence[Column]) -> str:
    """Say that a signal keeps its size, or that a drive moves beside it to the end; else nothing.

    A free decay of 20 cycles that loses less than 2 % of its size has a Q above 3000.
    """
    lasted, size = periods(time_s, values)
    if len(lasted) < _STEADY_CYCLES:
        return ""
    quarters = np.array([np.median(part) for part in np.array_split(size, 4)])
    even = float(np.std(size)) < 0.1 * quarters[0]
    cycles = round(float(np.ptp(time_s)) / float(np.median(lasted)))
    losses = -np.diff(quarters)
    # A free decay of high Q loses as much in each quarter.
    falls = losses.min() > 0.5 * losses.mean() > 0.0
    if even and abs(quarters[-1] / quarters[0] - 1.0) < _STEADY and not falls:
        return (
            f"its size stays the same within {100 * _STEADY:.0f} % over {cycles} cycles: a steady"
            f" or driven signal, {NOT_FREE}"
        )
    tail = slice(-max(8, len(values) // 10), None)
    driving = (
        f"'{drive.label}' beside it swings to the end: a driven signal, {NOT_FREE}"
        for drive in others
        if drive.role == "none" and drive.swing.clear and len(drive.values) == len(values)
        if np.ptp(drive.values[tail]) > 0.5 * np.ptp(drive.values) > 0.0
    )
    return next(driving, "")


SETTINGS: Final = "it holds settings of an instrument (a saved state), no samples"
WAVEFORM: Final = "save the waveform, best as CSV"
STATES: Final = (".set", ".stp", ".sta", ".setup", ".lss", ".stg")
"""Names that oscilloscopes give to a saved state."""
_SETTING: Final = re.compile(r"\[.*\]|:?[A-Z][\w:]* [-+.\w\"].*|[^=:]{1,40}[=:]\s*\S.*")
"""A line of a state: ``[Channel 1]``, ``:CH1:SCALE 0.5``, ``Scale=0.5``."""


def holds_settings(name: str, text: str) -> bool:
    """Say whether a file in which no table is found is a saved state: by its name or its lines."""
    pieces = [piece.strip() for piece in re.split("[\n;]", text[:20_000]) if piece.strip()]
    settings = sum(_SETTING.fullmatch(piece) is not None for piece in pieces)
    return name.lower().endswith(STATES) or (len(pieces) > 3 and settings > 0.8 * len(pieces))
