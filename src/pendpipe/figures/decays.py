"""The figures of one record's decay: 7, 8, and its amplitudes beside linear damping."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from pendpipe import physics
from pendpipe.arrays import FloatArray
from pendpipe.figures.data import Decay
from pendpipe.figures.style import (
    BLUE,
    GREY,
    INK,
    PALE,
    VERMILION,
    figure_with_residuals,
    key_above,
    new_figure,
    plain_numbers,
    plain_text,
    points,
    styled,
)
from pendpipe.quantities import axis_unit, compact
from pendpipe.recording import Recording


@styled
def draw_fig07(decay: Decay, recording: Recording, volts_per_radian: float | None) -> Figure:
    """Draw every sample with the envelope of Eq. 14, and the turning points' residuals.

    Parameters
    ----------
    decay
        Turning points and fit.
    recording
        All the samples, in volts or as motion.
    volts_per_radian
        Takes the envelope to the recording's unit; ``None`` where that is rad already.
    """
    scale = volts_per_radian if recording.quantity == "volts" and volts_per_radian else 1.0
    unit = recording.unit
    level = scale * _level(decay)
    time = np.linspace(0.0, float(decay.elapsed_s[-1]), 400)
    start, rates = decay.value("amplitude"), decay.rates
    envelope = scale * physics.amplitude(time, start, *rates)
    misfit = scale * (decay.amplitude_rad - physics.amplitude(decay.elapsed_s, start, *rates))
    misfit_sd = abs(scale) * decay.amplitude_sd_rad
    large, large_unit = axis_unit(recording.values[recording.usable], unit)
    small, small_unit = axis_unit(np.abs(misfit) + misfit_sd, unit)

    figure, upper, lower = figure_with_residuals(4.4)
    # Every sample is drawn; as pixels, since ten thousand line segments help nobody.
    upper.plot(
        recording.time_s,
        large * recording.values,
        color=PALE,
        linewidth=0.6,
        rasterized=True,
        label=plain_text(f"all {len(recording)} samples of {decay.record}"),
    )
    moment = decay.time_s[0] + time
    upper.plot(moment, large * (level + envelope), color=INK, label="envelope of the fit, Eq. 14")
    upper.plot(moment, large * (level - envelope), color=INK)
    name = "Sensor output" if unit == "V" else "Motion"
    upper.set(ylabel=f"{name} ({large_unit})")
    key_above(upper, 1)
    points(lower, decay.time_s, small * misfit, small * misfit_sd, 2.0)
    lower.set(xlabel="Time (s)", ylabel=f"Turning points\n− envelope ({small_unit})")
    lower.margins(x=0.01, y=0.1)
    return figure


def _level(decay: Decay) -> float:
    """The fitted level, or where there is none that of the turning points."""
    fitted = decay.parameters.get("offset")
    known = fitted is not None and np.isfinite(fitted.value)
    return fitted.value if fitted and known else float(np.median(decay.level_rad))


FALL = 0.75
"""A measured point spans turning points until the amplitude has fallen to this share."""


class LocalQuality(NamedTuple):
    """Q from turning points alone; arrays of shape (n,)."""

    time_s: FloatArray
    value: FloatArray
    sd: FloatArray


@styled
def draw_fig08(decay: Decay) -> Figure:
    """Draw Eq. 15 along the fitted decay with its 95 % band, the maximum and the limit."""
    time = np.linspace(0.0, float(decay.elapsed_s[-1]), 400)
    quality, half_width = quality_with_band(decay, time)
    moment = decay.time_s[0] + time
    b, frequency = decay.value("b"), decay.value("frequency")

    figure, axes = new_figure(3.6)
    axes.fill_between(
        moment,
        quality - half_width,
        quality + half_width,
        color=BLUE,
        alpha=0.22,
        linewidth=0.0,
        label="95 % band",
    )
    axes.plot(moment, quality, color=BLUE, label="Eq. 15 with the fitted $a$, $b$, $c$")
    measured = local_quality(decay)
    axes.errorbar(
        measured.time_s,
        measured.value,
        measured.sd,
        fmt="o",
        color=INK,
        markersize=3.5,
        markerfacecolor="white",
        elinewidth=0.8,
        label="turning points alone, no model",
    )
    top = float(np.nanmax(quality))
    if b > 0.0:
        limit = float(physics.quality_factor_limit(frequency, b))
        top = max(top, limit)
        axes.axhline(limit, color=VERMILION, linestyle="--", linewidth=1.1)
        axes.annotate(
            f"limit for $a = c = 0$: {limit:.1f}",
            (0.02, limit),
            (0.0, 4.0),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            color=VERMILION,
            fontsize=8.5,
        )
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
        f"maximum {largest:.1f}\nwhere $y$ = √($c$/$a$)",
        (moment, largest),
        (0.0, -30.0),
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=8.5,
        arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.7},
    )


def quality_with_band(decay: Decay, elapsed_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eq. 15 along a decay, and the half width of its 95 % band.

    The band follows from the fit's covariance of the amplitude and a, b, c by the
    derivatives of Q.

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
    start, a, b, c = (decay.value(name) for name in names)
    frequency = decay.value("frequency")
    y, by_parameter = physics.amplitude_and_gradient(elapsed_s, start, a, b, c)
    known = [name for name in names if name in decay.names] if decay.covariance.size else []
    columns, places = [names.index(n) for n in known], [decay.names.index(n) for n in known]
    with np.errstate(divide="ignore", invalid="ignore"):
        quality = physics.quality_factor(y, frequency, a, b, c)
        # Of the loss a y + b + c/y: by itself, and through y.
        own = np.stack([0.0 * y, y, np.ones_like(y), 1.0 / y], axis=-1)
        by_loss = (own + (a - c / y**2)[:, np.newaxis] * by_parameter)[:, columns]
    covariance = decay.covariance[np.ix_(places, places)]
    variance = np.nan_to_num(np.einsum("ni,ij,nj->n", by_loss, covariance, by_loss))
    return quality, 1.96 * quality**2 / (np.pi * frequency) * np.sqrt(np.maximum(variance, 0.0))


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


MANY = 150
"""From this many points on they are drawn as pixels inside the SVG, to keep it small."""


@styled
def draw_decay(decay: Decay) -> Figure:
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
    upper.plot(
        time[0] + moment,
        large * smooth,
        color=INK,
        linewidth=1.0,
        zorder=3,
        label=f"Eq. 14 (rms misfit {_rms(residual, decay.unit)})",
    )
    upper.plot(
        time[0] + moment,
        large * start * np.exp(-rate * moment),
        color=VERMILION,
        linestyle="--",
        linewidth=1.1,
        zorder=3,
        label=f"linear damping ({_rms(y - linear, decay.unit)})",
    )
    # The logarithm of an amplitude within its own noise is chance.
    lowest = float(np.min(y, where=y > 2.0 * sd, initial=float(np.max(y))))
    upper.set_yscale("log")
    upper.set_ylim(0.75 * large * lowest, 1.35 * large * float(np.max(y)))
    plain_numbers(upper.yaxis, _round_steps(*upper.get_ylim()))
    upper.yaxis.set_minor_locator(NullLocator())
    upper.set_ylabel(f"Amplitude ({large_unit})")
    key_above(upper, 2)

    _amplitudes(lower, time, small * residual, small * sd)
    lower.set(xlabel=plain_text(f"Time in {decay.record} (s)"), ylabel=f"Data − fit ({small_unit})")
    lower.margins(x=0.015)
    return figure


def _amplitudes(axes: Axes, time_s: FloatArray, values: FloatArray, errors: FloatArray) -> None:
    label = f"{len(time_s)} turning points"
    points(axes, time_s, values, errors, rasterized=len(time_s) > MANY, label=label)


def _rms(misfit: FloatArray, unit: str) -> str:
    """Root mean square with its unit."""
    return compact(float(np.sqrt(np.mean(misfit**2))), unit)


def _round_steps(low: float, high: float) -> tuple[float, ...]:
    """The numbers of a decade that an axis has room for."""
    if high < 8.0 * low:
        return (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
    return (1.0,) if high > 1000.0 * low else (1.0, 2.0, 5.0)


def fit_exponential(
    time_s: FloatArray, amplitude_rad: FloatArray, sd_rad: FloatArray
) -> tuple[float, float]:
    """Weighted least squares of ``y = y0 exp(-beta t)``.

    Parameters
    ----------
    time_s, amplitude_rad, sd_rad
        Times, amplitudes and their errors; shape (n,).

    Returns
    -------
    tuple of float
        y0 in rad and beta in 1/s.
    """
    from scipy.optimize import curve_fit

    def shape(time_s: FloatArray, start: float, rate: float) -> FloatArray:
        return np.asarray(start * np.exp(-rate * time_s))

    seen = amplitude_rad > 0.1 * np.max(amplitude_rad)
    slope, level = np.polyfit(time_s[seen], np.log(amplitude_rad[seen]), 1)
    error = np.maximum(sd_rad, np.max(sd_rad) * 1e-6)
    found, _ = curve_fit(shape, time_s, amplitude_rad, (np.exp(level), -slope), error)
    return float(found[0]), float(found[1])
