"""Say what physics a whole campaign lacks (kept for later: the name is taken)."""

from __future__ import annotations

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe diagnose-campaign``."""
    parser.add_argument("folder", metavar="DIR", help="results of a campaign")


def run(arguments: argparse.Namespace) -> int:
    """Say that it is not there yet."""
    from pendpipe.errors import InputError

    raise InputError(
        arguments.folder,
        "diagnose-campaign is not available yet",
        "diagnose each recording with pendpipe diagnose FILE --out DIR",
    )
