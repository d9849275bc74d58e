"""A campaign: the configuration and its table of records, read, checked and held together.

The table, ``config/records.tsv``, has one row per record. An error is one line with the nearest
known name.
"""

import csv
import io
import json
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass as checked

from pendpipe.configuration.models import WATER_C, Celsius, Configuration, Geometry, Section
from pendpipe.errors import InputError, nearest, refuse_if
from pendpipe.files import is_file, names_in, read_json, read_text, told_apart

NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
LONGEST_NAME: Final = 100
"""The names of files made from it stay below the 255 bytes that file systems allow."""
_OF_WINDOWS: Final = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)
_OF_THE_CAMPAIGN: Final = (
    *("figures", "calibration", "logs", "pages", "pendulums", "challenge", "challenge-sealed"),
    *("campaign.json", "comparison.json", "separation.json", "report.html", "readme.md"),
    *("campaign_diagnosis.json", "chunks", "records", "records.csv", "records.parquet"),
)
"""What stands beside the records' folders."""


@checked(frozen=True, config=ConfigDict(allow_inf_nan=False))
class Record:
    """A row of the table; what is blank is ``None`` (or ``""`` for the words).

    Parameters
    ----------
    record
        Its name, that of its folder in ``results/``.
    source
        ``simulated``, ``dataq:<port>`` or a file (``./simulated`` is one).
    fluid, branch, geometry
        Names from the configuration; `branch` groups records (``low``, ``high``, ``air``).
    channel
        Channel or column of the source, as its reader names it.
    unit, decimal, sample_rate
        Of a file, where its reader's guess is wrong: unit of the readings, decimal sign, Hz.
    start_s, stop_s
        The part to use; blank: found from the recording.
    volts_per_radian
        The sensor's constant; blank: from the file, or from the campaign's calibration.
    temperature_c
        Of the fluid.
    restoring
        The torque of the fit, ``linear`` or ``sine``; blank: what the recording asks for.
    order
        When it was taken: a number that rises over the day (an hour, a count); blank: its row.
    pendulum
        A name: records of one name are diagnosed together as well (docs/several.md).
    """

    record: str
    source: str
    fluid: str = ""
    branch: str = ""
    geometry: str = ""
    channel: str = ""
    unit: str = ""
    decimal: Literal["", ".", ","] = ""
    sample_rate: Annotated[float, Field(gt=0)] | None = None
    start_s: float | None = None
    stop_s: float | None = None
    volts_per_radian: float | None = None
    temperature_c: Celsius | None = None
    restoring: Literal["", "linear", "sine"] = ""
    order: float | None = None
    pendulum: str = ""

    @property
    def file(self) -> Path | None:
        """The file of the recording, where the source is one."""
        ours = self.source == "simulated" or self.source.startswith("dataq:")
        return None if ours else Path(self.source)


COLUMNS: Final = tuple(Record.__dataclass_fields__)


def read_records(path: str | Path) -> list[Record]:
    """Read the table.

    Raises
    ------
    InputError
        On a missing or unknown column, a name that is no name or is listed twice, or text
        where a number belongs: file, line, what, remedy.
    """
    place = Path(path)
    text = read_text(place, "see config/README.md", absent="table")
    lines = (line if line[:1] != "#" else "\n" for line in io.StringIO(text, newline=""))
    table = csv.reader(lines, delimiter="\t")
    rows = [
        (table.line_num, [cell.strip() for cell in row]) for row in table if "".join(row).strip()
    ]
    refuse_if(not rows, place, "the table is empty", f"begin with the columns {', '.join(COLUMNS)}")
    names = rows[0][1]
    for name in ("record", "source", *names):
        for wrong, problem, remedy in (
            (name not in names, f"the column '{name}' is missing", "separate columns by tabs"),
            (name not in COLUMNS, f"unknown column '{name}'", nearest(name, COLUMNS)),
            (names.count(name) > 1, f"the column '{name}' is listed twice", "drop one"),
        ):
            refuse_if(wrong, f"{place}, line {rows[0][0]}", problem, remedy)
    records: list[Record] = []
    last = rows[-1][0]
    for number, cells in rows[1:]:
        where = f"{place}, line {number}"
        refuse_if(
            len(cells) > len(names),
            where,
            f"{len(cells)} cells, not {len(names)}",
            "separate by one tab",
        )
        refuse_if(
            len(cells) < len(names) and number == last and not text.endswith(("\n", "\r")),
            where,
            f"the table ends in the middle of a row: {len(cells)} of {len(names)} cells",
            "complete it, and end it with a line end",
        )
        records.append(_record(where, dict(zip(names, cells, strict=False))))
    refuse_if(not records, place, "the table has no records", "add one row per record")
    # Windows takes names that differ in case only for one.
    counts = Counter(entry.record.lower() for entry in records)
    again = [entry.record for entry in records if counts[entry.record.lower()] > 1]
    refuse_if(again, place, f"the record '{''.join(again[-1:])}' is listed twice", "rename one")
    return records


def _record(where: str, row: dict[str, str]) -> Record:
    """Make a record from the cells of a row."""
    _check_name(where, row.get("record", ""))
    refuse_if(
        not row.get("source"),
        where,
        "the source is blank",
        "write simulated, dataq:<port> or a file",
    )
    cells: dict[str, Any] = {name: text for name, text in row.items() if text}
    if "pendulum" in cells:
        _check_name(where, cells["pendulum"])
    try:
        return Record(**cells)
    except ValidationError as fault:
        raise as_input_error(where, fault) from None


def unfit(name: str) -> tuple[str, str]:
    """Why this can't be a folder on Linux, Windows and macOS alike, and a remedy; else blank."""
    found = {
        len(name) > LONGEST_NAME: (
            f"the record's name has {len(name)} characters",
            f"use at most {LONGEST_NAME}",
        ),
        not NAME.fullmatch(name) or name.endswith("."): (
            f"'{name}' is no name for a folder",
            "use letters, digits, . _ -, and no dot at the end",
        ),
        _OF_WINDOWS.fullmatch(name) is not None: (
            f"Windows keeps the name '{name}' for itself",
            "rename the record",
        ),
        name.lower() in _OF_THE_CAMPAIGN: (
            f"the campaign has a file or folder '{name}' of its own",
            "rename the record",
        ),
    }
    return found.get(True, ("", ""))


def _check_name(where: str, name: str) -> None:
    problem, remedy = unfit(name)
    refuse_if(problem, where, problem, remedy)


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

    @property
    def sensor(self) -> Path | None:
        """The result of the caliper run; None where the campaign has no such run."""
        there = self.configuration.calibration is not None
        return self.folder / "calibration" / "sensor.json" if there else None

    @property
    def selected(self) -> tuple[Record, ...]:
        """The records to run: all, or those that the configuration names in ``only``."""
        return tuple(map(self.record, self.configuration.only)) or self.records

    def missing_files(self) -> list[str]:
        """A line for each record to run whose file is not there."""
        lines = []
        for record in self.selected:
            path = record.file
            if path is not None and not is_file(path):
                hint = nearest(path.name, names_in(path.parent), "it will be refused")
                where = f"{self.configuration.records}, record {record.record}"
                lines.append(f"{where}: there is no file {path}; {hint}")
        return lines

    def record(self, name: str) -> Record:
        """Find a record by its name."""
        if name in self._by_name:
            return self._by_name[name]
        remedy = nearest(name, self._by_name)
        raise InputError(self.configuration.records, f"no record '{name}'", remedy)

    @cached_property
    def _by_name(self) -> dict[str, Record]:
        return {entry.record: entry for entry in self.records}

    @cached_property
    def shown_sources(self) -> dict[str, str]:
        """The source of each record: of a file its name, with folders where two have one name."""
        files = {record.record: record.file for record in self.records if record.file is not None}
        names = dict(zip(files, told_apart([*files.values()]), strict=True))
        # A file may have the name of what is no file.
        names |= {name: f"./{shown}" for name, shown in names.items() if shown == "simulated"}
        ours = {each.record: each.source.partition(":")[0] for each in self.records}
        return ours | names

    def geometry(self, record: Record) -> Geometry | None:
        """Where the weights are for a record; ``None`` where none is given."""
        return self.configuration.geometries.get(record.geometry)


def read_configuration(path: str | Path) -> dict[str, Any]:
    """Read a configuration file, YAML or JSON, unchecked."""
    place = Path(path)
    text = read_text(place, "see config/README.md", absent="configuration", form="YAML")
    content = read_json(place) if place.suffix == ".json" else _yaml(place, text)
    refuse_if(
        not isinstance(content, dict),
        place,
        "this is not a mapping of keys to values",
        "see config/README.md",
    )
    return dict(content)


def _yaml(place: Path, text: str) -> Any:
    """Parse YAML; an error names its line."""
    import yaml

    class Loader(yaml.SafeLoader):
        """Refuses a key that is listed twice, where YAML takes the last."""

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Any:
            keys = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
            for key, _ in reversed(node.value):
                again = isinstance(key, yaml.ScalarNode) and keys.count(key.value) > 1
                if again and key.value != "<<":
                    twice = f"the key '{key.value:.60}' is listed twice"
                    raise yaml.MarkedYAMLError(problem=twice, problem_mark=key.start_mark)
            return super().construct_mapping(node, deep)

    try:
        return yaml.load(text, Loader)
    except yaml.MarkedYAMLError as fault:
        line = fault.problem_mark.line + 1 if fault.problem_mark else 1
        raise InputError(f"{place}, line {line}", fault.problem or "no YAML", "fix it") from None
    except (yaml.YAMLError, RecursionError, ValueError) as fault:  # a number of 5000 digits
        raise InputError(place, f"this is not YAML ({fault})", "fix it") from None


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
    # Snakemake's --config hands `null` on as text.
    given = {key: None if value == "null" else value for key, value in content.items()}
    try:
        configuration = Configuration.model_validate(given)
    except ValidationError as fault:
        raise as_input_error(place, fault, Configuration) from None
    check_results(configuration.results, place)
    records = tuple(read_records(configuration.records))
    campaign = Campaign(configuration, records)
    for entry in records:
        _check_record(campaign, entry)
    _check_geometries(configuration, place)
    for name in filter(None, [configuration.typical_record, *configuration.only]):
        campaign.record(name)
    return campaign


def check_results(results: str, place: str | Path) -> None:
    """Refuse a folder whose name shells, Snakemake's wildcards or Windows read otherwise."""
    where = f"{place}, results"
    refuse_if(
        not results.strip() or results.startswith("-"),
        where,
        f"'{results}' is not a folder",
        "name one, such as results",
    )
    wrong = next((sign for sign in results if sign in _NOT_IN_A_FOLDER or sign < " "), None)
    refuse_if(
        wrong is not None,
        where,
        f"{wrong!r} can't be part of its name",
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
    fluid = configuration.fluids.get(entry.fluid)
    if fluid and fluid.temperature_c is not None and entry.temperature_c is not None:
        coldest, warmest = WATER_C
        refuse_if(
            not coldest <= entry.temperature_c <= warmest,
            where,
            f"{entry.temperature_c:g} °C is not between {coldest:g} and {warmest:g} °C, where"
            f" the formulas for water hold",
            "give degrees Celsius, or blank the cell",
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
    releases = configuration.simulated.release if configuration.simulated else {}
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


def as_input_error(
    place: str | Path, fault: ValidationError, model: type[BaseModel] = Section
) -> InputError:
    """Turn what pydantic found into one line: a misspelt key before the one it leaves missing."""
    first = min(fault.errors(), key=lambda entry: entry["type"] != "extra_forbidden")
    path = [str(part) for part in first["loc"]]
    where = f"{place}, {'.'.join(path) or 'top level'}"
    if first["type"] == "extra_forbidden":
        known = _known_keys(model, path[:-1])
        return InputError(where, f"unknown key '{path[-1]}'", nearest(path[-1], known))
    if first["type"] == "missing":
        return InputError(where, "this key is missing", "add it (see config/README.md)")
    given = first.get("input")
    asked = _other_unit(path, given, first.get("ctx", {}))
    if asked:
        return InputError(where, *asked)
    problem = first["msg"][0].lower() + first["msg"][1:]
    shown = "" if isinstance(given, dict | list) else f" (it is {given!r})"
    return InputError(where, problem + shown, "see config/README.md")


_SMALLER: Final[Mapping[str, tuple[str, tuple[tuple[str, float], ...]]]] = {
    "_m": ("m", ((" mm", 1e-3), (" cm", 1e-2))),
    "_kg": ("kg", ((" g", 1e-3), (" mg", 1e-6))),
    "_m2": ("m²", ((" cm²", 1e-4), (" mm²", 1e-6))),
    "_m3": ("m³", ((" cm³", 1e-6), (" mm³", 1e-9))),
    "_pa_s": ("Pa s", ((" mPa s", 1e-3),)),
    "_m_per_s2": ("m/s²", ((" cm/s²", 1e-2),)),
    "_rad": ("rad", (("°", math.pi / 180.0),)),
}
"""By the ending of a key: its unit, and those in which people write as well."""


def _other_unit(path: list[str], given: Any, limits: Mapping[str, Any]) -> tuple[str, str] | None:
    """Ask whether a number beyond its bound is in a smaller unit; None where none would do."""
    largest = limits.get("le") or -limits.get("ge", 0.0)
    try:
        number = float(given)
    except (TypeError, ValueError):
        return None
    endings = (_SMALLER.get(end) for key in reversed(path) for end in _endings(key))
    unit, smaller = next(filter(None, endings), ("", ()))
    fits = [each for each in smaller if largest < abs(number) <= largest / each[1]]
    if not fits:
        return None
    (name, factor), *others = fits
    more = "".join(f" ({number:g}{name}: {number * factor:.6g})" for name, factor in others)
    problem = f"{number:g} {unit} is too large, since at most {largest:g} {unit} can be"
    return problem, f"is it {number:g}{name}? write {number * factor:.6g}{more}"


def _endings(key: str) -> Iterator[str]:
    """The parts of a key's name that may be its unit, the longest first."""
    return (key[at:] for at, sign in enumerate(key) if sign == "_")


def _known_keys(model: type[BaseModel], path: list[str]) -> Iterable[str]:
    """The keys of the section to which a path of keys leads."""
    schema = section = model.model_json_schema()
    for key in path:
        named = re.findall(r"#/\$defs/(\w+)", json.dumps(section["properties"].get(key)))
        # (A key that is the user's own name for an entry leads no further.)
        section = schema["$defs"][named[0]] if named else section
    return list(section["properties"])
