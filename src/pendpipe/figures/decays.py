"""The figures of one decay: 7, 8, each record's amplitudes, and that of `FitResult.plot`.

Each draws the law that was fitted, and names it in its key.
"""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe.analysis.fit.by_points import fit_envelope
from pendpipe.analysis.fit.quality import period_of, relative_loss_sd
from pendpipe.arrays import FloatArray
from pendpipe.figures.data import Decay, local_quality, spans
from pendpipe.figures.style import (
    BLUE,
    GREY,
    INK,
    PALE,
    RESIDUALS_BELOW,
    THIN,
    VERMILION,
    Mark,
    Panel,
    band,
    curve,
    figure_of,
    level,
    logarithmic,
    measured,
    plain_text,
    quantity_of,
    save,
    stretch_of,
    styled,
    words,
)
from pendpipe.quantities import axis_unit, compact
from pendpipe.recording import Recording


@styled
def draw_fig07(decay: Decay, recording: Recording, volts_per_radian: float | None) -> Figure:
    """Draw every sample with the amplitude of the fitted law, and the turning points' residuals.

    Parameters
    ----------
    decay
        Turning points and fit.
    recording
        All the samples, in volts or as motion.
    volts_per_radian
        Takes the amplitude to the recording's unit; ``None`` where that is rad already.
    """
    scale = volts_per_radian if recording.quantity == "volts" and volts_per_radian else 1.0
    samples = plain_text(f"all {len(recording)} samples of {decay.record}")
    readings = _readings(decay, recording, scale, PALE, label=samples)
    about = {"xlabel": "Time (s)", "xmargin": 0.01, "ymargin": 0.1}
    return figure_of(
        4.4,
        readings._replace(about={"ylabel": readings.about["ylabel"]}, key=1),
        _residual(decay, about, scale=scale, unit=recording.unit, markersize=2.0),
        shares=RESIDUALS_BELOW,
    )


def _readings(
    decay: Decay, recording: Recording, scale: float = 0.0, colour: str = BLUE, **look: Any
) -> Panel:
    """A recording, what was cut of it, and the amplitude of its law, unless the light is red.

    `scale` takes the law to the recording's unit, where that is not the turning points'.
    """
    own, unit = axis_unit(recording.values[recording.usable], recording.unit)
    if recording.unit == decay.points.unit:
        scale = scale or 1.0
    # Every sample is drawn; as pixels, since ten thousand line segments help nobody.
    look = {"rasterized": True, "label": "readings"} | look
    marks = [stretch_of(cut["start_s"], cut["stop_s"]) for cut in decay.fit.cuts]
    marks.append(curve(recording.time_s, own * recording.values, colour, width=0.5, **look))
    if scale and decay.fit.light != "red":
        marks += _fitted(decay, own * scale)
    about = {"xlabel": "Time (s)", "ylabel": f"{quantity_of(recording.unit)} ({unit})"}
    return Panel(marks, about | {"xlim": (recording.time_s[0], recording.time_s[-1])}, key=2)


def _fitted(decay: Decay, factor: float) -> list[Mark]:
    """The amplitude of the fitted law above and below the level."""
    elapsed = np.linspace(0.0, float(decay.elapsed_s[-1]), 400)
    moment = decay.points.time_s[0] + elapsed
    middle = np.interp(moment, decay.points.time_s, decay.level_rad)
    amplitude = decay.along(elapsed)[0]
    label = f"fitted amplitude, {decay.law_name}"
    fitted = [curve(moment, factor * (middle + amplitude), label=label)]
    if decay.fit.method == "amplitudes":
        return fitted
    return [*fitted, curve(moment, factor * (middle - amplitude))]


def _residual(
    decay: Decay,
    about: Mapping[str, Any],
    *,
    scale: float = 1.0,
    unit: str | None = None,
    **look: Any,
) -> Panel:
    """The turning points less the fitted law."""
    residual = scale * decay.residual_rad
    sd = abs(scale) * decay.points.angle_sd_rad
    factor, unit = axis_unit(np.abs(residual) + sd, unit or decay.points.unit)
    points = measured(decay.points.time_s, factor * residual, factor * sd, **_many(decay) | look)
    return Panel([level(0.0), points], {**about, "ylabel": f"Data − fit ({unit})"})


write = save
"""What `FitResult.save` writes its figure with."""
MANY = 150
"""From this many points on they are drawn as pixels inside the SVG, to keep it small."""


def _many(decay: Decay) -> dict[str, Any]:
    return {**THIN, "rasterized": len(decay.points) > MANY}


@styled
def draw_fig08(decay: Decay) -> Figure:
    """Draw the fitted law's Q along the decay with its 95 % band, the maximum and the limit."""
    elapsed = np.linspace(0.0, float(decay.elapsed_s[-1]), 400)
    quality, half_width = quality_with_band(decay, elapsed)
    moment = decay.points.time_s[0] + elapsed
    law = f"fitted law, {decay.law_name.replace('14', '15')}"
    marks = [
        band(moment, quality, half_width, label="95 % band"),
        curve(moment, quality, BLUE, label=law),
        _measured_quality(*local_quality(decay)),
    ]
    top, limit = float(np.nanmax(quality)), decay.fit.quality_factor_limit
    if limit is not None and limit.value > 0.0:
        top = max(top, limit.value)
        place = {"xycoords": ("axes fraction", "data"), "color": VERMILION}
        name = f"limit for $a = c = 0$: {limit.value:.1f}"
        marks += [
            level(limit.value, VERMILION, 1.1, linestyle="--"),
            words(name, (0.02, limit.value), (0.0, 4.0), **place),
            *_maximum(decay, elapsed, quality),
        ]
    return figure_of(
        3.6,
        Panel(
            marks,
            {
                "xlabel": plain_text(f"Time in {decay.record} (s)"),
                "ylabel": "Quality factor $Q$",
                "ylim": (0.0, 1.16 * top),
                "xmargin": 0.01,
            },
            key=2,
        ),
    )


def _maximum(decay: Decay, elapsed_s: FloatArray, quality: FloatArray) -> list[Mark]:
    """Where Q is largest, if that lies inside the record."""
    index = int(np.nanargmax(quality))
    if index in (0, len(quality) - 1):
        return []
    amplitude = float(decay.along(elapsed_s)[0][index])
    x, y = float(decay.points.time_s[0] + elapsed_s[index]), float(quality[index])
    text = f"maximum {y:.1f}\nwhere $y$ = {compact(amplitude, decay.points.unit)}"
    line = {"arrowstyle": "-", "color": GREY, "linewidth": 0.7}
    return [
        curve([x], [y], BLUE, "", marker="D", markersize=5, zorder=4),
        words(text, (x, y), (0.0, -30.0), ha="center", va="top", arrowprops=line),
    ]


def quality_with_band(decay: Decay, elapsed_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Q of the fitted law along a decay, and the half width of its 95 % band.

    The band is that of Q at the amplitudes of the decay.

    Parameters
    ----------
    decay
        The fit with its covariance.
    elapsed_s
        Times since the first turning point, shape (n,).

    Returns
    -------
    tuple of FloatArray
        Q and the half width, each of shape (n,).
    """
    amplitude, quality = decay.along(elapsed_s)
    relative = np.array([relative_loss_sd(decay.fit, y) for y in amplitude.tolist()])
    return quality, 1.96 * relative * quality


def local_period(decay: Decay) -> FloatArray:
    """Amplitude, mean period and its standard deviation in the spans of `local_quality`, (3, n)."""
    points, rows = decay.points, []
    for first, last in spans(decay):
        cycles = 0.5 * float(points.half_cycle[last] - points.half_cycle[first])
        lasts, sd = points.time_s[last] - points.time_s[first], points.time_sd_s[[first, last]]
        amplitude = float(np.mean(decay.amplitude_rad[first : last + 1]))
        rows.append((amplitude, lasts / cycles, float(np.hypot(*sd)) / cycles))
    return np.array(rows, dtype=np.float64).reshape(-1, 3).T


def _measured_quality(x: FloatArray, value: FloatArray, sd: FloatArray) -> Mark:
    look = {"markerfacecolor": "white", "markersize": 3.5, "capsize": 2.0, "elinewidth": 0.8}
    return measured(x, value, sd, None, INK, label="turning points alone, no model", **look)


_MARGINS: Final = {"top": 0.872, "bottom": 0.105, "hspace": 0.09}
"""Parts of the sheet: a title above two panels, one scale below them."""


@styled
def draw_decay(decay: Decay) -> Figure:
    """Draw the amplitudes of the turning points against time, and data minus fit."""
    time, y, sd = decay.points.time_s, decay.amplitude_rad, decay.points.angle_sd_rad
    linear = fit_envelope(decay.points, {"a": 0.0, "c": 0.0})
    rate, start = linear.value[[1, 3]].tolist()
    elapsed = np.linspace(0.0, float(decay.elapsed_s[-1]), 300)
    unit = decay.points.unit
    factor, shown_unit = axis_unit(y, unit)
    laws = [
        curve(
            time[0] + elapsed,
            factor * values,
            colour,
            dashes,
            1.1,
            zorder=3,
            label=f"{name} (rms misfit {compact(float(np.sqrt(np.mean(misfit**2))), unit)})",
        )
        for values, misfit, name, colour, dashes in (
            (decay.along(elapsed)[0], decay.residual_rad, decay.law_name, INK, "-"),
            (start * np.exp(-rate * elapsed), linear.residual, "linear damping", VERMILION, "--"),
        )
    ]
    turned = measured(
        time, factor * y, factor * sd, label=f"{len(y)} turning points", **_many(decay)
    )
    # The logarithm of an amplitude within its own noise is chance.
    lowest = float(np.min(y, where=y > 2.0 * sd, initial=float(np.max(y))))
    ends = 0.75 * factor * lowest, 1.35 * factor * float(np.max(y))
    return figure_of(
        4.2,
        Panel(
            [turned, *laws, logarithmic("y", ends[1] / ends[0])],
            {"ylim": ends, "ylabel": f"Amplitude ({shown_unit})"},
            key=2,
        ),
        _residual(decay, {"xlabel": plain_text(f"Time in {decay.record} (s)"), "xmargin": 0.015}),
        shares=(1.0, 0.5),
        margins=_MARGINS,
    )


@styled
def draw_fit(decay: Decay, recording: Recording) -> Figure:
    """Draw a recording with its fitted law.

    Parameters
    ----------
    decay
        The turning points and the fit.
    recording
        The decay, in the unit of the turning points.

    Returns
    -------
    Figure
        Four panels: readings with the fitted amplitude; turning points less the fitted law; period
        and Q against amplitude, by the law and as the turning points show them without one: in
        spans, and as the smooth curve with its 95 % band (`FitResult.backbone`).
    """
    readings, backbone = _readings(decay, recording), _by_amplitude(decay)
    about = {name: readings.about[name] for name in ("xlabel", "xlim")}
    return figure_of(
        4.6 + 2.0 * len(backbone),
        readings,
        _residual(decay, about),
        *backbone,
        shares=(1.3, 0.7, 1.0, 1.0)[: 2 + len(backbone)],
        sharex=False,
    )


def plot(decay: Decay, recording: Recording, axes: Axes | None = None) -> Figure:
    """Draw a fit (`draw_fit`); on axes that are handed in the decay with its amplitude alone."""
    if axes is None:
        return draw_fit(decay, recording)
    shown = _readings(decay, recording, rasterized=False)
    for mark in shown.marks:
        mark(axes)
    axes.set(xlabel=shown.about["xlabel"], ylabel=shown.about["ylabel"])
    axes.legend()
    figure = axes.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure


@styled
def draw_sheet(decay: Decay, recording: Recording) -> Figure:
    """Draw the whole recording with its cuts shaded, and Q against amplitude.

    Parameters
    ----------
    decay
        The turning points and the fit.
    recording
        All of it.

    Returns
    -------
    Figure
        Two panels for one printed sheet.
    """
    panels = (_readings(decay, recording), *_by_amplitude(decay)[-1:])
    return figure_of(4.9, *panels, shares=(1.2, 1.0)[: len(panels)], sharex=False)


@styled
def draw_residual(decay: Decay) -> Figure:
    """Draw what the fitted law leaves of the turning points."""
    return figure_of(2.2, _residual(decay, {"xlabel": "Time (s)"}))


def _by_amplitude(decay: Decay) -> tuple[Panel, ...]:
    """Period and Q against amplitude; nothing of amplitudes without a period."""
    amplitude, quality = decay.along(np.linspace(0.0, float(decay.elapsed_s[-1]), 400))
    if np.isnan(quality).all():
        return ()
    fit, (factor, unit) = decay.fit, axis_unit(decay.amplitude_rad, decay.points.unit)
    shown, has_law, label = fit.backbone, fit.light != "red", "curve through them, 95 %"
    periods: list[Mark] = []
    marks: list[Mark] = []
    if shown is not None:
        y = factor * shown.amplitude_rad
        seen = shown.amplitude_rad >= 0.999 * shown.seen_rad[1]
        of_loss = shown.decrement_sd / shown.decrement
        value = np.pi / (shown.period_s * shown.decrement)
        for panel, curve_, sd in (
            (periods, shown.period_s, shown.period_sd),
            (marks, value, value * of_loss),
        ):
            panel.append(band(y[seen], curve_[seen], 1.96 * sd[seen], label=label))
            panel.append(curve(y[seen], curve_[seen], BLUE, width=0.8))
    if has_law:
        marks.append(curve(factor * amplitude, quality, label="fitted law"))
        law = [period_of(fit, each) for each in amplitude.tolist()]
        periods.append(curve(factor * amplitude, law, label="fitted law"))
    if not marks:
        # Two modes that beat lose nothing that is theirs.
        return ()
    when, *q = local_quality(decay)
    place = np.interp(when, decay.points.time_s, decay.amplitude_rad)
    marks.append(_measured_quality(factor * place, *q))
    place, *of_time = local_period(decay)
    periods.append(_measured_quality(factor * place, *of_time))
    limit = fit.quality_factor_limit
    if limit is not None and 3.0 * limit.sd < limit.value < 2.0 * float(np.nanmax(quality)):
        marks.append(level(limit.value, GREY, 1.4, linestyle=":", label="limit πf/b"))
    largest, least = float(np.max(amplitude)), float(np.min(amplitude))
    # Dry friction ends the fitted motion: zero stands on no logarithmic axis.
    if 0.0 < 5.0 * least < largest:
        marks.append(logarithmic("x", largest / least))
        periods.append(logarithmic("x", largest / least))
    about = {"xlabel": f"Amplitude ({unit})", "ylabel": "Q", "ylim": (0.0, None)}
    found = Panel(marks, about, key=2)
    if shown is None or np.isnan(shown.period_s).all():
        return (found,)
    return Panel(periods, {"ylabel": "Period (s)"}), found
