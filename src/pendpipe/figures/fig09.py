"""Figure 9: Q of all the records in water beside the theory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe.figures.data import (
    NothingToDrawError,
    branches,
    curve,
    error,
    number,
    of_branch,
    series,
    used,
)
from pendpipe.figures.style import GREY, INK, branch, figure_with_residuals, key_above, styled
from pendpipe.quantities import with_error


@styled
def draw(comparison: Mapping[str, Any]) -> Figure:
    """Draw the limiting Q with Eq. 16 and the hysteretic part together, and their ratio."""
    figure, upper, lower = figure_with_residuals(4.8, residual_share=0.45, baseline=1.0)
    draw_measured(upper, comparison)
    for name in branches(comparison):
        frequency, theory = curve(comparison, name, "quality_factor_limit_theory")
        upper.plot(frequency, theory, color=branch(name).colour, zorder=1.5)
    upper.plot([], [], color=INK, label="lines: Eq. 16 and hysteresis together")
    upper.set(ylabel="Limiting quality factor $Q$", xlim=(0.0, None), ylim=(0.0, None))
    key_above(upper, 1)

    spread = _theory_spread(comparison)
    lower.axhspan(1.0 - spread, 1.0 + spread, color=GREY, alpha=0.18, linewidth=0.0)
    for name in branches(comparison):
        _ratio(lower, comparison, name)
    factor = comparison.get("theory_factor")
    if factor and np.isfinite(number(factor)):
        text = with_error(number(factor), error(factor))
        lower.set_title(f"Drag measured over Eq. 16: {text}", fontsize=8.5, pad=3)
    lower.set(xlabel="Frequency (Hz)", ylabel="Measured\nover theory")
    lower.margins(y=0.15)
    return figure


def draw_measured(axes: Axes, comparison: Mapping[str, Any]) -> None:
    """Draw the limiting Q of each branch with error bars."""
    names = branches(comparison)
    found = {n: series(of_branch(comparison, n), "quality_factor_limit") for n in names}
    if not any(len(points.x) for points in found.values()):
        raise NothingToDrawError("no record in a fluid has a limiting Q")
    for name, points in found.items():
        look = branch(name)
        axes.errorbar(
            points.x, points.y, points.y_sd, points.x_sd,
            fmt=look.marker, color=look.colour, zorder=3, label=f"measured, {look.name}",
        )  # fmt: skip


def _theory_spread(comparison: Mapping[str, Any]) -> float:
    """Relative standard deviation of Eq. 16 itself, from distances and diameter."""
    theory = [entry.get("quality_factor_viscous_theory") for entry in used(comparison)]
    spreads = [error(entry) / number(entry) for entry in theory if entry and number(entry) > 0.0]
    return float(np.median(spreads)) if spreads else 0.0


def _ratio(axes: Axes, comparison: Mapping[str, Any], name: str) -> None:
    """Draw measured over theory; the theory at each record's own geometry."""
    look = branch(name)
    entries = [e for e in of_branch(comparison, name) if e.get("quality_factor_limit_theory")]
    points = series(entries, "quality_factor_limit")
    theory = {e["record"]: number(e["quality_factor_limit_theory"]) for e in entries}
    own = np.array([theory[record] for record in points.names])
    axes.errorbar(
        points.x, points.y / own, points.y_sd / own,
        fmt=look.marker, color=look.colour, markersize=4.5, ecolor=GREY,
    )  # fmt: skip
