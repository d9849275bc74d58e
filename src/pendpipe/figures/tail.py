"""The trap of tail fits: a, b, c against the start of the fitted part of one record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from pendpipe.arrays import FloatArray
from pendpipe.figures.data import NothingToDrawError, error, number
from pendpipe.figures.style import BLUE, INK, VERMILION, WIDTH_IN, key_above, styled
from pendpipe.quantities import axis_unit, prefixed

_UNITS: Final = {"a": "rad⁻¹ s⁻¹", "b": "s⁻¹", "c": "rad/s"}


@styled
def draw(tail: Sequence[Mapping[str, Any]] | None) -> Figure:
    """Draw the three rates with error bars, and the whole record's as a line.

    Parameters
    ----------
    tail
        The entry ``tail`` of comparison.json; its first fit is that of the whole record.
    """
    if not tail or len(tail) < 2:
        raise NothingToDrawError("there are no fits to tails")
    figure = Figure(figsize=(WIDTH_IN, 5.0), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    start = np.array([fit["start_s"] for fit in tail], dtype=np.float64)
    for panel, name in zip(panels, "abc", strict=True):
        values = np.array([number(fit[name]) for fit in tail])
        errors = np.array([error(fit[name]) for fit in tail])
        factor, unit = _scale(name, values)
        # The whole record's value with its 95 % band, against the tails' error bars.
        panel.axhspan(
            factor * (values[0] - 1.96 * errors[0]), factor * (values[0] + 1.96 * errors[0]),
            color=BLUE, alpha=0.22, linewidth=0.0,
        )  # fmt: skip
        panel.axhline(factor * values[0], color=BLUE, label="whole record, 95 % band")
        panel.errorbar(
            start[1:], factor * values[1:], factor * errors[1:],
            fmt="o", color=VERMILION, markersize=4.5, label="fit to the tail from here on",
        )  # fmt: skip
        panel.set_ylabel(f"${name}$ ({unit})")
        panel.set_ylim(*(factor * end for end in _window(values, errors)))
    panels[-1].set_xlabel("Start of the fitted part (s)")
    _amplitudes_on_top(panels[0], tail, start)
    key_above(panels[0], 2, lift=1.28)
    figure.align_ylabels(panels)
    return figure


def _scale(name: str, values: FloatArray) -> tuple[float, str]:
    """A prefix for c's rad/s; a and b are numbers of ordinary size, b in 1/ks would be odd."""
    unit = _UNITS[name]
    return axis_unit(values, unit) if name == "c" else (1.0, unit)


def _window(values: FloatArray, errors: FloatArray) -> tuple[float, float]:
    """Limits about the whole record's value: the tails' errors, but no more than themselves.

    The shortest tails know nothing any more (errors of ten thousand times the value); their
    bars leave the panel, or no other fit could be told from the line.
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
    top = panel.secondary_xaxis("top")
    top.set_xticks(moments, [f"{mark:g}" for mark in marks])
    top.set_xlabel(f"Amplitude there ({unit})", color=INK, labelpad=3)
    top.spines["top"].set_visible(True)
