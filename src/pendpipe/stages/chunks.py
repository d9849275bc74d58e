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
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

from pendpipe.configuration import jobs
from pendpipe.configuration.load import Campaign, Record
from pendpipe.configuration.models import Configuration
from pendpipe.files import write_json
from pendpipe.manifest import (
    Findings,
    Manifest,
    changed_ns,
    handed_on,
    joined,
    look_through,
    of_content,
    read_checked,
    read_manifest,
    recorded,
)
from pendpipe.provenance import code_version
from pendpipe.version import __version__

FOLDER: Final = "chunks"
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
    options
        Options of its command that are no files.
    """

    name: str
    inputs: tuple[str, ...]
    output: str
    options: Callable[[Configuration, Record], dict[str, Any]] = lambda _settings, _record: {}

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


def call(campaign: Campaign, stage: Stage, record: Record, configuration: str) -> list[str]:
    """Return the words of the command that does a stage for one record."""
    home = campaign.folder / record.record
    files: dict[str, Any] = {
        Path(name).stem.replace("_", "-"): home / name for name in stage.inputs[1:]
    }
    if stage.name == "acquire":
        files["campaign"] = configuration
    if stage.name == "calibrate":
        files["sensor"] = campaign.sensor
    out = home / stage.output
    files["out"] = out.parent if stage.name == "diagnose" else out
    files["refused"] = None if campaign.configuration.strict else home / "refused.json"
    options = files | stage.options(campaign.configuration, record) | {"record": record.record}
    given = [f"--{name}={value}" for name, value in options.items() if value is not None]
    return [stage.name, *(str(home / name) for name in stage.inputs[:1]), *given]


def settings(campaign: Campaign, stage: Stage, record: Record, made: Manifest | None = None) -> str:
    """What the configuration says of one record's stage: a part of its key."""
    if stage.name == "acquire":
        return jobs.acquisition(campaign, record, made)
    options = stage.options(campaign.configuration, record)
    return f"{record.record} {campaign.configuration.strict} {options}"


def key(campaign: Campaign, stage: Stage, record: Record) -> str:
    """Digest all that a record's stage depends on: settings, code and what it reads."""
    home = campaign.folder / record.record
    sensor = campaign.sensor if stage.name == "calibrate" else None
    files = [home / name for name in stage.inputs] + ([sensor] if sensor else [])
    read = recorded(files)
    return jobs.digest([settings(campaign, stage, record), _code(stage.module), read])


_code = cache(code_version)
"""It takes 3 ms, and is asked for each record."""


def write_chunk(campaign: Campaign, stage: Stage, records: Sequence[Record], out: Path) -> None:
    """Write the manifests of a chunk's records into one file."""
    made = (read_manifest(campaign.folder / record.record, stage.name) for record in records)
    content = {one.home.name: one.content() for one in made}
    head = {"schema_version": 1, "stage": stage.name, "version": __version__}
    repaired = handed_on()["repaired"].get(str(out), "")
    write_json(out, head | {"repaired": repaired, "records": content})


class Plan(NamedTuple):
    """What a plan knows of the job of a chunk.

    Parameters
    ----------
    settings
        Digest of what the configuration says of its records: a parameter of the rule.
    found
        What is wrong with their results, and with the chunk's own file.
    own
        The history of damages of the chunk's own file, which its job writes into the next.
    """

    settings: str
    found: Findings
    own: str


def plan(campaign: Campaign, stage: Stage, chunk: str, records: Iterable[Record]) -> Plan:
    """Look at the results of a chunk; nothing is touched.

    One `stat` a file: it is hashed only where length or time of change speak.
    """
    path = stage.path(campaign, chunk)
    content, torn = read_checked(path)
    listed = content.get("records", {})
    written = changed_ns(path)
    made = [_manifest(campaign, stage, record, listed, written) for record in records]
    said = [settings(campaign, stage, *each) for each in zip(records, made, strict=True)]
    own = joined([content.get("repaired", ""), *(each.mark for each in torn)])
    damages, repaired = look_through(made)
    found = Findings((*torn, *damages), joined([own, repaired]))
    return Plan(jobs.digest(said), found, own)


def _manifest(
    campaign: Campaign, stage: Stage, record: Record, listed: dict[str, Any], written_ns: int
) -> Manifest:
    """What a record's stage wrote, as its chunk says unless that is older."""
    # (As text: a Path takes longer, and records are many.)
    home = f"{campaign.configuration.results}/{record.record}"
    content = listed.get(record.record)
    if content is None and not os.path.isdir(home):  # noqa: PTH112
        return Manifest(Path(home), stage.name)
    one = None if content is None else of_content(Path(home), stage.name, content)
    # It was altered, or a later job is cut.
    if one is None or changed_ns(one.path) >= written_ns:
        return read_manifest(Path(home), stage.name)
    return one
