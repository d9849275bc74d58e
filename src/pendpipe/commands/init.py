"""Begin a campaign of your own recordings in a folder.

DIR gets config/config.yaml and config/records.tsv, the table of the records: a row for each FILE,
which stays where it is. Without any it gets two recordings as examples. `pendpipe campaign` then
runs at once. No file is ever replaced.
"""

import os
import re
from importlib import resources
from pathlib import Path
from typing import Final

from pendpipe.arguments import Arguments, Flags
from pendpipe.configuration.load import LONGEST_NAME
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
    },
    "files": {"nargs": "*", "type": Path, "metavar": "FILE", "help": "recordings of your own"},
}


def run(arguments: Arguments) -> None:
    """Write the files."""
    folder: Path = arguments.folder
    files = _files(folder, arguments.files)
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
    print(f"Now: {where}pendpipe campaign    (more of your own: config/records.tsv, a row each)")


def _files(folder: Path, own: list[Path]) -> dict[str, bytes]:
    """What a campaign begins with, by its path in the folder."""
    templates = resources.files("pendpipe.configuration") / "templates"
    examples = () if own else sorted((PROJECT / "examples").glob("*.csv"))
    table = (templates / "records.tsv").read_text(encoding="utf-8")
    if own:
        head = table[: table.index("\nstring\t")]
        table = "\n".join([head, *_rows(folder, own)]) + "\n"
    return {
        CONFIGURATION.as_posix(): (templates / "config.yaml").read_bytes(),
        "config/records.tsv": table.encode(),
        **{f"recordings/{path.name}": path.read_bytes() for path in examples},
    }


def _rows(folder: Path, own: list[Path]) -> list[str]:
    """A row of the table for each recording, named after its file."""
    rows: dict[str, str] = {}
    for path in own:
        refuse_if(not path.is_file(), path, "there is no such file", "check the path")
        plain = re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-._")[:LONGEST_NAME] or "record"
        name = next(
            each
            for each in (plain, *(f"{plain}-{number}" for number in range(2, len(own) + 2)))
            if each.lower() not in rows
        )
        rows[name.lower()] = f"{name}\t{Path(os.path.relpath(path, folder)).as_posix()}"
    return list(rows.values())
