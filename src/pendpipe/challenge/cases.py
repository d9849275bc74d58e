"""Six cases before and after: the released command draws its own residuals once more."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

from pendpipe.challenge.solve import SOLVER, alone
from pendpipe.challenge.solved import Solved, read_items, six_cases
from pendpipe.files import read_json

DRAWER: Final = (*SOLVER[:-2], "--figures", "all")
MAP: Final = "residual_map.svg"


def draw_cases(
    opened: dict[str, Any], folder: Path, figures: Path, *, solver: Sequence[str] = DRAWER
) -> list[dict[str, Any]]:
    """Draw the residual of each case without and with what was named.

    The answers were given without figures. The same command on the same recording gives the
    same answer; whether it did is told, since the program may have been changed in between.

    Parameters
    ----------
    opened
        The opened set.
    folder
        Its folder, with the recordings.
    figures
        Where ``case-1.svg`` and so on go.
    solver
        The command that draws.

    Returns
    -------
    list
        Of each case in order: ``figure`` (None where there is none) and ``same_answer``.
    """
    figures.mkdir(parents=True, exist_ok=True)
    cases = list(enumerate(six_cases(read_items(opened)), 1))
    with ThreadPoolExecutor(2) as pool:
        found = pool.map(lambda case: _draw(folder, figures, case[0], case[1], solver), cases)
        return list(found)


def _draw(
    folder: Path, figures: Path, number: int, item: Solved, solver: Sequence[str]
) -> dict[str, Any]:
    recording = folder / "recordings" / f"{item.name}.csv"
    none = {"figure": None, "same_answer": None}
    if not recording.exists():
        return none
    with alone(recording, item.truth["baseline"], solver) as (_, said, answer):
        if not (answer / MAP).exists() or not (answer / "diagnosis.json").exists():
            print(f"{item.name}: no figure of its residual: {said[-200:]}", file=sys.stderr)
            return none
        (figures / f"case-{number}.svg").write_bytes((answer / MAP).read_bytes())
        again = read_json(answer / "diagnosis.json")
    same = again.get("statement") == item.answer.content.get("statement")
    return {"figure": f"case-{number}.svg", "same_answer": same}
