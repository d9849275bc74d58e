"""All the figures of a campaign, and which of them could not be drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

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


@dataclass
class Drawn:
    """What was drawn, and what was left out and why."""

    files: list[Path] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)


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
    names = list(_campaign_figures(comparison, folder))
    tasks = [
        *(partial(draw_figure, comparison, folder, out, name) for name in names),
        *(partial(draw_record, folder, entry) for entry in comparison["records"]),
    ]
    if processes < 2:
        return _together([task() for task in tasks])
    with ProcessPoolExecutor(processes) as pool:
        return _together([draw.result() for draw in [pool.submit(task) for task in tasks]])


def draw_record(folder: Path, entry: Entry) -> Drawn:
    """Draw one record's decay (for the page: a drawing in pixels would take as long again)."""
    drawn, name = Drawn(), entry["record"]
    if entry.get("refused"):
        drawn.left_out[f"{name}, decay"] = "the record was refused"
        return drawn
    stem = folder / name / "figures" / "decay"
    _draw(drawn, f"{name}, decay", _decay_of(folder, entry), stem, forms=("svg",))
    return drawn


def draw_figure(comparison: Comparison, folder: Path, out: Path, name: str) -> Drawn:
    """Draw one of figures 3 to 10, or the tail figure."""
    drawn = Drawn()
    keep_place = bool(comparison.get("has_theory")) and name.startswith("fig")
    draw = _campaign_figures(comparison, folder)[name]
    _draw(drawn, name, draw, out / name, keep_place=keep_place)
    return drawn


def _together(parts: list[Drawn]) -> Drawn:
    """What several have drawn, in their order."""
    whole = Drawn()
    for part in parts:
        whole.files += part.files
        whole.left_out |= part.left_out
    return whole


def _campaign_figures(comparison: Comparison, folder: Path) -> dict[str, Callable[[], Figure]]:
    """The drawing of each figure, not yet done."""
    figures: dict[str, Callable[[], Figure]] = {
        "fig03": lambda: draw_fig03(comparison.get("calibration")),
        "fig04": lambda: draw_fig04(comparison),
        "fig07": lambda: _typical_decay(comparison, folder),
        "fig08": lambda: draw_fig08(read_decay(folder, _typical(comparison))),
        "tail": lambda: draw_tail(comparison.get("tail")),
    }
    if comparison.get("has_theory"):
        figures |= {
            "fig05": lambda: draw_fig05(comparison),
            "fig06": lambda: draw_fig06(comparison),
            "fig09": lambda: draw_fig09(comparison),
            "fig10": lambda: draw_fig10(comparison),
        }
    return dict(sorted(figures.items()))


def _decay_of(folder: Path, entry: Entry) -> Callable[[], Figure]:
    return lambda: draw_decay(read_decay(folder, entry))


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


def _draw(
    drawn: Drawn,
    name: str,
    draw: Callable[[], Figure],
    stem: Path,
    *,
    keep_place: bool = False,
    forms: Sequence[str] = ("svg", "png"),
) -> None:
    """Draw and save one figure, or note why not (and say it in the figure's place)."""
    try:
        figure = draw()
    except NothingToDrawError as reason:
        drawn.left_out[name] = str(reason)
        if not keep_place:
            return
        figure = placeholder(str(reason))
    drawn.files += save(figure, stem, forms=forms)
