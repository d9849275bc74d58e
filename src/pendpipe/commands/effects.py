"""Print the catalogue of effects that may have been left out, as docs/effects.md has it.

With --list, one line an effect: identifier, kind, name.
"""

import argparse

from pendpipe.arguments import add, print_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe effects``."""
    parser.add_argument("--list", action="store_true", help="one line an effect")
    add(parser, "--json")


def run(arguments: argparse.Namespace) -> int:
    """Print."""
    from pendpipe.effects.catalogue import CATALOGUE
    from pendpipe.effects.manual import page

    if arguments.json:
        entries = [
            {"id": each.identifier, "name": each.name, "kind": each.kind, "equation": each.equation}
            for each in CATALOGUE
        ]
        print_json({"schema_version": 1, "effects": entries})
    elif arguments.list:
        for effect in CATALOGUE:
            print(f"{effect.identifier:<22}{effect.kind:<13}{effect.name}")
    else:
        print(page(), end="")
    return 0
