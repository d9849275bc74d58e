"""Figures of a scored set, and six cases before and after."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import numpy as np

from pendpipe.files import read_json
from pendpipe_challenge.answers import GROUPS, Solved, read_items, six_cases
from pendpipe_challenge.sets import SOLVER, alone

BLUE, GREEN, GREY = "#0072B2", "#007A5A", "#5F6670"


def draw(scores: dict[str, Any], folder: Path) -> list[str]:
    """Draw all figures as SVG and return their names."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    drawn = []
    with mpl.rc_context({"svg.hashsalt": "pendpipe", "font.size": 9}):
        for name, (draws, size) in FIGURES.items():
            figure, axes = plt.subplots(figsize=size, layout="constrained")
            draws(axes, scores)
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
            plt.close(figure)
            drawn.append(f"{name}.svg")
    return drawn


def _power(axes: Any, scores: dict[str, Any]) -> None:
    levels = scores["detection"]["levels"]
    size = np.array([max(level["delta_chi2"], 1.0) for level in levels])
    # Side by side, so that no interval hides another.
    for key, label, style, colour, beside in (
        ("solver", "pendpipe diagnose", "o-", BLUE, 1.0),
        ("oracle", "oracle, largest score", "s--", GREY, 0.96),
        ("oracle_by_effect", "oracle, effect by effect", "^:", GREEN, 1.04),
    ):
        rate = np.array([level[key]["rate"] for level in levels])
        low, high = np.array([level[key]["interval95"] for level in levels]).reshape(-1, 2).T
        axes.errorbar(
            size * beside,
            rate,
            [rate - low, high - rate],
            fmt=style,
            label=label,
            capsize=2,
            color=colour,
            markersize=5,
            elinewidth=0.8,
        )
    axes.set_xscale("log")
    axes.set_xlabel("oracle's Δχ² of the hidden effect")
    axes.set_ylabel("share detected (1 % level)")
    axes.set_ylim(-0.03, 1.03)
    axes.legend(loc="lower right", frameon=False)


def _confusion(axes: Any, scores: dict[str, Any]) -> None:
    """Shares by colour and counts in figures; the same order on both sides."""
    table = scores["confusion"]
    order = [name for effects in GROUPS.values() for name in effects]
    named = {name for row in table.values() for name in row}
    names = [name for name in order if name in table or name in named]
    names += sorted((named | set(table)) - set(order))
    rows = [name for name in names if name in table]
    grid = np.array([[table[r].get(c, 0) for c in names] for r in rows], dtype=float)
    grid = grid.reshape(len(rows), len(names))
    share = grid / np.maximum(grid.sum(axis=1, keepdims=True), 1.0)
    if rows:
        axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for row, column in np.argwhere(grid > 0):
        axes.text(
            column,
            row,
            f"{grid[row, column]:.0f}",
            ha="center",
            va="center",
            fontsize=7,
            color="white" if share[row, column] > 0.5 else "black",
        )
    axes.set_xticks(range(len(names)), names, rotation=90)
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xlabel("first name in the answer")
    axes.set_ylabel("what was hidden (single effects and ties that were detected)")


def _reliability(axes: Any, scores: dict[str, Any]) -> None:
    bins = scores["calibration"]["bins"]
    axes.plot([0, 1], [0, 1], color="0.7")
    if bins:
        stated = np.array([row["stated"] for row in bins])
        met = np.array([row["met"] for row in bins])
        low, high = np.array([row["interval95"] for row in bins]).T
        axes.errorbar(stated, met, [met - low, high - met], fmt="o", capsize=2, color=BLUE)
        for row in bins:
            axes.annotate(
                str(row["of"]),
                (row["stated"], row["met"]),
                (6, -3),
                color=GREY,
                fontsize=8,
                textcoords="offset points",
            )
    axes.set_xlim(-0.02, 1.06)
    axes.set_xlabel("stated probability of the first name (beside each point: answers)")
    axes.set_ylabel("share that is right")


def _abstention(axes: Any, scores: dict[str, Any]) -> None:
    """Accuracy and the share that is answered, against the threshold."""
    rows = [row for row in scores["abstention"] if row["accuracy"]["rate"] is not None]
    at = [row["threshold"] for row in rows]
    if rows:
        low, high = np.array([row["accuracy"]["interval95"] for row in rows]).T
        axes.fill_between(at, low, high, color=BLUE, alpha=0.18, linewidth=0)
    met = [row["accuracy"]["rate"] for row in rows]
    axes.plot(at, met, "o-", color=BLUE, markersize=4, label="right, of the names given")
    given = [row["answered"]["rate"] for row in rows]
    axes.plot(at, given, "s--", color=GREY, markersize=4, label="names given, of all")
    axes.plot([0, 1], [0, 1], color="0.7", linewidth=0.8)
    axes.set_xlim(-0.02, 1.02)
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel("probability below which a first name is withheld")
    axes.set_ylabel("share")
    axes.legend(loc="lower center", frameon=False)


FIGURES: Final = {
    "power": (_power, (6.0, 4.0)),
    "confusion": (_confusion, (9.0, 8.0)),
    "reliability": (_reliability, (6.0, 4.0)),
    "abstention": (_abstention, (6.0, 4.0)),
}
"""Each figure with what draws it and its size, inches."""


DRAWER: Final = (*SOLVER[:-2], "--figures", "all")
MAP: Final = "residual_map.svg"


def draw_cases(
    opened: dict[str, Any], folder: Path, figures: Path, *, solver: Sequence[str] = DRAWER
) -> list[dict[str, Any]]:
    """Draw the residual of each case without and with what was named.

    The answers were given without figures. The same command on the same recording gives the
    same answer; whether it did is reported, since the program may have been changed in between.

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
    with alone(recording, item.truth["baseline"], solver) as (_, errors, answer):
        if not (answer / MAP).exists() or not (answer / "diagnosis.json").exists():
            print(f"{item.name}: no figure of its residual: {errors[-200:]}", file=sys.stderr)
            return none
        (figures / f"case-{number}.svg").write_bytes((answer / MAP).read_bytes())
        again = read_json(answer / "diagnosis.json")
    same = again.get("statement") == item.answer.content.get("statement")
    return {"figure": f"case-{number}.svg", "same_answer": same}
