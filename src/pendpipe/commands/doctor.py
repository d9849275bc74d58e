"""Examine a campaign's results: what was altered, is unfinished, or is in the way.

Nothing is changed. Each line names a file or folder, what is wrong with it, and what is safe
to do. The exit status is 0, unless ``--fail-on findings`` asks for 3.
"""

import argparse
from pathlib import Path

from pendpipe.arguments import add, print_answer


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe doctor``."""
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=Path("results"),
        metavar="DIR",
        help="a folder of results (%(default)s)",
    )
    add(parser, "--json")
    parser.add_argument(
        "--fail-on", choices=("findings",), help="end with status 3 if anything is wrong"
    )


def run(arguments: argparse.Namespace) -> int:
    """Examine and print."""
    from pendpipe.doctor import examine

    found = examine(arguments.folder)
    content = {"schema_version": 1, "findings": [finding._asdict() for finding in found]}
    sound = f"{arguments.folder}: all results are as their stages wrote them"
    print_answer(arguments, content, "\n".join(map(str, found)) or sound)
    return 3 if found and arguments.fail_on else 0
