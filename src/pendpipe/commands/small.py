"""The commands of a few lines each: files in other forms, catalogues, the run of a campaign.

What stands above a function declares its arguments; its docstring is what ``--help`` says.
"""

import csv
import io
import json
import math
import os
import re
import subprocess
import sys
from importlib import resources
from inspect import getdoc
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from pendpipe.arguments import (
    FILE,
    Arguments,
    announce,
    command,
    print_answer,
    tell_written,
)
from pendpipe.errors import InputError, refuse_if
from pendpipe.options import ALTERNATIVES, INPUT, OUTPUT, flags, flags_of, given
from pendpipe.project import CONFIGURATION, PROJECT, SNAKEFILE
from pendpipe.reading import inspect as describe, read
from pendpipe.simulation.verbs import simulate as simulated

if TYPE_CHECKING:
    from pendpipe.configuration.load import Campaign
    from pendpipe.formats import Inspection


@command(
    FILE
    | flags("--json")
    | {"--why": {"action": "store_true", "help": "print how the file was understood"}}
)
def inspect(arguments: Arguments) -> None:
    """Print what a recording holds: format, channels, rate, gaps, markers, clipping, step."""
    found = describe(arguments.file, **given(arguments, read))
    lines = [arguments.file, *("  " + line for line in found.why)]
    text = lines if arguments.why else _lines(arguments.file, found)
    print_answer(arguments, found.as_json(), "\n".join(text))


_GIVES: Final = {
    "rad": "T0, the period of small swings, and Q by the angle",
    "rad/s": "the angle by the motion, so T0, the period of small swings, and Q by the angle",
    "m": "Q, and the period of these swings; with --length angle, T0 and g",
    "m/s^2": "Q, and the period of these swings, longer than T0; no angle",
    "V": "Q, and the period of these swings; with --volts-per-radian angle and T0",
}
"""What follows from readings in a unit; see `pendpipe.api.fit`."""


def _lines(file: str, found: "Inspection") -> list[str]:
    """Print it in words, a fact a line; what is uncertain first."""
    from pendpipe.quantities import after_number

    even = "evenly spaced" if found.uniform else "not evenly spaced (median interval)"
    read = [
        ("read", f"{found.chosen}, in{after_number(found.unit) or ' no known unit'}"),
        ("hangs at", f"{found.level:.6g}{after_number(found.unit)}"),
        (
            "gives",
            _GIVES.get("rad" if found.scaled else found.unit, "Q, and the period of these swings"),
        ),
    ]
    facts = [
        ("format", found.format),
        *([("kind", f"{found.kind}: no free decay")] if found.kind != "motion" else []),
        *(
            (
                f"channel {number}",
                name + f" [{unit}]" * bool(unit) + f" (--column {place})" * (place != number),
            )
            for number, ((name, unit), place) in enumerate(
                zip(found.channels, found.columns, strict=True), start=1
            )
        ),
        *(read if found.chosen else []),
        ("samples", f"{found.samples} at {found.sample_rate_hz:.6g} Hz, {even}"),
        ("span", f"{found.duration_s:.6g} s"),
        (
            "step",
            f"{found.resolution:.6g}{after_number(found.unit)}"
            if found.resolution
            else "none found",
        ),
        ("clipped", f"{found.clipped_samples} sample(s)"),
        *(("gap", f"{gap.missing_s:.6g} s after sample {gap.after_sample}") for gap in found.gaps),
        *(
            ("marker", f"{mark.time_s:.6g} s (sample {mark.sample}) {mark.comment}")
            for mark in found.markers
        ),
        *(("note", warning) for warning in found.warnings),
    ]
    guesses = [f"a guess: {guess}" for guess in found.weak_guesses]
    return [*guesses, file, *(f"  {name:<12}{text}".rstrip() for name, text in facts)]


@command(
    FILE
    | {
        "out": {
            "metavar": "OUT",
            "type": Path,
            "help": "OUT.csv: the plain form (- writes it to standard output); OUT.wdh: WinDaq",
        }
        | OUTPUT
    }
)
def convert(arguments: Arguments) -> None:
    """Write any supported recording in the plain CSV form, or as a WinDaq file (.wdh)."""
    from pendpipe.formats.writing import check_name, write

    check_name(arguments.out)
    recording = read(arguments.file, **given(arguments, read))
    announce(arguments, recording)
    for note in write(arguments.out, recording):
        print(f"{arguments.out}: {note}", file=sys.stderr)
    tell_written(arguments.out, f"{len(recording)} samples, {recording.quantity}")


_SIMULATED: Final = {"metavar": "OUT.csv", "type": Path, "help": "the recording"} | OUTPUT


@command(
    {
        "model": {"metavar": "MODEL.toml", "help": "what to simulate"} | INPUT,
        "out": _SIMULATED | {"nargs": "?"},
        "--out": _SIMULATED | {"dest": "named", "help": "the same"},
    }
    | flags_of(simulated)
)
def simulate(arguments: Arguments) -> None:
    """Make a recording from a described pendulum and measurement chain.

    MODEL.toml has the sections pendulum, sampling and, where wanted, sensor, converter and
    [[effects]] (what is left out of Eq. 8: see docs/effects.md); config/model.toml is an example
    with every key.
    """
    from pendpipe.recording import write_plain

    out = arguments.named or arguments.out
    refuse_if(out is None, "--out", "no file is named", "give --out OUT.csv")
    recording = simulated(arguments.model, **given(arguments, simulated))
    write_plain(out, recording)
    tell_written(out, f"{len(recording)} samples in {recording.unit}")


@command({"--list": {"action": "store_true", "help": "one line per effect"}} | flags("--json"))
def effects(arguments: Arguments) -> None:
    """Print the catalogue of effects that may have been left out.

    With --list, one line per effect: identifier, kind, name.
    """
    from pendpipe.effects.catalogue import CATALOGUE

    entries = [
        {"id": each.identifier, "name": each.name, "kind": each.kind, "equation": each.equation}
        for each in CATALOGUE
    ]
    listed = "\n".join(f"{each.identifier:<27} {each.kind:<12} {each.name}" for each in CATALOGUE)
    print_answer(
        arguments,
        {"schema_version": 1, "effects": entries},
        listed if arguments.list else catalogue_manual().removesuffix("\n"),
    )


_HEADINGS: Final = {
    "dynamics": "## Dynamics: the motion itself",
    "measurement": "## Measurement: the motion is as the baseline has it, the reading is not",
}


def catalogue_manual() -> str:
    """Return the catalogue as Markdown, made from the effects' own declarations."""
    from pendpipe.effects.catalogue import CATALOGUE
    from pendpipe.templates import render

    return render(
        "pendpipe.effects",
        "manual.md",
        effects=CATALOGUE,
        headings=_HEADINGS,
        text=getdoc,
        number=lambda value: "" if value is None or math.isinf(value) else f"{value:g}",
    )


@command(
    {
        "file": {"nargs": "?", "default": str(CONFIGURATION), "help": "configuration to check"},
        "--schema": {
            "heading": ALTERNATIVES,
            "action": "store_true",
            "help": "print the JSON schema",
        },
        "--manual": {
            "heading": ALTERNATIVES,
            "action": "store_true",
            "help": "print the tables of the manual",
        },
    }
)
def config(arguments: Arguments) -> None:
    """Check a campaign's configuration, or print its schema or the manual's tables."""
    from pendpipe.configuration.load import read_configuration

    if arguments.schema:
        print(schema(), end="")
    elif arguments.manual:
        print(configuration_manual())
    else:
        campaign = _checked(read_configuration(arguments.file), arguments.file)
        count = f", {len(campaign.records)} records" if campaign else ""
        print(f"{arguments.file}: in order{count}")


BEGIN: Final = "<!-- made by `pendpipe config --manual`: begin -->"
END: Final = "<!-- end -->"


def schema() -> str:
    """The JSON schema of a configuration, as the file in ``workflow/schemas`` holds it."""
    from pendpipe.configuration.models import Configuration

    content = Configuration.model_json_schema()
    content["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return json.dumps(content, indent=1, sort_keys=True) + "\n"


def configuration_manual() -> str:
    """The tables of ``config/README.md``: every key, its kind, default and meaning."""
    from pendpipe.configuration.models import Configuration
    from pendpipe.templates import render

    content = Configuration.model_json_schema()
    models = {"top level": content}
    models |= {f"{name}: {each['description']}": each for name, each in content["$defs"].items()}
    return render(
        "pendpipe.configuration",
        "manual.md",
        begin=BEGIN,
        end=END,
        models=models,
    )


@command(
    {
        "folder": {
            "nargs": "?",
            "type": Path,
            "default": Path(),
            "metavar": "DIR",
            "help": "the folder of the campaign; by default this one",
        },
        "files": {"nargs": "*", "type": Path, "metavar": "FILE", "help": "recordings of your own"},
    }
)
def init(arguments: Arguments) -> None:
    """Begin a campaign of your own recordings in a folder.

    DIR gets config/config.yaml and config/records.tsv, the table of the records, with one row for
    each FILE, which stays where it is. Without FILEs it gets two example recordings. Then run
    `pendpipe campaign` in DIR. No file is ever replaced.
    """
    from pendpipe.files import write_whole

    folder: Path = arguments.folder
    files = _beginning(folder, arguments.files)
    there = [str(folder / name) for name in files if (folder / name).exists()]
    refuse_if(
        there,
        ", ".join(there),
        "there already" if len(there) > 1 else "it is there already",
        "nothing was written: name another folder, or move them away",
    )
    for name, content in files.items():
        write_whole(folder / name, content)
        print(folder / name)
    where = "" if folder == Path() else f"cd {folder} && "
    print(f"Now: {where}pendpipe campaign    (more of your own: config/records.tsv, a row each)")


def _beginning(folder: Path, own: list[Path]) -> dict[str, bytes]:
    """What a campaign begins with, by its path in the folder."""
    templates = resources.files("pendpipe.configuration") / "templates"
    examples = () if own else sorted((PROJECT / "examples").glob("*.csv"))
    table = (templates / "records.tsv").read_text(encoding="utf-8")
    if own:
        head = table[: table.index("\nstring\t")]
        table = f"{head}\n{_rows(folder, own)}"
    return {
        CONFIGURATION.as_posix(): (templates / "config.yaml").read_bytes(),
        "config/records.tsv": table.encode(),
        **{f"recordings/{path.name}": path.read_bytes() for path in examples},
    }


def _rows(folder: Path, own: list[Path]) -> str:
    """A row of the table for each recording, named after its file."""
    from pendpipe.configuration.load import LONGEST_NAME, unfit

    text, taken = io.StringIO(newline=""), set[str]()
    table = csv.writer(text, delimiter="\t", lineterminator="\n")
    for path in own:
        refuse_if(not path.is_file(), path, "there is no such file", "check the path")
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-._")[: LONGEST_NAME - 20]
        begin = f"record-{plain}".strip("-._") if any(unfit(plain)) else plain
        numbered = (f"{begin}-{number}" for number in range(2, len(own) + 2))
        name = next(each for each in (begin, *numbered) if each.lower() not in taken)
        taken.add(name.lower())
        source = Path(os.path.relpath(path, folder)).as_posix()
        # A file may have the name of what is no file.
        there = "./" * (source == "simulated" or source.startswith("dataq:"))
        refuse_if(
            source != source.strip(),
            repr(str(path)),
            "a table can't hold a name with a blank at its begin or end",
            "rename the file",
        )
        table.writerow([name, there + source])
    return text.getvalue()


@command(
    {
        "--config": {
            "type": Path,
            "default": CONFIGURATION,
            "metavar": "CONFIG",
            "help": "another configuration, laid over config/config.yaml where there is one",
        },
        "--record": {
            "action": "append",
            "default": [],
            "metavar": "NAME",
            "help": "run this record's own stages alone; repeatable",
        },
        "--cores": {"type": int, "metavar": "N", "help": "jobs at once; by default a core each"},
        "--profile": {
            "default": "default",
            "metavar": "NAME",
            "help": "where the jobs run: a profile of pendpipe, or a folder of your own",
        },
        "-n": {"dest": "dry_run", "action": "store_true", "help": "print what would run"},
        "snakemake": {"nargs": "...", "metavar": "-- ...", "help": "options of Snakemake"},
    }
)
def campaign(arguments: Arguments) -> int:
    """Run a campaign: every recording of a table through all stages, by Snakemake.

    Run it in the folder with config/config.yaml, which pendpipe init writes. Only what is new or
    has changed is done. All options of Snakemake can follow:

    pendpipe campaign -n                        shows what would run
    pendpipe campaign --record air-01           runs that record's own stages
    pendpipe campaign -- --forcerun fit         repeats the fits and what depends on them
    """
    given: Path = arguments.config
    refuse_if(
        not given.is_file(),
        given,
        "there is no such configuration",
        "pendpipe init writes one" if given == CONFIGURATION else "check the path",
    )
    campaign = _checked(_merged(given), given)
    for name in arguments.record:
        if campaign is None:
            raise InputError(given, "a table of numbers has no records", "drop --record")
        campaign.record(name)
    command = [sys.executable, "-P", "-m", "snakemake", "--snakefile", str(SNAKEFILE)]
    command += ["--workflow-profile", str(_profile(arguments.profile))]
    command += ["--cores", str(arguments.cores or "all")]
    command += ["--dry-run"] if arguments.dry_run else []
    command += [word for word in arguments.snakemake if word != "--"]
    # What may be several words comes last: what follows would be one more of them.
    command += ["--configfile", str(given)] if given != CONFIGURATION else []
    command += ["--config", f"only={json.dumps(arguments.record)}"] if arguments.record else []
    with subprocess.Popen(command) as snakemake:
        try:
            return snakemake.wait()
        except KeyboardInterrupt:
            # Snakemake was interrupted as well, and ends its jobs first.
            snakemake.wait()
            raise


def _checked(content: dict[str, Any], place: str | Path) -> "Campaign | None":
    """Check a configuration; None of a table of published numbers."""
    from pendpipe.configuration.load import load_campaign
    from pendpipe.configuration.published import load_published

    if "cases" not in content:
        return load_campaign(content, place)
    load_published(place, content)
    return None


def _merged(given: Path) -> dict[str, Any]:
    """Lay a configuration over the folder's own, as Snakemake does."""
    from pendpipe.configuration.load import read_configuration

    if given == CONFIGURATION or not CONFIGURATION.is_file():
        return read_configuration(given)
    from snakemake.utils import update_config

    content = read_configuration(CONFIGURATION)
    update_config(content, read_configuration(given))
    return content


def _profile(name: str) -> Path:
    """Find a profile: ours by its name, else a folder of the user's."""
    known = {path.name: path for path in sorted((PROJECT / "profiles").iterdir())}
    folder = known.get(name, Path(name).absolute())
    refuse_if(
        not (folder / "config.yaml").is_file(),
        f"--profile {name}",
        "there is no such profile",
        f"known are {', '.join(known)}; or name a folder, ./default say",
    )
    return folder
