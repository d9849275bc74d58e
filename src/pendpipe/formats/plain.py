"""The project's own plain form among the readers: recognised by its header, read strictly."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from pendpipe.errors import InputError
from pendpipe.formats.options import ReadOptions
from pendpipe.formats.table import Column, Marker, Table
from pendpipe.formats.words import role_of, split_header
from pendpipe.recording import QUANTITIES, Recording, converter_step, read_plain

_READINGS: Final = ("angle", "volts", "length", "velocity", "acceleration", "signal")


def read_if_plain(place: Path, data: bytes, options: ReadOptions) -> Recording | None:
    """Read the file if its header is the plain form's; ``None`` if it is not.

    Options that would change the layout turn the plain form into one CSV among others.

    Raises
    ------
    InputError
        When the header has ``time_s`` and nothing that could be a reading, or a row
        is damaged.
    """
    steered = (
        options.channel,
        options.column,
        options.unit,
        options.sample_rate,
        options.decimal,
        options.delimiter,
    )
    names = _header(data)
    if "time_s" not in names or any(option is not None for option in steered):
        return None
    found = [name for name in QUANTITIES if name in names]
    if len(found) != 1:
        if any(role_of(split_header(name)[0]) in _READINGS for name in names):
            return None
        raise InputError(
            place,
            f"one of {', '.join(QUANTITIES)} is needed (found {', '.join(names)})",
            "name the reading's column, or choose it with --column and --unit",
        )
    recording = read_plain(place, data)
    step = recording.resolution
    if step is None:
        from pendpipe.formats.examine import resolution

        step = resolution(recording.values)
    return replace(recording, resolution=step)


def _header(data: bytes) -> list[str]:
    """Find the first line that is no remark, split at commas."""
    at = 3 if data.startswith(b"\xef\xbb\xbf") else 0
    while at < len(data):
        end = data.find(b"\n", at)
        line = data[at : len(data) if end < 0 else end].strip()
        if line and not line.startswith(b"#"):
            text = line[:4096].decode("utf-8", errors="replace")
            return [name.strip() for name in text.split(",")]
        if end < 0:
            break
        at = end + 1
    return []


def table_of_plain(place: Path, recording: Recording) -> Table:
    """Show a plain recording as the table that ``inspect`` goes through."""
    limits = None
    high, low = recording.number("range_volts"), recording.number("range_low_volts")
    step = converter_step(recording)
    if high is not None and step is not None:
        limits = (-high if low is None else low, high - step)
    column = Column(
        name=recording.quantity,
        unit=recording.unit,
        values=recording.values,
        number=2,
        time_s=recording.time_s,
        resolution=recording.resolution,
        limits=limits,
    )
    return Table(
        place=place,
        format="plain",
        columns=(column,),
        markers=tuple(markers_of(recording)),
        notes=recording.notes,
    )


def markers_of(recording: Recording) -> list[Marker]:
    """Read back the markers that ``convert`` has kept as metadata."""
    found = []
    for key, value in recording.metadata.items():
        if not key.startswith("marker_"):
            continue
        sample, time, comment = [*value.split(";", 2), "", ""][:3]
        try:
            found.append(
                Marker(int(sample), float(time.strip().removesuffix("s")), comment.strip())
            )
        except ValueError:
            continue
    return found
