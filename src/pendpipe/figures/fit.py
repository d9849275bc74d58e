"""One fit at a glance: the decay with the fitted law, what it leaves, and Q against amplitude."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe.analysis.fit.decrement import loss_of
from pendpipe.analysis.fit.result import FitResult
from pendpipe.analysis.fit.summary import period_of, seen_qualities
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, turning_points
from pendpipe.figures.style import (
    BLUE,
    GREY,
    INK,
    WIDTH_IN,
    key_above,
    plain_numbers,
    points,
    quantity_of,
    styled,
)
from pendpipe.quantities import axis_unit
from pendpipe.recording import Recording

COLUMNS: Final = 1200
"""A waveform of more samples than twice this is drawn as its lowest and highest in so many."""


@styled
def draw_fit(result: FitResult, points: TurningPoints, recording: Recording) -> Figure:
    """Draw a recording with its fitted law.

    Parameters
    ----------
    result
        The fit.
    points
        The turning points of the decay.
    recording
        The decay, in the unit of the turning points.

    Returns
    -------
    Figure
        Three panels: readings with the fitted amplitude; turning points less the fitted law;
        Q against amplitude, with the Q that the turning points show without a model.
    """
    law = result.law
    fitted = _fitted_amplitudes(law, result, points)
    factor, unit = axis_unit(points.amplitude_rad, points.unit)
    figure = Figure(figsize=(WIDTH_IN, 6.6), layout="constrained")
    decay, rest, quality = figure.subplots(3, 1, gridspec_kw={"height_ratios": [1.3, 0.7, 1.0]})
    _draw_decay(decay, factor, recording, points, fitted)
    decay.set_ylabel(f"{quantity_of(points.unit)} ({unit})")
    _draw_residual(rest, points, fitted)
    rest.sharex(decay)
    _draw_quality(quality, law, result, points)
    return figure


def _fitted_amplitudes(law: Eq8, result: FitResult, points: TurningPoints) -> FloatArray:
    """Amplitude of the law at each turning point; NaN once it has stopped."""
    number = points.half_cycle - points.half_cycle[0]
    release = Release(0.0, result.parameters["amplitude"].value)
    moved = np.abs(turning_points(law, release, count=int(number[-1]) + 1).angle_rad)
    found = np.full(len(points), math.nan)
    inside = number < len(moved)
    found[inside] = moved[number[inside]]
    return found


def _draw_decay(
    axes: Axes, factor: float, recording: Recording, points: TurningPoints, fitted: FloatArray
) -> None:
    time, values = _thinned(recording.time_s[recording.usable], recording.values[recording.usable])
    axes.plot(time, factor * values, color=BLUE, linewidth=0.5, alpha=0.6, label="readings")
    for side in (1.0, -1.0):
        axes.plot(
            points.time_s,
            factor * (points.level_rad + side * fitted),
            color=INK,
            linewidth=1.2,
            label="fitted amplitude" if side > 0 else None,
        )
    axes.set_xlabel("Time (s)")
    key_above(axes, 2)


def _thinned(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Keep the lowest and the highest reading of each of `COLUMNS` stretches."""
    if len(time) <= 2 * COLUMNS:
        return time, values
    edges = np.linspace(0, len(time), COLUMNS + 1).astype(int)
    kept = np.array(
        [
            first + extreme
            for first, last in pairwise(edges.tolist())
            for extreme in sorted(
                (int(np.argmin(values[first:last])), int(np.argmax(values[first:last])))
            )
        ]
    )
    return time[kept], values[kept]


def _draw_residual(axes: Axes, turning: TurningPoints, fitted: FloatArray) -> None:
    residual, sd = turning.amplitude_rad - fitted, turning.angle_sd_rad
    shown = np.isfinite(residual)
    factor, unit = axis_unit(np.abs(residual[shown]) + sd[shown], turning.unit)
    axes.axhline(0.0, color=INK, linewidth=0.9)
    points(axes, turning.time_s[shown], factor * residual[shown], factor * sd[shown])
    axes.set(xlabel="Time (s)", ylabel=f"Amplitude − fit\n({unit})")


def _draw_quality(axes: Axes, law: Eq8, result: FitResult, points: TurningPoints) -> None:
    clear = points.amplitude_rad[points.amplitude_rad > 0.0]
    factor, unit = axis_unit(clear, points.unit)
    amplitude = np.geomspace(float(clear.min()), float(clear.max()), 60)
    lost = np.array([loss_of(law, y) * period_of(result, y) for y in amplitude.tolist()])
    # Where a cycle takes more than half of the amplitude, no Q describes it.
    q = np.where(lost < 0.7, math.pi / lost, math.nan)
    axes.plot(factor * amplitude, q, color=INK, label="fitted law")
    seen = seen_qualities(result)
    if seen:
        axes.errorbar(
            [factor * at for at, _ in seen],
            [each.value for _, each in seen],
            [each.sd for _, each in seen],
            fmt="o",
            color=BLUE,
            label="turning points alone",
        )
    limit = result.quality_factor_limit
    if limit is not None and 3.0 * limit.sd < limit.value < 2.0 * float(np.nanmax(q)):
        axes.axhline(limit.value, color=GREY, linestyle=":", label="limit πf/b")
    if amplitude[-1] > 5.0 * amplitude[0]:
        axes.set_xscale("log")
        plain_numbers(axes.xaxis, (1.0, 2.0, 5.0))
    axes.set(xlabel=f"Amplitude ({unit})", ylabel="Q", ylim=(0.0, None))
    key_above(axes, 2)
