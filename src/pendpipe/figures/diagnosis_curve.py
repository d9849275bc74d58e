"""What an unnamed effect looks like: its curve with the 95 % band."""

from __future__ import annotations

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pendpipe.diagnosis.result import FoundEffect
from pendpipe.figures.data import NothingToDrawError
from pendpipe.figures.diagnosis_data import Shown
from pendpipe.figures.style import BLUE, GREEN, INK, WIDTH_IN, key_above, styled
from pendpipe.quantities import prefixed, pretty_unit


@styled
def draw(content: Shown) -> Figure:
    """Draw the curve of each unnamed effect, one below the other."""
    unnamed = [effect for effect in content.diagnosis.effects if effect.curve is not None]
    if not unnamed:
        raise NothingToDrawError("every effect has a name")
    rows = sum(2 if _exponents(effect) else 1 for effect in unnamed)
    height = 2.7 * rows
    figure = Figure(figsize=(WIDTH_IN, height))
    figure.subplots_adjust(
        left=0.15, right=0.975, bottom=0.5 / height, top=1.0 - 0.45 / height, hspace=0.5
    )
    panels = iter(figure.subplots(rows, 1, squeeze=False)[:, 0])
    for effect in unnamed:
        panel = next(panels)
        _curve(panel, effect)
        if not panel.get_legend():
            panel.set_title(effect.identifier)
        if _exponents(effect):
            _exponent(next(panels), effect)
    return figure


def _exponents(effect: FoundEffect) -> bool:
    return effect.curve is not None and "local_exponent" in effect.curve


def _curve(axes: Axes, effect: FoundEffect) -> None:
    assert effect.curve is not None
    curve = effect.curve
    at, argument = _scaled(curve["at"], curve["argument"])
    sizes = [curve["value"], *([curve["quadrature"]] if "quadrature" in curve else [])]
    largest = max(float(np.max(np.abs(size))) for size in sizes)
    name, _, unit = str(curve["ordinate"]).replace("omega^2", "ω²").partition(", ")
    factor, short = prefixed(largest, unit) if unit in ("rad", "m") else (1.0, unit)
    looks = [("value", "sd", BLUE, "-", "in phase" if len(sizes) > 1 else "")]
    if len(sizes) > 1:
        looks.append(("quadrature", "quadrature_sd", GREEN, "--", "in quadrature"))
    axes.axhline(0.0, color=INK, linewidth=0.9)
    for key, sd, colour, dashes, label in looks:
        value, half = factor * np.asarray(curve[key]), 1.96 * factor * np.asarray(curve[sd])
        axes.fill_between(at, value - half, value + half, color=colour, alpha=0.22, linewidth=0.0)
        axes.plot(at, value, color=colour, linestyle=dashes, label=label or None)
    label = f"{name[:1].upper()}{name[1:]}" + (f" ({pretty_unit(short)})" if short else "")
    axes.set(xlabel=argument, ylabel="\n".join(textwrap.wrap(label, 30)))
    axes.margins(x=0.01)
    if len(sizes) > 1:
        key_above(axes, 2)


def _exponent(axes: Axes, effect: FoundEffect) -> None:
    """The power of the velocity that the whole loss follows, by amplitude."""
    assert effect.curve is not None
    at, argument = _scaled(effect.curve["at"], effect.curve["argument"])
    value = np.asarray(effect.curve["local_exponent"])
    half = 1.96 * np.asarray(effect.curve["local_exponent_sd"])
    axes.fill_between(at, value - half, value + half, color=BLUE, alpha=0.22, linewidth=0.0)
    axes.plot(at, value, color=BLUE)
    for power in (0, 1, 2):
        axes.axhline(power, color=INK, linewidth=0.6, linestyle=":")
    axes.set(xlabel=argument, ylabel="Local exponent $n$ of |v|ⁿ")
    axes.set_ylim(max(float(np.min(value)) - 1.0, -2.0), min(float(np.max(value)) + 1.0, 5.0))
    axes.margins(x=0.01)


def _scaled(at: object, argument: str) -> tuple[np.ndarray, str]:
    """Arguments in a handy unit, and the axis's name."""
    values = np.asarray(at, dtype=np.float64)
    name, _, unit = argument.partition(", ")
    factor, short = (1.0, unit)
    if unit in ("rad", "m") and not name.startswith("phase"):
        factor, short = prefixed(float(np.max(np.abs(values))), unit)
    return factor * values, f"{name[:1].upper()}{name[1:]} ({short})"
