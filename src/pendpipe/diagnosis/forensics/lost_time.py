"""A second test of lost samples, in the readings as they are: the clock jumped, the motion did not.

What follows a loss of time lies on the same path, farther along: angle and velocity step together.
A knock changes the velocity and no angle, an offset the angle and no velocity.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from scipy.special import stdtr

from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray
from pendpipe.diagnosis.result import Confirmation

_DEGREE: Final = 5
"""Of the polynomial in time on each side."""
_WITHIN: Final = 0.4
"""Length of a side, in periods: what a polynomial leaves of a swing it leaves elsewhere, too. Of
simulated losses of 10 to 110 ms nine tenths are confirmed, with 0.3 periods eight tenths."""
_INSTANTS: Final = 0.1
"""Within this part of a period the instant is sought."""
_ELSEWHERE: Final = 20
"""Places of the same phase on each side, which tell how far such steps scatter."""
_AGREE_SD: Final = 3.0


def confirmed(samples: Samples, about_s: float, period_s: float) -> Confirmation:
    """Test whether angle and velocity step by one and the same time.

    A polynomial in time is fitted to each side of the instant that leaves least. The steps of angle
    and velocity, over their slopes, are two estimates of the lost time. What they are half periods
    before and after tells their errors; the p-value is that of one of them being none, and 1 where
    they disagree.
    """
    here = None if samples.counts else _lost(samples, about_s, period_s)
    places = [
        about_s + 0.5 * k * period_s for k in range(-_ELSEWHERE, _ELSEWHERE + 1) if abs(k) > 1
    ]
    others = [lost for at in places if (lost := _lost(samples, at, period_s)) is not None]
    if here is None or len(others) < _ELSEWHERE:
        return Confirmation("too few readings about the instant tell", 1.0)
    usual = np.median(others, axis=0)
    sd = 1.4826 * np.median(np.abs(others - usual), axis=0)
    lost = here - usual
    least = float(np.min(np.abs(lost) / sd))
    agree = abs(lost[0] - lost[1]) < _AGREE_SD * math.hypot(*sd)
    said = [
        f"{1e3 * value:.1f} ± {1e3 * error:.1f} ms" for value, error in zip(lost, sd, strict=True)
    ]
    return Confirmation(
        f"polynomials in time on both sides of it step by {said[0]} in the angle and by"
        f" {said[1]} in the velocity",
        float(2.0 * stdtr(len(others) - 1, -least)) if agree else 1.0,
    )


def _lost(samples: Samples, about_s: float, period_s: float) -> FloatArray | None:
    """Return the lost time by the angle, and by the velocity; None where they can't be had."""
    first, last = np.searchsorted(
        samples.time_s, [about_s - _WITHIN * period_s, about_s + _WITHIN * period_s]
    )
    time, values = samples.time_s[first:last], samples.values[first:last]
    fewest = 2 * (_DEGREE + 1)
    sides = [
        (_side(time[:row] - time[row], values[:row]), _side(time[row:] - time[row], values[row:]))
        for row in range(fewest, len(time) - fewest + 1)
        if abs(time[row] - about_s) <= _INSTANTS * period_s
    ]
    if not sides:
        return None
    (before, _), (after, _) = min(sides, key=lambda pair: pair[0][1] + pair[1][1])
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = 2.0 * (after - before)[:2] / (after + before)[1:]
    # Of a swing they are (2/omega) tan(omega tau/2).
    lost = period_s / math.pi * np.arctan(math.pi / period_s * steps)
    return np.asarray(lost) if np.all(np.isfinite(lost)) else None


def _side(time: FloatArray, values: FloatArray) -> tuple[FloatArray, float]:
    """Angle, velocity and acceleration at the instant, and the squares left."""
    scale = float(np.abs(time).max())
    columns = np.vander(time / scale, _DEGREE + 1, increasing=True)
    found = np.linalg.lstsq(columns, values, rcond=None)[0]
    left = values - columns @ found
    return found[:3] * np.array([1.0, 1.0 / scale, 2.0 / scale**2]), float(left @ left)
