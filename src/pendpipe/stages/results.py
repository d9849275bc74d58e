"""What the stages have left of each record, read back for the campaign's own stages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pendpipe.analysis.fit.result import FitResult, read_fit
from pendpipe.configuration.load import Campaign
from pendpipe.configuration.records import Record
from pendpipe.estimate import Estimate
from pendpipe.files import read_json


@dataclass(frozen=True)
class RecordResult:
    """One record's fit and calibration, or why it has none."""

    record: Record
    fit: FitResult | None
    calibration: dict[str, Any]
    refused: str | None = None

    @property
    def usable(self) -> bool:
        """Whether there is a fit that does not contradict the decay."""
        return self.fit is not None and self.fit.light != "red"

    def parameter(self, name: str) -> Estimate:
        """One of the fit's parameters (``a``, ``b``, ``c``, ``frequency``, ...)."""
        assert self.fit is not None
        return self.fit.parameters[name]


def record_files(campaign: Campaign, *names: str) -> list[Path]:
    """The files of these names in every record's folder."""
    return [campaign.folder / row.record / name for row in campaign.records for name in names]


def sensor_file(campaign: Campaign) -> Path:
    """The result of the campaign's caliper run."""
    return campaign.folder / "calibration" / "sensor.json"


def read_results(campaign: Campaign) -> list[RecordResult]:
    """Read every record's fit, in the order of the table."""
    return [_read(campaign.folder / record.record, record) for record in campaign.records]


def _read(folder: Path, record: Record) -> RecordResult:
    path = folder / "fit.json"
    refused = read_json(path).get("refused")
    fit = None if refused else read_fit(path)
    return RecordResult(record, fit, read_json(folder / "calibration.json"), refused)
