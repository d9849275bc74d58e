"""What ``pendpipe inspect`` reports of a file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.errors import InputError
from pendpipe.formats.choose import choose
from pendpipe.formats.examine import (
    Gap,
    clipped_samples,
    find_gaps,
    is_uniform,
    resolution,
    sample_rate,
)
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.plain import read_if_plain, table_of_plain
from pendpipe.formats.reading import file_bytes, recording_of, table_of
from pendpipe.formats.table import Marker
from pendpipe.formats.timebase import time_base
from pendpipe.formats.words import unit_of

_ANYTHING: Final = ReadOptions()


@dataclass(frozen=True)
class Inspection:
    """A file at a glance; `samples`, `gaps`, `clipped_samples` are of the chosen channel.

    Parameters
    ----------
    format
        ``plain``, ``csv``, ``windaq``, ``windaq-hires``, ``windaq-circular``,
        ``windaq-hires-circular``, ``windaq-csv``, ``di149-ascii``, ``matlab-v5``, ``excel``.
    channels
        Name and unit of each channel.
    samples
        Samples of one channel.
    sample_rate_hz, duration_s
        Rate (gaps left out) and time from the first to the last sample.
    uniform
        Whether the samples are evenly spaced, gaps apart.
    resolution
        The step between readings, in `unit`; ``None`` where there is none.
    unit
        Of the channel that would be analysed: ``rad``, ``V``, ``m``, or the file's own.
    gaps, markers, clipped_samples
        Missing times; events; samples at the converter's end.
    warnings
        What was guessed, repaired or looks odd.
    chosen
        The column or columns that the readings are taken from.
    level
        The median of the readings, in `unit`: where the pendulum hangs.
    weak_guesses
        What was guessed on slender grounds, with the option that overrides it.
    """

    format: str
    channels: tuple[tuple[str, str], ...]
    samples: int
    sample_rate_hz: float
    uniform: bool
    duration_s: float
    resolution: float | None
    unit: str
    gaps: tuple[Gap, ...]
    markers: tuple[Marker, ...]
    clipped_samples: int
    warnings: tuple[str, ...]
    chosen: str = ""
    level: float = 0.0
    weak_guesses: tuple[str, ...] = ()

    def as_json(self) -> dict[str, Any]:
        """Return the object that ``inspect --json`` prints."""
        return {
            "schema_version": 1,
            "format": self.format,
            "channels": [{"name": name, "unit": unit} for name, unit in self.channels],
            "samples": self.samples,
            "sample_rate_hz": self.sample_rate_hz if isfinite(self.sample_rate_hz) else None,
            "uniform": self.uniform,
            "duration_s": self.duration_s,
            "resolution": self.resolution,
            "gaps": [
                {"after_sample": gap.after_sample, "missing_s": gap.missing_s} for gap in self.gaps
            ],
            "markers": [
                {"sample": mark.sample, "time_s": mark.time_s, "comment": mark.comment}
                for mark in self.markers
            ],
            "clipped_samples": self.clipped_samples,
            "warnings": list(self.warnings),
            "chosen": self.chosen,
            "unit": self.unit,
            "level": self.level if isfinite(self.level) else None,
            "weak_guesses": list(self.weak_guesses),
        }


def inspect(path: str | Path, options: ReadOptions = _ANYTHING) -> Inspection:
    """Report what a file holds, even where none of its channels could be analysed.

    Raises
    ------
    InputError
        When no reader knows the file, or it holds no readings.
    """
    place = Path(path)
    data = file_bytes(place)
    plain = read_if_plain(place, data, options)
    table = table_of_plain(place, plain) if plain is not None else table_of(place, data, options)
    choice = choose(table, options, reading=False)
    if not choice.readings:
        if not choice.channels:
            raise InputError(place, "there is no column but the time", "give readings beside it")
        choice = replace(choice, readings=choice.channels[:1])
    column = choice.readings[0]
    weak: tuple[str, ...] = ()
    try:
        recording = recording_of(table, options) if plain is None else plain
        unit, values, notes = recording.unit, recording.values, list(recording.notes)
        time, step = recording.time_s[recording.usable], recording.resolution
        values, weak = values[recording.usable], recording.weak_guesses
    except InputError as fault:
        base = time_base(table, choice, options)
        time, values = base.time_s, column.values[base.rows]
        unit, step = column.unit, column.resolution or resolution(values)
        notes = [*table.notes, *choice.notes, f"the readings can't be analysed: {fault.problem}"]
    scale = 1.0
    known = unit_of(column.unit) if column.unit else None
    if known is not None and unit in ("rad", "V", "m"):
        scale = known.factor
    limits = (column.limits[0] * scale, column.limits[1] * scale) if column.limits else None
    finite = values[np.isfinite(values)]
    return Inspection(
        format=table.format,
        channels=tuple((column.label, column.unit) for column in choice.channels),
        samples=len(time),
        sample_rate_hz=sample_rate(time),
        uniform=is_uniform(time),
        duration_s=float(time[-1] - time[0]) if len(time) else 0.0,
        resolution=step,
        unit=unit,
        gaps=tuple(find_gaps(time)),
        markers=table.markers,
        clipped_samples=clipped_samples(values, step, limits),
        warnings=tuple(notes),
        chosen=", ".join(column.label for column in choice.readings),
        level=float(np.median(finite)) if len(finite) else float("nan"),
        weak_guesses=weak,
    )
