"""Seals, hashes and the ledger: who knew what when can be checked afterwards."""

from __future__ import annotations

import hashlib
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from pendpipe.errors import InputError
from pendpipe.files import finite


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
