"""The way of a recording through the house: the files that a command passes, and its returns.

    python -m benchmarks.rooms [RECORDING] [--commit 2af5a66]

A command runs once, and every function of the library is noted where it is called first. Stays
are runs of such calls within one file, rooms the files, returns the stays beyond the first in
each. Loops and later calls add nothing, so that only the order of the code counts.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from itertools import groupby
from pathlib import Path
from typing import Final

from benchmarks.house import copy_of
from benchmarks.journal import ROOT
from benchmarks.table import head, table_row

COMMANDS: Final = {"fit": ["--out", "fit.json"], "diagnose": ["--no-figures", "--out", "answer"]}
TRACED: Final = """
import json, sys
from pendpipe import cli
package, seen = sys.argv[1], {}
def note(frame, event, argument):
    code = frame.f_code
    if event == "call" and code.co_filename.startswith(package) and code.co_name[0] != "<":
        seen.setdefault((code.co_filename, code.co_firstlineno))
sys.setprofile(note)
status = cli.main(sys.argv[2:])
sys.setprofile(None)
json.dump([file for file, _ in seen], open("seen.json", "w"))
sys.exit(status)
"""


def trip(tree: Path, command: str, recording: Path) -> tuple[int, int, int]:
    """Stays, rooms and returns of one command on a recording."""
    environment = {**os.environ, "PYTHONPATH": str(tree / "src")}
    traced = ["-c", TRACED, str(tree / "src" / "pendpipe")]
    words = [command, str(recording), *COMMANDS[command]]
    with tempfile.TemporaryDirectory() as folder:
        # The first run compiles, which is another way, and a long one.
        for how in (["-m", "pendpipe.cli"], traced):
            call = [sys.executable, *how, *words]
            run = subprocess.run(call, cwd=folder, env=environment, capture_output=True, text=True)
            if run.returncode:
                sys.exit(run.stderr)
        files: list[str] = json.loads((Path(folder) / "seen.json").read_text("utf-8"))
    stays, rooms = len(list(groupby(files))), len(set(files))
    return stays, rooms, stays - rooms


def main() -> None:
    """Print the trips of a commit beside those of what is here."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    known = ROOT / "examples" / "rod-pendulum.csv"
    parser.add_argument("recording", type=Path, nargs="?", default=known)
    parser.add_argument("--commit", metavar="REF", help="a commit to set beside what is here")
    arguments = parser.parse_args()
    print(head("command", "commit", "stays", "rooms", "returns"))
    with tempfile.TemporaryDirectory() as folder:
        trees = {"here": copy_of(None, Path(folder))}
        if arguments.commit:
            trees = {arguments.commit: copy_of(arguments.commit, Path(folder)), **trees}
        for command in COMMANDS:
            for name, tree in trees.items():
                found = trip(tree, command, arguments.recording.resolve())
                print(table_row(command, [name, *found]), flush=True)


if __name__ == "__main__":
    main()
