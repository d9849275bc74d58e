"""The arguments that every command shares which reads a recording."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pendpipe.formats import ReadOptions
    from pendpipe.recording import Recording


def add_arguments(parser: argparse.ArgumentParser, *, several: bool = False) -> None:
    """Declare FILE (or `several`, as ``files``) and the overrides of a reader's guesses."""
    about = "a recording in any supported format; - is standard input"
    if several:
        parser.add_argument("files", metavar="FILE", nargs="+", help=about)
    else:
        parser.add_argument("file", metavar="FILE", help=about)
    group = parser.add_argument_group("where a guess is wrong")
    group.add_argument("--channel", metavar="CHANNEL", help="number (from 1) or name, see inspect")
    group.add_argument(
        "--column",
        metavar="COLUMN",
        help="number (from 1) or name; X,Y for a position; TIME:COLUMN",
    )
    group.add_argument("--unit", metavar="UNIT", help="rad, deg, V, mm, counts, ...; or ms:deg")
    group.add_argument("--sample-rate", metavar="HZ", type=float, help="samples a second")
    group.add_argument("--decimal", metavar="SIGN", help="decimal sign, '.' or ','")
    group.add_argument("--delimiter", metavar="SIGN", help="sign between cells, or tab, space")
    group.add_argument(
        "--volts-per-radian", metavar="V", type=float, help="the sensor's constant, V/rad"
    )
    group.add_argument("--start", metavar="S", type=float, help="first time to read, seconds")
    group.add_argument("--stop", metavar="S", type=float, help="last time to read, seconds")


def options(arguments: argparse.Namespace) -> ReadOptions:
    """Turn the parsed arguments into the readers' options."""
    from pendpipe.formats import ReadOptions

    return ReadOptions(
        channel=arguments.channel,
        column=arguments.column,
        unit=arguments.unit,
        sample_rate=arguments.sample_rate,
        decimal=arguments.decimal,
        delimiter=arguments.delimiter,
        volts_per_radian=arguments.volts_per_radian,
        start_s=arguments.start,
        stop_s=arguments.stop,
    )


def announce(arguments: argparse.Namespace, recording: Recording) -> None:
    """Print what was guessed, the weak guesses first, to stderr."""
    for guess in recording.weak_guesses:
        print(f"{arguments.file}: a guess: {guess}", file=sys.stderr)
    for note in recording.notes:
        print(f"{arguments.file}: {note}", file=sys.stderr)


def digest(arguments: argparse.Namespace) -> str:
    """SHA-256 of FILE, or of what came through standard input."""
    import hashlib
    from pathlib import Path

    from pendpipe.formats.reading import file_bytes

    return hashlib.sha256(file_bytes(Path(arguments.file))).hexdigest()
