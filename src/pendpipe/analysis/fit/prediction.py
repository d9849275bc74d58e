"""The fitted motion at any time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.analysis.fit.by_amplitudes import pendulum_decay
from pendpipe.analysis.fit.decrement import loss_of
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Release, sample
from pendpipe.physics.decay import amplitude

if TYPE_CHECKING:
    from pendpipe.analysis.fit.result import FitResult


def predicted(result: FitResult, time_s: FloatArray) -> FloatArray:
    """Return the law's motion; see `FitResult.predict`."""
    points = result.points
    assert points is not None
    omega, y0 = 2.0 * math.pi * result.value("frequency"), result.value("amplitude")
    if result.method == "amplitudes":
        since, rates = time_s - points.time_s[0], map(result.value, "abc")
        if result.restoring == "linear":
            return amplitude(since, y0, *rates)
        return pendulum_decay(result.hysteretic_share, result.drag, since, y0, *rates)[0]
    side = float(points.side[0])
    # The phase at the first reading counts from a turning point on the positive side.
    late = result.value("phase") - (0.0 if side > 0.0 else math.pi)
    turned_s = points.start_s - late / omega
    period_s = 2.0 * math.pi / omega
    turned_s += period_s * round((float(points.time_s[0]) - turned_s) / period_s)
    level = np.full(len(time_s), result.value("offset"))
    if result.zero_drift is not None:
        level += result.zero_drift.value * (time_s - 0.5 * (points.start_s + points.stop_s))
    order, motion = np.argsort(time_s, kind="stable"), np.empty(len(time_s))
    before, after = np.split(order, [np.searchsorted(time_s[order], turned_s)])
    early, loss = turned_s - time_s[before], loss_of(result.law, y0)
    swing = np.cos(omega * early) - loss / omega * np.sin(omega * early)
    motion[before] = side * y0 * np.exp(loss * early) * swing
    if len(after):
        motion[after] = sample(result.law, Release(turned_s, side * y0), time_s[after])
    return np.asarray(motion + level)
