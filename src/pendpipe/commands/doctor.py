"""Examine a campaign's results for what Snakemake can't see: altered files and leftovers, a lock.

Nothing is changed. Each line names a file or folder, what is wrong with it, and what is safe
to do. The exit status is 0, unless ``--fail-on findings`` asks for 3.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

from pendpipe.arguments import Arguments, command, print_answer
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import SET_ASIDE, damage_of
from pendpipe.options import flags
from pendpipe.stages.archive import FOLDER
from pendpipe.stages.refusal import is_stub

TEMPORARY: Final = re.compile(r"\.(.+)\.[0-9a-f]{8}")
"""The name of a file that `pendpipe.files.replaced` had not finished."""
_FOLDERS: Final = {FOLDER: ".zip", "pages": ".html"}
"""Whose files have names of their own, by what these end with."""
_CHALLENGE: Final = ("challenge", "challenge-sealed")
_LEAVE: Final = "no stage reads it: keep it, or move it elsewhere"
_RUN: Final = "snakemake makes it again"
_NAMES: Final = (
    *("recording.csv", "calibration.json", "turning_points.csv", "fit.json", "refused.json"),
    *("diagnosis.json", "decay.svg", "caliper.csv", "sensor.json"),
    *("separation.json", "comparison.json", "campaign.json", "campaign_diagnosis.json"),
    *("report.html", "records.csv", "records.parquet", "drawn.json"),
)
"""Of results, beside the archives of chunks and the records' own pages."""


@command(
    {
        "folder": {
            "nargs": "?",
            "type": Path,
            "default": Path("results"),
            "metavar": "DIR",
            "help": "a folder of results (%(default)s)",
        },
        **flags("--json"),
        "--fail-on": {"choices": ("findings",), "help": "end with status 3 if anything is wrong"},
    }
)
def run(arguments: Arguments) -> int:
    """Examine and print."""
    found = examine(arguments.folder)
    content = {"schema_version": 1, "findings": [finding._asdict() for finding in found]}
    sound = f"{arguments.folder}: all results are as their stages wrote them"
    print_answer(arguments, content, "\n".join(map(str, found)) or sound)
    return 3 if found and arguments.fail_on else 0


class Finding(NamedTuple):
    """Something that is not as it should be.

    Parameters
    ----------
    kind
        ``altered``, ``locked``, ``temporary``, ``raw`` or ``set-aside``.
    path
        Where.
    problem
        What is wrong.
    safe
        What can be done without losing anything.
    """

    kind: str
    path: str
    problem: str
    safe: str

    def __str__(self) -> str:
        return f"{self.path}: {self.problem}; {self.safe}"


def examine(results: Path) -> list[Finding]:
    """Examine a campaign's folder of results; nothing is changed.

    Raises
    ------
    InputError
        If there is no such folder, or no results in it, nor a sign of a run that was to make it.
    """
    found = [
        finding
        for project in dict.fromkeys((Path(), results.parent))
        for finding in _of_snakemake(project / ".snakemake")
    ]
    # Killed before the first result it is a lock alone.
    missing = not (found or results.is_dir())
    refuse_if(missing, results, "there is no such folder", "name a folder of results")
    found += _of_files(results)
    refuse_if(
        not (found or any(results.rglob(f"{FOLDER}/*.zip"))),
        results,
        "no stage has left results here",
        "name a campaign's folder of results",
    )
    return found


def _of_files(results: Path) -> Iterator[Finding]:
    """Results that are not as they were written, leftovers, recordings never decoded."""
    for path in sorted(path for path in results.rglob("*") if path.is_file()):
        ours = path.name in _NAMES or (path.parent.name, path.suffix) in _FOLDERS.items()
        begun = TEMPORARY.fullmatch(path.name)
        if {*path.relative_to(results).parts} & {*_CHALLENGE}:
            continue
        if begun and (begun[1] in _NAMES or path.parent.name in _FOLDERS):
            problem = "a process was killed while it wrote this"
            yield Finding("temporary", str(path), problem, "delete it when no run is alive")
        elif SET_ASIDE in path.name:
            problem = "a damaged result, kept when it was made again"
            yield Finding("set-aside", str(path), problem, _LEAVE)
        elif path.suffix == ".raw":
            yield from _undecoded(path)
        elif ours and (damage := damage_of(path)):
            yield Finding("altered", str(path), damage.problem, _RUN)


def _undecoded(raw: Path) -> Iterator[Finding]:
    """A raw recording without its CSV."""
    in_campaign = raw.parent.name == "raw"
    table = raw.parent.parent / "recording.csv" if in_campaign else raw.with_suffix(".csv")
    if table.is_file() and not is_stub(table):
        return
    from pendpipe.acquisition.attempts import read_attempts

    call = "snakemake" if in_campaign else f"pendpipe acquire --recover {raw} --out {table}"
    problem, safe = f"there is no {table.name} of it", f"{call} makes it"
    try:
        if not read_attempts([raw]):
            problem, safe = "it holds no scan", _LEAVE
    except InputError as fault:
        problem, safe = fault.problem, fault.remedy
    yield Finding("raw", str(raw), problem, safe)


def _of_snakemake(folder: Path) -> Iterator[Finding]:
    """A lock, and whether the run that took it is alive."""
    if any(folder.glob("locks/*")):
        problem, safe = "a run was killed", "snakemake --unlock, then run again"
        if alive := _alive(folder.parent):
            problem, safe = f"Snakemake is at work (process {alive})", "wait until it ends"
        yield Finding("locked", str(folder / "locks"), problem, safe)


def _alive(project: Path) -> int | None:
    """Find a living Snakemake of a project."""
    import psutil

    for process in psutil.process_iter(("cmdline", "cwd")):
        # Of somebody else's processes the system says neither.
        words, folder = process.info["cmdline"] or (), process.info["cwd"]
        of_snakemake = any("snakemake" in word for word in words[:3])
        if of_snakemake and folder and Path(folder) == project.resolve():
            return int(process.pid)
    return None
