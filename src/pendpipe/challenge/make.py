"""Make and seal a set: recordings on one side, the truth on the other, hashes between."""

from __future__ import annotations

import secrets
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pendpipe.challenge import sealing
from pendpipe.challenge.families import make_item, plan
from pendpipe.challenge.real import available, make_real
from pendpipe.challenge.recordings import recording_text
from pendpipe.challenge.workers import workers as processes
from pendpipe.errors import InputError
from pendpipe.files import read_json, replaced, write_json


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
    places: Places, count: int, *, seed: int | None = None, workers: int = 1,
    real: Path | None = None, ledger: Path | None = None,
) -> None:  # fmt: skip
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
    real
        Folder of real recordings; without it that family is left out.
    ledger
        Where every item that is ever made is entered; beside the set's folder if None.
    """
    _apart(places)
    if places.manifest.exists():
        raise InputError(places.manifest, "this set is made and sealed", "name another folder")
    if places.secret.exists():
        secret = read_json(places.secret)
    else:
        secret = {"seed": secrets.randbits(63) if seed is None else seed, "count": count,
                  "salt": secrets.token_hex(16), "begun": sealing.now()}  # fmt: skip
        write_json(places.secret, secret)
    there = len(available(real)) if real is not None else 0
    if real is not None and not there:
        print(f"{real}: no real recordings here: that family is left out", flush=True)
    root = np.random.default_rng([secret["seed"], 0])
    recipes = plan(secret["count"], root, real=1000 if there else 0)
    ledger = ledger or places.folder.parent / "ledger.jsonl"
    entered = sealing.entered(ledger, places.folder.name)
    names = [f"item-{number:04d}" for number in range(1, len(recipes) + 1)]
    todo = [
        (places, name, recipe, [secret["seed"], number], real)
        for number, (name, recipe) in enumerate(zip(names, recipes, strict=True), 1)
        if not (places.truth(name).exists() and name in entered)
    ]
    with processes(workers) as pool:
        for done, entry in enumerate(pool.map(_make_one, todo), 1):
            sealing.enter(
                ledger,
                {"set": places.folder.name, **entry,
                 "truth": sealing.salted(read_json(places.truth(entry["item"])), secret["salt"])},
            )  # fmt: skip
            print(f"\r{done}/{len(todo)} items made", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    _seal(places, names, secret)


def _apart(places: Places) -> None:
    """The truth may not lie where the solver looks."""
    folder, sealed = places.folder.resolve(), places.sealed.resolve()
    if folder == sealed or folder in sealed.parents or sealed in folder.parents:
        raise InputError(sealed, f"it is not apart from {folder}", "seal into another folder")


def _make_one(
    task: tuple[Places, str, dict[str, Any], list[int], Path | None],
) -> dict[str, str]:
    """Make one item; its truth is written last, so that it says the item is whole."""
    places, name, recipe, seed, real = task
    if places.truth(name).exists():  # made before an interruption, and not entered yet
        return {"item": name, "recording": _hash_of(places.recording(name))}
    random = np.random.default_rng(seed)
    if recipe["family"] == "real" and real is not None:
        found = make_real(real, recipe["number"], random)
        text, truth = found.text, found.truth
        twin = places.recording(f"{name}-twin")
        with replaced(twin) as stream:
            stream.write(found.twin)
    else:
        item = make_item(recipe, random)
        text, truth = recording_text(item.scenario, item.codes), item.truth
    with replaced(places.recording(name)) as stream:
        stream.write(text)
    write_json(places.truth(name), {"item": name, **truth})
    return {"item": name, "recording": sealing.of_text(text)}


def _seal(places: Places, names: list[str], secret: dict[str, Any]) -> None:
    """Write the manifest: what a laboratory knows, and hashes of what it does not."""
    truths = [read_json(places.truth(name)) for name in names]
    items = {}
    for name, truth in zip(names, truths, strict=True):
        entry = {
            "baseline": truth["baseline"],
            "recording_sha256": _hash_of(places.recording(name)),
            "truth_sha256": sealing.salted(truth, secret["salt"]),
        }
        twin = places.recording(f"{name}-twin")
        if twin.exists():
            # The twin's name must not betray the item: both are solved like any other.
            entry["twin_sha256"] = _hash_of(twin)
        items[name] = entry
    manifest = {
        "schema_version": 1,
        "set": places.folder.name,
        "count": len(names),
        "sealed_at": sealing.now(),
        "truth_sha256": sealing.salted(truths, secret["salt"]),
        "secret_sha256": sealing.salted(secret, secret["salt"]),
        "items": items,
    }
    write_json(places.sealed / "families.json", dict(Counter(t["family"] for t in truths)))
    write_json(places.manifest, manifest)


def _hash_of(path: Path) -> str:
    return sealing.of_text(path.read_text(encoding="utf-8"))
