"""The residual's spectrum, with the motion's harmonics and the noise."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.refine import Fit
from pendpipe.effects.baseline import OMEGA
from pendpipe.figures.data import NothingToDrawError
from pendpipe.figures.diagnosis_data import Shown
from pendpipe.figures.style import BLUE, GREY, INK, VERMILION, WIDTH_IN, key_above, styled
from pendpipe.quantities import axis_unit

_BANDS: Final = 500
_HARMONICS: Final = 8


@styled
def draw(content: Shown) -> Figure:
    """Draw the amplitude spectral density of what each model leaves."""
    frequency, baseline = spectrum(content, content.baseline)
    curves = [(content.baseline_name, baseline, VERMILION, 1.3)]
    if content.extended is not None:
        extended = spectrum(content, content.extended)[1]
        curves.append((content.extended_name, extended, BLUE, 0.8))
    level = noise_level(content, frequency)
    factor, unit = axis_unit(np.array([float(np.max(each)) for _, each, _, _ in curves]),
                             content.data.unit)  # fmt: skip
    figure = Figure(figsize=(WIDTH_IN, 3.3))
    figure.subplots_adjust(left=0.135, right=0.975, bottom=0.14, top=0.8)
    axes = figure.subplots()
    for name, density, colour, width in curves:
        axes.plot(frequency, factor * density, color=colour, linewidth=width, label=name)
    axes.plot(frequency, factor * level, color=INK, linestyle="--", linewidth=1.1, label="noise")
    axes.set(xscale="log", yscale="log", xlabel="Frequency (Hz)")
    axes.set_ylabel(f"Residual, density ({unit}/√Hz)")
    axes.set_xlim(float(frequency[0]), float(frequency[-1]))
    lowest = 0.1 * float(np.min(level))
    axes.set_ylim(factor * lowest, 2.0 * factor * max(float(np.max(each[1])) for each in curves))
    _plain(axes)
    _mark_harmonics(axes, content)
    key_above(axes, 2, lift=1.06)
    return figure


def _plain(axes: Axes) -> None:
    """Numbers instead of powers of ten."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.tick_params(which="minor", length=0)


def _mark_harmonics(axes: Axes, content: Shown) -> None:
    """A thin line at each multiple of the motion's frequency."""
    motion = float((content.extended or content.baseline).value[OMEGA]) / (2.0 * math.pi)
    low, high = axes.get_xlim()
    for harmonic in range(1, _HARMONICS + 1):
        line = harmonic * motion
        if not low < line < high:
            continue
        axes.axvline(line, color=GREY, linewidth=0.6, linestyle=":", zorder=0)
        if harmonic in (1, 2, 3, 5, 8):
            axes.annotate(
                f"{harmonic}", (line, 1.0), (0.0, 2.0), xycoords=("data", "axes fraction"),
                textcoords="offset points", ha="center", fontsize=7.5, color=GREY,
            )  # fmt: skip


def even_residual(content: Shown, fit: Fit) -> FloatArray:
    """The residual at even times: uneven readings are interpolated, masked ones bridged."""
    residual = content.residual(fit)
    known = np.isfinite(residual)
    if content.data.uniform and known.all():
        return residual
    time = content.data.time_s
    even = np.linspace(time[0], time[-1], len(time))
    return np.interp(even, time[known], residual[known])


def spectrum(content: Shown, fit: Fit) -> tuple[FloatArray, FloatArray]:
    """Amplitude spectral density of a residual, in bands of equal ratio.

    Returns
    -------
    frequency_hz, density
        Shape (k,): in rad/sqrt(Hz) (one-sided, Hann's window), rms over each band.
    """
    residual = even_residual(content, fit)
    count = len(residual)
    if count < 32:
        raise NothingToDrawError("there are too few readings for a spectrum")
    time = content.data.time_s
    interval = float(time[-1] - time[0]) / (count - 1)
    window = np.hanning(count)
    lines = np.fft.rfft((residual - np.mean(residual)) * window)
    density = np.asarray(2.0 * interval * np.abs(lines) ** 2 / np.sum(window**2), dtype=np.float64)
    frequency = np.fft.rfftfreq(count, interval)
    return _banded(np.asarray(frequency[2:-1], dtype=np.float64), density[2:-1])


def _banded(frequency: FloatArray, density: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Means of the power over bands, so that a long record makes no black carpet."""
    edges = np.geomspace(frequency[0], frequency[-1], _BANDS)
    band = np.searchsorted(edges, frequency, side="right")
    count = np.bincount(band, minlength=_BANDS + 1)
    full = count > 0
    mean = np.bincount(band, weights=density, minlength=_BANDS + 1)[full] / count[full]
    place = np.bincount(band, weights=frequency, minlength=_BANDS + 1)[full] / count[full]
    return place, np.sqrt(mean)


def noise_level(content: Shown, frequency: FloatArray) -> FloatArray:
    """The noise's density that the diagnosis has used, rad/sqrt(Hz), at given frequencies."""
    noise, data = content.noise, content.data
    interval = float(data.time_s[-1] - data.time_s[0]) / (len(data) - 1)
    if not noise.uniform:
        return np.full(len(frequency), noise.rms * math.sqrt(2.0 * interval))
    known = np.arange(len(noise.variance)) / (2.0 * len(noise.variance) * data.interval_s)
    return np.sqrt(2.0 * data.interval_s * np.interp(frequency, known, noise.variance))
