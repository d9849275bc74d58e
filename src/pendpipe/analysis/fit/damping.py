"""How long the amplitude takes to fall to a half and to 1/e, by integration of what is fitted."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from pendpipe.analysis.fit.fitted import Fitted, fast_beside
from pendpipe.analysis.fit.quality import qualities
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Eq8, Release, turning_points_with_jacobian
from pendpipe.estimate import Estimate

FALLS: Final = {"damping_time_s": math.exp(-1.0), "half_life_s": 0.5}
"""To what part of itself the amplitude falls in each of the times."""


def damping_of(result: Fitted) -> dict[str, Estimate]:
    """Return other measures of the loss at the largest amplitude of `quality.qualities`.

    ``half_life_s`` and ``damping_time_s``, the times in which the fitted law (where it is refuted:
    what the turning points show) takes that amplitude to a half and to 1/e of it; NaN where the
    motion stops before, infinite without a loss. ``logarithmic_decrement``, pi/Q, is that of one
    period at ``amplitude_rad``.
    """
    found = qualities(result)
    if not found:
        return {}
    large, tau = found[0], found[0].damping_time_s
    decrement = large.period_s / tau.value
    return {
        "amplitude_rad": Estimate(large.amplitude_rad, 0.0, result.parameters["amplitude"].unit),
        **{name: _falls(result, large.amplitude_rad, part) for name, part in FALLS.items()},
        "logarithmic_decrement": Estimate(decrement, decrement * tau.sd / tau.value, ""),
    }


def is_extrapolated(result: Fitted, amplitude: float) -> bool:
    """Whether the decay that was fitted ends above an amplitude."""
    if result.points is not None:
        return amplitude < float(np.min(result.points.amplitude_rad))
    checks = result.decrement_check
    return bool(checks) and amplitude < checks[-1].amplitude_rad


def _falls(result: Fitted, amplitude: float, part: float) -> Estimate:
    """The time to a part of an amplitude, with its error."""
    shown = result.lawless
    if shown is not None:
        return shown.fall(amplitude, part)
    time_s, gradient = fall_time(result.law, amplitude, part)
    covariance = result.covariance_of("a", "b", "c")
    sd = math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))
    return Estimate(time_s, sd if math.isfinite(time_s) else time_s, "s")


def fall_time(law: Eq8, amplitude: float, part: float) -> tuple[float, FloatArray]:
    """Time in which a law takes an amplitude to a part of it, and its derivatives by a, b, c.

    The motion is let go at `amplitude`, and ln y is interpolated between its turning points. How
    fast it swings matters to the second order of the losses: a motion of a high Q is followed with
    fewer swings.

    Returns
    -------
    time_s, gradient
        In s; NaN where it stops before, infinite without a loss. The gradient has shape (3,).
    """
    b = law.hysteretic + law.viscous
    fast = fast_beside(law.quadratic, b, law.coulomb, amplitude)
    law = replace(law, angular_frequency=min(law.angular_frequency, fast))
    share, none = law.share, np.zeros(3)
    if not law.quadratic * amplitude + b + law.coulomb > 0.0:
        return math.inf, none
    aim, count = math.log(part * amplitude), 64
    while True:
        try:
            turning, _, by_angle = turning_points_with_jacobian(law, Release(0.0, amplitude), count)
        except ValueError:
            # Overdamped.
            return math.nan, none
        y = np.abs(turning.angle_rad)
        first = int(np.argmax(y <= part * amplitude))
        if first > 0 and y[first] > 0.0 and first + 2 <= len(y):
            break
        if first > 0 or len(y) < count:
            return math.nan, none
        count *= 4
    # Four turning points about it, two where it falls at once.
    near = slice(max(first - 2, 0), first + 2)
    logs, by_log = np.log(y[near]) - aim, by_angle[near, :4] / turning.angle_rad[near, None]
    # Lagrange's polynomial, through the times: how much each of them weighs, and its slope.
    weight, slope = np.linalg.inv(np.vander(logs, increasing=True))[:2]
    time = turning.time_s[near]
    a, hysteretic, viscous, c = (-float(slope @ time) * (weight @ by_log)).tolist()
    gradient = np.array([a, share * hysteretic + (1.0 - share) * viscous, c])
    return float(weight @ time), gradient
