"""Figure 4: Q against the square of the frequency in air, the mark of hysteretic damping."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pendpipe.figures.data import NothingToDrawError, error, number, series, used
from pendpipe.figures.style import BLUE, GREY, INK, figure_with_residuals, styled
from pendpipe.quantities import with_error

PERIODS_S = (15, 6, 4, 3, 2.5, 2, 1.5, 1)


@styled
def draw(comparison: Mapping[str, Any]) -> Figure:
    """Draw the limiting Q of the air benchmark with the line k f^2, and their ratio."""
    points = series(
        [e for e in used(comparison) if e.get("fluid") == "air"], "quality_factor_limit"
    )
    fitted = comparison.get("hysteretic_coefficient")
    coefficient = number(fitted)
    if not len(points.x) or not np.isfinite(coefficient):
        raise NothingToDrawError("the campaign has no benchmark in air")
    squared, squared_sd = points.x**2, 2.0 * points.x * points.x_sd

    figure, upper, lower = figure_with_residuals(4.6)
    edge = 1.05 * float(np.max(squared))
    label = f"$Q = k\\,f^{{\\,2}}$, $k$ = {with_error(coefficient, error(fitted), 's^2')}"
    upper.plot([0.0, edge], [0.0, coefficient * edge], color=INK, label=label)
    upper.errorbar(
        squared, points.y, points.y_sd, squared_sd,
        fmt="^", color=BLUE, zorder=3, label="in air",
    )  # fmt: skip
    upper.set(ylabel="Quality factor $Q$", xlim=(0.0, edge), ylim=(0.0, None))
    upper.legend(loc="upper left")
    _periods_on_top(upper, edge)

    line = coefficient * squared
    lower.errorbar(
        squared, 100.0 * (points.y / line - 1.0), 100.0 * points.y_sd / line,
        fmt="^", color=BLUE, markersize=4.5,
    )  # fmt: skip
    band = 100.0 * error(fitted) / coefficient
    lower.axhspan(-band, band, color=GREY, alpha=0.18, linewidth=0.0)
    lower.set(xlabel="Frequency squared $f^{\\,2}$ (Hz²)", ylabel="Data over\nline − 1 (%)")
    lower.margins(y=0.2)
    exponent = (fitted or {}).get("free_exponent")
    if exponent:
        text = with_error(number(exponent), error(exponent))
        label = f"With a free exponent: $Q \\propto f^{{\\,n}}$, $n$ = {text}"
        lower.set_title(label, fontsize=8.5, pad=3)
    return figure


def _periods_on_top(axes: Any, edge: float) -> None:
    """Mark the periods that people think in along the upper edge."""
    top = axes.secondary_xaxis("top")
    periods = [period for period in PERIODS_S if period**-2.0 <= edge]
    top.set_xticks([period**-2.0 for period in periods], [f"{period:g}" for period in periods])
    top.set_xlabel("Period (s)", labelpad=3)
    top.tick_params(length=3)
    top.spines["top"].set_visible(True)
