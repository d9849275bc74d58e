"""Chunks of records: what one job of a stage does.

A group of more than `batch` records is split by the next bit of the SHA-256 of their names
(extendible hashing), so that a record that is added changes one chunk. A job does a stage for the
records of a chunk and leaves an archive, ``chunks/<stage>-<chunk>.zip``. A record's own files come
out of it: always in a campaign of up to `SMALL` records, else when they are asked for.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pendpipe.configuration import jobs
from pendpipe.configuration.load import Campaign, Record
from pendpipe.configuration.models import Configuration
from pendpipe.files import damage_of
from pendpipe.stages.archive import FOLDER, archives, members, unpack

SMALL: Final = 100
"""In campaigns of up to so many records each has a folder of its files (docs/scale.md): a folder
that one can look through."""
WHOLE: Final = "all"
"""Name of the chunk that was not split."""
ALONE: Final = "record."
"""Begins the name of a chunk of one record: a live recording, or one that was asked for alone."""
_SMALLEST, _LARGEST = 16, 128


@dataclass(frozen=True)
class Stage:
    """A stage that is run record by record.

    Parameters
    ----------
    name
        As its command is called.
    inputs
        The files of a record's folder that it reads.
    output
        The file there that the following stages read; beside it there may be a refusal, figures.
    options
        Options of its command that are no files.
    """

    name: str
    inputs: tuple[str, ...]
    output: str
    options: Callable[[Configuration, Record], dict[str, Any]] = lambda _settings, _record: {}

    @property
    def rule(self) -> str:
        """The name of its rule."""
        return self.name.replace("-", "_")

    def path(self, campaign: Campaign, chunk: str) -> Path:
        """The archive that the job of a chunk leaves."""
        return campaign.folder / FOLDER / f"{self.name}-{chunk}.zip"

    def call(self, campaign: Campaign, record: Record, home: Path, configuration: str) -> list[str]:
        """Return the words of the command that does it for a record, whose files are at `home`."""
        files: dict[str, Any] = {
            Path(name).stem.replace("_", "-"): home / name for name in self.inputs[1:]
        }
        if self.name == "acquire":
            files["campaign"] = configuration
        if self.name == "calibrate":
            files["sensor"] = campaign.sensor
        out = home / self.output
        files["out"] = out.parent if self.name == "diagnose" else out
        files["refused"] = None if campaign.configuration.strict else home / "refused.json"
        options = files | self.options(campaign.configuration, record) | {"record": record.record}
        given = [f"--{name}={value}" for name, value in options.items() if value is not None]
        return [self.name, *(str(home / name) for name in self.inputs[:1]), *given]


STAGES: Final = {
    stage.name: stage
    for stage in (
        Stage("acquire", (), "recording.csv"),
        Stage(
            "calibrate",
            ("recording.csv",),
            "calibration.json",
            lambda _, record: {"volts-per-radian": record.volts_per_radian},
        ),
        Stage("turning-points", ("recording.csv", "calibration.json"), "turning_points.csv"),
        Stage(
            "fit",
            ("recording.csv", "calibration.json", "turning_points.csv"),
            "fit.json",
            lambda settings, record: {
                "method": settings.fit.method,
                "restoring": record.restoring or None,
                "seed": settings.seed,
            },
        ),
        Stage("decay", ("fit.json", "turning_points.csv"), "figures/decay.svg"),
        Stage(
            "diagnose",
            ("recording.csv", "calibration.json", "turning_points.csv"),
            "diagnosis/diagnosis.json",
            lambda settings, record: {
                "baseline": settings.diagnose.baseline,
                "level": settings.diagnose.level,
                "figures": settings.diagnose.figures,
                "restoring": "linear" if record.restoring == "linear" else None,
                "seed": settings.seed,
            },
        ),
    )
}


def is_small(campaign: Campaign) -> bool:
    """Whether every record has a folder of its files."""
    return len(campaign.selected) <= SMALL


def batch_for(number: int) -> int:
    """Return the size of chunks for a number of records: some four chunks, of 16 to 128."""
    return min(max(1 << max(number // 4 - 1, 0).bit_length(), _SMALLEST), _LARGEST)


def chunks_of(campaign: Campaign) -> dict[str, tuple[Record, ...]]:
    """The records to run by the names of their chunks."""
    if campaign.configuration.only:
        return {f"{ALONE}{record.record}": (record,) for record in campaign.selected}
    batch = campaign.configuration.batch or batch_for(len(campaign.records))
    live = [record for record in campaign.records if record.source.startswith("dataq:")]
    others = {record.record: record for record in campaign.records if record not in live}
    return {f"{ALONE}{record.record}": (record,) for record in live} | split(others, batch)


def split(records: dict[str, Record], batch: int) -> dict[str, tuple[Record, ...]]:
    """Split records into chunks of `batch` at most, named by the first bits of their hashes.

    >>> sorted(split(dict.fromkeys(["a", "b", "c"]), 2))
    ['0', '1']
    """
    sums = {name: hashlib.sha256(name.encode()).digest() for name in records}
    bits = {name: f"{int.from_bytes(digest):0256b}" for name, digest in sums.items()}

    def parts(names: list[str], prefix: str) -> dict[str, tuple[Record, ...]]:
        if len(names) <= batch:
            return {prefix or WHOLE: tuple(records[name] for name in names)} if names else {}
        halves = [[name for name in names if bits[name][len(prefix)] == bit] for bit in "01"]
        return parts(halves[0], f"{prefix}0") | parts(halves[1], f"{prefix}1")

    return parts([*records], "")


def settings(campaign: Campaign, stage: Stage, record: Record, hash_of: jobs.Hash) -> str:
    """What the configuration says of one record's stage, and the user's file."""
    if stage.name == "acquire":
        return jobs.acquisition(campaign, record, hash_of)
    options = stage.options(campaign.configuration, record)
    return f"{record.record} {campaign.configuration.strict} {options}"


def extras(campaign: Campaign, stage: Stage, archive: Path) -> list[str]:
    """Files in the records' folders that an archive has of some: a refusal, figures."""
    own = [name for name in members(archive) if name.partition("/")[2] != stage.output]
    return [name for name in own if (campaign.folder / name).is_file()]


def _archives_of(campaign: Campaign) -> dict[Path, Stage]:
    """The archives that there are of a campaign's chunks, with their stages."""
    places = {
        stage.path(campaign, chunk): stage
        for stage in STAGES.values()
        for chunk in chunks_of(campaign)
    }
    return {path: stage for path, stage in places.items() if path.is_file()}


def refused(campaign: Campaign) -> list[str]:
    """The records that were refused."""
    names = (name.split("/", 1) for path in _archives_of(campaign) for name in members(path))
    return sorted({record for record, name in names if name == "refused.json"})


def tidy(campaign: Campaign) -> None:
    """Put the folders in order when a run has ended.

    The records' files of a stage that it ended with (`--until`) come out of their archives. What is
    the archive of no chunk any more goes, and in the records' folders a refusal that is over and
    figures of an earlier diagnosis: nothing that anything is made from.
    """
    made = _archives_of(campaign)
    for path, stage in made.items() if is_small(campaign) else ():
        names = [name for name in members(path) if name.partition("/")[2] == stage.output]
        if any(_is_older(campaign.folder / name, path) for name in names):
            unpack(path, campaign.folder)
    if not campaign.configuration.only:
        for path in {*archives(campaign.folder, "*")} - made.keys():
            path.unlink()
    there = {campaign.folder / name for path in made for name in members(path)}
    for record in campaign.selected:
        home = campaign.folder / record.record
        for path in {home / "refused.json", *home.glob("diagnosis/*.[sp][vn]g")} - there:
            if path.is_file() and damage_of(path) is None:
                path.unlink()


def _is_older(path: Path, archive: Path) -> bool:
    return not path.is_file() or path.stat().st_mtime_ns < archive.stat().st_mtime_ns
