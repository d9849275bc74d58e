"""Write the files of a campaign's records out of an archive of its folder chunks."""

from pathlib import Path

from pendpipe.arguments import Arguments, command
from pendpipe.stages.archive import unpack


@command(
    {
        "archive": {"type": Path, "metavar": "FILE", "help": "what a job has left of its records"},
        "folder": {"type": Path, "metavar": "DIR", "help": "where their folders are"},
        "--file": {"metavar": "RECORD/NAME", "help": "this one alone"},
    }
)
def run(arguments: Arguments) -> None:
    """Write them."""
    unpack(arguments.archive, arguments.folder, lambda name: arguments.file in (None, name))
