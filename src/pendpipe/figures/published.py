"""What theory leaves of published numbers: observed less calculated, row by row."""

from collections.abc import Sequence
from itertools import compress
from operator import methodcaller
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from pendpipe.figures.style import GREEN, GREY, INK, Panel, curve, figure_of, level, measured
from pendpipe.quantities import axis_unit

if TYPE_CHECKING:
    from pendpipe.campaign.published import Asked


def draw_published(asked: Sequence["Asked"]) -> Figure:
    """Draw a panel for each question: what is told leaves, and what remains with what was found."""
    return figure_of(3.0 * len(asked) + 0.6, *map(_panel, asked), sharex=False)


def _panel(one: "Asked") -> Panel:
    from pendpipe.campaign.published import counts, named_by
    from pendpipe.campaign.table import QUANTITIES

    own = counts(one.case, one.table)
    table, named = one.table, named_by(one.table)
    observed, *others = (
        table.scaled(each)[own]
        for each in (table.column("value"), one.told, one.best, table.column("then"))
    )
    rows = list(compress(table.runs, own))
    quantity = QUANTITIES[rows[0].quantity]
    factor, unit = (1.0, "") if quantity.log else axis_unit(observed, quantity.unit)
    told, best, then = (factor * (observed - each) for each in others)
    names = [getattr(row, named) for row in rows]
    groups = list(dict.fromkeys(names))
    place = np.arange(len(rows)) + [groups.index(name) for name in names]
    marks = [
        level(0.0, INK),
        measured(place, told, factor * one.errors.sd, label="as told"),
    ]
    if one.found.found:
        marks.append(
            curve(place, best, GREEN, "", marker="s", markersize=3.5, label="with the cause")
        )
    if np.isfinite(then).any():
        marks.append(curve(place, then, GREY, "", marker="_", markersize=7, label="at the time"))
    middles = [place[[name == group for name in names]].mean() for group in groups]
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
    of = "$n$" if rows[0].quantity == "n" else rows[0].quantity
    label = f"ln(observed/\ncalculated {of})" if quantity.log else f"Observed less\ncalculated {of}"
    return Panel(marks, {"ylabel": f"{label} ({unit})", "xlabel": one.case.title}, key=3)
