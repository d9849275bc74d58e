"""Print the catalogue of effects that may have been left out, as docs/effects.md has it.

With --list, one line an effect: identifier, kind, name.
"""

from typing import Final

from pendpipe.arguments import Arguments, print_answer, shared

ARGUMENTS: Final = {"--list": {"action": "store_true", "help": "one line an effect"}} | shared(
    "--json"
)


def run(arguments: Arguments) -> None:
    """Print."""
    from pendpipe.effects.catalogue import CATALOGUE
    from pendpipe.effects.manual import page

    entries = [
        {"id": each.identifier, "name": each.name, "kind": each.kind, "equation": each.equation}
        for each in CATALOGUE
    ]
    listed = "\n".join(f"{each.identifier:<22}{each.kind:<13}{each.name}" for each in CATALOGUE)
    print_answer(
        arguments,
        {"schema_version": 1, "effects": entries},
        listed if arguments.list else page().removesuffix("\n"),
    )
