"""Figure 5: how much buoyancy and added mass lengthen the period."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from pendpipe.figures.data import NothingToDrawError, branches, curve, of_branch
from pendpipe.figures.style import BLUE, GREEN, INK, branch, new_figure, styled

CAUSES: Final = {
    "buoyancy": ("buoyancy", BLUE, (5, 2)),
    "added_mass": ("added mass", GREEN, (1.5, 1.5)),
    "both": ("both", INK, ()),
}
_SHIFTS_PERCENT: Final = (1, 2, 5, 10, 20, 40, 60, 70, 80)


@styled
def draw(comparison: Mapping[str, Any]) -> Figure:
    """Draw the relative lengthening of the period against frequency, cause by cause."""
    names = branches(comparison)
    if not names:
        raise NothingToDrawError("the campaign has no theory curves")
    figure, axes = new_figure(3.8)
    for name in names:
        marker = branch(name).marker
        for cause, (_, colour, dashes) in CAUSES.items():
            frequency, value = curve(comparison, name, f"lengthening_{cause}")
            axes.plot(frequency, 100.0 * value, color=colour, dashes=dashes or (None, None))
            dots = [
                (e["frequency"]["value"], 100.0 * e["lengthening"][cause])
                for e in of_branch(comparison, name)
                if e.get("lengthening") and e.get("frequency")
            ]
            axes.plot(*np.array(dots).reshape(-1, 2).T, marker, color=colour, markersize=4.5)
    axes.set(
        yscale="log", xlabel="Frequency (Hz)", ylabel="Lengthening of the period (%)",
        xlim=(0.0, None),
    )  # fmt: skip
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", length=0)
    _lowering_on_the_right(axes)
    _keys(axes, names)
    return figure


def _lowering_on_the_right(axes: Any) -> None:
    """The same as a lowering of the frequency: T up by x means f down by x/(1 + x)."""
    right = axes.secondary_yaxis("right")
    low, high = axes.get_ylim()
    shown = [p for p in _SHIFTS_PERCENT if low <= 100.0 * p / (100.0 - p) <= high]
    right.set_yticks([100.0 * p / (100.0 - p) for p in shown], [str(p) for p in shown])
    right.yaxis.set_minor_locator(NullLocator())
    right.set_ylabel("Lowering of the frequency (%)")
    right.spines["right"].set_visible(True)


def _keys(axes: Any, names: list[str]) -> None:
    """Causes by colour and dashes, branches by symbol."""
    causes = [
        Line2D([], [], color=colour, dashes=dashes or (None, None), label=text)
        for text, colour, dashes in CAUSES.values()
    ]
    kinds = [
        Line2D([], [], color=INK, marker=branch(name).marker, linestyle="", markersize=4.5,
               label=branch(name).name)
        for name in names
    ]  # fmt: skip
    axes.legend(
        handles=causes + kinds, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2,
        borderaxespad=0.3,
    )  # fmt: skip
