"""What a long run has done so far, kept for as long as the code it ran is the same."""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / ".evidence"


@cache
def code(sources: tuple[str, ...]) -> str:
    """Digest of code: of files by pattern."""
    digest = hashlib.sha256()
    for path in (path for source in sources for path in sorted(ROOT.glob(source))):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


@cache
def commit() -> str:
    """The commit at work; ``-dirty`` behind it where more than a page was changed since."""
    git = ["git", "-C", str(ROOT)]
    name = subprocess.run(
        [*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    changed = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", ".", ":!docs"], check=False)
    return name + ("-dirty" if changed.returncode else "")


def judge_parser(doc: str | None, name: str, number: int) -> argparse.ArgumentParser:
    """What every judge of many recordings can be told."""
    parser = argparse.ArgumentParser(description=(doc or "").splitlines()[0])
    parser.add_argument("--number", type=int, default=number, help="recordings (%(default)s)")
    parser.add_argument("--journal", type=Path, default=KEPT / f"{name}.jsonl")
    parser.add_argument("--processes", type=int, choices=(1, 2), default=1)
    return parser


def answers(
    told: argparse.Namespace,
    keys: Sequence[Any],
    ask: Callable[[Any], Any],
    sources: tuple[str, ...] = ("src/pendpipe/**/*.py",),
) -> Iterator[Any]:
    """Yield the answer of each key in order; those of this code are read from the journal.

    Keys and answers are what JSON takes; a last line that was cut off counts as none.
    """
    known, mark = {}, code(sources)
    told.journal.parent.mkdir(parents=True, exist_ok=True)
    for line in told.journal.read_text("utf-8").splitlines() if told.journal.exists() else []:
        with suppress(ValueError, KeyError):
            kept = json.loads(line)
            if kept["code"] == mark:
                known[json.dumps(kept["key"])] = kept["answer"]
    left = [key for key in keys if json.dumps(key) not in known]
    with (
        told.journal.open("a", encoding="utf-8") as stream,
        ProcessPoolExecutor(told.processes) as pool,
    ):
        fresh = iter(pool.map(ask, left))
        for key in keys:
            text = json.dumps(key)
            if text not in known:
                known[text] = json.loads(json.dumps(next(fresh)))
                entry = {"code": mark, "key": key, "answer": known[text]}
                stream.write(json.dumps(entry) + "\n")
                stream.flush()
            yield known[text]
