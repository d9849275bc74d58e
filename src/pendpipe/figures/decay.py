"""One record's decay: amplitudes with the fit of Eq. 14, and with linear damping alone."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe import physics
from pendpipe.arrays import FloatArray
from pendpipe.figures.data import Decay
from pendpipe.figures.exponential import fit_exponential
from pendpipe.figures.style import (
    BLUE,
    INK,
    VERMILION,
    figure_with_residuals,
    key_above,
    plain_text,
    styled,
)
from pendpipe.quantities import axis_unit, compact

MANY = 150
"""From this many points on they are drawn as pixels inside the SVG, to keep it small."""


@styled
def draw(decay: Decay) -> Figure:
    """Draw the amplitudes of the turning points against time, and data minus fit."""
    time, y, sd = decay.time_s, decay.amplitude_rad, decay.amplitude_sd_rad
    fitted = physics.amplitude(decay.elapsed_s, decay.value("amplitude"), *decay.rates)
    start, rate = fit_exponential(decay.elapsed_s, y, sd)
    linear = start * np.exp(-rate * decay.elapsed_s)
    moment = np.linspace(0.0, float(decay.elapsed_s[-1]), 300)
    smooth = physics.amplitude(moment, decay.value("amplitude"), *decay.rates)
    large, large_unit = axis_unit(y, decay.unit)
    residual = y - fitted
    small, small_unit = axis_unit(np.abs(residual) + sd, decay.unit)

    figure, upper, lower = figure_with_residuals(4.2, constrained=False, residual_share=0.5)
    _amplitudes(upper, time, large * y, large * sd)
    upper.plot(time[0] + moment, large * smooth, color=INK, linewidth=1.0, zorder=3,
               label=f"Eq. 14 (rms misfit {_rms(residual, decay.unit)})")  # fmt: skip
    upper.plot(
        time[0] + moment, large * start * np.exp(-rate * moment), color=VERMILION,
        linestyle="--", linewidth=1.1, zorder=3,
        label=f"linear damping ({_rms(y - linear, decay.unit)})",
    )  # fmt: skip
    # The logarithm of an amplitude within its own noise is chance.
    lowest = float(np.min(y, where=y > 2.0 * sd, initial=float(np.max(y))))
    upper.set_yscale("log")
    upper.set_ylim(0.75 * large * lowest, 1.35 * large * float(np.max(y)))
    _plain_log_labels(upper)
    upper.set_ylabel(f"Amplitude ({large_unit})")
    key_above(upper, 2)

    _amplitudes(lower, time, small * residual, small * sd)
    lower.set(xlabel=plain_text(f"Time in {decay.record} (s)"), ylabel=f"Data − fit ({small_unit})")
    lower.margins(x=0.015)
    return figure


def _amplitudes(axes: Axes, time_s: FloatArray, values: FloatArray, errors: FloatArray) -> None:
    """Draw points with error bars."""
    axes.errorbar(
        time_s, values, errors, fmt="o", color=BLUE, markersize=2.4, elinewidth=0.6,
        capsize=0.0, rasterized=len(time_s) > MANY, label=f"{len(time_s)} turning points",
    )  # fmt: skip


def _rms(misfit: FloatArray, unit: str) -> str:
    """Root mean square with its unit."""
    return compact(float(np.sqrt(np.mean(misfit**2))), unit)


def _plain_log_labels(axes: Axes) -> None:
    """Write 0.5, 1, 2, 5, ... on a logarithmic axis instead of powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    low, high = axes.get_ylim()
    steps: tuple[float, ...] = (1.0,) if high > 1000.0 * low else (1.0, 2.0, 5.0)
    if high < 8.0 * low:
        steps = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
    axes.yaxis.set_major_locator(LogLocator(subs=steps))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_locator(NullLocator())
