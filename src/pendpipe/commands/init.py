"""Begin a campaign of your own recordings in a folder.

DIR gets config/config.yaml, config/records.tsv (the table of the records) and two recordings as
examples, with which `pendpipe campaign` runs at once. No file is ever replaced.
"""

from importlib import resources
from pathlib import Path
from typing import Final

from pendpipe.arguments import Arguments, Flags
from pendpipe.errors import refuse_if
from pendpipe.files import write_whole
from pendpipe.project import CONFIGURATION, PROJECT

ARGUMENTS: Final[Flags] = {
    "folder": {
        "nargs": "?",
        "type": Path,
        "default": Path(),
        "metavar": "DIR",
        "help": "the folder of the campaign; by default this one",
    }
}


def run(arguments: Arguments) -> None:
    """Write the files."""
    folder: Path = arguments.folder
    files = _files()
    there = [str(folder / name) for name in files if (folder / name).exists()]
    refuse_if(
        there,
        ", ".join(there),
        "there already" if len(there) > 1 else "it is there already",
        "nothing was written: name another folder, or move them away",
    )
    for name, content in files.items():
        write_whole(folder / name, content)
        print(folder / name)
    where = "" if folder == Path() else f"cd {folder} && "
    print(f"Now: {where}pendpipe campaign    (your own files: config/records.tsv, a row each)")


def _files() -> dict[str, bytes]:
    """What a campaign begins with, by its path in the folder."""
    templates = resources.files("pendpipe.configuration") / "templates"
    examples = sorted((PROJECT / "examples").glob("*.csv"))
    return {
        CONFIGURATION.as_posix(): (templates / "config.yaml").read_bytes(),
        "config/records.tsv": (templates / "records.tsv").read_bytes(),
        **{f"recordings/{path.name}": path.read_bytes() for path in examples},
    }
