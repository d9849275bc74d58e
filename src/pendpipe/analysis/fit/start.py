"""Where the fit of the readings begins, and which of them it takes: by the turning points."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.by_points import Period, envelope_and_period
from pendpipe.analysis.fit.fixed import Held
from pendpipe.analysis.torque import TOP, clear, period_excess, swing_phase
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.measure import Samples
from pendpipe.arrays import FloatArray
from pendpipe.dynamics.eq8 import Restoring
from pendpipe.physics.decay import time_at

_SLIP: Final = 0.7
"""Phase in rad by which the law's turning points may part from the measured ones."""
_SHOWN: Final = 3.5
"""Standard deviations of a turning point's phase, 0.2 rad, by which a slip is no error of it: that
of one of 2,000."""
_SLIPPED: Final = (
    "the period changes with the amplitude or the time as Eq. 8's does not:"
    " {:.2g} rad of phase along the record"
)
_HIGH: Final = 2.0
"""Amplitude in rad beyond which no turning point before the first is looked for with sin x."""
_MOST: Final = 0.4
"""Of ln amplitude in a half period back: a larger loss is no swing's."""
_STOP: Final = 6.0
"""In widths delta = pi c/(2 omega) of the Coulomb stop: amplitudes below are left out."""


class Start(NamedTuple):
    """Where the search begins."""

    value: FloatArray
    before: int
    """Half cycles from the release to the first turning point kept."""
    warnings: tuple[str, ...]


def start_values(
    points: TurningPoints,
    held: Held,
    restoring: Restoring = "linear",
    *,
    samples: Samples | None = None,
) -> Start:
    """Turn a fit of the turning points into the waveform's nine parameters.

    The release is a turning point before the first reading (a virtual one, if need be),
    unless the amplitude is held: then it is the first turning point itself. So it is with sin x
    where the one before would be so large that there may be none below pi.
    """
    points = points if restoring == "linear" else clear(points)
    envelope, period = envelope_and_period(points, held, restoring, start=True)
    a, b, c, y0, level = envelope.value.tolist()
    late = period.late_rad[period.angular_frequency * points.time_sd_s < _SLIP / _SHOWN]
    slipped = held.angular_frequency is None and np.max(np.abs(late), initial=0.0) > _SLIP
    at_first, losses = "amplitude" in held.fixed, (a, b, c, held.likely_share(b))
    angle, time, before = _release(points, y0, losses, period, restoring, at_first=at_first)
    if restoring == "sine":
        angle = math.copysign(min(abs(angle), TOP), angle)
    # The level is that of the readings, its error that of angles.
    angles = samples is None or samples.unit == points.unit
    offset = held.fixed.get("offset", float(np.mean(points.level_rad)) - (level if angles else 0.0))
    value = np.array([*losses, period.angular_frequency, angle, time, offset, 0.0])
    return Start(value, before, (_SLIPPED.format(np.ptp(late)),) if slipped else ())


def _release(
    points: TurningPoints,
    y0: float,
    losses: tuple[float, float, float, float],
    period: Period,
    restoring: Restoring,
    *,
    at_first: bool,
) -> tuple[float, float, int]:
    """Angle and time of the release, and half cycles from it to the first turning point."""
    a, b, c, _ = losses
    omega, first_s = period.angular_frequency, period.time_s
    side = float(points.side[0])
    if at_first:
        return side * y0, first_s, 0
    half_period = math.pi / omega
    before = max(1, math.ceil((first_s - points.start_s) / half_period + 0.05))
    earlier, back = y0, 0.0
    for _ in range(before):
        last, total = earlier, 0.0
        # One of Runge and Kutta's steps of ln y.
        for share, part in ((0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)):
            rate = a * earlier + b + c / earlier
            total += part / 6.0 * rate
            earlier = last * math.exp(min((share * rate if share else total) * half_period, _MOST))
        if restoring == "sine" and earlier > _HIGH:
            return side * y0, first_s, 0
        lasts = float(swing_phase(np.array([earlier, last]), restoring)[0]) / omega
        back += lasts * (1.0 + float(period_excess(0.5 * (last + earlier), omega, *losses)))
    return side * (-1.0) ** before * earlier, first_s - back, before


def usable_span(
    samples: Samples, points: TurningPoints, value: FloatArray, *, at_release: bool
) -> slice:
    """The readings that are compared: while the motion is seen, and not about the stop.

    None is before a release that is the first turning point itself (`at_release`). Where Coulomb
    friction has stopped the pendulum is a discontinuous function of the parameters; so the last
    half cycles before the stop are left out.
    """
    a, b, c, _, omega, _, time, *_ = value.tolist()
    half_period = math.pi / omega
    first = time + 0.05 * half_period if at_release else samples.time_s[0]
    last = float(points.time_s[-1]) + 0.5 * half_period
    width = 0.5 * half_period * c
    y0, end = abs(float(points.angle_rad[0])), abs(float(points.angle_rad[-1]))
    if 0.0 < _STOP * width < y0 and end < 2.0 * _STOP * width:
        last = min(last, float(points.time_s[0]) + float(time_at(_STOP * width, y0, a, b, c)))
    least = float(points.time_s[min(3, len(points) - 1)])
    begin = int(np.searchsorted(samples.time_s, first))
    return slice(begin, int(np.searchsorted(samples.time_s, max(last, least), side="right")))
