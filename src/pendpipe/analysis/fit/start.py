"""Where fits begin: the turning points' answer, and which torque their half swings favour.

Turning points are counted, so that the phase of a law can't slip against them, whatever its
amplitude; no motion is fitted.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from pendpipe.analysis.fit.by_points import (
    TOP,
    Period,
    clear,
    envelope_and_period,
    fit_energies,
    fit_period,
    period_excess,
    phases,
    share_of,
)
from pendpipe.analysis.fit.fixed import loss_rates_of
from pendpipe.analysis.fit.result import TORQUES, Baseline, Restoring
from pendpipe.analysis.turning_points import TurningPoints
from pendpipe.analysis.turning_points.samples import Samples
from pendpipe.arrays import FloatArray
from pendpipe.physics.decay import amplitude, time_at

_LARGE: Final = 0.2
"""Of the largest amplitude: below, sin x lengthens the period by 4 % of what it does there."""
_FEWEST: Final = 6
_SEEN: Final = 3.0
"""Standard deviations from which an amplitude, or a coefficient, is seen, and up to which the
coefficient may be off."""
_AGREES: Final = 2.0
"""Standard deviations within which the coefficient agrees with 1 where it has to tell by itself."""
_NEAR: Final = 0.2
"""How near to 1 it must be where sin x removes most of chi^2."""
_PENDULUM: Final = 0.25
"""Amplitude in rad from which sin x lengthens the period by 0.4 %, more than frequencies wander:
what swings so far is taken for a pendulum unless its half cycles speak against it."""
_BLOCKS: Final = 8


class Coefficient(NamedTuple):
    """How much of sin x the times of the turning points ask for: 0 nothing, 1 all of it."""

    value: float
    sd: float
    """From parts of the decay left out in turn, and from what a drift of the frequency would do."""
    scatter: float
    """The part of `sd` that is no drift."""
    removed: float
    """Part of chi^2 of the times that the whole of sin x removes."""

    @property
    def agrees(self) -> bool:
        """Whether the times alone ask for sin x.

        The coefficient is seen and agrees with 1; or sin x removes most of chi^2, and what else
        there is moves the coefficient by less than 0.2.
        """
        near = abs(self.value - 1.0) < _AGREES * self.scatter and self.value > _SEEN * self.scatter
        return near or (self.removed > 0.5 and abs(self.value - 1.0) < _NEAR)

    @property
    def excludes_sine(self) -> bool:
        """Whether the whole of sin x contradicts the times, a drift of the frequency granted."""
        return abs(self.value - 1.0) > _SEEN * self.sd


class LawStart(NamedTuple):
    """Eq. 8 with one torque, from half periods and energies; the motion itself is not fitted."""

    restoring: Restoring
    rates: FloatArray
    """a, b, c of Eq. 13, shape (3,)."""
    angular_frequency: float
    """omega, rad/s: with sin x that of small amplitudes."""
    angle_rad: float
    """Signed angle of the first turning point, about the offset."""
    time_s: float
    """When that is."""
    offset_rad: float
    slip_rad: float
    """Largest phase by which the law's turning points and the measured ones part."""

    @property
    def value(self) -> FloatArray:
        """The same in the order of `eq8.BASELINE`, b half hysteretic; shape (8,)."""
        return np.array(
            [*self.rates, 0.5, self.angular_frequency, self.angle_rad, self.time_s, self.offset_rad]
        )


class Starts(NamedTuple):
    """What half periods and energies tell before any motion is fitted."""

    linear: LawStart
    sine: LawStart | None
    """None where the readings are no angles, or the half cycles are too few."""
    favoured: Restoring
    """The torque that the half cycles favour."""
    coefficient: Coefficient
    """Of sin x, set free: a torque (1 - eta) x + eta sin x, as far as the period goes."""


def start_of(points: TurningPoints, *, stated: bool = True) -> Starts:
    """Find where fits of the linear and of the sine law begin, and which the half cycles favour.

    Parameters
    ----------
    points
        The turning points; gaps between them are allowed.
    stated
        Whether it is known that the readings are angles. If so, swings beyond 0.25 rad are a
        pendulum's unless the half cycles exclude sin x; else the half cycles must ask for it.

    Returns
    -------
    Starts
        For each law a, b, c, omega, angle and time of the first turning point, and the offset;
        the favoured law; the coefficient of sin x, set free, with its standard deviation.

    Notes
    -----
    A half swing from A to A' takes [K(A) + K(A')]/omega and loses omega^2 (cos A' - cos A); with
    the linear law pi/omega and omega^2 (A^2 - A'^2)/2. An error of the level alternates from side
    to side and is fitted too. omega and the first time come from the
    straight line through the times against the half swings counted so; the losses from
    non-negative least squares (`by_points.fit_energies`).

    Examples
    --------
    >>> from pendpipe import turning_points
    >>> points = turning_points("examples/rod-pendulum.csv")
    >>> start = start_of(points)
    >>> start.favoured, round(start.linear.angular_frequency, 3)
    ('linear', 5.485)
    """
    coefficient = sine_coefficient(points)
    sine = _law_start(points, "sine") if may_be_sine(points) else None
    favoured = restoring_of(points, coefficient, stated=stated)
    return Starts(_law_start(points, "linear"), sine, favoured, coefficient)


def restoring_of(
    points: TurningPoints, coefficient: Coefficient | None = None, *, stated: bool = True
) -> Restoring:
    """Which torque the half cycles favour; see `start_of`."""
    if not may_be_sine(points):
        return "linear"
    coefficient = coefficient or sine_coefficient(points)
    wide = abs(float(clear(points).angle_rad[0])) > _PENDULUM
    pendulum = stated and wide and not coefficient.excludes_sine
    return "sine" if coefficient.agrees or pendulum else "linear"


def may_be_sine(points: TurningPoints) -> bool:
    """Whether these are angles below the top, enough of them clear of the noise."""
    inside = points.unit == "rad" and float(np.max(points.amplitude_rad)) < math.pi
    return inside and len(clear(points)) >= _FEWEST


def _law_start(points: TurningPoints, restoring: Restoring) -> LawStart:
    """The start of one law: its energies, and times on a straight line against its phase."""
    part = clear(points) if restoring == "sine" else points
    found = fit_energies(part, restoring=restoring)
    rates = found.value[:3]
    period = fit_period(part, found.amplitude, *rates.tolist(), share=0.5, restoring=restoring)
    return LawStart(
        restoring,
        rates,
        period.angular_frequency,
        float(part.angle_rad[0]),
        period.time_s,
        float(np.mean(points.level_rad)),
        float(np.max(np.abs(period.late_rad))),
    )


def sine_coefficient(points: TurningPoints) -> Coefficient:
    """Fit the times with a free coefficient of sin x, at the larger amplitudes.

    A half swing lasts [pi (1 + losses) + eta (K + K' - pi)]/omega: the times are linear in
    1/omega and in eta/omega. The level's error makes them alternate.

    The coefficient's error does not trust that the times scatter independently: an eighth of the
    decay is left out in turn, the phase beyond it free. And by what it changes if the frequency may
    drift in time, it is uncertain too.
    """
    part = clear(points, _LARGE)
    if len(part) < _FEWEST or points.unit != "rad":
        return Coefficient(0.0, math.inf, math.inf, 0.0)
    start = _law_start(part, "sine")
    losses = (*start.rates.tolist(), 0.5)
    plain, phase = (
        phases(part, part.amplitude_rad, losses, start.angular_frequency, torque)
        for torque in TORQUES
    )
    weight = 1.0 / part.time_sd_s
    columns = np.stack([plain, phase - plain, np.ones_like(phase), part.side], axis=1)
    columns *= weight[:, None]
    right = (part.time_s - part.time_s[0]) * weight

    def eta(design: FloatArray) -> float:
        values = np.linalg.lstsq(design, right, rcond=1e-13)[0]
        return float(values[1] / values[0])

    def square(design: FloatArray) -> float:
        values = np.linalg.lstsq(design, right, rcond=1e-13)[0]
        return float(np.sum((right - design @ values) ** 2))

    value, count = eta(columns), len(part)
    blocks = min(_BLOCKS, count // 3)
    edges = np.linspace(0, count, blocks + 1).astype(int).tolist()
    rows = np.column_stack([columns, weight, right])
    without = _without_each([rows[low:high] for low, high in pairwise(edges)])
    scatter = math.sqrt((blocks - 1) * float(np.var(without)))
    slower = np.cumsum(np.linspace(-1.0, 1.0, count) * np.diff(plain, prepend=0.0))
    drift = eta(np.column_stack([columns, weight * slower])) - value
    linear, bent = square(columns[:, [0, 2, 3]]), columns[:, [0, 2, 3]]
    bent[:, 0] += columns[:, 1]
    removed = 1.0 - square(bent) / linear if linear > 0.0 else 0.0
    return Coefficient(value, math.hypot(scatter, drift), scatter, removed)


def _without_each(blocks: list[FloatArray]) -> FloatArray:
    """The coefficient without each block of the decay in turn, the phase beyond it free.

    Rows of a block are the four columns of the design, the weight (of a step of the phase) and the
    right side.
    """
    scale = 1.0 / np.linalg.norm(np.concatenate(blocks), axis=0)
    products = np.stack([(rows * scale).T @ (rows * scale) for rows in blocks])
    system = products.sum(axis=0) - products
    beyond = products.sum(axis=0) - np.cumsum(products, axis=0)
    # Before the first and behind the last block there is nothing for a step to part.
    beyond[[0, -1]] = 0.0
    beyond[[0, -1], 4, 4] = 1.0
    system[:, 4, :], system[:, :, 4] = beyond[:, 4, :], beyond[:, :, 4]
    # A hair, for blocks without which there are fewer turning points than columns.
    system[:, range(5), range(5)] += 1e-14
    values = np.linalg.solve(system[:, :5, :5], system[:, :5, 5:])[..., 0]
    return np.asarray(values[:, 1] / values[:, 0] * scale[1] / scale[0])


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
    offset = float(np.mean(points.level_rad)) - level
    value = np.array([a, b, c, middle_share, known.angular_frequency, angle, time, offset])
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
    points: TurningPoints,
    values: tuple[float, float, float, float],
    share: float,
    period: Period,
    *,
    at_first: bool,
) -> tuple[float, float, int]:
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
    a, b, c, _, omega, _, time, _ = start.value.tolist()
    half_period = math.pi / omega
    first = time if start.before == 0 else samples.time_s[0]
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
