"""Figures of a scored set."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pendpipe.challenge.solved import Solved, read_items, six_cases


def draw(opened: dict[str, Any], scores: dict[str, Any], folder: Path) -> list[str]:
    """Draw all figures as SVG and return their names."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    folder.mkdir(parents=True, exist_ok=True)
    items = read_items(opened)
    drawn = []
    with mpl.rc_context({"svg.hashsalt": "pendpipe", "font.size": 9}):
        for name in ("power", "confusion", "reliability", "cases"):
            wide = name == "confusion"
            figure, axes = plt.subplots(figsize=(9, 8) if wide else (6, 4), layout="constrained")
            if name == "power":
                _power(axes, scores)
            elif name == "confusion":
                _confusion(axes, scores)
            elif name == "reliability":
                _reliability(axes, scores)
            else:
                _cases(axes, items)
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
            plt.close(figure)
            drawn.append(f"{name}.svg")
    return drawn


def _power(axes: Any, scores: dict[str, Any]) -> None:
    levels = scores["detection"]["levels"]
    size = [max(level["delta_chi2"], 1.0) for level in levels]
    for key, label, style in (
        ("solver", "pendpipe diagnose", "o-"),
        ("oracle", "oracle, largest score", "s--"),
        ("oracle_by_effect", "oracle, effect by effect", "^:"),
    ):
        rate = np.array([level[key]["rate"] for level in levels])
        low, high = np.array([level[key]["interval95"] for level in levels]).T
        axes.errorbar(size, rate, [rate - low, high - rate], fmt=style, label=label, capsize=2)
    axes.set_xscale("log")
    axes.set_xlabel("oracle's Δχ² of the hidden effect")
    axes.set_ylabel("share detected (1 % level)")
    axes.set_ylim(-0.03, 1.03)
    axes.legend()


def _confusion(axes: Any, scores: dict[str, Any]) -> None:
    table = scores["confusion"]
    rows = sorted(table)
    columns = sorted({name for row in table.values() for name in row})
    grid = np.array([[table[r].get(c, 0) for c in columns] for r in rows], dtype=float)
    share = grid / np.maximum(grid.sum(axis=1, keepdims=True), 1.0) if rows else np.zeros((1, 1))
    axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    axes.set_xticks(range(len(columns)), columns, rotation=90)
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xlabel("first name in the answer")
    axes.set_ylabel("what was hidden")


def _reliability(axes: Any, scores: dict[str, Any]) -> None:
    bins = scores["calibration"]["bins"]
    axes.plot([0, 1], [0, 1], color="0.7")
    if bins:
        stated = np.array([row["stated"] for row in bins])
        met = np.array([row["met"] for row in bins])
        low, high = np.array([row["interval95"] for row in bins]).T
        axes.errorbar(stated, met, [met - low, high - met], fmt="o", capsize=2)
    axes.set_xlabel("stated probability of the first name")
    axes.set_ylabel("share that is right")


def _cases(axes: Any, items: list[Solved]) -> None:
    cases = six_cases(items)
    for row, item in enumerate(cases):
        content = item.answer.content
        before = (content.get("baseline") or {}).get("residual_rms_rad")
        after = (content.get("improved") or {}).get("residual_rms_rad")
        noise = content.get("noise_rms_rad")
        if before and noise:
            axes.plot(before / noise, row, "o", color="C3", label="before" if row == 0 else None)
        if after and noise:
            axes.plot(after / noise, row, "o", color="C0", label="after" if row == 0 else None)
    labels = [f"{i.effect['effect']} → {i.answer.lead or 'nothing'}" for i in cases]
    axes.set_yticks(range(len(cases)), labels)
    axes.axvline(1.0, color="0.7")
    axes.set_xscale("log")
    axes.set_xlabel("rms residual over noise")
    axes.legend()
