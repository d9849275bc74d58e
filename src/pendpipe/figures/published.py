"""What theory leaves of published numbers: observed less calculated, row by row."""

from collections.abc import Sequence
from operator import methodcaller
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from pendpipe.figures.style import GREEN, GREY, INK, Panel, curve, figure_of, level, measured

if TYPE_CHECKING:
    from pendpipe.campaign.published import Asked


def draw_published(asked: Sequence["Asked"]) -> Figure:
    """Draw a panel for each question: what is told leaves, and what remains with what was found."""
    return figure_of(3.0 * len(asked) + 0.6, *map(_panel, asked), sharex=False)


def _panel(one: "Asked") -> Panel:
    table, found = one.table, one.found
    groups = list(dict.fromkeys(row.group for row in table.runs))
    place = np.arange(len(table.runs)) + [groups.index(row.group) for row in table.runs]
    n = table.column("n")
    marks = [
        level(0.0, INK),
        measured(place, n - one.told, one.errors.sd, label="as told"),
    ]
    if found.found:
        left = n - one.best
        marks.append(
            curve(place, left, GREEN, "", marker="s", markersize=3.5, label="with the cause")
        )
    then = n - table.column("then")
    marks.append(curve(place, then, GREY, "", marker="_", markersize=7, label="at the time"))
    middles = [place[[row.group == group for row in table.runs]].mean() for group in groups]
    marks.append(
        methodcaller(
            "set_xticks",
            middles,
            groups,
            rotation=40,
            ha="right",
            fontsize=6.5,
            rotation_mode="anchor",
        )
    )
    about = {"ylabel": "Observed less\ncalculated $n$", "xlabel": one.case.title}
    return Panel(marks, about, key=3)
