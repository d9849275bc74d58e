"""Print the catalogue of effects that may have been left out.

With --list, one line an effect: identifier, kind, name.
"""

import inspect
import math
from typing import Final

from pendpipe.arguments import Arguments, print_answer, shared
from pendpipe.effects.catalogue import CATALOGUE
from pendpipe.templates import render

ARGUMENTS: Final = {"--list": {"action": "store_true", "help": "one line an effect"}} | shared(
    "--json"
)
_HEADINGS: Final = {
    "dynamics": "## Dynamics: the motion itself",
    "measurement": "## Measurement: the motion is as the baseline has it, the reading is not",
}


def run(arguments: Arguments) -> None:
    """Print."""
    entries = [
        {"id": each.identifier, "name": each.name, "kind": each.kind, "equation": each.equation}
        for each in CATALOGUE
    ]
    listed = "\n".join(f"{each.identifier:<27} {each.kind:<12} {each.name}" for each in CATALOGUE)
    print_answer(
        arguments,
        {"schema_version": 1, "effects": entries},
        listed if arguments.list else manual().removesuffix("\n"),
    )


def manual() -> str:
    """Return the catalogue as Markdown, made from the effects' own declarations."""
    return render(
        "pendpipe.effects",
        "manual.md",
        effects=CATALOGUE,
        headings=_HEADINGS,
        text=inspect.getdoc,
        number=lambda value: "" if value is None or math.isinf(value) else f"{value:g}",
    )
