"""Write any supported recording in the plain CSV form, or as a WinDaq file (.wdh)."""

import sys
from pathlib import Path
from typing import Final

from pendpipe.arguments import FILE, OUTPUT, Arguments, announce, read_options, tell_written

ARGUMENTS: Final = FILE | {
    "out": {
        "metavar": "OUT",
        "type": Path,
        "help": "OUT.csv: the plain form (- writes it to standard output); OUT.wdh: WinDaq HiRes",
    }
    | OUTPUT
}


def run(arguments: Arguments) -> None:
    """Read, say what was guessed, and write."""
    from pendpipe.formats import read
    from pendpipe.formats.writing import check_name, write

    check_name(arguments.out)
    recording = read(arguments.file, read_options(arguments))
    announce(arguments, recording)
    for note in write(arguments.out, recording):
        print(f"{arguments.out}: {note}", file=sys.stderr)
    tell_written(arguments.out, f"{len(recording)} samples, {recording.quantity}")
