"""What stands in a figure's place when there is nothing to draw."""

from __future__ import annotations

import textwrap

from matplotlib.figure import Figure

from pendpipe.figures.style import GREY, WIDTH_IN, plain_text, styled


@styled
def placeholder(reason: str) -> Figure:
    """A figure that says why it is empty."""
    figure = Figure(figsize=(WIDTH_IN, 1.4))
    text = "\n".join(textwrap.wrap(f"Not drawn: {reason}.", 60))
    figure.text(0.5, 0.5, plain_text(text), ha="center", va="center", color=GREY)
    return figure
