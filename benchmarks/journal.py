"""What a long run has done so far, kept for as long as the code it ran is the same."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

from pendpipe.provenance import code_version

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / ".evidence"


@cache
def code() -> str:
    """Digest of the readers, the acquisition, and of what tries them."""
    digest = hashlib.sha256()
    for module in ("pendpipe.acquisition.simulated", "pendpipe.formats.writing"):
        digest.update(code_version(module).encode())
    for folder, pattern in (
        ("src/pendpipe/formats", "*.py"),
        ("benchmarks", "fuzz*.py"),
        ("benchmarks", "acquisition*.py"),
    ):
        for path in sorted((ROOT / folder).glob(pattern)):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def read(name: str, nothing: Any) -> Any:
    """Return what is kept under a name; `nothing` if it is of other code."""
    path = KEPT / f"{name}.json"
    if not path.exists():
        return nothing
    kept = json.loads(path.read_text(encoding="utf-8"))
    return kept["done"] if kept.get("code") == code() else nothing


def keep(name: str, done: Any) -> None:
    """Keep it; what was there before gives way at once or not at all."""
    KEPT.mkdir(exist_ok=True)
    beside = KEPT / f"{name}.new"
    beside.write_text(json.dumps({"code": code(), "done": done}), encoding="utf-8")
    beside.replace(KEPT / f"{name}.json")
