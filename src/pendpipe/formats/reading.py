"""Any supported file to a recording: the readers in turn, then the choice of columns."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from pendpipe.arrays import ByteArray
from pendpipe.errors import InputError
from pendpipe.formats.choose import Choice, choose
from pendpipe.formats.examine import clipped_samples, find_gaps, is_uniform, resolution, sample_rate
from pendpipe.formats.inspection import Inspection
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.plain import read_if_plain, table_of_plain
from pendpipe.formats.readings import readings
from pendpipe.formats.table import Marker, NotThisFormatError, Table
from pendpipe.formats.timebase import time_base
from pendpipe.formats.units import unit_of
from pendpipe.recording import GOOD, MISSING, Recording, check

READERS: Final = {
    "WinDaq": "windaq",
    "MATLAB": "matlab",
    "Excel": "excel",
    "WinDaq CSV": "windaq_csv",
    "DI-149 capture": "captures",
    "text table": "text",
}
"""The readers in the order in which they are tried, with the modules they live in."""

_ANYTHING: Final = ReadOptions()


def read(path: str | Path, options: ReadOptions = _ANYTHING) -> Recording:
    """Read one channel of any supported file.

    Every guess stands in the recording's ``notes`` and gives way to `options`.

    Raises
    ------
    InputError
        When no reader knows the file (each with its reason), or its samples can't be true:
        file, line, what is wrong, what to do.
    """
    place = Path(path)
    data = _bytes(place)
    plain = read_if_plain(place, data, options)
    recording = plain if plain is not None else _recording(_table(place, data, options), options)
    metadata = dict(recording.metadata)
    metadata.setdefault("source", place.name)
    if options.volts_per_radian is not None:
        metadata["volts_per_radian"] = repr(float(options.volts_per_radian))
    recording = replace(recording, metadata=metadata)
    if options.start_s is None and options.stop_s is None:
        return recording
    part = recording.between(options.start_s, options.stop_s)
    if not len(part):
        first, last = recording.time_s[0], recording.time_s[-1]
        raise InputError(
            place,
            "there is no sample between --start and --stop",
            f"the recording runs from {first:.6g} to {last:.6g} s",
        )
    return part


def inspect(path: str | Path, options: ReadOptions = _ANYTHING) -> Inspection:
    """Say what a file holds, even where none of its channels could be analysed."""
    place = Path(path)
    data = _bytes(place)
    plain = read_if_plain(place, data, options)
    table = table_of_plain(place, plain) if plain is not None else _table(place, data, options)
    choice = choose(table, options, reading=False)
    if not choice.readings:
        if not choice.channels:
            raise InputError(place, "there is no column but the time", "give readings beside it")
        choice = replace(choice, readings=choice.channels[:1])
    notes = [*table.notes, *choice.notes]
    try:
        recording = _recording(table, options) if plain is None else plain
        unit, values, notes = recording.unit, recording.values, list(recording.notes)
        time, step = recording.time_s[recording.usable], recording.resolution
        values = values[recording.usable]
    except InputError as fault:
        base = time_base(table, choice, options)
        column = choice.readings[0]
        time, values = base.time_s, column.values[base.keep]
        unit, step = column.unit, column.resolution or resolution(values)
        notes.append(f"the readings can't be analysed: {fault.problem}")
    column = choice.readings[0]
    scale = 1.0
    known = unit_of(column.unit) if column.unit else None
    if known is not None and unit in ("rad", "V", "m"):
        scale = known.factor
    limits = (column.limits[0] * scale, column.limits[1] * scale) if column.limits else None
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
    )


def _bytes(place: Path) -> bytes:
    """Read the file whole, or say why not."""
    try:
        data = place.read_bytes()
    except FileNotFoundError:
        raise InputError(place, "there is no such file", "check the path") from None
    except IsADirectoryError:
        raise InputError(place, "this is a folder", "give a file in it") from None
    except OSError as fault:
        reason = fault.strerror or str(fault)
        raise InputError(place, f"the file can't be read ({reason})", "check it") from None
    if not data.strip(b"\0 \t\r\n\xef\xbb\xbf"):
        raise InputError(place, "the file is empty", "record again, or give another file")
    return data


def _table(place: Path, data: bytes, options: ReadOptions) -> Table:
    """Try the readers in turn."""
    reasons = []
    for name, module in READERS.items():
        reader = importlib.import_module(f"pendpipe.formats.{module}")
        try:
            table: Table = reader.read_table(place, data, options)
        except NotThisFormatError as reason:
            reasons.append(f"{name}: {reason}")
        else:
            return table
    raise InputError(
        place,
        f"no reader knows this file ({', '.join(reasons)})",
        "export it as CSV with a time and an angle column",
    )


def _recording(table: Table, options: ReadOptions) -> Recording:
    """Choose the columns of a table and turn them into a recording."""
    choice = choose(table, options)
    _refuse_text(table, choice)
    base = time_base(table, choice, options)
    time_s = np.full(len(base.keep), np.nan)
    time_s[base.keep] = base.time_s
    found = readings(table, choice, options, time_s)
    if len(found.values) != len(base.keep):
        raise InputError(table.place, "the columns are of unequal length", "choose with --column")
    values = found.values[base.keep]
    quality = _quality(table, choice, values, base.keep)
    notes = [*table.notes, *choice.notes, *base.notes, *found.notes]
    if quality is not None:
        notes.append(f"{np.sum(quality == MISSING)} row(s) without a reading, marked missing")
    own_step = choice.readings[0].resolution
    step = own_step * found.factor if own_step is not None else resolution(values)
    recording = Recording(
        time_s=np.ascontiguousarray(base.time_s),
        values=np.ascontiguousarray(values),
        quantity=found.quantity,
        quality=quality,
        metadata={**_kept(table), **base.metadata, **_markers(table.markers)},
        resolution=step,
        notes=tuple(notes),
    )
    check(table.place, recording)
    return recording


def _refuse_text(table: Table, choice: Choice) -> None:
    for column in choice.readings:
        if column.fault is not None:
            row, text = column.fault
            raise InputError(
                table.where(row), f"'{text}' is no number", "mend the row, or leave it blank"
            )


def _quality(
    table: Table,
    choice: Choice,
    values: np.ndarray[tuple[int], np.dtype[np.float64]],
    keep: np.ndarray[tuple[int], np.dtype[np.bool_]],
) -> ByteArray | None:
    """Mark rows with an empty cell as missing; a written NaN is a fault."""
    blank = np.zeros(len(keep), dtype=bool)
    for column in choice.readings:
        if column.blank is not None:
            blank |= column.blank
    odd = np.flatnonzero(~np.isfinite(values) & ~blank[keep])
    if odd.size:
        row = int(np.flatnonzero(keep)[odd[0]])
        raise InputError(
            table.where(row),
            f"{odd.size} reading(s) that are NaN or infinite",
            "drop the rows, or leave the cells blank",
        )
    if not blank[keep].any():
        return None
    return np.where(blank[keep], MISSING, GOOD).astype(np.uint8)


def _kept(table: Table) -> dict[str, str]:
    """Keep of a file's own remarks those that the plain form knows."""
    known = ("volts_per_radian", "bits", "range_volts", "range_low_volts", "recorded_at")
    return {key: value for key, value in table.metadata.items() if key in known}


def _markers(markers: tuple[Marker, ...]) -> dict[str, str]:
    """Carry markers as metadata ``marker_1: sample; time; comment``."""
    return {
        f"marker_{number}": f"{mark.sample}; {mark.time_s!r} s; {mark.comment}"
        for number, mark in enumerate(markers, start=1)
    }
