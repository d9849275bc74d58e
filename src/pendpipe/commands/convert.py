"""Write any supported recording in the plain CSV form."""

import argparse
import sys
from pathlib import Path

from pendpipe.arguments import add_file, announce, read_options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``pendpipe convert``."""
    add_file(parser)
    parser.add_argument(
        "out",
        metavar="OUT",
        type=Path,
        help="OUT.csv, the plain form; - is standard output",
    )


def run(arguments: argparse.Namespace) -> None:
    """Read, say what was guessed, and write."""
    from pendpipe.formats import read
    from pendpipe.recording import check_name, plain_lines, write_plain

    piped = str(arguments.out) == "-"
    if not piped:
        check_name(arguments.out)
    recording = read(arguments.file, read_options(arguments))
    announce(arguments, recording)
    if piped:
        sys.stdout.writelines(plain_lines(recording))
        return
    write_plain(arguments.out, recording)
    print(f"{arguments.out}: {len(recording)} samples, {recording.quantity}")
