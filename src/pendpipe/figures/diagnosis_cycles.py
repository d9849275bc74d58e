"""Damping and frequency against amplitude: the readings' cycles beside both models."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.cycles import Spans
from pendpipe.effects.baseline import OMEGA
from pendpipe.figures.diagnosis_data import Shown
from pendpipe.figures.style import BLUE, INK, VERMILION, WIDTH_IN, key_above, styled
from pendpipe.quantities import axis_unit


@styled
def draw_damping(content: Shown) -> Figure:
    """Draw 1/Q of each span of cycles, and by how much it differs from the baseline's."""
    measured = content.measured
    curves = _models(content)
    omega = float(content.baseline.value[OMEGA])
    figure = Figure(figsize=(WIDTH_IN, 4.2))
    figure.subplots_adjust(left=0.135, right=0.975, bottom=0.11, top=0.885, hspace=0.1)
    upper, lower = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [1.0, 0.8]})
    quality, quality_sd = 2.0 * measured.loss / omega, 2.0 * measured.loss_sd / omega
    across, unit = axis_unit(measured.amplitude, content.data.unit)
    x = across * measured.amplitude
    _points(upper, x, 1e3 * quality, 1e3 * quality_sd, "readings")
    for name, colour, dashes, spans in curves:
        upper.plot(x, 2e3 * spans.loss / omega, color=colour, linestyle=dashes, label=name,
                   linewidth=1.2)  # fmt: skip
    upper.set_ylabel("Loss 1/Q (10⁻³)")
    expected = 2.0 * curves[0][3].loss / omega
    power, factor = _power(np.concatenate([quality - expected, quality_sd]))
    _points(lower, x, factor * (quality - expected), factor * quality_sd, "")
    for _, colour, dashes, spans in curves:
        lower.plot(x, factor * (2.0 * spans.loss / omega - expected), color=colour,
                   linestyle=dashes, linewidth=1.2)  # fmt: skip
    lower.set_ylabel(f"1/Q − {content.baseline_name}'s ({power})")
    _amplitude_axis(lower, x, unit)
    key_above(upper, 3 if content.extended is None else 2)
    figure.align_ylabels([upper, lower])
    return figure


@styled
def draw_frequency(content: Shown) -> Figure:
    """Draw the frequency of each span of cycles, relative to the baseline's omega/(2 pi)."""
    measured = content.measured
    curves = _models(content)
    origin = float(content.baseline.value[OMEGA]) / (2.0 * math.pi)
    shift = measured.frequency_hz / origin - 1.0
    shift_sd = measured.frequency_sd_hz / origin
    power, factor = _power(np.concatenate([shift, shift_sd]))
    figure = Figure(figsize=(WIDTH_IN, 3.2))
    figure.subplots_adjust(left=0.135, right=0.975, bottom=0.145, top=0.84)
    axes = figure.subplots()
    across, unit = axis_unit(measured.amplitude, content.data.unit)
    x = across * measured.amplitude
    _points(axes, x, factor * shift, factor * shift_sd, "readings")
    for name, colour, dashes, spans in curves:
        axes.plot(x, factor * (spans.frequency_hz / origin - 1.0), color=colour, linestyle=dashes,
                  label=name, linewidth=1.2)  # fmt: skip
    axes.set_ylabel(f"Frequency/({origin:.6g} Hz) − 1 ({power})")
    _amplitude_axis(axes, x, unit)
    key_above(axes, 3 if content.extended is None else 2)
    return figure


def _models(content: Shown) -> list[tuple[str, str, str, Spans]]:
    """Name, colour, dashes and spans of the baseline and of the extended model."""
    found = [(content.baseline_name, VERMILION, "--", content.of_model(content.baseline))]
    if content.extended is not None:
        found.append((content.extended_name, INK, "-", content.of_model(content.extended)))
    return found


def _points(axes: Axes, x: FloatArray, y: FloatArray, sd: FloatArray, label: str) -> None:
    axes.errorbar(
        x, y, sd, fmt="o", color=BLUE, markersize=3.2, elinewidth=0.7, capsize=0.0,
        label=label or None,
    )  # fmt: skip


def _power(values: FloatArray) -> tuple[str, float]:
    """The power of a thousand that an axis of pure numbers is counted in."""
    largest = float(np.nanmax(np.abs(values)))
    if largest >= 0.5 or largest == 0.0:
        return "1", 1.0
    if largest >= 0.5e-3:
        return "10⁻³", 1e3
    return "10⁻⁶", 1e6


def _amplitude_axis(axes: Axes, x: FloatArray, unit: str) -> None:
    """Amplitude along the axis: logarithmic where it falls far."""
    axes.set_xlabel(f"Amplitude ({unit})")
    if float(np.max(x)) < 3.0 * float(np.min(x)):
        return
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    decades = math.log10(float(np.max(x)) / float(np.min(x)))
    between = (1.0, 3.0) if decades > 2.0 else (1.0, 2.0, 5.0)
    axes.xaxis.set_major_locator(
        LogLocator(subs=between if decades > 1.0 else (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0))
    )
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", length=0)
