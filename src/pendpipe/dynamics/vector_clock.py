"""The phase clock of `panel.py` for any autonomous law, many half cycles at once, in numpy.

About a centre m, x = m + s r cos(psi), v = -s Omega r sin(psi), s the side of the start: turning
points are psi = 0 and pi for every law. With A the acceleration times s and X = s (x - m),

    dr/dt = -sin(psi) (Omega r cos(psi) + A/Omega),
    dpsi/dt = Omega sin(psi)^2 - A cos(psi)/(Omega r).

The panels are halved where a law is not smooth (|v|^n at the turning points, Stribeck).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pendpipe.dynamics.chebyshev import ANALYSIS, INTEGRATION, NODES, powers_of_chebyshev
from pendpipe.dynamics.layout import DEGREE

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.laws import Autonomous

TOLERANCE = 1e-11
"""Of the estimate of a panel's error, which is pessimistic, relative to the amplitude."""
FINEST = math.pi * 2.0**-36
_POWERS = powers_of_chebyshev(DEGREE + 1)


@dataclass(frozen=True)
class HalfCycles:
    """Half cycles that start at rest, one a row.

    Parameters
    ----------
    end
        (half cycles,): the angle of the next turning point.
    panel_end_s
        (half cycles, panels): the times since the start at which the panels end.
    polynomials
        (half cycles, panels, 17): the angle in powers of theta, -1 to 1 over the panel's time.
    """

    end: FloatArray
    panel_end_s: FloatArray
    polynomials: FloatArray


@dataclass(frozen=True)
class _Place:
    """Where a panel lies: its start and width in psi, and about which centre, from which side.

    `radius` is that of each half cycle at the start; on the `finest` panel any error is taken.
    """

    radius: FloatArray
    psi: float
    width: float
    side: float
    centre: float

    @property
    def finest(self) -> bool:
        return self.width <= FINEST

    @property
    def phase(self) -> FloatArray:
        """At the nodes, shape (17,)."""
        return np.asarray(self.psi + 0.5 * self.width * (1.0 + NODES))


@dataclass(frozen=True)
class _Panel:
    """A panel's radii and times since its start at the nodes, (half cycles, 17)."""

    radius: FloatArray
    time_s: FloatArray


def half_cycles(law: Autonomous, start: FloatArray, side: float, centre: float) -> HalfCycles:
    """Solve the half cycles from rest at `start` (all on the side -`side` of `centre`).

    Raises
    ------
    ValueError
        If the pendulum does not swing through: it is overdamped, or beyond the unstable
        equilibrium.
    """
    radius = np.abs(start - centre)
    time_s = np.zeros_like(radius)
    ends, polynomials = [], []
    psi, width = 0.0, 0.5 * math.pi
    while psi < math.pi:
        width = min(width, math.pi - psi)
        if math.pi - psi - width < 1e-9 * width:
            width = math.pi - psi
        place = _Place(radius, psi, width, side, centre)
        panel = _solve(law, place)
        inverted = _in_time(panel, place) if panel else None
        if panel is None or inverted is None:
            if place.finest:
                message = "the pendulum does not swing through its equilibrium"
                raise ValueError(message)
            width *= 0.5
            continue
        radius, time_s = panel.radius[:, -1], time_s + panel.time_s[:, -1]
        ends.append(time_s)
        polynomials.append(inverted)
        psi = math.pi if psi + width >= math.pi else psi + width
        width *= 2.0
    return HalfCycles(centre + side * radius, np.stack(ends, 1), np.stack(polynomials, 1))


def _solve(law: Autonomous, place: _Place) -> _Panel | None:
    """Solve a panel by Picard's iteration; None if it is too wide."""
    omega, side, centre = law.restoring.angular_frequency, place.side, place.centre
    cos, sin = np.cos(place.phase), np.sin(place.phase)
    radius = place.radius[:, None]
    r = np.repeat(radius, NODES.size, axis=1)
    integrate = 0.5 * place.width * INTEGRATION.T
    before = np.inf
    for _ in range(60):
        push = -side * law.acceleration(centre - side * r * cos, side * omega * r * sin, side)
        turning = omega * sin**2 - push * cos / (omega * r)
        if not (turning > 0.0).all():
            return None
        slope = -sin * (omega * r * cos + push / omega) / turning
        new = radius + slope @ integrate
        if not (new > 0.0).all():
            return None
        change = float(np.max(np.abs(new - r) / radius))
        r = new
        if change < 1e-15 or (change < 1e-13 and change >= before):
            break
        before = change
    else:
        return None
    clock = 1.0 / turning
    fine = place.finest or (
        _unresolved(slope / radius) * place.width <= TOLERANCE
        and _unresolved(clock * omega) * place.width <= TOLERANCE
    )
    return _Panel(r, clock @ integrate) if fine else None


def _unresolved(values: FloatArray) -> float:
    """Return the estimated size of the Chebyshev coefficients left out, of the worst row."""
    tail = np.abs(values @ ANALYSIS[-4:].T)
    before, last = tail[:, :2].max(axis=1) + 1e-300, tail[:, 2:].max(axis=1)
    return float(np.max(last * np.minimum(1.0, last / before)))


def _in_time(panel: _Panel, place: _Place) -> FloatArray | None:
    """Return the angle as polynomials in the panel's time; None if these do not resolve it."""
    angle = place.centre - place.side * panel.radius * np.cos(place.phase)
    duration = panel.time_s[:, -1:]
    target = 0.5 * duration * (1.0 + NODES)
    zeta = np.broadcast_to(NODES, target.shape).copy()
    coefficients = panel.time_s @ ANALYSIS.T
    slopes = np.polynomial.chebyshev.chebder(coefficients, axis=1)
    for _ in range(30):
        table = _chebyshev_table(zeta)
        late = np.einsum("kij,kj->ki", table, coefficients) - target
        rate = np.einsum("kij,kj->ki", table[:, :, :-1], slopes)
        step = late / rate
        zeta = np.clip(zeta - step, -1.0, 1.0)
        if np.max(np.abs(step)) < 1e-10:
            break
    values = np.einsum("kij,kj->ki", _chebyshev_table(zeta), angle @ ANALYSIS.T)
    if not place.finest and _unresolved(values / place.radius[:, None]) > TOLERANCE:
        return None
    return np.asarray(values @ ANALYSIS.T @ _POWERS)


def _chebyshev_table(zeta: FloatArray) -> FloatArray:
    """Return T_k(zeta), k along the last axis."""
    return np.cos(np.arange(DEGREE + 1) * np.arccos(zeta)[..., None])
