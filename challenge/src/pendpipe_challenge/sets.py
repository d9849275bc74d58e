"""A set's life: made and sealed, solved, opened. Who knew what when can be checked later.

Recordings lie on one side, the truth on the other, hashes between. The released command line
solves each recording in a process of its own, which sees a folder with one recording and
nothing else; no path of the set, let alone of the sealed truth, is in its arguments, its
environment or its working folder.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import secrets
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import numpy as np

import pendpipe
from pendpipe.errors import InputError
from pendpipe.files import finite, read_json, replaced, write_json
from pendpipe.process import ONE_THREAD
from pendpipe.version import __version__
from pendpipe_challenge.items import make_item, plan

LEDGER: Final = "ledger.jsonl"
"""Beside the sets' folders: every item ever made."""
UNRECORDED: Final = "not recorded"
"""What older sets did not keep."""


@contextmanager
def process_pool(number: int) -> Iterator[ProcessPoolExecutor]:
    """Run processes that keep to one thread each, whatever the environment sets.

    Linear algebra that takes every core in each of several processes spends its time
    waiting for itself: an item cost three times its CPU on two cores, more on busy ones
    (Snakemake sets the number of threads to the rule's, and the rule's are processes here).
    A forked process would have numpy, and its threads, from us; so they start
    afresh.

    Parameters
    ----------
    number
        Processes.
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        fresh = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(number, mp_context=fresh) as pool:
            yield pool
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def canonical(content: Any) -> str:
    """JSON in one fixed spelling, so that a hash means the content."""
    return json.dumps(finite(content), sort_keys=True, ensure_ascii=False, separators=(",", ":"))


def salted(content: Any, salt: str) -> str:
    """SHA-256 of a content with a salt, without which nobody can guess what was hashed."""
    return hashlib.sha256((salt + canonical(content)).encode()).hexdigest()


def of_text(text: str) -> str:
    """SHA-256 of a file's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def now() -> str:
    """The time, UTC."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def enter(ledger: Path, entry: dict[str, Any]) -> None:
    """Append to the ledger; each line holds the hash of the one before.

    The ledger keeps every item that was ever made, whether it was solved or not.
    """
    ledger.parent.mkdir(parents=True, exist_ok=True)
    before = "start"
    if ledger.exists():
        lines = ledger.read_text(encoding="utf-8").splitlines()
        if lines:
            before = of_text(lines[-1])
    with ledger.open("a", encoding="utf-8", newline="\n") as stream:
        stream.write(canonical({**entry, "at": now(), "before": before}) + "\n")


def entered(ledger: Path, of_set: str) -> set[str]:
    """The items of one set that the ledger holds already."""
    if not ledger.exists():
        return set()
    entries = map(json.loads, ledger.read_text(encoding="utf-8").splitlines())
    return {entry["item"] for entry in entries if entry["set"] == of_set}


def check_ledger(ledger: Path) -> int:
    """Check the chain of hashes; returns the number of entries."""
    lines = ledger.read_text(encoding="utf-8").splitlines()
    before = "start"
    for number, line in enumerate(lines, 1):
        if json.loads(line)["before"] != before:
            raise InputError(
                f"{ledger}, line {number}", "the chain of hashes is broken", "find out who cut it"
            )
        before = of_text(line)
    return len(lines)


def sets_before(ledger: Path, of_set: str) -> str:
    """The sets that were begun before one, in order; whether opened, scored or given up."""
    if not ledger.exists():
        return UNRECORDED
    try:
        check_ledger(ledger)
    except InputError as fault:
        return str(fault)
    entries = map(json.loads, ledger.read_text(encoding="utf-8").splitlines())
    begun = list(dict.fromkeys(entry["set"] for entry in entries))
    earlier = begun[: begun.index(of_set)] if of_set in begun else begun
    return f"{len(earlier)} ({', '.join(earlier)})" if earlier else "none"


@dataclass(frozen=True)
class Places:
    """Where a set lies: `folder` is what the solver may have, `sealed` what it may not."""

    folder: Path
    sealed: Path

    def recording(self, name: str) -> Path:
        """One item's file."""
        return self.folder / "recordings" / f"{name}.csv"

    @property
    def manifest(self) -> Path:
        """Hashes of recordings and truth, written before anything is solved."""
        return self.folder / "manifest.json"

    @property
    def secret(self) -> Path:
        """Seed and salt."""
        return self.sealed / "secret.json"

    def truth(self, name: str) -> Path:
        """One item's truth."""
        return self.sealed / "truth" / f"{name}.json"


def make_set(
    places: Places,
    count: int,
    *,
    seed: int | None = None,
    workers: int = 1,
    ledger: Path | None = None,
) -> None:
    """Make a set, or go on with one that was interrupted.

    Parameters
    ----------
    places
        The set's two folders; neither may lie within the other.
    count
        How many items.
    seed
        Drawn where it is not given; it is sealed with the truth.
    workers
        Processes.
    ledger
        Where every item that is ever made is entered; beside the set's folder if None.
    """
    _apart(places)
    if places.manifest.exists():
        raise InputError(places.manifest, "this set is made and sealed", "name another folder")
    if places.secret.exists():
        secret = read_json(places.secret)
    else:
        secret = {
            "seed": secrets.randbits(63) if seed is None else seed,
            "count": count,
            "salt": secrets.token_hex(16),
            "begun": now(),
        }
        write_json(places.secret, secret)
    root = np.random.default_rng([secret["seed"], 0])
    recipes = plan(secret["count"], root)
    ledger = ledger or places.folder.parent / LEDGER
    there_already = entered(ledger, places.folder.name)
    names = [f"item-{number:04d}" for number in range(1, len(recipes) + 1)]
    todo = [
        (places, name, recipe, [secret["seed"], number])
        for number, (name, recipe) in enumerate(zip(names, recipes, strict=True), 1)
        if not (places.truth(name).exists() and name in there_already)
    ]
    with process_pool(workers) as pool:
        for done, entry in enumerate(pool.map(_make_one, todo), 1):
            enter(
                ledger,
                {
                    "set": places.folder.name,
                    **entry,
                    "truth": salted(read_json(places.truth(entry["item"])), secret["salt"]),
                },
            )
            print(f"\r{done}/{len(todo)} items made", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    _seal(places, names, secret)


def _apart(places: Places) -> None:
    """The truth may not lie where the solver looks."""
    folder, sealed = places.folder.resolve(), places.sealed.resolve()
    if folder == sealed or folder in sealed.parents or sealed in folder.parents:
        raise InputError(sealed, f"it is not apart from {folder}", "seal into another folder")


def _make_one(task: tuple[Places, str, dict[str, Any], list[int]]) -> dict[str, str]:
    """Make one item; its truth is written last, so that it marks the item as whole."""
    places, name, recipe, seed = task
    if places.truth(name).exists():  # made before an interruption, and not entered yet
        return {"item": name, "recording": _hash_of(places.recording(name))}
    item = make_item(recipe, np.random.default_rng(seed))
    with replaced(places.recording(name)) as stream:
        stream.write(item.text)
    write_json(places.truth(name), {"item": name, **item.truth})
    return {"item": name, "recording": of_text(item.text)}


def _seal(places: Places, names: list[str], secret: dict[str, Any]) -> None:
    """Write the manifest: what a laboratory knows, and hashes of what it does not."""
    truths = [read_json(places.truth(name)) for name in names]
    items = {
        name: {
            "baseline": truth["baseline"],
            "recording_sha256": _hash_of(places.recording(name)),
            "truth_sha256": salted(truth, secret["salt"]),
        }
        for name, truth in zip(names, truths, strict=True)
    }
    manifest = {
        "schema_version": 1,
        "set": places.folder.name,
        "count": len(names),
        "sealed_at": now(),
        "truth_sha256": salted(truths, secret["salt"]),
        "secret_sha256": salted(secret, secret["salt"]),
        "items": items,
    }
    write_json(places.sealed / "families.json", dict(Counter(t["family"] for t in truths)))
    write_json(places.manifest, manifest)


def _hash_of(path: Path) -> str:
    return of_text(path.read_text(encoding="utf-8"))


SOLVER: Final = (sys.executable, "-m", "pendpipe.cli", "diagnose", "--figures", "none")
PATIENCE_S: Final = 600.0
PASSED_ON: Final = (
    "PATH",
    "HOME",
    "LANG",
    "LC_ALL",
    "TMPDIR",
    "SYSTEMROOT",
    "PYTHONPATH",
    "NUMBA_CACHE_DIR",
    "XDG_CACHE_HOME",
    "LOCALAPPDATA",
    "VIRTUAL_ENV",
)
"""Of the environment; nothing else of ours reaches the solver."""


def solve_set(
    folder: Path, *, workers: int = 1, solver: Sequence[str] = SOLVER, limit: int | None = None
) -> None:
    """Solve what is not solved yet, and hash each answer as it comes.

    Parameters
    ----------
    folder
        The set's folder: ``manifest.json`` and ``recordings/``.
    workers
        Recordings at a time.
    solver
        The command; the recording, ``--out`` and ``--baseline`` follow.
    limit
        Stop after so many (the set stays unfinished).
    """
    manifest = _manifest(folder)
    tasks = [(name, entry["baseline"]) for name, entry in manifest["items"].items()]
    todo = [task for task in tasks if not answer_path(folder, task[0]).exists()][:limit]
    with ThreadPoolExecutor(workers) as pool:
        work = pool.map(lambda task: _solve_one(folder, task[0], task[1], solver), todo)
        for done, _ in enumerate(work, 1):
            print(f"\r{done}/{len(todo)} solved", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    if all(answer_path(folder, name).exists() for name, _ in tasks):
        _hash_answers(folder, [name for name, _ in tasks])


def answer_path(folder: Path, name: str) -> Path:
    """Where an answer is kept."""
    return folder / "answers" / f"{name}.json"


def _manifest(folder: Path) -> dict[str, Any]:
    path = folder / "manifest.json"
    if not path.exists():
        raise InputError(path, "there is no sealed set here", "run pendpipe challenge make first")
    found: dict[str, Any] = read_json(path)
    return found


def _solve_one(folder: Path, name: str, baseline: str, solver: Sequence[str]) -> None:
    """One recording: copied into an empty folder, solved there, the answer taken home."""
    with alone(folder / "recordings" / f"{name}.csv", baseline, solver) as (status, errors, answer):
        found, diagnosis = answer / "diagnosis.json", None
        if found.exists():
            try:
                diagnosis = json.loads(found.read_text(encoding="utf-8"))
            except ValueError as fault:
                errors = f"diagnosis.json is no JSON: {fault}"
    write_json(
        answer_path(folder, name),
        {
            "item": name,
            "status": status,
            "stderr": errors if status else "",
            "diagnosis": diagnosis,
            "solved_at": now(),
            "solved_by": code_of_the_solver(),
        },
    )


def code_of_the_solver() -> str:
    """The commit of the clone that answers, ``-dirty`` where files differ; or the version."""
    words = ("git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*")
    folder = Path(pendpipe.__file__).parent
    try:
        found = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return f"pendpipe {__version__}, no commit known"
    return found.stdout.strip()


@contextmanager
def alone(recording: Path, baseline: str, solver: Sequence[str]) -> Iterator[tuple[int, str, Path]]:
    """Run the solver in an empty folder with a copy of one recording.

    Yields
    ------
    tuple
        Its exit status (-1: it ran out of its time), its standard error, and the folder
        of its answer, which is gone afterwards.
    """
    with tempfile.TemporaryDirectory(prefix="pendulum-") as place:
        room = Path(place)
        shutil.copyfile(recording, room / "recording.csv")
        words = [*solver, "recording.csv", "--out", "answer", "--baseline", baseline]
        environment = {key: os.environ[key] for key in PASSED_ON if key in os.environ}
        environment |= ONE_THREAD
        try:
            run = subprocess.run(
                words,
                cwd=room,
                env=environment,
                capture_output=True,
                text=True,
                timeout=PATIENCE_S,
                check=False,
                stdin=subprocess.DEVNULL,
            )
            status, errors = run.returncode, run.stderr.strip()[-2000:]
        except subprocess.TimeoutExpired:
            status, errors = -1, f"no answer within {PATIENCE_S:g} s"
        yield status, errors, room / "answer"


def _hash_answers(folder: Path, names: list[str]) -> None:
    """Hash all answers together, before anybody opens the truth."""
    path = folder / "answers.json"
    if path.exists():
        return
    answers = {name: read_json(answer_path(folder, name)) for name in names}
    write_json(
        path,
        {
            "answered_at": now(),
            "answered_by": ", ".join(
                sorted({a.get("solved_by", UNRECORDED) for a in answers.values()})
            ),
            "answers_sha256": salted(answers, ""),
            "answers": {name: salted(answer, "") for name, answer in answers.items()},
        },
    )


def open_set(places: Places) -> Path:
    """Check and open; the answers must have been hashed before.

    Returns
    -------
    Path
        ``opened.json``: truth and answer of every item, with the hashes that were checked.
    """
    opened = places.folder / "opened.json"
    if opened.exists():
        raise InputError(opened, "this set was opened before", "score it, or make a fresh set")
    hashed = places.folder / "answers.json"
    if not hashed.exists():
        raise InputError(
            places.folder, "the answers are not all there", "run pendpipe challenge solve first"
        )
    manifest, seals = read_json(places.manifest), read_json(hashed)
    if not places.secret.exists():
        raise InputError(places.secret, "the sealed truth is not there", "name its --sealed folder")
    secret = read_json(places.secret)
    salt = secret["salt"]
    truths = [read_json(places.truth(name)) for name in manifest["items"]]
    if salted(truths, salt) != manifest["truth_sha256"]:
        raise InputError(places.sealed, "the truth is not what was sealed", "distrust this set")
    if salted(secret, salt) != manifest["secret_sha256"]:
        raise InputError(places.secret, "the seed is not what was sealed", "distrust this set")
    items = {
        truth["item"]: {"truth": truth, "answer": _answer(places, truth["item"], seals)}
        for truth in truths
    }
    write_json(
        opened,
        {
            "set": manifest["set"],
            "count": manifest["count"],
            "seed": secret["seed"],
            "salt": salt,
            "sealed_at": manifest["sealed_at"],
            "answered_at": seals["answered_at"],
            "answered_by": seals["answered_by"],
            "opened_at": now(),
            "sets_before": sets_before(places.folder.parent / LEDGER, places.folder.name),
            "truth_sha256": manifest["truth_sha256"],
            "answers_sha256": seals["answers_sha256"],
            "items": items,
        },
    )
    return opened


def _answer(places: Places, name: str, seals: dict[str, Any]) -> dict[str, Any]:
    """An answer whose hash still holds."""
    answer: dict[str, Any] = read_json(answer_path(places.folder, name))
    if salted(answer, "") != seals["answers"][name]:
        raise InputError(
            answer_path(places.folder, name),
            "it was changed after it was hashed",
            "solve a fresh set",
        )
    return answer
