"""All the figures of a campaign, and which of them could not be drawn."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pendpipe.arrays import FloatArray
from pendpipe.errors import InputError
from pendpipe.figures.data import (
    Entry,
    NothingToDrawError,
    branches,
    curve,
    error,
    number,
    of_branch,
    series,
    typical_record,
    used,
)
from pendpipe.figures.decays import draw_decay, draw_fig07, draw_fig08, read_decay
from pendpipe.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    VERMILION,
    WIDTH_IN,
    branch,
    figure_with_residuals,
    key_above,
    panels,
    placeholder,
    plain_numbers,
    save,
    second_scale,
    styled,
)
from pendpipe.files import read_json
from pendpipe.quantities import axis_unit, prefixed, with_error
from pendpipe.recording import read_plain

Comparison = Mapping[str, Any]


class Drawn(NamedTuple):
    """What was drawn, and what was left out and why."""

    files: list[Path]
    left_out: dict[str, str]


def draw_all(comparison: Comparison, folder: Path, out: Path, *, processes: int = 1) -> Drawn:
    """Draw figures 3 to 10, the tail figure and each record's decay.

    Parameters
    ----------
    comparison
        The content of comparison.json.
    folder
        The campaign's results: a folder a record lies in it.
    out
        Where the campaign's figures go; a record's go to its own folder.
    processes
        How many draw at once.

    Returns
    -------
    Drawn
        A campaign with theory leaves a file for each of figures 3 to 10, with the reason
        in it where there was nothing to draw; one without leaves them out.
    """
    draws: dict[str, Callable[[], Figure]] = {
        "fig03": partial(draw_fig03, comparison.get("calibration")),
        "fig04": partial(draw_fig04, comparison),
        "fig07": partial(_typical_decay, comparison, folder),
        "fig08": partial(_typical_quality, comparison, folder),
        "tail": partial(draw_tail, comparison.get("tail")),
    }
    has_theory = bool(comparison.get("has_theory"))
    if has_theory:
        draws |= {
            "fig05": partial(draw_fig05, comparison),
            "fig06": partial(draw_fig06, comparison),
            "fig09": partial(draw_fig09, comparison),
            "fig10": partial(draw_fig10, comparison),
            "causes": partial(draw_causes, folder / "campaign_diagnosis.json"),
        }
    tasks = [
        partial(_drawn, name, draw, out / name, keep_place=has_theory and name.startswith("fig"))
        for name, draw in sorted(draws.items())
    ]
    # (For the page: a record's drawing in pixels would take as long again.)
    tasks += [
        partial(
            _drawn,
            f"{entry['record']}, decay",
            partial(_decay, folder, entry),
            folder / entry["record"] / "figures" / "decay",
            forms=("svg",),
        )
        for entry in comparison["records"]
    ]
    if processes < 2:
        parts = [task() for task in tasks]
    else:
        with ProcessPoolExecutor(processes) as pool:
            parts = [draw.result() for draw in [pool.submit(task) for task in tasks]]
    return Drawn(
        [path for part in parts for path in part.files],
        dict(reason for part in parts for reason in part.left_out.items()),
    )


def _decay(folder: Path, entry: Entry) -> Figure:
    """Draw one record's decay."""
    if entry.get("refused"):
        raise NothingToDrawError("the record was refused")
    return draw_decay(read_decay(folder, entry))


def _typical(comparison: Comparison) -> Entry:
    """The record of figures 7 and 8."""
    entry, name = typical_record(comparison), comparison.get("typical_record")
    if entry is None:
        refused = f"the typical record {name} was refused"
        raise NothingToDrawError(refused if name else "the configuration names no typical record")
    return entry


def _typical_decay(comparison: Comparison, folder: Path) -> Figure:
    entry = _typical(comparison)
    constant = number(entry.get("volts_per_radian"))
    try:
        recording = read_plain(folder / entry["record"] / "recording.csv")
    except InputError as fault:
        raise NothingToDrawError(str(fault)) from None
    return draw_fig07(read_decay(folder, entry), recording, constant)


def _typical_quality(comparison: Comparison, folder: Path) -> Figure:
    return draw_fig08(read_decay(folder, _typical(comparison)))


def _drawn(
    name: str,
    draw: Callable[[], Figure],
    stem: Path,
    *,
    keep_place: bool = False,
    forms: Sequence[str] = ("svg", "png"),
) -> Drawn:
    """Draw and save one figure, or note why not (and say it in the figure's place)."""
    try:
        return Drawn(save(draw(), stem, forms=forms), {})
    except NothingToDrawError as fault:
        reason = str(fault)
    return Drawn(save(placeholder(reason), stem) if keep_place else [], {name: reason})


@styled
def draw_fig03(calibration: Mapping[str, Any] | None) -> Figure:
    """Draw volts against angle, and volts minus the line.

    Parameters
    ----------
    calibration
        The entry ``calibration`` of comparison.json.
    """
    if not calibration or not calibration.get("points"):
        raise NothingToDrawError("the campaign has no calibration of the sensor")
    columns = ("angle_rad", "angle_sd_rad", "volts", "volts_sd")
    angle, angle_sd, volts, volts_sd = np.array(
        [[point.get(name) or 0.0 for name in columns] for point in calibration["points"]]
    ).T
    slope, offset = number(calibration["volts_per_radian"]), number(calibration["offset_volts"])
    residual = volts - offset - slope * angle
    residual_sd = np.hypot(volts_sd, slope * angle_sd)
    turn, unit = axis_unit(angle, "rad")

    figure, upper, lower = figure_with_residuals()
    ends = 1.06 * np.array([np.min(angle), np.max(angle)])
    label = f"line: {with_error(slope, error(calibration['volts_per_radian']), 'V/rad')}"
    upper.plot(turn * ends, offset + slope * ends, color=INK, zorder=3, label=label)
    upper.errorbar(
        turn * angle,
        volts,
        volts_sd,
        turn * angle_sd,
        fmt="o",
        color=BLUE,
        markersize=4.5,
        label=f"caliper run, {len(angle)} positions",
    )
    upper.set_ylabel("Sensor output (V)")
    key_above(upper)
    lower.errorbar(
        turn * angle, 1e3 * residual, 1e3 * residual_sd, fmt="o", color=BLUE, markersize=3.5
    )
    lower.set(xlabel=f"Angle ({unit})", ylabel="Data − line (mV)")
    lower.margins(y=0.25)
    verdict = _linearity(calibration)
    if verdict:
        lower.set_title(verdict, fontsize=8.5, pad=3)
    return figure


def _linearity(calibration: Mapping[str, Any]) -> str:
    """The linearity test in a line."""
    chance = (calibration.get("linear") or {}).get("p_value")
    if chance is None:
        return ""
    verdict = "no sign of curvature" if chance >= 0.01 else "the line does not suffice"
    return f"Linearity test: $p$ = {chance:.2g}, {verdict}"


PERIODS_S = (15, 6, 4, 3, 2.5, 2, 1.5, 1)


@styled
def draw_fig04(comparison: Mapping[str, Any]) -> Figure:
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
        squared,
        points.y,
        points.y_sd,
        squared_sd,
        fmt="^",
        color=BLUE,
        zorder=3,
        label="in air",
    )
    upper.set(ylabel="Quality factor $Q$", xlim=(0.0, edge), ylim=(0.0, None))
    upper.legend(loc="upper left")
    # The periods that people think in.
    periods = [period for period in PERIODS_S if period**-2.0 <= edge]
    at = [period**-2.0 for period in periods]
    second_scale(upper, "top", at, [f"{period:g}" for period in periods], "Period (s)")

    line = coefficient * squared
    lower.errorbar(
        squared,
        100.0 * (points.y / line - 1.0),
        100.0 * points.y_sd / line,
        fmt="^",
        color=BLUE,
        markersize=4.5,
    )
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


CAUSES: Final = {
    "buoyancy": ("buoyancy", BLUE, (5, 2)),
    "added_mass": ("added mass", GREEN, (1.5, 1.5)),
    "both": ("both", INK, ()),
}
_SHIFTS_PERCENT: Final = (1, 2, 5, 10, 20, 40, 60, 70, 80)


@styled
def draw_fig05(comparison: Mapping[str, Any]) -> Figure:
    """Draw the relative lengthening of the period against frequency, cause by cause."""
    names = branches(comparison)
    figure, axes = panels(3.8)
    for name in names:
        marker = branch(name).marker
        for cause, (_, colour, dashes) in CAUSES.items():
            frequency, value = curve(comparison, name, f"lengthening_{cause}")
            axes.plot(frequency, 100.0 * value, color=colour, dashes=dashes or (None, None))
            dots = [
                (e["frequency"]["value"], 100.0 * e["lengthening"][cause])
                for e in of_branch(comparison, name)
                if e.get("lengthening") and e.get("frequency")
            ]
            axes.plot(*np.array(dots).reshape(-1, 2).T, marker, color=colour, markersize=4.5)
    axes.set(
        yscale="log",
        xlabel="Frequency (Hz)",
        ylabel="Lengthening of the period (%)",
        xlim=(0.0, None),
    )
    plain_numbers(axes.yaxis, (1.0, 2.0, 5.0))
    axes.tick_params(which="minor", length=0)
    # The same as a lowering of the frequency: T up by x means f down by x/(1 + x).
    low, high = axes.get_ylim()
    lowered = [p for p in _SHIFTS_PERCENT if low <= 100.0 * p / (100.0 - p) <= high]
    at = [100.0 * p / (100.0 - p) for p in lowered]
    label = "Lowering of the frequency (%)"
    second_scale(axes, "right", at, [str(p) for p in lowered], label)
    _keys(axes, names)
    return figure


def _keys(axes: Any, names: list[str]) -> None:
    """Causes by colour and dashes, branches by symbol."""
    causes = [
        Line2D([], [], color=colour, dashes=dashes or (None, None), label=text)
        for text, colour, dashes in CAUSES.values()
    ]
    kinds = [
        Line2D(
            [],
            [],
            color=INK,
            marker=branch(name).marker,
            linestyle="",
            markersize=4.5,
            label=branch(name).name,
        )
        for name in names
    ]
    key_above(axes, 2, handles=causes + kinds)


@styled
def draw_fig06(comparison: Mapping[str, Any]) -> Figure:
    """Draw log10 Q_v against frequency: Eq. 16, steady Stokes flow, and what was measured."""
    names = branches(comparison)
    figure, axes = panels(4.0)
    for name in names:
        look = branch(name)
        frequency, steady = curve(comparison, name, "quality_factor_viscous_steady")
        axes.plot(
            frequency,
            np.log10(steady),
            color=look.colour,
            linestyle="--",
            label=f"{name}: steady Stokes, Eq. 1",
        )
        _, full = curve(comparison, name, "quality_factor_viscous_theory")
        axes.plot(
            frequency, np.log10(full), color=look.colour, label=f"{name}: with history term, Eq. 16"
        )
        _say_how_many_times(axes, frequency, steady, full, look.colour)
        points = series(of_branch(comparison, name), "quality_factor_viscous")
        axes.errorbar(
            points.x,
            np.log10(points.y),
            points.y_sd / (points.y * np.log(10.0)),
            points.x_sd,
            fmt=look.marker,
            color=look.colour,
            markerfacecolor="white",
            markersize=4.5,
            label=f"{name}: measured, Eq. 17",
        )
    axes.set(xlabel="Frequency (Hz)", ylabel="$\\log_{10}\\, Q_v$", xlim=(0.0, None))
    handles, labels = axes.get_legend_handles_labels()
    # A column of the key for each branch, theory before measurement.
    order = sorted(range(len(labels)), key=lambda i: names.index(labels[i].partition(":")[0]))
    key_above(
        axes,
        len(names),
        handles=[handles[i] for i in order],
        labels=[labels[i] for i in order],
    )
    return figure


def _say_how_many_times(
    axes: Axes, frequency: FloatArray, steady: FloatArray, full: FloatArray, colour: str
) -> None:
    """An arrow from one curve to the other, with the factor between them."""
    middle = len(frequency) // 2
    x, low, high = frequency[middle], np.log10(full[middle]), np.log10(steady[middle])
    axes.annotate(
        "",
        (x, low),
        (x, high),
        arrowprops={"arrowstyle": "->", "color": colour, "linewidth": 0.9, "shrinkB": 3.0},
    )
    axes.annotate(
        f"÷ {steady[middle] / full[middle]:.0f}",
        (x, 0.5 * (low + high)),
        (5.0, 0.0),
        textcoords="offset points",
        va="center",
        fontsize=8.5,
        color=colour,
    )


@styled
def draw_fig09(comparison: Mapping[str, Any]) -> Figure:
    """Draw the limiting Q with Eq. 16 and the hysteretic part together, and their ratio."""
    figure, upper, lower = figure_with_residuals(4.8, residual_share=0.45, baseline=1.0)
    draw_measured(upper, comparison)
    for name in branches(comparison):
        frequency, theory = curve(comparison, name, "quality_factor_limit_theory")
        upper.plot(frequency, theory, color=branch(name).colour, zorder=1.5)
    upper.plot([], [], color=INK, label="lines: Eq. 16 and hysteresis together")
    upper.set(ylabel="Limiting quality factor $Q$", xlim=(0.0, None), ylim=(0.0, None))
    key_above(upper, 1)

    spread = _theory_spread(comparison)
    lower.axhspan(1.0 - spread, 1.0 + spread, color=GREY, alpha=0.18, linewidth=0.0)
    for name in branches(comparison):
        _ratio(lower, comparison, name)
    factor = comparison.get("theory_factor")
    if factor and np.isfinite(number(factor)):
        text = with_error(number(factor), error(factor))
        lower.set_title(f"Drag measured over Eq. 16: {text}", fontsize=8.5, pad=3)
    lower.set(xlabel="Frequency (Hz)", ylabel="Q, measured\nover theory")
    lower.margins(y=0.15)
    return figure


@styled
def draw_causes(path: Path) -> Figure:
    """Draw what each cause alone predicts of the excess over Eq. 16, and what was measured."""
    patterns = read_json(path).get("patterns") if path.is_file() else None
    if not patterns:
        raise NothingToDrawError("the records were not diagnosed together")
    figure = Figure(figsize=(WIDTH_IN, 5.0), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    records = patterns["records"]
    frequency = np.array([record["frequency_hz"] for record in records])
    excess = np.array([record["excess"] for record in records])
    span = max(1.6 * float(np.abs(excess).max()), 0.01)
    names = list(dict.fromkeys(record["branch"] for record in records))
    for axes, within in ((left, True), (right, False)):
        shown = [cause for cause in patterns["causes"] if cause["in_class"] == within][:8]
        for name in names:
            # A line ends with its branch: the other one is another set of weights.
            mine = [n for n, record in enumerate(records) if record["branch"] == name]
            at = sorted(mine, key=frequency.__getitem__)
            look = branch(name)
            points = {"fmt": look.marker, "color": look.colour, "mfc": "none", "zorder": 3}
            sds = [100.0 * records[number]["sd"] for number in at]
            label = f"measured, {look.name}" if within else None
            axes.errorbar(frequency[at], 100.0 * excess[at], sds, label=label, **points)
            for colour, cause in enumerate(shown):
                curve_ = 100.0 * np.array(cause["excess"])[at]
                label = cause["name"] if name == names[0] else None
                axes.plot(frequency[at], curve_, color=f"C{colour}", label=label)
        axes.set(xlabel="Frequency (Hz)", ylim=(-10.0 * span, 110.0 * span))
        axes.set_title("not told apart" if within else "rejected")
        if shown:
            axes.legend(fontsize=6.5, loc="upper center", bbox_to_anchor=(0.5, -0.16))
    left.set(ylabel="Viscous loss above Eq. 16 (%)")
    return figure


def draw_measured(axes: Axes, comparison: Mapping[str, Any]) -> None:
    """Draw the limiting Q of each branch with error bars."""
    names = branches(comparison)
    found = {n: series(of_branch(comparison, n), "quality_factor_limit") for n in names}
    if not any(len(points.x) for points in found.values()):
        raise NothingToDrawError("no record in a fluid has a limiting Q")
    for name, points in found.items():
        look = branch(name)
        axes.errorbar(
            points.x,
            points.y,
            points.y_sd,
            points.x_sd,
            fmt=look.marker,
            color=look.colour,
            zorder=3,
            label=f"measured, {look.name}",
        )


def _theory_spread(comparison: Mapping[str, Any]) -> float:
    """Relative standard deviation of Eq. 16 itself, from distances and diameter."""
    theory = [entry.get("quality_factor_viscous_theory") for entry in used(comparison)]
    spreads = [error(entry) / number(entry) for entry in theory if entry and number(entry) > 0.0]
    return float(np.median(spreads)) if spreads else 0.0


def _ratio(axes: Axes, comparison: Mapping[str, Any], name: str) -> None:
    """Draw measured over theory; the theory at each record's own geometry."""
    look = branch(name)
    entries = [e for e in of_branch(comparison, name) if e.get("quality_factor_limit_theory")]
    points = series(entries, "quality_factor_limit")
    theory = {e["record"]: number(e["quality_factor_limit_theory"]) for e in entries}
    own = np.array([theory[record] for record in points.names])
    axes.errorbar(
        points.x,
        points.y / own,
        points.y_sd / own,
        fmt=look.marker,
        color=look.colour,
        markersize=4.5,
        ecolor=GREY,
    )


@styled
def draw_fig10(comparison: Mapping[str, Any]) -> Figure:
    """Draw the limiting Q with Eq. 16 alone, in red, beside the full theory."""
    figure, axes = panels(4.1)
    draw_measured(axes, comparison)
    for name in branches(comparison):
        frequency, full = curve(comparison, name, "quality_factor_limit_theory")
        axes.plot(frequency, full, color=GREY, linewidth=1.0, zorder=1.2)
        frequency, viscous = curve(comparison, name, "quality_factor_viscous_theory")
        axes.plot(frequency, viscous, color=VERMILION, linestyle="--", linewidth=1.8, zorder=1.5)
        axes.fill_between(frequency, full, viscous, color=VERMILION, alpha=0.10, linewidth=0.0)
    axes.plot(
        [],
        [],
        color=VERMILION,
        linestyle="--",
        linewidth=1.8,
        label="Eq. 16 alone: hysteresis left out",
    )
    axes.plot([], [], color=GREY, linewidth=1.0, label="Eq. 16 and hysteresis together")
    axes.set(
        xlabel="Frequency (Hz)",
        ylabel="Limiting quality factor $Q$",
        xlim=(0.0, None),
        ylim=(0.0, None),
    )
    key_above(axes, 1)
    return figure


_UNITS: Final = {"a": "rad⁻¹ s⁻¹", "b": "s⁻¹", "c": "rad/s"}


@styled
def draw_tail(tail: Sequence[Mapping[str, Any]] | None) -> Figure:
    """Draw the three rates with error bars, and the whole record's as a line.

    Parameters
    ----------
    tail
        The entry ``tail`` of comparison.json; its first fit is that of the whole record.
    """
    if not tail or len(tail) < 2:
        raise NothingToDrawError("there are no fits to tails")
    figure, drawn = panels(5.0, 3, sharex=True)
    start = np.array([fit["start_s"] for fit in tail], dtype=np.float64)
    for panel, name in zip(drawn, "abc", strict=True):
        values = np.array([number(fit[name]) for fit in tail])
        errors = np.array([error(fit[name]) for fit in tail])
        factor, unit = axis_unit(values, _UNITS[name])
        # The whole record's value with its 95 % band, against the tails' error bars.
        panel.axhspan(
            factor * (values[0] - 1.96 * errors[0]),
            factor * (values[0] + 1.96 * errors[0]),
            color=BLUE,
            alpha=0.22,
            linewidth=0.0,
        )
        panel.axhline(factor * values[0], color=BLUE, label="whole record, 95 % band")
        panel.errorbar(
            start[1:],
            factor * values[1:],
            factor * errors[1:],
            fmt="o",
            color=VERMILION,
            markersize=4.5,
            label="fit to the tail from here on",
        )
        panel.set_ylabel(f"${name}$ ({unit})")
        panel.set_ylim(*(factor * end for end in _window(values, errors)))
    drawn[-1].set_xlabel("Start of the fitted part (s)")
    _amplitudes_on_top(drawn[0], tail, start)
    key_above(drawn[0], 2, lift=1.28)
    figure.align_ylabels(drawn)
    return figure


def _window(values: FloatArray, errors: FloatArray) -> tuple[float, float]:
    """Limits about the whole record's value: the tails' errors, but no more than themselves.

    The shortest tails know nothing any more (errors of ten thousand times the value); their
    bars leave the panel, or no other fit could be distinguished from the line.
    """
    whole = values[0]
    reach = np.abs(values - whole) + errors
    near = reach[reach <= abs(whole)]
    half = 1.15 * max(float(np.max(near, initial=0.0)), 3.0 * errors[0], 1e-3 * abs(whole))
    return whole - half, whole + half


def _amplitudes_on_top(panel: Any, tail: Sequence[Mapping[str, Any]], start: FloatArray) -> None:
    """Mark round amplitudes where the decay passes them."""
    amplitude = np.array([number(fit["amplitude_rad"]) for fit in tail])
    factor, unit = prefixed(float(np.nanmax(amplitude)), "rad")
    decades = 10.0 ** np.arange(-6, 4)
    marks = np.sort(np.outer(decades, [1.0, 2.0, 5.0]).ravel())
    shown = factor * amplitude
    marks = marks[(marks >= np.min(shown)) & (marks <= np.max(shown))]
    order = np.argsort(shown)
    moments = np.interp(np.log(marks), np.log(shown[order]), start[order])
    second_scale(
        panel, "top", moments, [f"{mark:g}" for mark in marks], f"Amplitude there ({unit})"
    )
