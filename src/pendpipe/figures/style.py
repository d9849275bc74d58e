"""How every figure looks: colours that colour-blind readers tell apart, sizes, saving.

Colour never carries a meaning alone: branches differ in their symbols too, curves in their
dashes. Vermilion is kept for what goes wrong when something is left out.
"""

import io
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from operator import methodcaller
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from pendpipe.arrays import FloatArray
from pendpipe.cells import csv_rows
from pendpipe.files import MADE_BY, replaced

SHEET: Final = Path(__file__).with_name("pendpipe.mplstyle")
"""Sizes, letters, lines and colours of all figures."""
_SHEET: Final = mpl.rc_params_from_file(SHEET, use_default_template=False)
_LOOK: Final[dict[Any, Any]] = {
    key: value for key, value in mpl.rcParamsDefault.items() if key != "backend"
} | dict(_SHEET)
"""All of it: a ``matplotlibrc`` of the machine or of the folder changes no figure."""
styled = mpl.rc_context(_LOOK)
"""Gives a drawing function the common look, and leaves matplotlib's settings as they were."""
WIDTH_IN: Final = float(_SHEET["figure.figsize"][0])
"""One size for all: letters stay legible at a column's width and on a phone."""
BLUE, GREEN, INK, GREY, PALE, VERMILION = _SHEET["axes.prop_cycle"].by_key()["color"][:6]
_FONTS: Final = ["DejaVu Sans", "Verdana", "Arial", "sans-serif"]
"""Of a saved figure: what reads it may not have the first."""


class Branch(NamedTuple):
    """How a branch is drawn, and its name for people."""

    name: str
    colour: str
    marker: str


BRANCHES: Final = {
    "high": Branch("high branch (lower weight alone)", BLUE, "o"),
    "low": Branch("low branch (pair of weights)", GREEN, "s"),
}


def branch(name: str) -> Branch:
    """The style of a branch; one that is not in the paper is drawn in grey."""
    return BRANCHES.get(name, Branch(name or "no branch", GREY, "^"))


Mark = Callable[[Axes], Any]
"""One thing that a panel shows: it draws itself on axes."""
THIN: Final[dict[str, Any]] = {"capsize": 0.0, "elinewidth": 0.6, "markersize": 2.4}
"""The look of many measured points."""


def curve(
    x: Any, y: Any, colour: str = INK, dashes: Any = "-", width: float = 1.4, **look: Any
) -> Mark:
    """A line; with a marker, and "" for dashes, points without errors."""
    return methodcaller("plot", x, y, color=colour, linestyle=dashes, linewidth=width, **look)


def measured(x: Any, y: Any, sd: Any, x_sd: Any = None, colour: str = BLUE, **look: Any) -> Mark:
    """Measured points with their error bars."""
    look = {"fmt": "o", "markersize": 4.5, "color": colour} | look
    return methodcaller("errorbar", x, y, sd, x_sd, **look)


def band(x: FloatArray, y: FloatArray, half: FloatArray, colour: str = BLUE, **look: Any) -> Mark:
    """The band of a curve's uncertainty."""
    look = {"color": colour, "alpha": 0.22, "linewidth": 0.0} | look
    return methodcaller("fill_between", x, y - half, y + half, **look)


def level(y: float, colour: str = INK, width: float = 0.9, **look: Any) -> Mark:
    """A line across the panel."""
    return methodcaller("axhline", y, color=colour, linewidth=width, **look)


def strip(low: float, high: float) -> Mark:
    """The uncertainty of a level, across the panel."""
    return methodcaller("axhspan", low, high, color=GREY, alpha=0.18, linewidth=0.0)


def stretch_of(start_s: float, stop_s: float) -> Mark:
    """A stretch of time that was left out."""
    return methodcaller("axvspan", start_s, stop_s, color=GREY, alpha=0.25, linewidth=0.0)


def words(text: str, at: tuple[Any, Any], off: tuple[float, float], **look: Any) -> Mark:
    """Words, some points off a place."""
    look = {"fontsize": 8.5, "textcoords": "offset points"} | look
    return methodcaller("annotate", text, at, off, **look)


RESIDUALS_BELOW: Final = (1.0, 0.4)
"""Heights of a panel for data and fit, and of one below for how they differ."""


class Panel(NamedTuple):
    """What one pair of axes shows.

    Parameters
    ----------
    marks
        What is drawn, in turn.
    about
        What `Axes.set` takes: labels, limits, scales, margins.
    key
        Columns of the legend above, where it can't hide data; 0 for none.
    lift
        How high that stands, over the height of the axes.
    note
        A line in smaller letters above.
    """

    marks: Iterable[Mark]
    about: dict[str, Any]
    key: int = 0
    lift: float = 1.0
    note: str = ""


class ShownFigure(Figure):
    """A figure that shows itself: in a notebook as a picture, elsewhere in a window."""

    @styled
    def _repr_png_(self) -> bytes:
        """Return the picture for a notebook."""
        out = io.BytesIO()
        self.savefig(out, format="png", dpi=110)
        return out.getvalue()

    def show(self, warn: bool = True) -> None:  # noqa: ARG002 - matplotlib's signature
        """Open a window, where matplotlib's backend has any."""
        import matplotlib.pyplot as plt

        if (manager := plt.figure().canvas.manager) is not None:
            manager.canvas.figure = self
            self.set_canvas(manager.canvas)
        plt.show()


def figure_of(
    height_in: float,
    *panels: Panel,
    shares: Sequence[float] | None = None,
    margins: Mapping[str, float] | None = None,
    sharex: bool = True,
    across: bool = False,
) -> Figure:
    """Draw panels.

    Parameters
    ----------
    height_in
        Of the figure, in inches.
    panels
        From the top down; side by side if they stand `across`.
    shares
        Their heights, relative to each other.
    margins
        By default it is laid out so that nothing is cut off. With fixed margins it is four times
        faster, for the figures that every record has.
    sharex
        Whether panels below each other have one scale.
    """
    figure = ShownFigure(figsize=(WIDTH_IN, height_in), layout=None if margins else "constrained")
    if margins:
        figure.subplots_adjust(**{"left": 0.135, "right": 0.975, **margins})
    rows, columns = (1, len(panels)) if across else (len(panels), 1)
    common = {"sharey": True} if across else {"sharex": sharex, "height_ratios": shares}
    grid = figure.subplots(rows, columns, squeeze=False, **common)
    for axes, panel in zip(grid.flat, panels, strict=True):
        for mark in panel.marks:
            mark(axes)
        # A quantity without a unit has no brackets.
        axes.set(
            **{
                name: re.sub(r"\s*\(1?\)$", "", of) if name in ("xlabel", "ylabel") else of
                for name, of in panel.about.items()
            }
        )
        if panel.note:
            axes.set_title(panel.note, fontsize=8.5, pad=3)
        if panel.key:
            above: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, panel.lift)}
            axes.legend(ncols=panel.key, borderaxespad=0.3, **above)
    figure.align_ylabels()
    return figure


def quantity_of(unit: str) -> str:
    """Name what has this unit, for an axis."""
    names = {"rad": "Angle", "m": "Displacement", "V": "Sensor output"}
    return names.get(unit, "Reading")


def logarithmic(axis: Literal["x", "y"], span: float | None = None) -> Mark:
    """A logarithmic axis with 0.5, 1, 2, 5, ... instead of powers of ten.

    `span`, the highest over the lowest value, tells how many of a decade it has room for.
    """

    def scale(axes: Axes) -> None:
        axes.set(**{f"{axis}scale": "log"})
        own: Axis = getattr(axes, f"{axis}axis")
        if span is not None:
            few, many = (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)
            own.set_major_locator(LogLocator(subs=many if span < 10.0 else few))
        own.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        own.set_minor_locator(NullLocator())

    return scale


def second_scale(
    side: Literal["top", "right"], at: Any, numbers: Sequence[str], label: str
) -> Mark:
    """The same axis in other units, along the upper or the right edge."""
    letter = "x" if side == "top" else "y"

    def scale(axes: Axes) -> None:
        other = getattr(axes, f"secondary_{letter}axis")(side)
        other.set(**{f"{letter}ticks": at, f"{letter}ticklabels": numbers})
        getattr(other, f"{letter}axis").set_minor_locator(NullLocator())
        getattr(other, f"set_{letter}label")(label, labelpad=3)
        other.spines[side].set_visible(True)

    return scale


def plain_text(text: str) -> str:
    """Free text for a title: a dollar sign is no formula."""
    return text.replace("$", r"\$")


@styled
def placeholder(reason: str) -> Figure:
    """An empty figure with the reason in it."""
    figure = Figure(figsize=(WIDTH_IN, 1.4))
    text = "\n".join(textwrap.wrap(f"Not drawn: {reason}.", 60))
    figure.text(0.5, 0.5, plain_text(text), ha="center", va="center", color=GREY)
    return figure


def plotted(figure: Figure) -> str:
    """What a figure shows, as CSV; points that are drawn as pixels stand in the results."""
    table = list[tuple[str, ...]]()
    for axes in figure.axes:
        bars = [each for each in axes.containers if isinstance(each, ErrorbarContainer)]
        caps = [line for each in bars for line in each.lines[1]]
        rows = []
        for line in axes.lines:
            if line in caps or line.get_rasterized() or line.get_transform() != axes.transData:
                continue
            own = [each for each in bars if each.lines[0] is line]
            label = str((own[0] if own else line).get_label())
            points = np.asarray(line.get_xydata(), dtype=np.float64)
            sd = [""] * len(points)
            if own and own[0].has_yerr:
                segments = own[0].lines[2][-1].get_segments()
                sd = [f"{0.5 * np.ptp(ends[:, 1]):.3g}" if len(ends) else "" for ends in segments]
            name = "" if label.startswith("_") else label
            both = zip(points.tolist(), sd, strict=False)
            rows += [(name, f"{x:.7g}", f"{y:.7g}", error) for (x, y), error in both]
        if rows:
            table += [("of", axes.get_xlabel() or "x", axes.get_ylabel() or "y", "sd"), *rows]
    return csv_rows(table)


def save(
    figure: Figure, stem: Path, *, dpi: int = 200, forms: Sequence[str] = ("svg", "png")
) -> list[Path]:
    """Write a figure as SVG and PNG, the same bytes whenever the same data are drawn."""
    written = [stem.with_name(f"{stem.name}.{form}") for form in forms]
    # A salt for each figure, so that two of them in one page do not share identifiers.
    saving: dict[Any, Any] = {
        **_LOOK,
        "svg.hashsalt": f"pendpipe {stem.name}",
        "font.family": _FONTS,
    }
    metadata: dict[str, dict[str, Any]] = {
        "svg": {"Date": None, "Creator": MADE_BY},
        "png": {"Software": MADE_BY},
        "pdf": {"Creator": MADE_BY, "CreationDate": None},
    }
    if "png" in forms:  # a figure of its own, and not one of a thousand records
        metadata["svg"]["Keywords"] = [plotted(figure)]
    with mpl.rc_context(saving):
        for path in written:
            form = path.suffix[1:]
            with replaced(path, "wb") as stream:
                figure.savefig(stream, format=form, dpi=dpi, metadata=metadata[form])
            # Laid out once: both forms are alike. (With "none" each would be drawn twice.)
            figure.set_layout_engine(None)
    return written
