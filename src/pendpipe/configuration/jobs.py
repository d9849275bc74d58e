"""What the workflow's rules need to know about a campaign: names, sources, digests."""

import json
import os
import sys
from collections.abc import Callable
from importlib.metadata import distribution, version
from pathlib import Path
from typing import Any

from pendpipe import files
from pendpipe.configuration.load import Campaign, Record
from pendpipe.configuration.models import Section
from pendpipe.process import leave_the_folder_out, one_thread


def prepare_environment() -> None:
    """Let the jobs find `pendpipe`, nothing in the campaign's folder, and one thread each.

    The command stands beside the Python that runs Snakemake, whether its environment is
    activated or not; Snakemake runs the jobs side by side, so each keeps to one thread.
    """
    folder = str(Path(sys.executable).parent)
    os.environ["PATH"] = os.pathsep.join([folder, os.environ.get("PATH", "")])
    one_thread()
    leave_the_folder_out()


def store(configuration: Section, folder: str | Path) -> str:
    """Write the checked configuration under a name made of its content, unless it is there.

    Snakemake merges files and ``--config`` (which hands numbers on as text); the jobs read
    what the check made of them, defaults and all. The name is not a parameter of the rules,
    so that a change reruns only what it touches.
    """
    content = configuration.model_dump(mode="json")
    path = Path(folder) / f"configuration-{files.digest(content)}.json"
    if not path.exists():
        files.write_json(path, content)
    return path.as_posix()


Hash = Callable[[Path], str | None]
"""How the content of a user's file is known; None where it can't be read."""


def acquisition(campaign: Campaign, row: Record, sha256: Hash) -> str:
    """Digest all that a record's acquisition depends on, a file's content included."""
    settings = campaign.configuration
    content: dict[str, Any] = {
        "row": vars(row),
        "source_sha256": row.file and sha256(row.file),
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
    return files.digest(content)


def caliper(campaign: Campaign, sha256: Hash) -> str:
    """Digest all that the sensor's calibration depends on."""
    settings, source = campaign.configuration, caliper_source(campaign)
    truth = settings.simulated
    return files.digest(
        {
            "run": settings.calibration and settings.calibration.model_dump(),
            "seed": settings.seed,
            "source_sha256": source and sha256(source),
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
    return files.digest([content, [vars(record) for record in campaign.records]])


def environment(folder: str | Path, template: str | Path) -> str:
    """Write the environment of `snakemake --sdm conda`, and say where.

    That of `template`, with this pendpipe from where it was installed: a clone of the
    repository, a wheel; from an index by its version.
    """
    content = Path(template).read_text(encoding="utf-8")
    origin = json.loads(distribution("pendpipe").read_text("direct_url.json") or "{}")
    wanted = f" @ {origin['url']}" if "url" in origin else f"=={version('pendpipe')}"
    content += f"  - pip:\n      - pendpipe{wanted}\n"
    path = Path(folder, f"environment-{files.digest(content)}.yaml").absolute()
    if not path.exists():
        files.write_whole(path, content)
    return path.as_posix()
