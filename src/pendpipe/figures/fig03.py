"""Figure 3: the sensor's volts against angle, with the calibration line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from pendpipe.figures.data import NothingToDrawError, error, number
from pendpipe.figures.style import BLUE, INK, figure_with_residuals, key_above, styled
from pendpipe.quantities import axis_unit, with_error


@styled
def draw(calibration: Mapping[str, Any] | None) -> Figure:
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
        turn * angle, volts, volts_sd, turn * angle_sd,
        fmt="o", color=BLUE, markersize=4.5, label=f"caliper run, {len(angle)} positions",
    )  # fmt: skip
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
