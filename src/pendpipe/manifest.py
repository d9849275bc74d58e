"""What each stage read and wrote: length and hash, kept beside the results.

A stage that ends leaves ``manifest/<stage>.json`` in its folder: that of a record, or of the
campaign, which are looked through alike. A job hashes every result that it reads and compares it
with the manifest of the stage that wrote it: a damaged file is set aside under another name, and
Snakemake makes it again.

Planning must notice a file whose old time was put back, without hashing thousands of
files. No program can set a file's time of change (``st_ctime``): a file of the right
length that has not changed since its manifest was written is sound.

Snakemake compares a rule's parameters with those of its last run. The history of a stage's damages
is such a parameter (`Findings.repaired`): planning adds what it finds, and the job writes the same
into the manifest, so that each damage runs the stage once. A record's job finds the same damages
again. Snakemake deletes what it knows of the campaign's own stages before their jobs; they inherit
what planning found (`hand_on`).
"""

import hashlib
import json
import os
import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, NamedTuple

from pendpipe.errors import DamagedError, InputError
from pendpipe.files import is_file, is_whole, sha256, write_json, writing
from pendpipe.version import __version__

FOLDER: Final = "manifest"
SET_ASIDE: Final = ".damaged-"
"""Stands in the name of a damaged file, before the first digits of its hash."""
RUN: Final = "PENDPIPE_RUN"
"""Variable of the environment by which the jobs of a run inherit what its planning knows."""


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
        """Name the damage in a history."""
        return f"{self.path.name}:{self.found}"

    def __str__(self) -> str:
        return f"{self.path}: {self.problem}; a run sets it aside and makes it again"

    def set_aside(self) -> str:
        """Give the file another name beside its own, and say which."""
        if not self.path.exists():
            return "its stage runs again"
        kept = self.path.with_name(f"{self.path.name}{SET_ASIDE}{self.found}")
        try:
            self.path.replace(kept)
        except OSError as fault:
            raise InputError(
                self.path,
                f"{self.problem}, and it can't be renamed ({fault.strerror})",
                "make the folder writable",
            ) from None
        return f"set aside as {kept.name}"


@dataclass(frozen=True)
class Manifest:
    """What one stage read and wrote.

    Parameters
    ----------
    home
        The folder that the names are relative to.
    stage
        Its name.
    outputs
        The files that it wrote, by name.
    inputs
        Results of other stages that were read, by name, with their hashes.
    sources
        Files of the user, by name alone.
    repaired
        The damages that made the stage run again.
    key
        Digest of what the stage of a record was done with; empty while it is not done.
    own_damage
        Where the manifest's own file can't be believed; it then lists nothing.
    """

    home: Path
    stage: str
    outputs: Mapping[str, Sum] = field(default_factory=dict)
    inputs: Mapping[str, str] = field(default_factory=dict)
    sources: Mapping[str, Sum] = field(default_factory=dict)
    repaired: str = ""
    key: str = ""
    own_damage: Damage | None = None

    @cached_property
    def path(self) -> Path:
        """The manifest's own file."""
        return self.home / FOLDER / f"{self.stage}.json"

    def write(self) -> None:
        """Write it; two runs of the same campaign write the same bytes."""
        head = {"schema_version": 1, "stage": self.stage, "version": __version__}
        write_json(self.path, head | self.content())

    def content(self) -> dict[str, Any]:
        """What it lists."""
        sums = {
            name: {key: made._asdict() for key, made in getattr(self, name).items()}
            for name in _SUMS
        }
        return {**sums, "inputs": dict(self.inputs), "repaired": self.repaired, "key": self.key}

    def damages(self, *, hash_all: bool = False) -> list[Damage]:
        """Compare the results with what was written.

        Only files whose length or time of change differs are hashed, unless `hash_all`.
        """
        if self.own_damage:
            return [self.own_damage]
        since = None if hash_all or not self.outputs else _written_ns(self.path)
        # (As text: a Path takes longer, and files are many.)
        home = str(self.home)
        compared = (
            _compare(self.home / name, made)
            for name, made in self.outputs.items()
            if not _unchanged(f"{home}/{name}", made, since)
        )
        return [damage for damage in compared if damage is not None]


_SUMS: Final = ("outputs", "sources")


def read_manifest(home: Path, stage: str) -> Manifest:
    """Read a stage's manifest; an empty one where there is none, or it was altered."""
    content, torn = read_checked(Manifest(home, stage).path)
    if not content:
        return Manifest(home, stage, own_damage=next(iter(torn), None))
    return of_content(home, stage, content)


def read_checked(path: Path) -> tuple[dict[str, Any], list[Damage]]:
    """Read JSON that says who made it, and what is wrong with it; empty where there is none."""
    try:
        written = path.read_bytes()
    except OSError:
        return {}, []
    whole = is_whole(written)
    if whole is None:  # its stage runs again in any case: the code is another
        return {}, []
    if not whole:
        found = hashlib.sha256(written).hexdigest()[:8]
        return {}, [Damage(path, "this list of results is torn or altered", found)]
    return dict(json.loads(written)), []


def of_content(home: Path, stage: str, content: Mapping[str, Any]) -> Manifest:
    """Make a manifest of what was written of it (`Manifest.content`)."""
    rest: dict[str, Any] = {name: content[name] for name in ("inputs", "repaired", "key")}
    for name in _SUMS:
        rest[name] = {key: Sum(**made) for key, made in content[name].items()}
    return Manifest(home, stage, **rest)


def manifests(home: Path) -> Iterator[Manifest]:
    """Read all manifests of a folder."""
    yield from (read_manifest(home, path.stem) for path in sorted((home / FOLDER).glob("*.json")))


class Findings(NamedTuple):
    """What is wrong with the results of a job when a run is planned.

    Parameters
    ----------
    damages
        What is not as it was written.
    repaired
        These damages and those that were repaired before: a parameter of the rule.
    """

    damages: tuple[Damage, ...] = ()
    repaired: str = ""


def look_through(listed: Iterable[Manifest]) -> Findings:
    """Look for damage in what manifests list; nothing is touched."""
    pairs = [(one, one.damages()) for one in listed]
    found = tuple(damage for _, damages in pairs for damage in damages)
    return Findings(found, joined(_history(one, damages) for one, damages in pairs))


def _history(one: Manifest, damages: Iterable[Damage]) -> str:
    return joined([one.repaired, *(damage.mark for damage in damages)])


def joined(histories: Iterable[str]) -> str:
    """Join the histories of several manifests to one parameter."""
    return " ".join(filter(None, histories))


def hand_on(*, anew: Iterable[str], repaired: Mapping[str, str]) -> None:
    """Let the jobs of a run inherit what its planning knows, on a cluster too.

    Parameters
    ----------
    anew
        Stages of records whose results are made again even if they are done.
    repaired
        `Findings.repaired` by the path of a manifest.
    """
    os.environ[RUN] = json.dumps({"anew": list(anew), "repaired": dict(repaired)})


def handed_on() -> dict[str, Any]:
    """Return what this job inherits."""
    inherited: dict[str, Any] = json.loads(os.environ.get(RUN) or "{}")
    return {"anew": [], "repaired": {}} | inherited


@contextmanager
def job(
    home: Path,
    stage: str,
    *,
    inputs: Iterable[Path] = (),
    sources: Iterable[Path] = (),
    outputs: Sequence[Path] = (),
) -> Iterator[list[Path]]:
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

    Yields
    ------
    list of Path
        The outputs, to which the stage may add.

    Raises
    ------
    DamagedError
        If an input is not what its stage wrote, or was made from other files than those
        that are there now.
    """
    inputs, sources, written = tuple(inputs), tuple(sources), list(outputs)
    if outputs and not outputs[0].absolute().is_relative_to(home.absolute()):
        check(inputs)
        with writing(inputs=(*inputs, *sources)):
            yield written
        return
    old = set_aside_damaged(read_manifest(home, stage))
    checked = check(inputs)
    # Until the stage has ended its old results are nobody's.
    begun = disown(old)
    with writing(inputs=(*inputs, *sources)):
        yield written
    replace(
        begun,
        outputs={_name(path, home): sum_of(path) for path in written if path.is_file()},
        inputs={_name(path, home): made for path, made in checked.items()},
        sources={path.name: made for path in sources if (made := _sum_of_source(path))},
    ).write()


def set_aside_damaged(old: Manifest) -> Manifest:
    """Set the damaged results of a stage aside before it runs; return the manifest that says so."""
    damages = old.damages()
    for damage in damages:
        if damage.path.exists():
            line = f"{damage.path}: {damage.problem}; {damage.set_aside()}"
            print(f"pendpipe: {line}", file=sys.stderr)
    repaired = handed_on()["repaired"].get(str(old.path), _history(old, damages))
    return replace(old, repaired=repaired)


def disown(old: Manifest) -> Manifest:
    """Write that a stage has not ended: its results are nobody's."""
    begun = Manifest(old.home, old.stage, repaired=old.repaired)
    begun.write()
    return begun


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
                f"{damage.problem}, {damage.set_aside()}",
                f"run snakemake again: stage {owner.stage} makes it anew",
            )
        hashes[path] = made.sha256
    return hashes


def recorded(paths: Iterable[Path]) -> dict[str, str]:
    """The hashes of results as their stages recorded them; of a file in no manifest, its own."""
    index, hashes = Index(), {}
    for path in paths:
        found = index.find(path)
        if found is not None or path.is_file():
            hashes[path.name] = sha256(path) if found is None else found[1].sha256
    return hashes


class Index(dict[Path, dict[str, tuple[Manifest, Sum]]]):
    """Finds the manifest that lists a file, reading each folder's manifests once."""

    def __missing__(self, home: Path) -> dict[str, tuple[Manifest, Sum]]:
        self[home] = {
            name: (manifest, made)
            for manifest in manifests(home)
            for name, made in manifest.outputs.items()
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
    if made is not None and _unchanged(source, made, _written_ns(manifest.path)):
        return made.sha256
    try:
        return sha256(source)
    except OSError:  # its own job says why it can't be read
        return None


def changed_ns(path: str | Path) -> int:
    """When a file was changed, which nobody can put back; 0 where there is none."""
    status = _status(path)
    return 0 if status is None else _changed_ns(status)


def _status(path: str | Path) -> os.stat_result | None:
    try:
        return os.stat(path)  # noqa: PTH116 (a Path takes longer, and files are many)
    except OSError:
        return None


def _changed_ns(status: os.stat_result) -> int:
    # On Windows st_ctime is the time of creation, and st_mtime all there is.
    return max(status.st_ctime_ns, status.st_mtime_ns)


def _written_ns(path: Path) -> int | None:
    """When a manifest was written; None where it is gone, or its time is no measure.

    That lies ahead of us: a clock was set back, or the file was touched. What has changed since
    may bear any time.
    """
    status = _status(path)
    if status is None:
        return None
    ours = (status.st_mtime_ns,) if os.name == "nt" else (status.st_mtime_ns, status.st_ctime_ns)
    return since if (since := min(ours)) <= time.time_ns() else None


def _unchanged(path: str | Path, made: Sum, since_ns: int | None) -> bool:
    """Whether a file has its length, and nobody has changed it since a moment."""
    status = None if since_ns is None else _status(path)
    if status is None or since_ns is None:
        return False
    return status.st_size == made.length and _changed_ns(status) < since_ns


def _name(path: Path, home: Path) -> str:
    return Path(os.path.relpath(path.absolute(), home.absolute())).as_posix()


def _compare(path: Path, made: Sum) -> Damage | None:
    """Compare a file with what was written: hash it."""
    if not path.is_file():
        return Damage(path, "it is missing", "missing")
    length, found = sum_of(path)
    torn = f"it is torn or altered ({length} bytes of {made.length})"
    problem = torn if length < made.length else "it was altered"
    changed = Damage(path, problem if length else "it is empty", found[:8])
    return changed if found != made.sha256 else None
