"""What each stage read and wrote: length and hash, kept beside the results.

A stage that ends leaves ``manifest/<stage>.json`` in its folder (a record's, or the
campaign's), a file for each stage since fit and diagnosis run at once. A job hashes every
result that it reads and compares it with the manifest of the stage that wrote it: a
damaged file is set aside under another name, and Snakemake makes it again.

Planning must notice a file whose old time was put back, without hashing thousands of
files. No program can set a file's time of change (``st_ctime``): a file of the right
length that has not changed since its manifest was written is sound.

Snakemake compares a rule's parameters with those of its last run. One of `histories` is
such a parameter: it lists every damage of a stage's results, and keeps those that were repaired,
so that each damage runs the stage once.
"""

import os
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

from pendpipe.errors import DamagedError, InputError
from pendpipe.files import digest, is_file, read_json, sha256, write_json, writing
from pendpipe.version import __version__

FOLDER: Final = "manifest"
SET_ASIDE: Final = ".damaged-"
"""Stands in the name of a damaged file, before the first digits of its hash."""


class Sum(NamedTuple):
    """Length and hash of a file."""

    length: int
    sha256: str


class Damage(NamedTuple):
    """A result that is not what its stage wrote."""

    path: Path
    problem: str
    found: str
    """First digits of the hash of what is there now; ``missing`` where nothing is."""

    @property
    def mark(self) -> str:
        """Name the damage in a manifest's history."""
        return f"{self.path.name}:{self.found}"


@dataclass
class Manifest:
    """What one stage read and wrote.

    Parameters
    ----------
    home
        The folder that the names are relative to.
    stage
        Its name.
    outputs
        The files that Snakemake knows, by name.
    extras
        Others: a figure of a record, ``refused.json``.
    inputs
        Results of other stages that were read, by name, with their hashes.
    sources
        Files of the user, by name alone.
    repaired
        Marks of the damages that made the stage run again.
    key
        Digest of what the stage of a record was done with; empty while it is not done.
    own_damage
        Where the manifest's own file can't be believed; it then lists nothing.
    """

    home: Path
    stage: str
    outputs: dict[str, Sum] = field(default_factory=dict)
    extras: dict[str, Sum] = field(default_factory=dict)
    inputs: dict[str, str] = field(default_factory=dict)
    sources: dict[str, Sum] = field(default_factory=dict)
    repaired: tuple[str, ...] = ()
    key: str = ""
    own_damage: Damage | None = None

    @property
    def path(self) -> Path:
        """The manifest's own file."""
        return self.home / FOLDER / f"{self.stage}.json"

    def write(self) -> None:
        """Write it; two runs of the same campaign write the same bytes."""
        head = {"schema_version": 1, "stage": self.stage, "version": __version__}
        content = head | self.content()
        write_json(self.path, content | {"check": digest(content)})

    def content(self) -> dict[str, Any]:
        """What it lists."""
        return {
            **{
                name: {key: entry._asdict() for key, entry in getattr(self, name).items()}
                for name in ("outputs", "extras", "sources")
            },
            "inputs": self.inputs,
            "repaired": list(self.repaired),
            "key": self.key,
        }

    def damages(self, *, hash_all: bool = False, missing: bool = False) -> list[Damage]:
        """Compare the results with what was written.

        A missing output is none unless `missing`: Snakemake sees those of the campaign's own
        stages by itself. Only files whose length or time of change differs are hashed, unless
        `hash_all`.
        """
        if self.own_damage:
            return [self.own_damage]
        home, listed = str(self.home), self.outputs | self.extras
        try:
            since = None if hash_all else _written_ns(self.path)
        except OSError:
            return [Damage(self.path, "it is missing", "missing")] if listed else []
        found = []
        for name, made in listed.items():
            if since is None or not _unchanged(f"{home}/{name}", made, since):
                damage = _compare(self.home / name, made)
                lost = damage is not None and damage.found == "missing"
                if damage is not None and (missing or name in self.extras or not lost):
                    found.append(damage)
        return found


def read_manifest(home: Path, stage: str) -> Manifest:
    """Read a stage's manifest; an empty one where there is none, or it was altered."""
    manifest = Manifest(home, stage)
    if not manifest.path.is_file():
        return manifest
    try:
        content = read_json(manifest.path)
        if content.pop("check") != digest(content):
            raise ValueError
        return of_content(home, stage, content)
    except (InputError, AttributeError, KeyError, TypeError, ValueError):
        found = sha256(manifest.path)[:8]
        damage = Damage(manifest.path, "this manifest is torn or altered", found)
        return Manifest(home, stage, own_damage=damage)


def of_content(home: Path, stage: str, content: dict[str, Any]) -> Manifest:
    """Make a manifest of what was written of it (`Manifest.content`)."""
    files: dict[str, Any] = {
        name: {key: Sum(**entry) for key, entry in content[name].items()}
        for name in ("outputs", "extras", "sources")
    }
    return Manifest(
        home,
        stage,
        **files,
        inputs=dict(content["inputs"]),
        repaired=tuple(content["repaired"]),
        key=str(content.get("key", "")),
        own_damage=None,
    )


def noticed(damage: Damage) -> str:
    """The line about a damaged file when a run is planned."""
    return f"{damage.path}: {damage.problem}; a run sets it aside and makes it again"


def recorded(paths: Iterable[Path]) -> dict[str, str]:
    """The hashes of results as their stages recorded them; of a file in no manifest, its own."""
    index, hashes = Index(), {}
    for path in paths:
        found = index.find(path)
        if found is not None or path.is_file():
            hashes[path.name] = sha256(path) if found is None else found[1].sha256
    return hashes


def manifests(home: Path) -> Iterator[Manifest]:
    """Read all manifests of a folder."""
    yield from (read_manifest(home, path.stem) for path in sorted((home / FOLDER).glob("*.json")))


def histories(home: Path) -> tuple[dict[str, str], list[str]]:
    """Look for damage in a folder of results when a run is planned; nothing is touched.

    Returns
    -------
    histories
        For each stage its damages, repaired or not: a parameter of its rule.
    lines
        A line for each damaged file.
    """
    found, lines = {}, []
    for manifest in manifests(home):
        damages = manifest.damages()
        found[manifest.stage] = " ".join((*manifest.repaired, *(one.mark for one in damages)))
        lines += [noticed(damage) for damage in damages]
    return found, lines


def set_aside_damaged(home: Path, *, missing: bool = False) -> list[str]:
    """Before the jobs run: set aside what is damaged in a folder of results.

    Parameters
    ----------
    home
        The folder.
    missing
        Whether a missing output is damage, as in a record's folder.

    Returns
    -------
    list of str
        A line for each damaged file.
    """
    lines = []
    for manifest in manifests(home):
        found = manifest.damages(missing=missing)
        lines += [f"{damage.path}: {damage.problem}; {set_aside(damage)}" for damage in found]
        if found:
            damaged = {damage.path for damage in found}
            manifest.outputs = {
                name: made for name, made in manifest.outputs.items() if home / name not in damaged
            }
            manifest.extras, manifest.key = {}, ""
            manifest.repaired += tuple(damage.mark for damage in found)
            manifest.write()
        else:
            # All is sound: files whose time of change is younger need no second hash.
            with suppress(OSError):
                os.utime(manifest.path)
    return lines


def set_aside(damage: Damage) -> str:
    """Give a damaged file another name beside its own, and say which."""
    if damage.found == "missing":
        return "its stage runs again"
    kept = damage.path.with_name(f"{damage.path.name}{SET_ASIDE}{damage.found}")
    try:
        damage.path.replace(kept)
    except OSError as fault:
        raise InputError(
            damage.path,
            f"{damage.problem}, and it can't be renamed ({fault.strerror})",
            "make the folder writable",
        ) from None
    return f"set aside as {kept.name}"


@dataclass
class Job:
    """What a running stage will leave in its manifest."""

    outputs: list[Path] = field(default_factory=list)
    extras: list[Path] = field(default_factory=list)


@contextmanager
def job(
    home: Path,
    stage: str,
    *,
    inputs: Iterable[Path] = (),
    sources: Iterable[Path] = (),
    outputs: Sequence[Path] = (),
) -> Iterator[Job]:
    """Run a stage between a check of what it reads and a record of what it wrote.

    Parameters
    ----------
    home, stage
        The folder of the results, and the stage's name.
    inputs
        Results of other stages. What is damaged is set aside, and the stage doesn't run.
    sources
        Files of the user: recorded and never touched. A missing one is left to the stage.
    outputs
        What is written; somewhere else than in `home` it is no result of the campaign, and
        nothing is recorded.

    Raises
    ------
    DamagedError
        If an input is not what its stage wrote, or was made from other files than those
        that are there now.
    """
    inputs, sources = tuple(inputs), tuple(sources)
    checked = check(inputs)
    if outputs and not outputs[0].absolute().is_relative_to(home.absolute()):
        with writing(inputs=(*inputs, *sources)):
            yield Job()
        return
    repaired = read_manifest(home, stage).repaired
    # Until the stage has ended its old results are nobody's.
    Manifest(home, stage, repaired=repaired).write()
    running = Job(list(outputs))
    with writing(inputs=(*inputs, *sources)):
        yield running
    Manifest(
        home,
        stage,
        outputs={_name(path, home): sum_of(path) for path in running.outputs if path.is_file()},
        extras={_name(path, home): sum_of(path) for path in running.extras if path.is_file()},
        inputs={_name(path, home): made for path, made in checked.items()},
        sources={path.name: made for path in sources if (made := _sum_of_source(path))},
        repaired=repaired,
    ).write()


def check(paths: Iterable[Path]) -> dict[Path, str]:
    """Hash results before they are read; set aside the first that is damaged.

    A file that no manifest lists, from before there were manifests, is read as it is.
    """
    index = Index()
    hashes = {}
    for path in paths:
        if not path.is_file():
            continue  # the stage says what is missing, and how to make it
        found = index.find(path)
        if found is None:
            hashes[path] = sha256(path)
            continue
        owner, made = found
        damage = _compare(path, made) or index.made_from_others(path, owner)
        if damage is not None:
            raise DamagedError(
                path,
                f"{damage.problem}, {set_aside(damage)}",
                f"run snakemake again: stage {owner.stage} makes it anew",
            )
        hashes[path] = made.sha256
    return hashes


class Index(dict[Path, dict[str, tuple[Manifest, Sum]]]):
    """Finds the manifest that lists a file, reading each folder's manifests once."""

    def __missing__(self, home: Path) -> dict[str, tuple[Manifest, Sum]]:
        self[home] = {
            name: (manifest, made)
            for manifest in manifests(home)
            for name, made in (manifest.outputs | manifest.extras).items()
        }
        return self[home]

    def find(self, path: Path) -> tuple[Manifest, Sum] | None:
        """Look in the file's own folder and in the two above it."""
        found = (self[home].get(_name(path, home)) for home in path.absolute().parents[:3])
        return next(filter(None, found), None)

    def made_from_others(self, path: Path, owner: Manifest) -> Damage | None:
        """Whether a result was made from other files than those that are there now."""
        for name, was in owner.inputs.items():
            found = self.find(owner.home / name)
            if found is not None and found[1].sha256 != was:
                return Damage(
                    path,
                    f"it was made from another {Path(name).name} than the one there now",
                    sha256(path)[:8],
                )
        return None


def sum_of(path: Path) -> Sum:
    """Measure and hash a file."""
    return Sum(path.stat().st_size, sha256(path))


def _sum_of_source(path: Path) -> Sum | None:
    """Measure a user's file; None where it can't be read, which its stage has said."""
    try:
        return sum_of(path) if path.is_file() else None
    except (OSError, ValueError):
        return None


def source_sha256(manifest: Manifest, source: Path) -> str | None:
    """Hash a file of the user; from the manifest if it has not changed since."""
    if not is_file(source):
        return None
    made = manifest.sources.get(source.name)
    since = _written_ns(manifest.path) if made is not None else None
    kept = made is not None and since is not None and _unchanged(source, made, since)
    try:
        return made.sha256 if made is not None and kept else sha256(source)
    except OSError:  # its own job says why it can't be read
        return None


def changed_ns(path: Path) -> int:
    """When a file was changed, which nobody can put back; 0 where there is none."""
    try:
        status = os.stat(path)  # noqa: PTH116 (a Path takes longer, and files are many)
    except OSError:
        return 0
    # On Windows st_ctime is the time of creation, and st_mtime all there is.
    return max(status.st_ctime_ns, status.st_mtime_ns)


def _written_ns(path: Path) -> int | None:
    """When a manifest was written; None where its time is no measure, since it lies ahead of us.

    A clock that was set back, or a touched file. What has changed since may bear any time.
    """
    status = path.stat()
    # On Windows st_ctime is the time of creation.
    changed_ns = status.st_mtime_ns if os.name == "nt" else status.st_ctime_ns
    since = min(status.st_mtime_ns, changed_ns)
    return since if since <= time.time_ns() else None


def _name(path: Path, home: Path) -> str:
    return Path(os.path.relpath(path.absolute(), home.absolute())).as_posix()


def _unchanged(path: str | Path, made: Sum, since_ns: int) -> bool:
    """Whether a file has its length, and nobody has changed it since a moment."""
    try:
        status = os.stat(path)  # noqa: PTH116 (a Path takes longer, and files are many)
    except OSError:
        return False
    # On Windows st_ctime is the time of creation, and st_mtime all there is.
    changed_ns = max(status.st_ctime_ns, status.st_mtime_ns)
    return status.st_size == made.length and changed_ns < since_ns


def _compare(path: Path, made: Sum) -> Damage | None:
    """Compare a file with what was written: hash it."""
    if not path.is_file():
        return Damage(path, "it is missing", "missing")
    length, found = sum_of(path)
    torn = f"it is torn or altered ({length} bytes of {made.length})"
    problem = torn if length < made.length else "it was altered"
    changed = Damage(path, problem if length else "it is empty", found[:8])
    return changed if found != made.sha256 else None
