"""How every figure looks: colours that colour-blind readers tell apart, sizes, saving.

Colour never carries a meaning alone: branches differ in their symbols too, curves in their
dashes. Vermilion is kept for what goes wrong when something is left out.
"""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, ParamSpec

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from pendpipe.arrays import FloatArray
from pendpipe.files import replaced

Arguments = ParamSpec("Arguments")

BLUE, VERMILION, GREEN = "#0072B2", "#C8321A", "#007A5A"
INK, GREY, PALE = "#1A1A1A", "#5F6670", "#9CC4E0"
WIDTH_IN: Final = 5.2
"""One size for all: letters stay legible at a column's width and on a phone."""

_FONTS: Final = ["DejaVu Sans", "Verdana", "Arial", "sans-serif"]
_LOOK: Final[dict[Any, Any]] = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 6),
    "axes.unicode_minus": True,
    "grid.color": "#E3E6EA",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    "legend.columnspacing": 1.4,
    "legend.borderaxespad": 0.2,
    "lines.linewidth": 1.4,
    "lines.markersize": 5.0,
    "errorbar.capsize": 2.0,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "figure.constrained_layout.use": False,
    "mathtext.fontset": "dejavusans",
    # Letters stay letters: they can be searched, selected and read aloud.
    "svg.fonttype": "none",
    "path.simplify": True,
}


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
    """The look of a branch; one that the paper does not have is drawn in grey."""
    return BRANCHES.get(name, Branch(name or "no branch", GREY, "^"))


def styled(draw: Callable[Arguments, Figure]) -> Callable[Arguments, Figure]:
    """Give a drawing function the common look, and leave matplotlib's settings as they were."""

    @wraps(draw)
    def inside(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Figure:
        with mpl.rc_context(_LOOK):
            return draw(*args, **kwargs)

    return inside


def panels(
    height_in: float = 3.5, rows: int = 1, margins: Mapping[str, float] | None = None, **grid: Any
) -> tuple[Figure, Any]:
    """A figure, and its axes or the array of them, one below the other.

    It is laid out so that nothing is cut off, or with fixed `margins`: four times faster, for
    the figures that every record has.
    """
    figure = Figure(figsize=(WIDTH_IN, height_in), layout=None if margins else "constrained")
    if margins:
        figure.subplots_adjust(**{"left": 0.135, "right": 0.975, **margins})
    return figure, figure.subplots(rows, 1, **grid)


def figure_with_residuals(
    height_in: float = 4.4,
    *,
    margins: Mapping[str, float] | None = None,
    residual_share: float = 0.4,
    baseline: float = 0.0,
) -> tuple[Figure, Axes, Axes]:
    """A figure with a panel for data and fit, and one below for how they differ."""
    shares = {"height_ratios": [1.0, residual_share]}
    figure, (upper, lower) = panels(height_in, 2, margins, sharex=True, gridspec_kw=shares)
    figure.align_ylabels([upper, lower])
    lower.axhline(baseline, color=INK, linewidth=0.9)
    return figure, upper, lower


def quantity_of(unit: str) -> str:
    """Name what has this unit, for an axis."""
    return {"rad": "Angle", "m": "Displacement"}.get(unit, "Reading")


def points(
    axes: Axes, x: FloatArray, y: FloatArray, sd: FloatArray, size: float = 2.4, **look: Any
) -> None:
    """Draw many measured points with thin error bars."""
    look = {"fmt": "o", "color": BLUE, "capsize": 0.0, "elinewidth": 0.6, **look}
    axes.errorbar(x, y, sd, markersize=size, **look)


def band(
    axes: Axes, x: FloatArray, y: FloatArray, half: FloatArray, colour: str = BLUE, **look: Any
) -> None:
    """Draw the band of a curve's uncertainty."""
    axes.fill_between(x, y - half, y + half, color=colour, alpha=0.22, linewidth=0.0, **look)


def plain_numbers(axis: Axis, steps: Sequence[float] | None = None) -> None:
    """Write 0.5, 1, 2, 5, ... on a logarithmic axis instead of powers of ten."""
    if steps is not None:
        axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def key_above(axes: Axes, columns: int = 2, *, lift: float = 1.0, **entries: Any) -> None:
    """Put the legend above the axes, where it can't hide data."""
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, lift)}
    axes.legend(ncols=columns, borderaxespad=0.3, **place, **entries)


def second_scale(
    axes: Any, side: Literal["top", "right"], at: Sequence[float], marks: Sequence[str], label: str
) -> None:
    """Mark the same axis in other units along the upper or the right edge."""
    letter = "x" if side == "top" else "y"
    scale = getattr(axes, f"secondary_{letter}axis")(side)
    getattr(scale, f"set_{letter}ticks")(at, marks)
    getattr(scale, f"{letter}axis").set_minor_locator(NullLocator())
    getattr(scale, f"set_{letter}label")(label, labelpad=3)
    scale.spines[side].set_visible(True)


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
        "svg": {"Date": None, "Creator": "pendpipe"},
        "png": {"Software": "pendpipe"},
    }
    with mpl.rc_context(saving):
        for path in written:
            form = path.suffix[1:]
            with replaced(path, "wb") as stream:
                figure.savefig(stream, format=form, dpi=dpi, metadata=metadata[form])
            # Laid out once: both forms are alike, in half the time.
            figure.set_layout_engine("none")
    return written
