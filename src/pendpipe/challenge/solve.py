"""Solve a set with the released command line, each recording in a process of its own.

The solver sees a folder with one recording and nothing else; no path of the set, let alone
of the sealed truth, is in its arguments, its environment or its working folder.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from pendpipe.challenge import sealing
from pendpipe.errors import InputError
from pendpipe.files import read_json, write_json
from pendpipe.process import ONE_THREAD

SOLVER: Final = (sys.executable, "-m", "pendpipe.cli", "diagnose", "--figures", "none")
PATIENCE_S: Final = 600.0
PASSED_ON: Final = (
    "PATH", "HOME", "LANG", "LC_ALL", "TMPDIR", "SYSTEMROOT", "PYTHONPATH", "NUMBA_CACHE_DIR",
    "XDG_CACHE_HOME", "LOCALAPPDATA", "VIRTUAL_ENV",
)  # fmt: skip
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
    tasks = []
    for name, entry in manifest["items"].items():
        tasks.append((name, entry["baseline"]))
        if "twin_sha256" in entry:
            tasks.append((f"{name}-twin", entry["baseline"]))
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
    with alone(folder / "recordings" / f"{name}.csv", baseline, solver) as (status, said, answer):
        found, diagnosis = answer / "diagnosis.json", None
        if found.exists():
            try:
                diagnosis = json.loads(found.read_text(encoding="utf-8"))
            except ValueError as fault:
                said = f"diagnosis.json is no JSON: {fault}"
    write_json(
        answer_path(folder, name),
        {"item": name, "status": status, "stderr": said if status else "", "diagnosis": diagnosis,
         "solved_at": sealing.now()},
    )  # fmt: skip


@contextmanager
def alone(recording: Path, baseline: str, solver: Sequence[str]) -> Iterator[tuple[int, str, Path]]:
    """Run the solver in an empty folder with a copy of one recording.

    Yields
    ------
    tuple
        Its exit status (-1: it ran out of its time), what it said on stderr, and the folder
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
                words, cwd=room, env=environment, capture_output=True, text=True,
                timeout=PATIENCE_S, check=False, stdin=subprocess.DEVNULL,
            )  # fmt: skip
            status, said = run.returncode, run.stderr.strip()[-2000:]
        except subprocess.TimeoutExpired:
            status, said = -1, f"no answer within {PATIENCE_S:g} s"
        yield status, said, room / "answer"


def _hash_answers(folder: Path, names: list[str]) -> None:
    """Hash all answers together, before anybody opens the truth."""
    path = folder / "answers.json"
    if path.exists():
        return
    answers = {name: read_json(answer_path(folder, name)) for name in names}
    write_json(
        path,
        {
            "answered_at": sealing.now(),
            "answers_sha256": sealing.salted(answers, ""),
            "answers": {name: sealing.salted(answer, "") for name, answer in answers.items()},
        },
    )
