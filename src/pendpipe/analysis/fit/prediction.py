"""The fitted motion at any time."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from pendpipe.analysis.fit.decrement import loss_of
from pendpipe.analysis.fit.fitted import Fitted
from pendpipe.arrays import FloatArray
from pendpipe.dynamics import Release, sample
from pendpipe.dynamics.eq8 import Drag
from pendpipe.physics.decay import amplitude
from pendpipe.physics.lengthening import elliptic

_NODES: Final = 2000
"""Of a decay, to `_LEAST` of the first amplitude: the sums are right to 1e-6."""
_LEAST: Final = 1e-3
"""Part of the first amplitude below which no reading is asked for."""


def predicted(result: Fitted, time_s: FloatArray) -> FloatArray:
    """Return the law's motion; see `FitResult.predict`."""
    points = result.points
    assert points is not None
    omega, y0 = 2.0 * math.pi * result.value("frequency"), result.value("amplitude")
    if result.method == "amplitudes":
        since, rates = time_s - points.time_s[0], map(result.value, "abc")
        if result.restoring == "linear":
            return amplitude(since, y0, *rates)
        return pendulum_decay(result.form.hysteretic_share, result.form.drag, since, y0, *rates)[0]
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


def pendulum_decay(
    share: float, drag: Drag, time_s: FloatArray, amplitude0: float, a: float, b: float, c: float
) -> tuple[FloatArray, FloatArray]:
    """Amplitude of a pendulum of sin x whose losses in a swing are small, with its derivatives.

    ``sin(y) dy/dt = -E(y)/(2 K)``: a half swing, which lasts 2 K(k)/omega with k = sin(y/2), loses
    E/omega of the energy ``1 - cos y``. With a, b_h, b_v, c of one E is 4 pi y k^2 (or
    3 pi (sin y - y cos y) of v|v|), 2 pi y k, 16 (E(k) - (1 - k^2) K(k)) and pi y: at small
    amplitude Eq. 13.

    Parameters
    ----------
    share
        The hysteretic part of b.
    drag
        ``"energy"`` or ``"speed"``.
    time_s, amplitude0, a, b, c
        As in `pendpipe.physics.decay.amplitude`; times from the first on.

    Returns
    -------
    amplitude, gradient
        y in rad, shape (n,), and dy/d(y0, a, b, c), shape (n, 4).
    """
    y = np.geomspace(amplitude0, _LEAST * amplitude0, _NODES)
    k2 = np.sin(0.5 * y) ** 2
    first, second = elliptic(k2)
    dragged = 4.0 * math.pi * y * k2 if drag == "energy" else _of_speed(y)
    viscous = 16.0 * (second - (1.0 - k2) * first)
    linear = share * 2.0 * math.pi * y * np.sqrt(k2) + (1.0 - share) * viscous
    losses = np.stack([dragged, linear, math.pi * y]) / (2.0 * first * np.sin(y))
    loss = np.maximum(np.array([a, b, c]) @ losses, 1e-300)
    parts = np.concatenate([np.ones((1, len(y))), losses / loss]) / loss * y
    step = math.log(_LEAST) / (1 - len(y))
    sums = np.zeros(parts.shape)
    np.cumsum(0.5 * step * (parts[:, 1:] + parts[:, :-1]), axis=1, out=sums[:, 1:])
    elapsed, *integrals = sums
    found = np.exp(np.interp(time_s, elapsed, np.log(y)))
    slopes = [loss / loss[0], *(-loss * each for each in integrals)]
    return found, np.stack([np.interp(time_s, elapsed, each) for each in slopes], axis=1)


_SMALL: Final = 0.1
"""Amplitude, rad, below which a series serves: its next term is y^6/15120 of it, 7e-11."""


def _of_speed(y: FloatArray) -> FloatArray:
    """3 pi (sin y - y cos y), without the cancellation at small y."""
    series = y**3 * (1.0 - 0.1 * y**2 * (1.0 - y**2 / 28.0))
    return np.asarray(math.pi * np.where(y < _SMALL, series, 3.0 * (np.sin(y) - y * np.cos(y))))
