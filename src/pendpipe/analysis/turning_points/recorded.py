"""The turning points of a whole recording: its free decay is found first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from pendpipe.analysis.free_decay import find_free_decay
from pendpipe.analysis.turning_points.find import find_turning_points
from pendpipe.analysis.turning_points.table import TurningPoints
from pendpipe.recording import Recording


def measure_recording(
    recording: Recording, place: str | Path, provenance: Mapping[str, Any] | None = None
) -> tuple[TurningPoints, Recording]:
    """Find the free decay of a recording and measure its turning points.

    Parameters
    ----------
    recording
        In rad or m.
    place
        Named in messages.
    provenance
        Goes into the table's head.

    Returns
    -------
    points, part
        The turning points, with the cuts; and the part of the recording they are from.
    """
    decay = find_free_decay(recording, place)
    part = decay.of(recording)
    points = find_turning_points(part, place)
    notes = (*decay.notes, *points.notes)
    metadata = {key: str(value) for key, value in (provenance or {}).items() if value is not None}
    metadata = {**points.metadata, **metadata}
    return replace(points, cuts=tuple(decay.cuts), metadata=metadata, notes=notes), part
