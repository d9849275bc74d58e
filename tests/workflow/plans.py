"""What Snakemake plans and runs, in this process: another would take seconds to begin."""

import contextlib
import io
import os
import re
import sys
import warnings
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import pendpipe

LIBRARY = str(Path(pendpipe.__file__).parents[1])
"""What is tested is what the jobs run."""


def snakemake(folder: Path, *arguments: str) -> tuple[int, str]:
    """Status and words of a call.

    It runs a loop of events of its own, which a thread that drives a browser has already: so it has
    a thread of its own. It leaves the environments of its jobs open.
    """
    from snakemake.cli import main

    said = io.StringIO()
    with (
        ThreadPoolExecutor(1) as thread,
        patch.dict(os.environ, PYTHONPATH=LIBRARY),
        warnings.catch_warnings(action="ignore", category=ResourceWarning),
        contextlib.chdir(folder),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
    ):
        try:
            thread.submit(main, [*arguments]).result()
        except SystemExit as end:
            return int(end.code or 0), said.getvalue()
    raise AssertionError("it always ends so")


def _here(command: Sequence[str]) -> contextlib.AbstractContextManager[SimpleNamespace]:
    """Call Snakemake, in the place of a process that is begun in the working folder."""
    status, said = snakemake(Path(), *command[command.index("snakemake") + 1 :])
    print(said, file=sys.stderr)
    return contextlib.nullcontext(SimpleNamespace(wait=lambda: status))


def campaign(folder: Path, *words: str) -> tuple[int, str]:
    """Status and words of `pendpipe campaign`, which begins Snakemake."""
    from pendpipe.cli import main

    with (
        patch("pendpipe.commands.small.subprocess", SimpleNamespace(Popen=_here)),
        contextlib.chdir(folder),
        contextlib.redirect_stderr(said := io.StringIO()),
    ):
        return main(["campaign", *words]), said.getvalue()


def jobs_in(said: str) -> dict[str, int]:
    """The table of jobs of a plan, or of what was run."""
    table = re.findall(r"^(\w+) +(\d+)$", said, flags=re.MULTILINE)
    return {name: int(count) for name, count in table}


def planned(folder: Path, *arguments: str) -> dict[str, int]:
    """Count the jobs that Snakemake would run."""
    status, said = snakemake(folder, "-n", "--nolock", *arguments)
    assert status == 0, said
    return jobs_in(said)
