"""All the figures of a campaign, and which of them could not be drawn."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from operator import methodcaller
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from pendpipe.errors import InputError
from pendpipe.figures.data import (
    Entry,
    NothingToDrawError,
    branches,
    error,
    number,
    of_branch,
    read_decay,
    series,
    theory,
    typical_record,
    used,
)
from pendpipe.figures.decays import draw_fig07, draw_fig08
from pendpipe.figures.style import (
    BLUE,
    BRANCHES,
    GREEN,
    GREY,
    INK,
    RESIDUALS_BELOW,
    VERMILION,
    Mark,
    Panel,
    band,
    branch,
    curve,
    figure_of,
    level,
    logarithmic,
    measured,
    placeholder,
    save,
    second_scale,
    strip,
    styled,
    words,
)
from pendpipe.files import read_json, without_folders
from pendpipe.levels import FALSE_ALARM
from pendpipe.quantities import axis_unit, with_error
from pendpipe.recording import read_plain

Comparison = Mapping[str, Any]


class Drawn(NamedTuple):
    """What was drawn, and what was left out and why."""

    files: list[Path]
    left_out: dict[str, str]


def draw_all(
    comparison: Comparison,
    folder: Path,
    out: Path,
    *,
    records: Path | None = None,
) -> Drawn:
    """Draw figures 3 to 10.

    Parameters
    ----------
    comparison
        The content of comparison.json.
    folder
        The campaign's results.
    out
        Where the campaign's figures go.
    records
        A folder with that of the typical record's results; that of the campaign unless it is
        another.

    Returns
    -------
    Drawn
        A campaign with theory leaves a file for each of figures 3 to 10, with the reason
        in it where there was nothing to draw; one without leaves them out.
    """
    records = records or folder
    draws: dict[str, Callable[[], Figure]] = {
        "fig03": partial(draw_fig03, comparison.get("calibration")),
        "fig04": partial(draw_fig04, comparison),
        "fig07": partial(_typical_decay, comparison, records),
        "fig08": partial(_typical_quality, comparison, records),
    }
    has_theory = bool(comparison.get("has_theory"))
    if has_theory:
        draws |= {
            "fig05": partial(draw_fig05, comparison),
            "fig06": partial(draw_fig06, comparison),
            "fig09": partial(draw_fig09, comparison),
            "fig10": partial(draw_fig10, comparison),
            "causes": partial(draw_causes, folder / "campaign_diagnosis.json"),
            "walls": partial(draw_walls, comparison),
        }
    together = (folder / "campaign_diagnosis.json").is_file()
    files, left_out = list[Path](), dict[str, str]()
    for name, draw in sorted(draws.items()):
        try:
            files += save(draw(), out / name)
        except NothingToDrawError as fault:
            left_out[name] = without_folders(str(fault))
            if has_theory and (together or name != "causes"):
                files += save(placeholder(left_out[name]), out / name)
    return Drawn(files, left_out)


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
    residual = 1e3 * (volts - offset - slope * angle)
    residual_sd = 1e3 * np.hypot(volts_sd, slope * angle_sd)
    turn, unit = axis_unit(angle, "rad")
    ends = 1.06 * np.array([np.min(angle), np.max(angle)])
    line = f"line: {with_error(slope, error(calibration['volts_per_radian']), 'V/rad')}"
    run = f"caliper run, {len(angle)} positions"
    return figure_of(
        4.4,
        Panel(
            [
                curve(turn * ends, offset + slope * ends, zorder=3, label=line),
                measured(turn * angle, volts, volts_sd, turn * angle_sd, label=run),
            ],
            {"ylabel": "Sensor output (V)"},
            key=2,
        ),
        Panel(
            [level(0.0), measured(turn * angle, residual, residual_sd, markersize=3.5)],
            {"xlabel": f"Angle ({unit})", "ylabel": "Data − line (mV)", "ymargin": 0.25},
            note=_linearity(calibration),
        ),
        shares=RESIDUALS_BELOW,
    )


def _linearity(calibration: Mapping[str, Any]) -> str:
    """The linearity test in a line."""
    chance = (calibration.get("linear") or {}).get("p_value")
    if chance is None:
        return ""
    verdict = "no sign of curvature" if chance >= FALSE_ALARM else "the line does not suffice"
    return f"Linearity test: $p$ = {chance:.2g}, {verdict}"


PERIODS_S: Final = (15.0, 6.0, 4.0, 3.0, 2.5, 2.0, 1.5, 1.0)
"""The periods that people think in."""


@styled
def draw_fig04(comparison: Mapping[str, Any]) -> Figure:
    """Draw the limiting Q of the air benchmark with the line k f^2, and their ratio."""
    in_air = [e for e in used(comparison) if e.get("fluid") == "air"]
    points, line_of = (series(in_air, f"quality_factor_{each}") for each in ("limit", "hysteretic"))
    fitted = comparison.get("hysteretic_coefficient")
    coefficient = number(fitted)
    if not len(points.x) or not np.isfinite(coefficient):
        raise NothingToDrawError("the campaign has no benchmark in air")
    if len(line_of.x) == len(points.x):  # as it were at the moment of inertia of k
        there = coefficient * points.x**2 / line_of.y
        points = points._replace(y=points.y * there, y_sd=points.y_sd * there)
    squared, squared_sd = points.x**2, 2.0 * points.x * points.x_sd
    per_line, spread = 100.0 / (coefficient * squared), 100.0 * error(fitted) / coefficient
    edge = 1.05 * float(np.max(squared))
    line = f"$Q = k\\,f^{{\\,2}}$, $k$ = {with_error(coefficient, error(fitted), 's^2')}"
    exponent = (fitted or {}).get("free_exponent")
    free = with_error(number(exponent), error(exponent)) if exponent else ""
    triangles = {"fmt": "^"}
    return figure_of(
        4.6,
        Panel(
            [
                curve([0.0, edge], [0.0, coefficient * edge], label=line),
                measured(
                    squared,
                    points.y,
                    points.y_sd,
                    squared_sd,
                    zorder=3,
                    label="in air",
                    markersize=5.0,
                    **triangles,
                ),
                methodcaller("legend", loc="upper left"),
                second_scale(
                    "top", np.power(PERIODS_S, -2.0), [f"{p:g}" for p in PERIODS_S], "Period (s)"
                ),
            ],
            {"ylabel": "Quality factor $Q$", "xlim": (0.0, edge), "ylim": (0.0, None)},
        ),
        Panel(
            [
                level(0.0),
                measured(squared, per_line * points.y - 100.0, per_line * points.y_sd, **triangles),
                strip(-spread, spread),
            ],
            {
                "xlabel": "Frequency squared $f^{\\,2}$ (Hz²)",
                "ylabel": "Data over\nline − 1 (%)",
                "ymargin": 0.2,
            },
            note=free and f"With a free exponent: $Q \\propto f^{{\\,n}}$, $n$ = {free}",
        ),
        shares=RESIDUALS_BELOW,
    )


CAUSES: Final[dict[str, tuple[str, str, Any]]] = {
    "buoyancy": ("buoyancy", BLUE, (0, (5, 2))),
    "added_mass": ("added mass", GREEN, (0, (1.5, 1.5))),
    "both": ("both", INK, "-"),
}
_SHIFTS_PERCENT: Final = (1, 2, 5, 10, 20, 40, 60, 70, 80)
"""Where the second scale has its marks."""


@styled
def draw_fig05(comparison: Mapping[str, Any]) -> Figure:
    """Draw the relative lengthening of the period against frequency, cause by cause."""
    names = branches(comparison)
    causes = [
        mark for name in names for cause in CAUSES for mark in _cause(comparison, name, cause)
    ]
    symbols = [
        curve([], [], INK, "", marker=branch(name).marker, markersize=4.5, label=branch(name).name)
        for name in names
    ]
    # The same as a lowering of the frequency: T up by x means f down by x/(1 + x).
    at = [100.0 * p / (100.0 - p) for p in _SHIFTS_PERCENT]
    lowered = second_scale(
        "right", at, [str(p) for p in _SHIFTS_PERCENT], "Lowering of the frequency (%)"
    )
    return figure_of(
        3.8,
        Panel(
            [*causes, *symbols, logarithmic("y", 100.0), lowered],
            {
                "xlabel": "Frequency (Hz)",
                "ylabel": "Lengthening of the period (%)",
                "xlim": (0.0, None),
            },
            key=2,
        ),
    )


def _cause(comparison: Mapping[str, Any], name: str, cause: str) -> list[Mark]:
    """One cause along a branch, and at the geometry of each of its records."""
    text, colour, dashes = CAUSES[cause]
    frequency, value = theory(comparison, name, f"lengthening_{cause}")
    dots = [
        (e["frequency"]["value"], 100.0 * e["lengthening"][cause])
        for e in of_branch(comparison, name)
        if e.get("lengthening") and e.get("frequency")
    ]
    x, y = np.array(dots).reshape(-1, 2).T
    symbol: dict[str, Any] = {"marker": branch(name).marker, "markersize": 4.5}
    label = text if name == branches(comparison)[0] else None
    return [
        curve(frequency, 100.0 * value, colour, dashes, label=label),
        curve(x, y, colour, "", **symbol),
    ]


@styled
def draw_fig06(comparison: Mapping[str, Any]) -> Figure:
    """Draw log10 Q_v against frequency: Eq. 16, steady Stokes flow, and what was measured."""
    names = branches(comparison)
    marks = [mark for name in names for mark in _viscous(comparison, name)]
    return figure_of(
        4.0,
        Panel(
            marks,
            {
                "xlabel": "Frequency (Hz)",
                "ylabel": "$\\log_{10}\\, Q_v$",
                "xlim": (0.0, None),
            },
            key=len(names),
        ),
    )


def _viscous(comparison: Mapping[str, Any], name: str) -> list[Mark]:
    """Both theories of a branch, with the factor between them, and its records."""
    look = branch(name)
    frequency, steady = theory(comparison, name, "quality_factor_viscous_steady")
    _, full = theory(comparison, name, "quality_factor_viscous_theory")
    points = series(of_branch(comparison, name), "quality_factor_viscous")
    middle = len(frequency) // 2
    x, low, high = frequency[middle], np.log10(full[middle]), np.log10(steady[middle])
    symbol: dict[str, Any] = {"markerfacecolor": "white", "markersize": 4.5}
    arrow = {"arrowstyle": "->", "color": look.colour, "linewidth": 0.9, "shrinkB": 3.0}
    return [
        curve(
            frequency, np.log10(steady), look.colour, "--", label=f"{name}: steady Stokes, Eq. 1"
        ),
        curve(frequency, np.log10(full), look.colour, label=f"{name}: with history term, Eq. 16"),
        methodcaller("annotate", "", (x, low), (x, high), arrowprops=arrow),
        words(
            f"÷ {steady[middle] / full[middle]:.0f}",
            (x, 0.5 * (low + high)),
            (5.0, 0.0),
            va="center",
            color=look.colour,
        ),
        measured(
            points.x,
            np.log10(points.y),
            points.y_sd / (points.y * np.log(10.0)),
            points.x_sd,
            look.colour,
            fmt=look.marker,
            **symbol,
        ),
        # The key has a column for each branch, theory before measurement.
        curve(
            [], [], look.colour, "", marker=look.marker, label=f"{name}: measured, Eq. 17", **symbol
        ),
    ]


@styled
def draw_fig09(comparison: Mapping[str, Any]) -> Figure:
    """Draw the limiting Q with Eq. 16 and the hysteretic part together, and their ratio."""
    names = branches(comparison)
    full = [
        curve(*theory(comparison, name, "quality_factor_limit_theory"), branch(name).colour)
        for name in names
    ]
    key = curve([], [], label="lines: Eq. 16 and hysteresis together")
    factor = comparison.get("drag_factor") or comparison.get("theory_factor")
    known = factor and np.isfinite(number(factor))
    note = f"Drag measured over Eq. 16: {with_error(number(factor), error(factor))}"
    return figure_of(
        4.8,
        Panel(
            [*limits_measured(comparison), *full, key],
            {"ylabel": "Limiting quality factor $Q$", "xlim": (0.0, None), "ylim": (0.0, None)},
            key=1,
        ),
        Panel(
            [
                level(1.0),
                *(_theory_band(comparison, name) for name in names),
                *(_ratio(comparison, name) for name in names),
            ],
            {"xlabel": "Frequency (Hz)", "ylabel": "Q, measured\nover theory", "ymargin": 0.15},
            note=note if known else "",
        ),
        shares=(1.0, 0.45),
    )


@styled
def draw_causes(path: Path) -> Figure:
    """Draw what each cause alone predicts of the excess over theory, and what was measured."""
    patterns = read_json(path).get("patterns") if path.is_file() else None
    if not patterns:
        raise NothingToDrawError("the records were not diagnosed together")
    records = patterns["records"]
    excess = np.array([record["excess"] for record in records])
    span = max(1.6 * float(np.abs(excess).max()), 0.01)
    # As far to a side as there are records on it.
    ends = [110.0 if np.any(side * excess > 0.1 * span) else 10.0 for side in (-1.0, 1.0)]
    limits = {"xlabel": "Frequency (Hz)", "ylim": (-ends[0] * span, ends[1] * span)}
    return figure_of(
        5.0,
        *(
            Panel(
                [*_in_class(patterns, within), methodcaller("set_title", title)],
                {**limits, "ylabel": "Viscous loss above theory (%)" if within else ""},
            )
            for within, title in ((True, "not distinguished"), (False, "rejected"))
        ),
        across=True,
    )


@styled
def draw_walls(comparison: Mapping[str, Any]) -> Figure:
    """Draw what a tank's walls do to the drag by the depth of the fluid, and what was measured."""
    walls, factor = comparison.get("walls"), comparison.get("theory_factor")
    if not walls or not factor:
        raise NothingToDrawError("no tank is told, or no drag was measured")
    depth = 100.0 * np.array(walls["depth_m"])
    told, told_sd = 100.0 * walls["told_depth_m"], 100.0 * walls["told_depth_sd_m"]
    wide = 1.96 * error(factor)
    return figure_of(
        3.8,
        Panel(
            [
                strip(number(factor) - wide, number(factor) + wide),
                level(number(factor), GREY, label="measured, 95 %"),
                curve(depth, walls["clean"], BLUE, label="walls, clean surface"),
                curve(depth, walls["film"], VERMILION, "--", label="walls, film on the surface"),
                methodcaller("axvspan", told - told_sd, told + told_sd, color=GREEN, alpha=0.18),
                methodcaller("axvline", told, color=GREEN, label="depth that is told"),
            ],
            {
                "xlabel": "Depth of the fluid (cm)",
                "ylabel": "Drag over Eq. 16",
                "ylim": (1.0, None),
            },
            key=2,
        ),
    )


_COLOURS: Final = 7
"""Of the nine of a figure; the first two are the branches'."""


def _in_class(patterns: Mapping[str, Any], within: bool) -> Iterator[Mark]:
    """The records, and causes that are told apart from them or not, each of its own colour."""
    ranked = sorted(patterns["causes"], key=lambda cause: not cause["in_class"])
    coloured = [(c, f"C{n}") for n, c in enumerate(ranked[:_COLOURS], len(BRANCHES))]
    shown = [(cause, colour) for cause, colour in coloured if cause["in_class"] == within]
    names = list(dict.fromkeys(record["branch"] for record in patterns["records"]))
    for name in names:
        # A line ends with its branch: the other one is another set of weights.
        mine = [n for n, record in enumerate(patterns["records"]) if record["branch"] == name]
        at = sorted(mine, key=lambda n: patterns["records"][n]["frequency_hz"])
        own = [patterns["records"][n] for n in at]
        look, frequency = branch(name), [record["frequency_hz"] for record in own]
        yield measured(
            frequency,
            [100.0 * record["excess"] for record in own],
            [100.0 * record["sd"] for record in own],
            None,
            look.colour,
            label=f"measured, {look.name}" if within else None,
            fmt=look.marker,
            markersize=5.0,
            mfc="none",
            zorder=3,
        )
        for cause, colour in shown:
            label = cause["name"] if name == names[0] else None
            excess = [100.0 * cause["excess"][n] for n in at]
            yield curve(frequency, excess, colour, label=label)
    if shown:
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.16)}
        yield methodcaller("legend", fontsize=6.5, **below)


def limits_measured(comparison: Mapping[str, Any]) -> list[Mark]:
    """The limiting Q of each branch with error bars."""
    names = branches(comparison)
    found = {n: series(of_branch(comparison, n), "quality_factor_limit") for n in names}
    if not any(len(points.x) for points in found.values()):
        raise NothingToDrawError("no record in a fluid has a limiting Q")
    return [
        measured(
            points.x,
            points.y,
            points.y_sd,
            points.x_sd,
            branch(name).colour,
            fmt=branch(name).marker,
            markersize=5.0,
            zorder=3,
            label=f"measured, {branch(name).name}",
        )
        for name, points in found.items()
    ]


def _theory_band(comparison: Mapping[str, Any], name: str) -> Mark:
    """One standard deviation of the theory itself, from all inputs and the loss torque."""
    rows = sorted(
        (number(e["frequency"]), number(e.get("quality_factor_limit_theory_sd")) / theory)
        for e in of_branch(comparison, name)
        if np.isfinite(theory := number(e.get("quality_factor_limit_theory")))
    )
    frequency, sd = np.array(rows, dtype=np.float64).reshape(-1, 2).T
    return band(frequency, np.ones(len(frequency)), sd, branch(name).colour)


def _ratio(comparison: Mapping[str, Any], name: str) -> Mark:
    """Measured over theory; the theory at each record's own geometry."""
    look = branch(name)
    measured_of, theory_of = "quality_factor_limit", "quality_factor_limit_theory"
    entries = [
        e
        for e in of_branch(comparison, name)
        if np.isfinite(number(e.get(measured_of))) and np.isfinite(number(e.get(theory_of)))
    ]
    points, own = series(entries, measured_of), series(entries, theory_of).y
    symbol = {"fmt": look.marker, "ecolor": GREY}
    return measured(points.x, points.y / own, points.y_sd / own, None, look.colour, **symbol)


@styled
def draw_fig10(comparison: Mapping[str, Any]) -> Figure:
    """Draw the limiting Q with Eq. 16 alone, in red, beside the full theory."""
    without: dict[str, Any] = {"colour": VERMILION, "dashes": "--", "width": 1.8}
    marks = limits_measured(comparison)
    for name in branches(comparison):
        frequency, full = theory(comparison, name, "quality_factor_limit_theory")
        _, viscous = theory(comparison, name, "quality_factor_viscous_theory")
        half = 0.5 * (full - viscous)
        marks += [
            curve(frequency, full, GREY, width=1.0, zorder=1.2),
            curve(frequency, viscous, zorder=1.5, **without),
            band(frequency, viscous + half, half, VERMILION, alpha=0.10),
        ]
    marks += [
        curve([], [], label="Eq. 16 alone: hysteresis left out", **without),
        curve([], [], GREY, width=1.0, label="Eq. 16 and hysteresis together"),
    ]
    return figure_of(
        4.1,
        Panel(
            marks,
            {
                "xlabel": "Frequency (Hz)",
                "ylabel": "Limiting quality factor $Q$",
                "xlim": (0.0, None),
                "ylim": (0.0, None),
            },
            key=1,
        ),
    )
