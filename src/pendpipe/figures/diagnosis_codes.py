"""How often each of the converter's codes was given, where codes matter."""

from __future__ import annotations

from typing import Final

import numpy as np
from matplotlib.figure import Figure

from pendpipe.diagnosis.forensics.lattice import find_lattice
from pendpipe.figures.data import NothingToDrawError
from pendpipe.figures.diagnosis_data import Shown
from pendpipe.figures.style import BLUE, INK, VERMILION, WIDTH_IN, key_above, styled

CONCERNED: Final = ("clipping", "missing-codes", "coarse-quantisation")
_BARS: Final = 400


@styled
def draw(content: Shown) -> Figure:
    """Draw the histogram of codes beside that which the fitted motion with its noise expects."""
    effects = content.diagnosis.effects
    marked = sorted({code for effect in effects for code in effect.location.adc_codes})
    if not marked and not any(effect.identifier in CONCERNED for effect in effects):
        raise NothingToDrawError("no code is concerned")
    step = content.data.step
    if not step > 0.0:
        raise NothingToDrawError("the readings have no steps")
    values = content.data.values
    # The codes of the diagnosis: 0 is the one nearest to a reading of zero.
    lattice = find_lattice(values, step)
    origin, step = (0.0, step) if lattice is None else (lattice.origin, lattice.step)
    codes = np.rint((values - origin) / step).astype(np.int64)
    model = (content.extended or content.baseline).at.reading
    expected = np.rint((model - origin) / step).astype(np.int64)
    low, high = int(codes.min()), int(codes.max())
    group = -(-(high - low + 1) // _BARS)
    edges = np.arange(low - 0.5, high + group + 0.5, group)
    given, _ = np.histogram(codes, edges)
    wanted, _ = np.histogram(expected, edges)
    middle = 0.5 * (edges[1:] + edges[:-1])
    figure = Figure(figsize=(WIDTH_IN, 3.0))
    figure.subplots_adjust(left=0.135, right=0.975, bottom=0.15, top=0.86)
    axes = figure.subplots()
    axes.bar(middle, given, width=group, color=BLUE, linewidth=0.0, label="readings")
    axes.step(middle, wanted, where="mid", color=INK, linewidth=0.9, label="expected")
    for code in marked[:200]:
        axes.axvline(code, color=VERMILION, linewidth=0.8, zorder=0)
    axes.set(xlabel="Code (0: nearest to a reading of zero)", ylabel="Readings")
    axes.margins(x=0.0)
    key_above(axes, 2)
    return figure
