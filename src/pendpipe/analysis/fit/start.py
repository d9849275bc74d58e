"""Where the waveform fit begins: the turning points' answer, put before the first reading."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.by_points import envelope_and_period, share_of
from pendpipe.analysis.fit.fixed import loss_rates_of
from pendpipe.analysis.fit.period import TOP, Period, fit_period, period_excess
from pendpipe.analysis.fit.result import Baseline, Restoring
from pendpipe.analysis.fit.swings import clear
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray
from pendpipe.physics.decay import amplitude, time_at

_SURE: Final = 0.7
"""Phase in rad by which the start may be off: half a radian and some more converges."""
_STOP: Final = 6.0
"""In widths delta = pi c/(2 omega) of the Coulomb stop: amplitudes below are left out."""


class Start(NamedTuple):
    """Where the search begins."""

    value: FloatArray
    before: int
    """Half cycles from the release to the first turning point kept."""
    reliable: int
    """How many turning points the start predicts to a fraction of a radian."""
    warnings: tuple[str, ...]


def start_values(
    points: TurningPoints,
    held: Mapping[str, float],
    fixed: Mapping[str, float],
    baseline: Baseline,
    restoring: Restoring = "linear",
) -> Start:
    """Turn a fit of the turning points into the waveform's eight parameters.

    The release is a turning point before the first reading (a virtual one, if need be),
    unless the amplitude is held: then it is the first turning point itself. So it is with sin x:
    there may be none before it below pi.
    """
    points = points if restoring == "linear" else clear(points)
    omega = 2.0 * math.pi * fixed["frequency"] if "frequency" in fixed else None
    parts = loss_rates_of(fixed, points.apparent_frequency_hz)
    envelope, period = envelope_and_period(
        points, held, parts, fixed, baseline, restoring, tolerance=0.3
    )
    a, b, c, y0, level = (float(number) for number in envelope.value)
    share = share_of(parts, b, baseline)
    known, reliable, warnings = period, len(points), []
    # What is not known to a fraction of a radian accuses nobody.
    late = period.late_rad[period.angular_frequency * points.time_sd_s < 0.2]
    if np.max(np.abs(late), initial=0.0) > _SURE and omega is None:
        reliable, known = _sure_part(points, envelope.amplitude, (a, b, c), share, restoring)
        warnings.append(
            "the period changes with the amplitude or the time as Eq. 8's does not:"
            f" {np.ptp(late):.2g} rad of phase along the record"
        )
    middle_share = 0.5 if share is None else share
    angle, time, before = _release(
        points,
        (a, b, c, y0),
        middle_share,
        known,
        at_first="amplitude" in fixed or restoring == "sine",
    )
    if restoring == "sine":
        angle = math.copysign(min(abs(angle), TOP), angle)
    value = np.array(
        [a, b, c, known.angular_frequency, angle, time,
         float(np.mean(points.level_rad)) - level, middle_share]
    )  # fmt: skip
    return Start(value, before, reliable, tuple(warnings))


def _sure_part(
    points: TurningPoints,
    amplitudes: FloatArray,
    rates: tuple[float, float, float],
    share: float | None,
    restoring: Restoring,
) -> tuple[int, Period]:
    """The longest beginning over which one frequency describes the times, and that."""
    count = len(points)
    while True:
        count = max(4, int(0.7 * count))
        part = points.first(count)
        period = fit_period(part, amplitudes[:count], *rates, share=share, restoring=restoring)
        if np.max(np.abs(period.late_rad)) < 0.5 * _SURE or count == 4:
            return count, period


def _release(
    points: TurningPoints, values: tuple[float, float, float, float], share: float,
    period: Period, *, at_first: bool,
) -> tuple[float, float, int]:  # fmt: skip
    """Angle and time of the release, and half cycles from it to the first turning point."""
    a, b, c, y0 = values
    omega, first_s = period.angular_frequency, period.time_s
    side = float(points.side[0])
    if at_first:
        return side * y0, first_s, 0
    half_period = math.pi / omega
    before = max(1, math.ceil((first_s - points.start_s) / half_period + 0.05))
    earlier, back = y0, 0.0
    for step in range(before):
        last = earlier
        earlier = float(amplitude(-(step + 1.0) * half_period, y0, a, b, c))
        if not earlier < 1.5 * last:
            earlier = last * math.exp(min((a * last + b + c / last) * half_period, 0.4))
        middle = np.array([0.5 * (last + earlier)])
        back += half_period * (1.0 + float(period_excess(middle, omega, a, b, c, share)[0]))
    return side * (-1.0) ** before * earlier, first_s - back, before


def usable_span(samples: Samples, points: TurningPoints, start: Start) -> slice:
    """The readings that are compared: while the motion is seen, and not about the stop.

    Where Coulomb friction has stopped the pendulum is a discontinuous function of the
    parameters; so the last half cycles before the stop are left out.
    """
    a, b, c, omega = (float(number) for number in start.value[:4])
    half_period = math.pi / omega
    first = float(start.value[5]) if start.before == 0 else samples.time_s[0]
    last = float(points.time_s[-1]) + 0.5 * half_period
    width = 0.5 * half_period * c
    y0, end = abs(float(points.angle_rad[0])), abs(float(points.angle_rad[-1]))
    if 0.0 < _STOP * width < y0 and end < 2.0 * _STOP * width:
        last = min(last, float(points.time_s[0]) + float(time_at(_STOP * width, y0, a, b, c)))
    least = float(points.time_s[min(3, len(points) - 1)])
    begin = int(np.searchsorted(samples.time_s, first))
    if start.before == 0:
        begin = int(np.searchsorted(samples.time_s, first + 0.05 * half_period))
    return slice(begin, int(np.searchsorted(samples.time_s, max(last, least), side="right")))
