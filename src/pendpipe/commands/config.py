"""Check a campaign's configuration, or print its schema or the manual's tables."""

import json
from typing import Final

from pendpipe.arguments import ALTERNATIVES, Arguments, Flags
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


def run(arguments: Arguments) -> None:
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
    )
