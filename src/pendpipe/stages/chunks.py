"""Chunks of records: what one job of a stage does, and how a run learns what is left to do.

A group of more than `batch` records is split by the next bit of the SHA-256 of their names
(extendible hashing), so that a record that is added changes one chunk. A job does a stage for the
records of a chunk and leaves ``chunks/<stage>-<chunk>.json``: the manifests of its records in one
file, which a plan reads instead of theirs. Snakemake knows that file alone, and deletes it before
the job. A record's own manifest stays, so that what is done is not done again: with the key of what
its stage was done with.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from pendpipe import manifest
from pendpipe.configuration import jobs
from pendpipe.configuration.load import Campaign, Record
from pendpipe.errors import InputError
from pendpipe.files import read_json, sha256, write_json
from pendpipe.provenance import code_version
from pendpipe.version import __version__

FOLDER: Final = "chunks"
ANEW: Final = "PENDPIPE_ANEW"
"""Variable that names the stages whose results are made again even if they are done."""
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
        The file there that the following stages read.
    """

    name: str
    inputs: tuple[str, ...]
    output: str

    @property
    def module(self) -> str:
        """The module of its command."""
        return f"pendpipe.commands.{self.name.replace('-', '_')}"

    def path(self, campaign: Campaign, chunk: str) -> Path:
        """Where the job of a chunk says what it did."""
        return campaign.folder / FOLDER / f"{self.name}-{chunk}.json"


STAGES: Final = {
    stage.name: stage
    for stage in (
        Stage("acquire", (), "recording.csv"),
        Stage("calibrate", ("recording.csv",), "calibration.json"),
        Stage("turning-points", ("recording.csv", "calibration.json"), "turning_points.csv"),
        Stage("fit", ("recording.csv", "calibration.json", "turning_points.csv"), "fit.json"),
        Stage(
            "diagnose",
            ("recording.csv", "calibration.json", "turning_points.csv"),
            "diagnosis/diagnosis.json",
        ),
    )
}


def batch_for(number: int) -> int:
    """Return the size of chunks for a number of records: some four chunks, of 16 to 128."""
    return min(max(1 << max(number // 4 - 1, 0).bit_length(), _SMALLEST), _LARGEST)


def chunks_of(campaign: Campaign) -> dict[str, tuple[Record, ...]]:
    """The records to run by the names of their chunks."""
    if campaign.configuration.only:
        return {f"{ALONE}{record.record}": (record,) for record in campaign.selected}
    batch = campaign.configuration.batch or batch_for(len(campaign.records))
    live = [record for record in campaign.records if record.source.startswith("dataq:")]
    others = {record.record: record for record in campaign.records}
    for record in live:
        del others[record.record]
    return {f"{ALONE}{record.record}": (record,) for record in live} | split(others, batch)


def split(records: dict[str, Record], batch: int) -> dict[str, tuple[Record, ...]]:
    """Split records into chunks of `batch` at most, named by the first bits of their hashes.

    >>> sorted(split(dict.fromkeys(["a", "b", "c"]), 2))
    ['0', '1']
    """
    bits = {name: _bits(name) for name in records}

    def parts(names: list[str], prefix: str) -> Iterator[tuple[str, list[str]]]:
        if len(names) <= batch:
            if names:
                yield prefix or WHOLE, names
            return
        for bit in "01":
            chosen = [name for name in names if bits[name][len(prefix)] == bit]
            yield from parts(chosen, prefix + bit)

    return {
        chunk: tuple(records[name] for name in names) for chunk, names in parts(list(records), "")
    }


def _bits(name: str) -> str:
    return f"{int.from_bytes(hashlib.sha256(name.encode()).digest()):0256b}"


def call(campaign: Campaign, stage: Stage, record: Record, configuration: str) -> list[str]:
    """Return the words of the command that does a stage for one record."""
    home = campaign.folder / record.record
    files: dict[str, Any] = {}
    if stage.name == "acquire":
        files["campaign"] = configuration
    if stage.name == "calibrate":
        files["sensor"] = _sensor(campaign)
    if "calibration.json" in stage.inputs:
        files["calibration"] = home / "calibration.json"
    if "turning_points.csv" in stage.inputs:
        files["turning-points"] = home / "turning_points.csv"
    out = home / stage.output
    files["out"] = out.parent if stage.name == "diagnose" else out
    files["refused"] = None if campaign.configuration.strict else home / "refused.json"
    options = files | _options(campaign, stage, record) | {"record": record.record}
    given = [f"--{name}={value}" for name, value in options.items() if value is not None]
    return [stage.name, *(str(home / name) for name in stage.inputs[:1]), *given]


def _options(campaign: Campaign, stage: Stage, record: Record) -> dict[str, Any]:
    """The options of a stage's command that are no files."""
    settings = campaign.configuration
    if stage.name == "calibrate":
        return {"volts-per-radian": record.volts_per_radian}
    if stage.name == "fit":
        restoring = record.restoring or None
        return {"method": settings.fit.method, "restoring": restoring, "seed": settings.seed}
    if stage.name == "diagnose":
        asked = settings.diagnose
        return {
            "baseline": asked.baseline,
            "level": asked.level,
            "figures": asked.figures,
            "restoring": "linear" if record.restoring == "linear" else None,
            "seed": settings.seed,
        }
    return {}


def _sensor(campaign: Campaign) -> Path | None:
    if campaign.configuration.calibration is None:
        return None
    return campaign.folder / "calibration" / "sensor.json"


def settings(
    campaign: Campaign, stage: Stage, record: Record, made: manifest.Manifest | None = None
) -> str:
    """What the configuration says of one record's stage: a part of its key."""
    if stage.name == "acquire":
        return jobs.acquisition(campaign, record, made)
    return f"{record.record} {campaign.configuration.strict} {_options(campaign, stage, record)}"


def key(campaign: Campaign, stage: Stage, record: Record) -> str:
    """Digest all that a record's stage depends on: settings, code and what it reads."""
    home = campaign.folder / record.record
    sensor = _sensor(campaign) if stage.name == "calibrate" else None
    files = [home / name for name in stage.inputs] + ([sensor] if sensor else [])
    read = manifest.recorded(files)
    return jobs.digest([settings(campaign, stage, record), _code(stage.module), read])


_code = cache(code_version)
"""It takes 3 ms, and is asked for each record."""


def write_chunk(campaign: Campaign, stage: Stage, records: Sequence[Record], out: Path) -> None:
    """Write the manifests of a chunk's records into one file."""
    content = {
        record.record: manifest.read_manifest(campaign.folder / record.record, stage.name).content()
        for record in records
    }
    write_json(
        out,
        {
            "schema_version": 1,
            "stage": stage.name,
            "version": __version__,
            "records": content,
        },
    )


@dataclass(frozen=True)
class Plan:
    """What a plan knows of the job of a chunk: parameters of its rule, and what is wrong.

    Parameters
    ----------
    settings
        Digest of what the configuration says of its records.
    repaired
        The damages, repaired or not, that made the stage run again (`pendpipe.manifest`).
    damaged
        The folders with results that are not as they were written.
    lines
        A line for each of these results.
    """

    settings: str
    repaired: str
    damaged: tuple[Path, ...]
    lines: tuple[str, ...]


def plan(campaign: Campaign, stage: Stage, chunk: str, records: Iterable[Record]) -> Plan:
    """Look at the results of a chunk; nothing is touched.

    One `stat` a file: it is hashed only where length or time of change speak.
    """
    said: list[str] = []
    repaired: list[str] = []
    lines: list[str] = []
    damaged: list[Path] = []
    path = stage.path(campaign, chunk)
    made = _read_chunk(path)
    if made is None and path.is_file():
        torn = manifest.Damage(path, "it is torn or altered", sha256(path)[:8])
        repaired.append(torn.mark)
        lines.append(f"{path}: {torn.problem}; a run makes it again")
    written = 0 if made is None else manifest.changed_ns(path)
    nothing = manifest.Manifest(Path(), stage.name)
    for record in records:
        # (As text: a Path takes longer, and records are many.)
        home = f"{campaign.configuration.results}/{record.record}"
        content = None if made is None else made.get(record.record)
        if content is None and not os.path.isdir(home):  # noqa: PTH112
            said.append(settings(campaign, stage, record, nothing))
            continue
        if content is not None:
            one = manifest.of_content(Path(home), stage.name, content)
            if manifest.changed_ns(one.path) >= written:  # it was altered, or a later job is cut
                one = manifest.read_manifest(one.home, stage.name)
        else:
            one = manifest.read_manifest(Path(home), stage.name)
        said.append(settings(campaign, stage, record, one))
        found = [] if content is None else one.damages(missing=True)
        if found:
            damaged.append(one.home)
        lines += [manifest.noticed(damage) for damage in found]
        marks = (*one.repaired, *(damage.mark for damage in found))
        repaired += [f"{record.record}/{mark}" for mark in marks]
    return Plan(jobs.digest(said), " ".join(repaired), tuple(damaged), tuple(lines))


def _read_chunk(path: Path) -> dict[str, Any] | None:
    """Read what a chunk's job left; None where it is missing or torn: the job then runs."""
    try:
        return dict(read_json(path)["records"])
    except (InputError, KeyError, TypeError, ValueError):
        return None


def forced() -> set[str]:
    """The stages that are to be done again."""
    return set(os.environ.get(ANEW, "").split())
