"""The decay with both models, and what each of them leaves."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.refine import Fit
from pendpipe.figures.diagnosis_data import Shown
from pendpipe.figures.style import BLUE, GREY, INK, VERMILION, WIDTH_IN, key_above, styled
from pendpipe.quantities import axis_unit

Model = tuple[str, Fit, str]
"""A model's name in the key, its fit and its colour."""
_CYCLES: Final = 4.0
"""Cycles at the end of the decay that are drawn with each reading."""


@styled
def draw(content: Shown) -> Figure:
    """Draw the amplitude's decay, the last cycles, and the residuals against time."""
    models: list[Model] = [(content.baseline_name, content.baseline, VERMILION)]
    if content.extended is not None:
        models.append((content.extended_name, content.extended, BLUE))
    data, figure = content.data, Figure(figsize=(WIDTH_IN, 5.4), layout="constrained")
    decay, end, rest = figure.subplots(3, 1)
    quantity = "Angle" if data.unit == "rad" else "Displacement"
    values = np.where(data.weight > 0.0, data.values, np.nan)
    factor, unit = axis_unit(values, data.unit)
    decay.plot(data.time_s, factor * values, color=GREY, linewidth=0.4, label="readings")
    for name, fit, colour in models:
        middle = float(np.median(fit.at.reading - fit.at.sampled.angle))
        for side in (1.0, -1.0):
            outline = factor * (middle + side * fit.at.sampled.amplitude)
            label = name if side > 0.0 else None
            decay.plot(data.time_s, outline, color=colour, linewidth=1.2, label=label)
    decay.set_ylabel(f"{quantity} ({unit})")
    key_above(decay, 3)
    _draw_end(end, content, values, models)
    end.set_ylabel(f"{quantity} ({unit})")
    residuals = [content.residual(fit) for _, fit, _ in models]
    small, small_unit = axis_unit(np.stack(residuals), data.unit)
    rest.axhline(0.0, color=INK, linewidth=0.8)
    for residual, (_, _, colour) in zip(residuals, models, strict=True):
        rest.plot(data.time_s, small * residual, ".", color=colour, markersize=1.5)
    rest.set(xlabel="Time (s)", ylabel=f"Readings − model ({small_unit})")
    return figure


def _draw_end(axes: Axes, content: Shown, values: FloatArray, models: list[Model]) -> None:
    """Draw the last cycles, where a wrong model is most out of phase."""
    time = content.data.time_s
    factor, _ = axis_unit(values, content.data.unit)
    last = time > time[-1] - _CYCLES * content.baseline.at.span.period_s
    axes.plot(time[last], factor * values[last], "o", color=GREY, markersize=2.0)
    for _, fit, colour in models:
        axes.plot(time[last], factor * fit.at.reading[last], color=colour, linewidth=1.0)
    axes.set_xlabel("Time (s)")
