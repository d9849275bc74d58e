"""Write any supported recording in the plain CSV form, or as a WinDaq file (.wdh)."""

import sys
from pathlib import Path
from typing import Final

from pendpipe.arguments import FILE, Arguments, announce, read_options

ARGUMENTS: Final = FILE | {
    "out": {
        "metavar": "OUT",
        "type": Path,
        "help": "OUT.csv: the plain form (- writes it to standard output); OUT.wdh: WinDaq HiRes",
    }
}


def run(arguments: Arguments) -> None:
    """Read, say what was guessed, and write."""
    from pendpipe.formats import read
    from pendpipe.formats.writing import check_name, write
    from pendpipe.recording import plain_lines

    piped = str(arguments.out) == "-"
    if not piped:
        check_name(arguments.out)
    recording = read(arguments.file, read_options(arguments))
    announce(arguments, recording)
    if piped:
        sys.stdout.writelines(plain_lines(recording))
        return
    for note in write(arguments.out, recording):
        print(f"{arguments.out}: {note}", file=sys.stderr)
    print(f"{arguments.out}: {len(recording)} samples, {recording.quantity}")
