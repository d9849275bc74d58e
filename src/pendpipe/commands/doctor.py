"""Examine a campaign's results: altered and unfinished files, locks and leftovers.

Nothing is changed. Each line names a file or folder, what is wrong with it, and what is safe
to do. The exit status is 0, unless ``--fail-on findings`` asks for 3.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

from pendpipe import manifest
from pendpipe.arguments import Arguments, command, print_answer
from pendpipe.errors import InputError, refuse_if
from pendpipe.options import flags

TEMPORARY: Final = re.compile(r"\.(.+)\.[0-9a-f]{8}")
"""The name of a file that `pendpipe.files.replaced` had not finished."""
_OF_NO_STAGE: Final = (manifest.FOLDER, "logs", "raw")
"""Folders in one with results that hold none."""
_CHALLENGE: Final = ("challenge", "challenge-sealed")
_LEAVE: Final = "no stage reads it: keep it, or move it elsewhere"
_RUN: Final = "snakemake makes it again"
_NAMES: Final = (
    *("recording.csv", "calibration.json", "turning_points.csv", "fit.json", "refused.json"),
    *("diagnosis.json", "caliper.csv", "sensor.json", "separation.json", "comparison.json"),
    *("campaign.json", "report.html", "records.csv", "records.parquet"),
)
"""Of results, beside those that manifests list."""


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
    stages = [stage for home in homes for stage in manifest.manifests(home)]
    found += [finding for stage in stages for finding in _of_manifest(stage)]
    listed = {(stage.home / name).resolve() for stage in stages for name in stage.outputs}
    found += _of_files(results, homes, listed)
    refuse_if(
        not (homes or found),
        results,
        "no stage has left results here",
        "name a campaign's folder of results",
    )
    return found


def _homes(results: Path) -> list[Path]:
    """The folders with a manifest: a campaign's, its records', and those of others in it."""
    found = (path.parent for path in results.rglob(manifest.FOLDER) if any(path.glob("*.json")))
    return sorted(home for home in found if not set(_inside(home, results)) & set(_CHALLENGE))


def _inside(path: Path, folder: Path) -> tuple[str, ...]:
    return path.relative_to(folder).parts


def _of_manifest(stage: manifest.Manifest) -> Iterator[Finding]:
    """Results that are not what their stage wrote, from other files, or never finished."""
    damages, index = stage.damages(hash_all=True), manifest.Index()
    for damage in damages:
        kind = "incomplete" if damage.found == "missing" else "altered"
        yield Finding(kind, str(damage.path), damage.problem, _RUN)
    for path in (stage.home / name for name in stage.outputs):
        if path.is_file() and (stale := index.made_from_others(path, stage)):
            yield Finding("stale", str(path), stale.problem, _RUN)
    if not stage.outputs and not damages:
        yield Finding(
            "incomplete",
            str(stage.home),
            f"stage {stage.stage} began and did not end",
            "snakemake runs it again",
        )


def _of_files(results: Path, homes: list[Path], listed: set[Path]) -> Iterator[Finding]:
    """Files that no stage claims, and recordings that were never decoded."""
    names, known = {path.name for path in listed} | set(_NAMES), set(homes)
    campaigns = {parent for home in homes for parent in home.parents}
    for path in sorted(path for path in results.rglob("*") if path.is_file()):
        if set(_inside(path, results)) & set(_CHALLENGE):
            continue
        home = next((parent for parent in path.parents if parent in known), None)
        ours = path.resolve() in listed or path.name.lower() == "readme.md"
        begun = TEMPORARY.fullmatch(path.name)
        if begun and (begun[1] in names or path.parent.name == manifest.FOLDER):
            yield Finding(
                "temporary",
                str(path),
                "a process was killed while it wrote this",
                "delete it when no run is alive",
            )
        elif manifest.SET_ASIDE in path.name:
            yield Finding(
                "set-aside",
                str(path),
                "a damaged result, kept when it was made again",
                _LEAVE,
            )
        elif path.suffix == ".raw":
            yield from _undecoded(path)
        elif home is None or ours or set(_inside(path, home)) & set(_OF_NO_STAGE):
            continue
        # A folder in the campaign's own is the user's, unless a stage works there.
        elif path.parent == home or home not in campaigns:
            yield Finding("orphaned", str(path), "no stage has written this", _LEAVE)


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
