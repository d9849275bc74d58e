"""Figure 10: figure 9 with the hysteretic part left out, and how wrong that is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from pendpipe.figures.data import branches, curve
from pendpipe.figures.fig09 import draw_measured
from pendpipe.figures.style import GREY, VERMILION, key_above, new_figure, styled


@styled
def draw(comparison: Mapping[str, Any]) -> Figure:
    """Draw the limiting Q with Eq. 16 alone, in red, beside the full theory."""
    figure, axes = new_figure(4.1)
    draw_measured(axes, comparison)
    for name in branches(comparison):
        frequency, full = curve(comparison, name, "quality_factor_limit_theory")
        axes.plot(frequency, full, color=GREY, linewidth=1.0, zorder=1.2)
        frequency, viscous = curve(comparison, name, "quality_factor_viscous_theory")
        axes.plot(frequency, viscous, color=VERMILION, linestyle="--", linewidth=1.8, zorder=1.5)
        axes.fill_between(frequency, full, viscous, color=VERMILION, alpha=0.10, linewidth=0.0)
    axes.plot([], [], color=VERMILION, linestyle="--", linewidth=1.8,
              label="Eq. 16 alone: hysteresis left out")  # fmt: skip
    axes.plot([], [], color=GREY, linewidth=1.0, label="Eq. 16 and hysteresis together")
    axes.set(
        xlabel="Frequency (Hz)", ylabel="Limiting quality factor $Q$",
        xlim=(0.0, None), ylim=(0.0, None),
    )  # fmt: skip
    key_above(axes, 1)
    return figure
