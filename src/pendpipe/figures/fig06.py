"""Figure 6: the viscous limit of Q, with and without the history term."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe.arrays import FloatArray
from pendpipe.figures.data import NothingToDrawError, branches, curve, of_branch, series
from pendpipe.figures.style import branch, new_figure, styled


@styled
def draw(comparison: Mapping[str, Any]) -> Figure:
    """Draw log10 Q_v against frequency: Eq. 16, steady Stokes flow, and what was measured."""
    names = branches(comparison)
    if not names:
        raise NothingToDrawError("the campaign has no theory curves")
    figure, axes = new_figure(4.0)
    for name in names:
        look = branch(name)
        frequency, steady = curve(comparison, name, "quality_factor_viscous_steady")
        axes.plot(frequency, np.log10(steady), color=look.colour, linestyle="--",
                  label=f"{name}: steady Stokes, Eq. 1")  # fmt: skip
        _, full = curve(comparison, name, "quality_factor_viscous_theory")
        axes.plot(frequency, np.log10(full), color=look.colour,
                  label=f"{name}: with history term, Eq. 16")  # fmt: skip
        _say_how_many_times(axes, frequency, steady, full, look.colour)
        points = series(of_branch(comparison, name), "quality_factor_viscous")
        points = points.mapped(np.log10, 1.0 / (points.y * np.log(10.0)))
        axes.errorbar(
            points.x, points.y, points.y_sd, points.x_sd, fmt=look.marker, color=look.colour,
            markerfacecolor="white", markersize=4.5, label=f"{name}: measured, Eq. 17",
        )  # fmt: skip
    axes.set(xlabel="Frequency (Hz)", ylabel="$\\log_{10}\\, Q_v$", xlim=(0.0, None))
    handles, labels = axes.get_legend_handles_labels()
    # A column of the key for each branch, theory before measurement.
    order = sorted(range(len(labels)), key=lambda i: names.index(labels[i].partition(":")[0]))
    axes.legend(
        [handles[i] for i in order], [labels[i] for i in order], loc="lower left",
        bbox_to_anchor=(0.0, 1.0), ncols=len(names), borderaxespad=0.3,
    )  # fmt: skip
    return figure


def _say_how_many_times(
    axes: Axes, frequency: FloatArray, steady: FloatArray, full: FloatArray, colour: str
) -> None:
    """An arrow from one curve to the other, with the factor between them."""
    middle = len(frequency) // 2
    x, low, high = frequency[middle], np.log10(full[middle]), np.log10(steady[middle])
    axes.annotate(
        "", (x, low), (x, high),
        arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 0.9, "shrinkB": 3.0},
    )  # fmt: skip
    axes.annotate(
        f"÷ {steady[middle] / full[middle]:.0f}", (x, 0.5 * (low + high)), (5.0, 0.0),
        textcoords="offset points", va="center", fontsize=8.5, color=colour,
    )  # fmt: skip
