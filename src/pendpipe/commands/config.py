"""Check a campaign's configuration, or print its schema or the manual's tables."""

import argparse
import json
from collections.abc import Iterator
from typing import Any, Final

from pendpipe.arguments import ALTERNATIVES, Flags
from pendpipe.configuration.load import load_campaign, read_configuration
from pendpipe.configuration.models import Configuration
from pendpipe.templates import render

BEGIN: Final = "<!-- made by `pendpipe config --manual`: begin -->"
END: Final = "<!-- end -->"


ARGUMENTS: Final[Flags] = {
    "file": {"nargs": "?", "default": "config/config.yaml", "help": "configuration to check"},
    "--schema": {"heading": ALTERNATIVES, "action": "store_true", "help": "print the JSON schema"},
    "--manual": {
        "heading": ALTERNATIVES,
        "action": "store_true",
        "help": "print the tables of the manual",
    },
}


def run(arguments: argparse.Namespace) -> None:
    """Check, or print."""
    if arguments.schema:
        print(schema(), end="")
    elif arguments.manual:
        print(manual())
    else:
        campaign = load_campaign(read_configuration(arguments.file), arguments.file)
        print(f"{arguments.file}: in order, {len(campaign.records)} records")


def schema() -> str:
    """The JSON schema of a configuration, as the file in ``workflow/schemas`` holds it."""
    content = Configuration.model_json_schema()
    content["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    return json.dumps(content, indent=1, sort_keys=True) + "\n"


def manual() -> str:
    """The tables of ``config/README.md``: every key, its kind, default and meaning."""
    content = Configuration.model_json_schema()
    models = {"top level": content}
    models |= {f"{name}: {each['description']}": each for name, each in content["$defs"].items()}
    return render(
        "pendpipe.configuration",
        "manual.md",
        begin=BEGIN,
        end=END,
        models=models,
        kind=_kind,
        default=_default,
    )


def _kind(entry: dict[str, Any]) -> str:
    """The kind of a value in a reader's words."""
    return " or ".join(dict.fromkeys(_kinds(entry)))


def _kinds(entry: dict[str, Any]) -> Iterator[str]:
    if "$ref" in entry:
        yield entry["$ref"].rpartition("/")[2]
    elif "enum" in entry:
        yield ", ".join(f"`{value}`" for value in entry["enum"])
    elif "anyOf" in entry:
        for option in entry["anyOf"]:
            yield from _kinds(option)
    elif "additionalProperties" in entry:
        yield "names, each with " + _kind(entry["additionalProperties"])
    else:
        yield {"null": "blank", "string": "text", "boolean": "true or false"}.get(
            entry["type"], str(entry["type"])
        )


def _default(entry: dict[str, Any], required: bool) -> str:
    if required:
        return "needed"
    default = entry.get("default")
    if default is None or isinstance(default, dict):
        return "blank" if default is None and "default" in entry else "see there"
    return f"`{json.dumps(default)}`"
