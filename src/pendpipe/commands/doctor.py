"""Examine a campaign's results: altered and unfinished files, locks and leftovers.

Nothing is changed. Each line names a file or folder, what is wrong with it, and what is safe
to do. The exit status is 0, unless ``--fail-on findings`` asks for 3.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final, NamedTuple

from pendpipe.arguments import Arguments, command, print_answer
from pendpipe.errors import InputError, refuse_if
from pendpipe.files import SET_ASIDE, damage_of
from pendpipe.options import flags
from pendpipe.stages.archive import FOLDER, archives, hashes, made_in, members

TEMPORARY: Final = re.compile(r"\.(.+)\.[0-9a-f]{8}")
"""The name of a file that `pendpipe.files.replaced` had not finished."""
_CHALLENGE: Final = ("challenge", "challenge-sealed")
_LEAVE: Final = "no stage reads it: keep it, or move it elsewhere"
_RUN: Final = "snakemake makes it again"
_NAMES: Final = (
    *("recording.csv", "calibration.json", "turning_points.csv", "fit.json", "refused.json"),
    *("diagnosis.json", "decay.svg", "record.html", "caliper.csv", "sensor.json"),
    *("separation.json", "comparison.json", "campaign.json", "campaign_diagnosis.json"),
    *("report.html", "records.csv", "records.parquet", "drawn.json"),
)
"""Of results, beside the archives of chunks."""


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
        ``altered``, ``incomplete``, ``stale``, ``orphaned``, ``locked``, ``temporary``,
        ``raw`` or ``set-aside``.
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
    if not results.is_dir():
        if found:  # killed before the first result
            return found
        raise InputError(results, "there is no such folder", "name a folder of results")
    homes = _homes(results)
    found += [finding for home in homes for finding in _stale(home)]
    found += _of_files(results, homes)
    refuse_if(
        not (homes or found),
        results,
        "no stage has left results here",
        "name a campaign's folder of results",
    )
    return found


def _homes(results: Path) -> dict[Path, set[str]]:
    """The folders of campaigns' results, this one and others in it, with their records."""
    folders = {path.parent.parent for path in results.rglob(f"{FOLDER}/*.zip")}
    return {
        home: {name.partition("/")[0] for path in archives(home, "*") for name in members(path)}
        for home in sorted(folders)
        if not _of_the_challenge(home, results)
    }


def _of_the_challenge(path: Path, results: Path) -> bool:
    return bool({*path.relative_to(results).parts} & {*_CHALLENGE})


def _stale(home: Path) -> Iterator[Finding]:
    """Results that were made from other files than those that there are now."""
    whole = [path for path in archives(home, "*") if damage_of(path) is None]
    now = {name: found for path in whole for name, found in hashes(path).items()}
    for path in whole:
        for record, made in made_in(path).items():
            for name, was in made["read"].items():
                if now.get(f"{record}/{name}", was) != was:
                    problem = f"{record} in it was made from another {name} than the one there now"
                    yield Finding("stale", str(path), problem, _RUN)


def _of_files(results: Path, homes: Mapping[Path, set[str]]) -> Iterator[Finding]:
    """Results that are not as they were written, files of nobody, recordings never decoded."""
    for path in sorted(path for path in results.rglob("*") if path.is_file()):
        ours = path.name in _NAMES or (path.parent.name == FOLDER and path.suffix == ".zip")
        begun = TEMPORARY.fullmatch(path.name)
        if _of_the_challenge(path, results):
            continue
        if begun and (begun[1] in _NAMES or path.parent.name == FOLDER):
            problem = "a process was killed while it wrote this"
            yield Finding("temporary", str(path), problem, "delete it when no run is alive")
        elif SET_ASIDE in path.name:
            problem = "a damaged result, kept when it was made again"
            yield Finding("set-aside", str(path), problem, _LEAVE)
        elif path.suffix == ".raw":
            yield from _undecoded(path)
        elif ours and (damage := damage_of(path)):
            yield Finding("altered", str(path), damage.problem, _RUN)
        elif not ours and _is_orphan(path, homes):
            yield Finding("orphaned", str(path), "no stage has written this", _LEAVE)


def _is_orphan(path: Path, homes: Mapping[Path, set[str]]) -> bool:
    """Whether a file lies among a campaign's results or in a record's folder, and is nobody's.

    Another folder is the user's, and so are the folders of raw recordings and of logs.
    """
    home = next((parent for parent in path.parents if parent in homes), None)
    if home is None or path.name.lower() == "readme.md":
        return False
    first, *rest = path.relative_to(home).parts
    of_a_record = first in homes[home] and {*rest[:-1]} <= {"diagnosis", "figures"}
    return not rest or (of_a_record and rest[0] != "diagnosis")


def _undecoded(raw: Path) -> Iterator[Finding]:
    """A raw recording without its CSV."""
    in_campaign = raw.parent.name == "raw"
    table = raw.parent.parent / "recording.csv" if in_campaign else raw.with_suffix(".csv")
    if table.is_file():
        with table.open("rb") as stream:
            if stream.read(10) != b"# refused:":
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
    """Locks, and results that Snakemake knows to be unfinished."""
    if any(folder.glob("locks/*")):
        problem, safe = "a run was killed", "snakemake --unlock, then run again"
        if alive := _alive(folder.parent):
            problem, safe = f"Snakemake is at work (process {alive})", "wait until it ends"
        yield Finding("locked", str(folder / "locks"), problem, safe)
    unfinished = sum(1 for path in folder.glob("incomplete/**/*") if path.is_file())
    if unfinished:
        yield Finding(
            "incomplete",
            str(folder / "incomplete"),
            f"{unfinished} results were being written when a run was killed",
            _RUN,
        )


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
