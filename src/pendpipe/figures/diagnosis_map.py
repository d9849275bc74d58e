"""Where the residual lies: time against phase of the cycle, before and after."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import AsinhNorm, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import FixedFormatter

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.refine import Fit
from pendpipe.figures.diagnosis_data import Shown
from pendpipe.figures.style import BLUE, VERMILION, WIDTH_IN, styled
from pendpipe.quantities import compact

PHASES: Final = 24
_COLUMNS: Final = 90
_IN_A_CELL: Final = 4
"""Readings, usually: fewer would leave holes."""
_CHARACTER: Final = 0.0165
"""Width of a figure in a tick label, over the drawing's."""
_COLOURS = LinearSegmentedColormap.from_list(
    "residual", [BLUE, "#FFFFFF", VERMILION]
).with_extremes(bad="#E3E6EA")


@styled
def draw(content: Shown) -> Figure:
    """Draw mean residuals over their standard errors, the baseline's and the extended model's."""
    models = [(content.baseline_name, content.baseline)]
    if content.extended is not None:
        models.append((content.extended_name, content.extended))
    maps = [residual_map(content, fit) for _, fit in models]
    largest = max([4.0] + [float(np.nanmax(np.abs(each))) for each in maps])
    norm = AsinhNorm(linear_width=2.0, vmin=-largest, vmax=largest)
    figure = Figure(figsize=(WIDTH_IN, 2.0 * len(maps) + 0.95))
    height = figure.get_figheight()
    ticks = _ticks(largest)
    labels = _signed(ticks)
    right = 0.845 - _CHARACTER * max(max(map(len, labels)) - 3, 0)
    figure.subplots_adjust(
        left=0.105, right=right, bottom=0.46 / height, top=1.0 - 0.28 / height, hspace=0.28
    )
    rows = figure.subplots(len(maps), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, fit), values in zip(rows, models, maps, strict=True):
        image = _panel(axes, content, values, norm)
        rms = math.sqrt(float(np.nanmean(content.residual(fit) ** 2)))
        axes.set_title(f"{name}: residual {compact(rms, content.data.unit)} rms")
    rows[-1].set_xlabel("Time (s)")
    low = rows[-1].get_position().y0
    place = figure.add_axes((right + 0.02, low, 0.02, rows[0].get_position().y1 - low))
    bar = figure.colorbar(image, cax=place, ticks=ticks, format=FixedFormatter(labels))
    bar.ax.minorticks_off()
    bar.set_label("Data − model (standard errors)", labelpad=1)
    return figure


def _panel(axes: Axes, content: Shown, values: FloatArray, norm: AsinhNorm) -> AxesImage:
    time = content.data.time_s
    image = axes.imshow(
        values, norm=norm, cmap=_COLOURS, aspect="auto", origin="lower", interpolation="nearest",
        extent=(float(time[0]), float(time[-1]), 0.0, 2.0 * math.pi),
    )  # fmt: skip
    axes.grid(visible=False)
    axes.set_yticks(
        [0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi, 2.0 * math.pi], ["0", "π/2", "π", "3π/2", "2π"]
    )
    axes.set_ylabel("Phase of the cycle", labelpad=1)
    return image


def _ticks(largest: float) -> list[float]:
    """Round numbers, both signs."""
    steps = [2.0, 4.0, 10.0, 30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6]
    inside = [step for step in steps if step <= largest]
    kept = inside[:: max(1, math.ceil(len(inside) / 4))]
    return sorted([-step for step in kept] + [0.0] + kept)


def _signed(ticks: list[float]) -> list[str]:
    return [f"{tick:+.0f}".replace("-", "−") if tick else "0" for tick in ticks]


def residual_map(content: Shown, fit: Fit) -> FloatArray:
    """Mean residual over its standard error in cells of phase and time.

    Phase 0 is the turning point on the positive side, pi that on the negative. Every cell
    is a cycle or more wide.

    Returns
    -------
    FloatArray
        Shape (PHASES, columns); NaN where there is no reading.
    """
    residual, sampled = content.residual(fit), content.clock.sampled
    known = np.isfinite(residual)
    turned = math.pi if sampled.motion.upwards < 0.0 else 0.0
    phase = np.mod(sampled.phase + turned, 2.0 * math.pi) / (2.0 * math.pi)
    time = content.data.time_s
    turns = float(sampled.phase[-1] - sampled.phase[0]) / (2.0 * math.pi)
    columns = max(1, int(min(turns, _COLUMNS, len(time) / (_IN_A_CELL * PHASES))))
    row = np.minimum((phase * PHASES).astype(np.int64), PHASES - 1)
    share = (time - time[0]) / (time[-1] - time[0])
    column = np.minimum((share * columns).astype(np.int64), columns - 1)
    cell = (row * columns + column)[known]
    count = np.bincount(cell, minlength=PHASES * columns)
    total = np.bincount(cell, weights=residual[known], minlength=PHASES * columns)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = total / (np.sqrt(count) * content.noise.rms)
    return np.where(count > 0, found, math.nan).reshape(PHASES, columns)
