"""What Snakemake plans, asked in this process: another would take a second to begin."""

import contextlib
import io
import os
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from unittest.mock import patch


def snakemake(folder: Path, *arguments: str) -> tuple[int, str]:
    """Status and words of a call that runs no job.

    It runs a loop of events of its own, which a thread that drives a browser has already: so it has
    a thread of its own.
    """
    from snakemake.cli import main

    said = io.StringIO()
    with (
        ThreadPoolExecutor(1) as thread,
        patch.dict(os.environ),
        contextlib.chdir(folder),
        contextlib.redirect_stdout(said),
        contextlib.redirect_stderr(said),
    ):
        try:
            thread.submit(main, [*arguments]).result()
        except SystemExit as end:
            return int(end.code or 0), said.getvalue()
    raise AssertionError("it always ends so")


def jobs_in(said: str) -> dict[str, int]:
    """The table of jobs of a plan, or of what was run."""
    table = re.findall(r"^(\w+) +(\d+)$", said, flags=re.MULTILINE)
    return {name: int(count) for name, count in table}


def planned(folder: Path, *arguments: str) -> dict[str, int]:
    """Count the jobs that Snakemake would run."""
    status, said = snakemake(folder, "-n", "--nolock", *arguments)
    assert status == 0, said
    return jobs_in(said)
