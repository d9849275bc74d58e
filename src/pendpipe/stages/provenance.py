"""What a result says of its making: versions, configuration, seed; no paths of a machine."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from typing import Any, Final

from pendpipe.configuration.jobs import digest
from pendpipe.configuration.load import Campaign
from pendpipe.provenance import code_version
from pendpipe.version import __version__

PACKAGES: Final = ("numpy", "scipy", "numba", "matplotlib", "pyserial", "snakemake")


def stamp(campaign: Campaign) -> dict[str, Any]:
    """Versions of the program and its libraries, digest of the configuration, seed."""
    return {
        "version": __version__,
        "code": code_version("pendpipe.stages.compare"),
        "configuration": digest(campaign.configuration.model_dump(exclude={"results", "records"})),
        "seed": campaign.configuration.seed,
        "packages": {name: _version(name) for name in PACKAGES},
    }


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
