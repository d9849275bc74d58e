"""A campaign: the configuration and its records, read, checked and held together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from pendpipe.configuration.faults import as_input_error, nearest, read_text
from pendpipe.configuration.models import Configuration, Geometry
from pendpipe.configuration.records import Record, read_records
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import read_json

_NOT_IN_A_FOLDER: Final = frozenset("{}*?[]\"'`$;&|<>!#%^\x7f")


@dataclass(frozen=True)
class Campaign:
    """A checked configuration with its records."""

    configuration: Configuration
    records: tuple[Record, ...]

    @property
    def folder(self) -> Path:
        """The results: a folder a record lies in it."""
        return Path(self.configuration.results)

    def record(self, name: str) -> Record:
        """Find a record by its name."""
        for entry in self.records:
            if entry.record == name:
                return entry
        known = [entry.record for entry in self.records]
        raise InputError(self.configuration.records, f"no record '{name}'", nearest(name, known))

    def geometry(self, record: Record) -> Geometry | None:
        """Where the weights are for a record; ``None`` where none is given."""
        return self.configuration.geometries.get(record.geometry)


def read_configuration(path: str | Path) -> dict[str, Any]:
    """Read a configuration file, YAML or JSON, unchecked."""
    place = Path(path)
    text = read_text(place, "configuration", "see config/README.md", "YAML")
    content = read_json(place) if place.suffix == ".json" else _yaml(place, text)
    if not isinstance(content, dict):
        raise InputError(place, "this is no mapping of keys to values", "see config/README.md")
    return content


def _yaml(place: Path, text: str) -> Any:
    """Parse YAML; an error names its line."""
    import yaml

    try:
        return yaml.safe_load(text)
    except yaml.MarkedYAMLError as fault:
        line = fault.problem_mark.line + 1 if fault.problem_mark else 1
        raise InputError(f"{place}, line {line}", fault.problem or "no YAML", "fix it") from None
    except (yaml.YAMLError, RecursionError) as fault:
        raise InputError(place, f"this is no YAML ({fault})", "fix it") from None


def load_campaign(content: Mapping[str, Any], place: str | Path) -> Campaign:
    """Check a configuration and read its records.

    Parameters
    ----------
    content
        The keys and values, from `read_configuration` or from Snakemake.
    place
        Where they stand, for the messages.

    Raises
    ------
    InputError
        On the first error: the place, what is wrong, what to do.
    """
    try:
        configuration = Configuration.model_validate(content)
    except ValidationError as fault:
        raise as_input_error(place, fault, Configuration) from None
    _check_results(configuration.results, place)
    records = tuple(read_records(configuration.records))
    campaign = Campaign(configuration, records)
    for entry in records:
        _check_record(campaign, entry)
    _check_geometries(configuration, place)
    if configuration.typical_record is not None:
        campaign.record(configuration.typical_record)
    return campaign


def _check_results(results: str, place: str | Path) -> None:
    """Refuse a folder whose name shells, Snakemake's wildcards or Windows read otherwise."""
    where = f"{place}, results"
    refuse_if(
        not results.strip() or results.startswith("-"),
        where,
        f"'{results}' is no folder",
        "name one, such as results",
    )
    wrong = next((sign for sign in results if sign in _NOT_IN_A_FOLDER or sign < " "), None)
    refuse_if(
        wrong is not None,
        where,
        f"{wrong!r} can't stand in its name",
        "use letters, digits, spaces, / . _ -",
    )
    folder = Path(results)
    existing = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    refuse_if(
        not existing.is_dir(), where, f"{existing} is a file, not a folder", "name another folder"
    )


def _check_record(campaign: Campaign, entry: Record) -> None:
    """Refuse a record that names what the configuration does not have."""
    configuration = campaign.configuration
    where = f"{configuration.records}, record {entry.record}"
    known: dict[str, tuple[str, Mapping[str, Any]]] = {
        "fluid": (entry.fluid, configuration.fluids),
        "geometry": (entry.geometry, configuration.geometries),
    }
    for column, (name, names) in known.items():
        refuse_if(
            name and name not in names, where, f"unknown {column} '{name}'", nearest(name, names)
        )
    refuse_if(
        entry.start_s is not None and entry.stop_s is not None and entry.stop_s <= entry.start_s,
        where,
        "stop_s is not after start_s",
        "fix or blank the cells",
    )
    if entry.source != "simulated":
        return
    missing = [
        name
        for name, there in {
            "apparatus": configuration.apparatus,
            "simulated": configuration.simulated,
            "a fluid": entry.fluid,
            "a geometry": entry.geometry,
        }.items()
        if not there
    ]
    refuse_if(missing, where, f"a simulated record needs {', '.join(missing)}", "add it")
    assert configuration.simulated is not None
    releases = configuration.simulated.release
    refuse_if(
        entry.record not in releases and entry.fluid not in releases,
        where,
        "its release is not described",
        "add it to simulated.release",
    )


def _check_geometries(configuration: Configuration, place: str | Path) -> None:
    """Refuse a geometry that clamps a weight the apparatus does not have."""
    apparatus = configuration.apparatus
    if apparatus is None:
        return  # a campaign of others' recordings, whose configuration extends the default one
    for name, geometry in configuration.geometries.items():
        where = f"{place}, geometries.{name}"
        for weight in geometry.weights_m:
            refuse_if(
                weight not in apparatus.weights,
                where,
                f"unknown weight '{weight}'",
                nearest(weight, apparatus.weights),
            )
        refuse_if(
            geometry.sphere and apparatus.sphere is None,
            where,
            "the apparatus has no sphere",
            "add it, or set sphere: false",
        )
