"""Figure 8: the dissipation history of figure 7's record, Q against time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe import physics
from pendpipe.arrays import FloatArray
from pendpipe.figures.data import Decay
from pendpipe.figures.style import (
    BLUE,
    GREY,
    INK,
    VERMILION,
    key_above,
    new_figure,
    plain_text,
    styled,
)

FALL = 0.75
"""A measured point spans turning points until the amplitude has fallen to this share."""


class LocalQuality(NamedTuple):
    """Q from turning points alone; arrays of shape (n,)."""

    time_s: FloatArray
    value: FloatArray
    sd: FloatArray


@styled
def draw(decay: Decay) -> Figure:
    """Draw Eq. 15 along the fitted decay with its 95 % band, the maximum and the limit."""
    time = np.linspace(0.0, float(decay.elapsed_s[-1]), 400)
    quality, half_width = quality_with_band(decay, time)
    moment = decay.time_s[0] + time
    b, frequency = decay.value("b"), decay.value("frequency")

    figure, axes = new_figure(3.6)
    axes.fill_between(
        moment, quality - half_width, quality + half_width,
        color=BLUE, alpha=0.22, linewidth=0.0, label="95 % band",
    )  # fmt: skip
    axes.plot(moment, quality, color=BLUE, label="Eq. 15 with the fitted $a$, $b$, $c$")
    measured = local_quality(decay)
    axes.errorbar(
        measured.time_s, measured.value, measured.sd, fmt="o", color=INK, markersize=3.5,
        markerfacecolor="white", elinewidth=0.8, label="turning points alone, no model",
    )  # fmt: skip
    top = float(np.nanmax(quality))
    if b > 0.0:
        limit = float(physics.quality_factor_limit(frequency, b))
        top = max(top, limit)
        axes.axhline(limit, color=VERMILION, linestyle="--", linewidth=1.1)
        axes.annotate(
            f"limit for $a = c = 0$: {limit:.1f}", (0.02, limit), (0.0, 4.0),
            xycoords=("axes fraction", "data"), textcoords="offset points",
            color=VERMILION, fontsize=8.5,
        )  # fmt: skip
        _mark_maximum(axes, decay, time, quality)
    axes.set(xlabel=plain_text(f"Time in {decay.record} (s)"), ylabel="Quality factor $Q$")
    axes.set_ylim(0.0, 1.16 * top)
    axes.margins(x=0.01)
    key_above(axes, 2)
    return figure


def _mark_maximum(axes: Axes, decay: Decay, time: FloatArray, quality: FloatArray) -> None:
    """Mark where Q is largest, if that lies inside the record."""
    index = int(np.nanargmax(quality))
    if index in (0, len(time) - 1):
        return
    a, b, c = decay.rates
    largest = float(physics.largest_quality_factor(decay.value("frequency"), a, b, c))
    moment = float(decay.time_s[0] + time[index])
    axes.plot([moment], [largest], "D", color=BLUE, markersize=5, zorder=4)
    axes.annotate(
        f"maximum {largest:.1f}\nwhere $y$ = √($c$/$a$)", (moment, largest), (0.0, -30.0),
        textcoords="offset points", ha="center", va="top", fontsize=8.5,
        arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.7},
    )  # fmt: skip


def quality_with_band(decay: Decay, elapsed_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eq. 15 along a decay, and the half width of its 95 % band.

    The band follows from the fit's covariance of the amplitude and a, b, c by the
    derivatives of Q, which are taken numerically.

    Parameters
    ----------
    decay
        The fit with its covariance.
    elapsed_s
        Times since the first turning point, shape (n,).

    Returns
    -------
    tuple of FloatArray
        Q and the half width, each of shape (n,); zero width without a covariance.
    """
    names = ("amplitude", "a", "b", "c")
    values = np.array([decay.value(name) for name in names])

    def quality(numbers: FloatArray) -> FloatArray:
        start, a, b, c = numbers
        y = physics.amplitude(elapsed_s, start, a, b, c)
        with np.errstate(divide="ignore", invalid="ignore"):
            return physics.quality_factor(y, decay.value("frequency"), a, b, c)

    centre = quality(values)
    known = [name for name in names if name in decay.names]
    if not known or not decay.covariance.size:
        return centre, np.zeros_like(centre)
    places = [decay.names.index(name) for name in known]
    covariance = decay.covariance[np.ix_(places, places)]
    slopes = []
    for place, name in enumerate(known):
        step = 1e-3 * float(np.sqrt(max(covariance[place, place], 0.0)))
        moved = values.copy()
        moved[names.index(name)] += step
        slopes.append((quality(moved) - centre) / step if step > 0.0 else np.zeros_like(centre))
    gradient = np.array(slopes)
    variance = np.einsum("in,ij,jn->n", gradient, covariance, gradient)
    return centre, 1.96 * np.sqrt(np.maximum(variance, 0.0))


def local_quality(decay: Decay) -> LocalQuality:
    """Q from the logarithmic decrement between turning points, without a model.

    ``Q = pi f (t2 - t1)/ln(y1/y2)`` over spans in which the amplitude falls to `FALL`;
    the error is that of the two amplitudes.
    """
    frequency, rows, first = decay.value("frequency"), [], 0
    time, y, sd = decay.time_s, decay.amplitude_rad, decay.amplitude_sd_rad
    for last in range(1, len(time)):
        if min(y[first], y[last]) <= 10.0 * max(sd[first], sd[last]):
            break
        if y[last] > FALL * y[first]:
            continue
        decrement = np.log(y[first] / y[last])
        value = np.pi * frequency * (time[last] - time[first]) / decrement
        spread = value * np.hypot(sd[first] / y[first], sd[last] / y[last]) / decrement
        rows.append((0.5 * (time[first] + time[last]), value, spread))
        first = last
    return LocalQuality(*np.array(rows, dtype=np.float64).reshape(-1, 3).T)
