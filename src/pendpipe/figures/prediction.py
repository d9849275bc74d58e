"""Predicted decays and driven responses, with their bands and what was measured."""

from collections.abc import Mapping
from operator import methodcaller
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from pendpipe.figures.style import BLUE, GREY, INK, VERMILION, Mark, Panel, curve, figure_of, styled
from pendpipe.quantities import after_number

if TYPE_CHECKING:
    from pandas import DataFrame


@styled
def draw_prediction(tables: "Mapping[str, DataFrame]", unit: str) -> Figure:
    """Draw what was predicted, in a unit: a panel for each quantity."""
    amplitude = f"Amplitude ({after_number(unit).strip()})"
    named = {"amplitude": amplitude, "phase_deg": "Phase (°)", "time_s": "Time (s)"}
    panels = list[Panel]()
    if "decay" in tables:
        about = {"xlabel": "Time (s)", "ylabel": amplitude}
        panels.append(Panel(_band(tables["decay"], "time_s", "amplitude"), about))
    compared = dict(list(tables["compared"].groupby("quantity"))) if "compared" in tables else {}
    by_turns = "time_s" in compared
    for quantity, label in named.items():
        points, key = compared.get(quantity), 2 * (quantity in compared)
        if by_turns and points is not None:
            less = points.assign(**points[["measured", "low", "high"]].sub(points.value, axis=0))
            about = {"xlabel": "Turning point", "ylabel": f"{label}, less predicted"}
            panels.append(Panel(_points(less.assign(value=0.0)), about, key=key))
        elif quantity != "time_s":
            marks = [] if points is None else _points(points)
            for branch, rows in (
                tables["response"].groupby("branch") if "response" in tables else ()
            ):
                dashes = "--" if branch == "unstable" else "-"
                marks = [*_band(rows, "frequency_hz", quantity, dashes), *marks]
            about = {"xlabel": "Frequency of the drive (Hz)", "ylabel": label}
            panels += [Panel(marks, about, key=key)] if marks else []
    return figure_of(2.6 * len(panels) + 0.4, *panels, sharex=False)


def _band(table: "DataFrame", x: str, y: str, dashes: str = "-") -> list[Mark]:
    """A band and its middle; beyond what the decays showed in grey."""
    marks = list[Mark]()
    for outside, colour in ((False, BLUE), (True, GREY)):
        rows = table[[y, f"{y}_low", f"{y}_high"]].where(table.extrapolated == outside)
        middle, low, high = (rows[name] for name in rows)
        look = {"color": colour, "alpha": 0.25, "linewidth": 0.0}
        marks.append(methodcaller("fill_between", table[x], low, high, **look))
        marks.append(curve(table[x], middle, colour, dashes, 1.0))
    return marks


def _points(table: "DataFrame") -> list[Mark]:
    """Measured points over the bands that were predicted of them."""
    half = [table.value - table.low, table.high - table.value]
    look = {"fmt": "none", "ecolor": BLUE, "elinewidth": 3.0, "alpha": 0.35, "capsize": 0.0}
    bars = methodcaller("errorbar", table["at"], table.value, half, label="predicted", **look)
    out = table[~table.held]
    return [
        bars,
        curve(table["at"], table.measured, INK, "", marker="o", markersize=3.0, label="measured"),
        curve(out["at"], out.measured, VERMILION, "", marker="o", markersize=3.0),
    ]
