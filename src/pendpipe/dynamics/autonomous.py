"""The half-cycle map of any autonomous law: tabulated where it is smooth, else solved."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.dynamics.chebyshev import gauss_analysis, gauss_nodes
from pendpipe.dynamics.vector_clock import HalfCycles, half_cycles

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.laws import Autonomous
    from pendpipe.dynamics.model import Release

_POINTS = 18
_WIDEST, _NARROWEST = 2.5, 0.1
"""Of the range of ln y that a table spans."""
_SMOOTH_FROM = 20.0
"""Below this multiple of the angle of the stop, half cycles are solved one by one."""
_LOSS_TOLERANCE = 1e-11
_Z = gauss_nodes(_POINTS)
_FIT = gauss_analysis(_POINTS)


@dataclass(frozen=True)
class _Table:
    """Half cycles from one side as Chebyshev series in ln y."""

    low: float
    high: float
    panels: int
    series: FloatArray
    """(points, 1 + panels + 17 panels): ln(y/y'), the panels' ends, their polynomials over y."""

    def row(self, log_y: FloatArray) -> FloatArray:
        """Return the half cycles that start at ln y."""
        z = (2.0 * log_y - self.low - self.high) / (self.high - self.low)
        return np.asarray(np.polynomial.chebyshev.chebvander(z, _POINTS - 1) @ self.series)


@dataclass
class _Side:
    """The half cycles that go towards `towards`."""

    law: Autonomous
    towards: float
    largest: float
    tables: list[_Table] = field(default_factory=list)
    no_table_above: float = math.inf

    def __post_init__(self) -> None:
        self.stop = self.law.slides_to(self.towards, self.largest)

    def solve(self, y: FloatArray) -> HalfCycles:
        """Solve the half cycles from amplitudes y."""
        return half_cycles(self.law, -self.towards * y, self.towards, self.stop)

    def table(self, log_y: float) -> _Table | None:
        """Return the table for ln y, made if it is not there; None if none is smooth enough."""
        for table in self.tables:
            if table.low <= log_y <= table.high:
                return table
        floor = math.log(_SMOOTH_FROM * abs(self.stop)) if self.stop != 0.0 else -math.inf
        span = min(_WIDEST, log_y - floor)
        while span > _NARROWEST and log_y < self.no_table_above:
            made = self._tabulate(log_y - span, log_y)
            if made is not None:
                self.tables.append(made)
                return made
            span *= 0.5
        self.no_table_above = min(self.no_table_above, log_y - _NARROWEST)
        return None

    def _tabulate(self, low: float, high: float) -> _Table | None:
        """Tabulate a range of ln y; None if it does not resolve."""
        y = np.exp(0.5 * (low + high) + 0.5 * (high - low) * _Z)
        try:
            solved = self.solve(y)
        except ValueError:  # further down it may creep instead of swinging
            return None
        loss = -np.log(np.abs(solved.end) / y)
        panels = solved.panel_end_s.shape[1]
        polynomials = solved.polynomials.reshape(_POINTS, -1) / y[:, None]
        series = _FIT @ np.column_stack([loss, solved.panel_end_s, polynomials])
        tail = np.abs(series[-2:]).max(axis=0)
        duration = solved.panel_end_s[:, -1].min()
        fine = (
            tail[0] <= _LOSS_TOLERANCE and tail[1 : 1 + panels].max() <= _LOSS_TOLERANCE * duration
        )
        return _Table(low, high, panels, series) if fine else None


@dataclass
class Motion:
    """A whole motion: its turning points, and its panels for sampling."""

    time_s: FloatArray
    angle_rad: FloatArray
    stopped: bool
    starts: FloatArray
    durations: FloatArray
    polynomials: FloatArray

    def sample(self, time_s: FloatArray) -> FloatArray:
        """Return the angle at the given times, the rest after the stop."""
        index = np.searchsorted(self.starts, time_s, side="right") - 1
        resting = np.full(time_s.shape, self.angle_rad[-1])
        moving = time_s < self.time_s[-1]
        index = np.clip(index[moving], 0, None)
        theta = 2.0 * (time_s[moving] - self.starts[index]) / self.durations[index] - 1.0
        angle = np.zeros(theta.size)
        for power in range(self.polynomials.shape[1] - 1, -1, -1):
            angle = angle * theta + self.polynomials[index, power]
        resting[moving] = angle
        return resting


def follow(
    law: Autonomous, release: Release, most: float, until_s: float, *, tabulate: bool
) -> Motion:
    """Follow the pendulum for `most` turning points, or to the first not before `until_s`."""
    sides = {towards: _Side(law, towards, 1.05 * abs(release.angle_rad)) for towards in (-1.0, 1.0)}
    times, angles = [release.time_s], [release.angle_rad]
    pieces: list[tuple[FloatArray, FloatArray]] = []
    while not law.sticks(angles[-1]) and abs(angles[-1]) > 1e-120:
        if len(times) >= most or times[-1] >= until_s:
            return _gather(times, angles, pieces, stopped=False)
        towards, y = -math.copysign(1.0, angles[-1]), abs(angles[-1])
        side = sides[towards]
        table = side.table(math.log(y)) if tabulate and y > _SMOOTH_FROM * abs(side.stop) else None
        if table is None:
            solved = side.solve(np.array([y]))
            end, ends = float(solved.end[0]), solved.panel_end_s[0]
            pieces.append((ends, solved.polynomials[0]))
        else:
            row = table.row(np.array([math.log(y)]))[0]
            end = towards * y * math.exp(-row[0])
            ends = row[1 : 1 + table.panels]
            pieces.append((ends, y * row[1 + table.panels :].reshape(table.panels, -1)))
        times.append(times[-1] + float(ends[-1]))
        angles.append(end)
    return _gather(times, angles, pieces, stopped=True)


def _gather(
    times: list[float],
    angles: list[float],
    pieces: list[tuple[FloatArray, FloatArray]],
    *,
    stopped: bool,
) -> Motion:
    """Put the half cycles together."""
    starts = [
        begin + np.concatenate([[0.0], ends[:-1]])
        for begin, (ends, _) in zip(times, pieces, strict=False)
    ]
    durations = [np.diff(ends, prepend=0.0) for ends, _ in pieces]
    nothing = np.zeros((0, 1))
    return Motion(
        np.array(times),
        np.array(angles),
        stopped,
        np.concatenate([np.zeros(0), *starts]),
        np.concatenate([np.zeros(0), *durations]),
        np.concatenate([p for _, p in pieces]) if pieces else nothing,
    )
