"""Figure 7: a typical free decay, the sensor's volts against time, with its envelope."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from pendpipe import physics
from pendpipe.figures.data import Decay, number
from pendpipe.figures.style import (
    BLUE,
    INK,
    PALE,
    figure_with_residuals,
    key_above,
    plain_text,
    styled,
)
from pendpipe.quantities import axis_unit
from pendpipe.recording import Recording


@styled
def draw(decay: Decay, recording: Recording, volts_per_radian: float | None) -> Figure:
    """Draw every sample with the envelope of Eq. 14, and the turning points' residuals.

    Parameters
    ----------
    decay
        Turning points and fit.
    recording
        All the samples, in volts or as motion.
    volts_per_radian
        Takes the envelope to the recording's unit; ``None`` where that is rad already.
    """
    scale = volts_per_radian if recording.quantity == "volts" and volts_per_radian else 1.0
    unit = recording.unit
    level = scale * _level(decay)
    time = np.linspace(0.0, float(decay.elapsed_s[-1]), 400)
    start, rates = decay.value("amplitude"), decay.rates
    envelope = scale * physics.amplitude(time, start, *rates)
    misfit = scale * (decay.amplitude_rad - physics.amplitude(decay.elapsed_s, start, *rates))
    misfit_sd = abs(scale) * decay.amplitude_sd_rad
    large, large_unit = axis_unit(recording.values[recording.usable], unit)
    small, small_unit = axis_unit(np.abs(misfit) + misfit_sd, unit)

    figure, upper, lower = figure_with_residuals(4.4)
    # Every sample is drawn; as pixels, since ten thousand line segments help nobody.
    upper.plot(
        recording.time_s, large * recording.values, color=PALE, linewidth=0.6, rasterized=True,
        label=plain_text(f"all {len(recording)} samples of {decay.record}"),
    )  # fmt: skip
    moment = decay.time_s[0] + time
    upper.plot(moment, large * (level + envelope), color=INK, label="envelope of the fit, Eq. 14")
    upper.plot(moment, large * (level - envelope), color=INK)
    name = "Sensor output" if unit == "V" else "Motion"
    upper.set(ylabel=f"{name} ({large_unit})")
    key_above(upper, 1)
    lower.errorbar(
        decay.time_s, small * misfit, small * misfit_sd,
        fmt="o", color=BLUE, markersize=2.0, elinewidth=0.6, capsize=0.0,
    )  # fmt: skip
    lower.set(xlabel="Time (s)", ylabel=f"Turning points\n− envelope ({small_unit})")
    lower.margins(x=0.01, y=0.1)
    return figure


def _level(decay: Decay) -> float:
    """The fitted level, or where there is none that of the turning points."""
    fitted = number(decay.parameters.get("offset"))
    return fitted if np.isfinite(fitted) else float(np.median(decay.level_rad))
