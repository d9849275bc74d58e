"""All the figures of a campaign, and which of them could not be drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from pendpipe.errors import InputError
from pendpipe.figures.comparison import (
    draw_fig03,
    draw_fig04,
    draw_fig05,
    draw_fig06,
    draw_fig09,
    draw_fig10,
    draw_tail,
)
from pendpipe.figures.data import (
    Entry,
    NothingToDrawError,
    number,
    read_decay,
    used,
)
from pendpipe.figures.decays import draw_decay, draw_fig07, draw_fig08
from pendpipe.figures.style import placeholder, save
from pendpipe.recording import read_plain

Comparison = Mapping[str, Any]


class Drawn(NamedTuple):
    """What was drawn, and what was left out and why."""

    files: list[Path]
    left_out: dict[str, str]


def draw_all(comparison: Comparison, folder: Path, out: Path, *, processes: int = 1) -> Drawn:
    """Draw figures 3 to 10, the tail figure and each record's decay.

    Parameters
    ----------
    comparison
        The content of comparison.json.
    folder
        The campaign's results: a folder a record lies in it.
    out
        Where the campaign's figures go; a record's go to its own folder.
    processes
        How many draw at once.

    Returns
    -------
    Drawn
        A campaign with theory leaves a file for each of figures 3 to 10, with the reason
        in it where there was nothing to draw; one without leaves them out.
    """
    tasks = [
        *(
            partial(_figure, comparison, folder, out, name)
            for name in _campaign_figures(comparison)
        ),
        *(partial(_decay, folder, entry) for entry in comparison["records"]),
    ]
    if processes < 2:
        parts = [task() for task in tasks]
    else:
        with ProcessPoolExecutor(processes) as pool:
            parts = [draw.result() for draw in [pool.submit(task) for task in tasks]]
    return Drawn(
        [path for part in parts for path in part.files],
        dict(reason for part in parts for reason in part.left_out.items()),
    )


def _decay(folder: Path, entry: Entry) -> Drawn:
    """Draw one record's decay (for the page: a drawing in pixels would take as long again)."""
    name = f"{entry['record']}, decay"
    if entry.get("refused"):
        return Drawn([], {name: "the record was refused"})
    stem = folder / entry["record"] / "figures" / "decay"
    return _drawn(name, lambda: draw_decay(read_decay(folder, entry)), stem, forms=("svg",))


def _figure(comparison: Comparison, folder: Path, out: Path, name: str) -> Drawn:
    """Draw one of figures 3 to 10, or the tail figure."""
    keep_place = bool(comparison.get("has_theory")) and name.startswith("fig")
    draw = _campaign_figures(comparison)[name]
    return _drawn(name, lambda: draw(comparison, folder), out / name, keep_place=keep_place)


def _campaign_figures(comparison: Comparison) -> dict[str, Callable[[Comparison, Path], Figure]]:
    """The drawing of each figure from the comparison and the campaign's results, by name."""
    figures: dict[str, Callable[[Comparison, Path], Figure]] = {
        "fig03": lambda comparison, _: draw_fig03(comparison.get("calibration")),
        "fig04": lambda comparison, _: draw_fig04(comparison),
        "fig07": _typical_decay,
        "fig08": lambda comparison, folder: draw_fig08(read_decay(folder, _typical(comparison))),
        "tail": lambda comparison, _: draw_tail(comparison.get("tail")),
    }
    if comparison.get("has_theory"):
        figures |= {
            "fig05": lambda comparison, _: draw_fig05(comparison),
            "fig06": lambda comparison, _: draw_fig06(comparison),
            "fig09": lambda comparison, _: draw_fig09(comparison),
            "fig10": lambda comparison, _: draw_fig10(comparison),
        }
    return dict(sorted(figures.items()))


def _typical(comparison: Comparison) -> Entry:
    """The record of figures 7 and 8."""
    name = comparison.get("typical_record")
    if not name:
        raise NothingToDrawError("the configuration names no typical record")
    for entry in used(comparison):
        if entry["record"] == name:
            return entry
    raise NothingToDrawError(f"the typical record {name} was refused")


def _typical_decay(comparison: Comparison, folder: Path) -> Figure:
    entry = _typical(comparison)
    constant = number(entry.get("volts_per_radian"))
    try:
        recording = read_plain(folder / entry["record"] / "recording.csv")
    except InputError as fault:
        raise NothingToDrawError(str(fault)) from None
    return draw_fig07(read_decay(folder, entry), recording, constant)


def _drawn(
    name: str,
    draw: Callable[[], Figure],
    stem: Path,
    *,
    keep_place: bool = False,
    forms: Sequence[str] = ("svg", "png"),
) -> Drawn:
    """Draw and save one figure, or note why not (and say it in the figure's place)."""
    try:
        return Drawn(save(draw(), stem, forms=forms), {})
    except NothingToDrawError as fault:
        reason = str(fault)
    return Drawn(save(placeholder(reason), stem) if keep_place else [], {name: reason})
