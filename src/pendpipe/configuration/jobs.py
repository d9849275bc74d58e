"""What the workflow's rules need to know about a campaign: names, sources, digests."""

import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from pendpipe import files
from pendpipe.configuration.load import Campaign
from pendpipe.manifest import source_sha256
from pendpipe.process import one_thread


def prepare_environment() -> None:
    """Let the jobs find `pendpipe`, and leave threads to Snakemake.

    The command stands beside the Python that runs Snakemake, whether its environment is
    activated or not; Snakemake runs the jobs side by side, so each keeps to one thread.
    """
    folder = str(Path(sys.executable).parent)
    os.environ["PATH"] = os.pathsep.join([folder, os.environ.get("PATH", "")])
    one_thread()


def digest(content: Any) -> str:
    """Hash what a job depends on, short enough for a parameter or a file's name."""
    return files.digest(content)[:12]


def store(campaign: Campaign, folder: str | Path) -> str:
    """Write the checked configuration under a name made of its content, unless it is there.

    Snakemake merges files and ``--config`` (which hands numbers on as text); the jobs read
    what the check made of them, defaults and all. The name is not a parameter of the rules,
    so that a change reruns only what it touches.
    """
    content = campaign.configuration.model_dump(mode="json")
    path = Path(folder) / f"configuration-{digest(content)}.json"
    if not path.exists():
        files.write_json(path, content)
    return path.as_posix()


_OF_SNAKEMAKE: Final = "{}<>"


def source_files(campaign: Campaign, record: str) -> list[str]:
    """The file that a record comes from, where it is one and exists.

    A missing file is no input: the record is then refused by its own job, in one line,
    while Snakemake would stop the whole campaign. So is one in whose name Snakemake would see
    wildcards; its content is part of `acquisition` all the same.
    """
    path = campaign.record(record).file
    if path is None or set(path.as_posix()) & set(_OF_SNAKEMAKE) or not files.is_file(path):
        return []
    return [path.as_posix()]


def acquisition(campaign: Campaign, record: str) -> str:
    """Digest all that a record's acquisition depends on, a file's content included."""
    row = campaign.record(record)
    settings = campaign.configuration
    home = Path(settings.results, record)
    content: dict[str, Any] = {
        "row": asdict(row),
        "source_sha256": row.file and source_sha256(home, "acquire", row.file),
    }
    if row.source == "simulated" and settings.simulated is not None:
        truth = settings.simulated.model_dump()
        releases = truth.pop("release")
        content |= {
            "truth": truth,
            "release": releases.get(row.record, releases.get(row.fluid)),
            "seed": settings.seed,
            "apparatus": settings.apparatus and settings.apparatus.model_dump(),
            "geometry": (geometry := campaign.geometry(row)) and geometry.model_dump(),
            "fluid": settings.fluids[row.fluid].model_dump(),
        }
    return digest(content)


def caliper(campaign: Campaign) -> str:
    """Digest all that the sensor's calibration depends on."""
    settings, source = campaign.configuration, caliper_source(campaign)
    home, truth = Path(settings.results, "calibration"), settings.simulated
    return digest(
        {
            "run": settings.calibration and settings.calibration.model_dump(),
            "seed": settings.seed,
            "source_sha256": source and source_sha256(home, "caliper", source),
            "instrument": truth and truth.model_dump(include={"sensor", "device"}),
        }
    )


def caliper_source(campaign: Campaign) -> Path | None:
    """The user's table of the caliper run, where the run is not simulated."""
    run = campaign.configuration.calibration
    return None if run is None or run.source == "simulated" else Path(run.source)


def theory(campaign: Campaign) -> str:
    """Digest what the campaign's own stages take from the configuration."""
    content = campaign.configuration.model_dump(
        include={"title", "apparatus", "geometries", "fluids", "typical_record"}
    )
    return digest([content, [asdict(record) for record in campaign.records]])
