"""Open a solved set: check every hash, then put truth and answers side by side, once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pendpipe.challenge import sealing
from pendpipe.challenge.make import Places
from pendpipe.challenge.solve import answer_path
from pendpipe.errors import InputError
from pendpipe.files import read_json, write_json


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
    if sealing.salted(truths, salt) != manifest["truth_sha256"]:
        raise InputError(places.sealed, "the truth is not what was sealed", "distrust this set")
    if sealing.salted(secret, salt) != manifest["secret_sha256"]:
        raise InputError(places.secret, "the seed is not what was sealed", "distrust this set")
    items = {}
    for truth in truths:
        name = truth["item"]
        entry: dict[str, Any] = {"truth": truth, "answer": _answer(places, name, seals)}
        if "twin_sha256" in manifest["items"][name]:
            entry["twin"] = _answer(places, f"{name}-twin", seals)
        items[name] = entry
    write_json(
        opened,
        {
            "set": manifest["set"],
            "count": manifest["count"],
            "seed": secret["seed"],
            "salt": salt,
            "sealed_at": manifest["sealed_at"],
            "answered_at": seals["answered_at"],
            "opened_at": sealing.now(),
            "truth_sha256": manifest["truth_sha256"],
            "answers_sha256": seals["answers_sha256"],
            "items": items,
        },
    )
    return opened


def _answer(places: Places, name: str, seals: dict[str, Any]) -> dict[str, Any]:
    """An answer whose hash still holds."""
    answer: dict[str, Any] = read_json(answer_path(places.folder, name))
    if sealing.salted(answer, "") != seals["answers"][name]:
        raise InputError(
            answer_path(places.folder, name), "it was changed after it was hashed",
            "solve a fresh set",
        )  # fmt: skip
    return answer
