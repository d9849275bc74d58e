"""What ``pendpipe inspect`` says of a file."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Any

from pendpipe.formats.examine import Gap
from pendpipe.formats.table import Marker


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
        ``rad``, ``V`` or ``m``: of the channel that would be analysed.
    gaps, markers, clipped_samples
        Missing times; events; samples at the converter's end.
    warnings
        What was guessed, mended or looks odd.
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
        }
