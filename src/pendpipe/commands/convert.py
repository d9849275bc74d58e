"""Write any supported recording in the plain CSV form."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from pendpipe.commands import _reading


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe convert``."""
    _reading.add_arguments(parser)
    parser.add_argument("out", metavar="OUT.csv", type=Path, help="the plain form")


def run(arguments: argparse.Namespace) -> int:
    """Read, say what was guessed, and write."""
    from pendpipe.formats import read
    from pendpipe.recording import write_plain

    recording = read(arguments.file, _reading.options(arguments))
    for note in recording.notes:
        print(f"{arguments.file}: {note}", file=sys.stderr)
    write_plain(arguments.out, recording)
    print(f"{arguments.out}: {len(recording)} samples, {recording.quantity}")
    return 0
