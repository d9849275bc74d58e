"""The slow general way: torques that depend on time, and states of their own.

Every stretch between turning points is integrated by itself (scipy's DOP853), with the side of
the motion fixed, so that no step crosses the jump of the friction; at rest the pendulum waits
until a torque overcomes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pendpipe.dynamics.eq8 import TurningPoints

if TYPE_CHECKING:
    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics.model import Release


class Driven(Protocol):
    """A law with explicit time and states besides angle and velocity."""

    extra_start: tuple[float, ...]
    """The extra states at the release; may be empty."""

    def acceleration(
        self, time_s: float, angle_rad: float, velocity: float, side: float, extra: FloatArray
    ) -> float:
        """Return x'', for motion towards `side` (+1 or -1); velocity may be 0."""

    def extra_rates(
        self, time_s: float, angle_rad: float, velocity: float, extra: FloatArray
    ) -> FloatArray:
        """Return the time derivatives of the extra states."""


@dataclass(frozen=True)
class DrivenMotion:
    """What `follow_driven` returns: samples, and the turning points up to the last of them."""

    angle_rad: FloatArray
    velocity: FloatArray
    extra: FloatArray
    turning: TurningPoints


def follow_driven(
    law: Driven,
    release: Release,
    time_s: FloatArray,
    *,
    relative_tolerance: float = 1e-11,
    longest_step_s: float = np.inf,
) -> DrivenMotion:
    """Integrate a law with explicit time or extra states, and sample it.

    Parameters
    ----------
    law
        What moves.
    release
        From where, at rest.
    time_s
        Ascending times, none before the release.
    relative_tolerance
        Of the integrator, relative to the release's angle as well.
    longest_step_s
        So that a short impulse is not stepped over.

    Returns
    -------
    DrivenMotion
        Angle (offset included), velocity and extra states (one column each) at `time_s`, and
        the turning points: where the pendulum comes to rest, for a moment or to stay.
    """
    times = np.asarray(time_s, dtype=np.float64)
    state = np.array([release.angle_rad, 0.0, *law.extra_start])
    states = np.empty((times.size, state.size))
    now, end = release.time_s, float(times[-1])
    turned = [(now, release.angle_rad)]
    scale = relative_tolerance * max(abs(release.angle_rad), 1e-6)
    options: dict[str, Any] = {
        "method": "DOP853", "rtol": relative_tolerance, "atol": 1e-3 * scale,
        "max_step": longest_step_s, "dense_output": True,
    }  # fmt: skip
    done = 0
    side = _side(law, now, state)
    while True:
        stretch = _moving if side != 0.0 else _waiting
        solution = stretch(law, side, now, end, state, options)
        upto = int(np.searchsorted(times, solution.t[-1], side="right"))
        if solution.status == 0:  # the end was reached, not an event
            upto = times.size
        if upto > done:
            states[done:upto] = solution.sol(times[done:upto]).T
        done = upto
        now, state = float(solution.t[-1]), solution.y[:, -1].copy()
        state[1] = 0.0
        if done == times.size:
            break
        if side != 0.0:
            turned.append((now, float(state[0])))
            side = _side(law, now, state)
        else:
            side = 1.0 if solution.t_events[0].size else -1.0
    when, where = np.array(turned).T
    where = where + release.offset_rad
    rests = side == 0.0
    points = TurningPoints(when, where, rests, float(where[-1]) if rests else np.nan)
    return DrivenMotion(states[:, 0] + release.offset_rad, states[:, 1], states[:, 2:], points)


def _side(law: Driven, time_s: float, state: FloatArray) -> float:
    """Return where a pendulum at rest goes: +1, -1, or 0 if friction holds it."""
    if law.acceleration(time_s, state[0], 0.0, 1.0, state[2:]) > 0.0:
        return 1.0
    if law.acceleration(time_s, state[0], 0.0, -1.0, state[2:]) < 0.0:
        return -1.0
    return 0.0


def _moving(
    law: Driven, side: float, start: float, end: float, state: FloatArray, options: dict[str, Any]
) -> Any:
    """Integrate to the next turning point."""
    from scipy.integrate import solve_ivp

    def rates(t: float, y: FloatArray) -> FloatArray:
        acceleration = law.acceleration(t, y[0], y[1], side, y[2:])
        return np.array([y[1], acceleration, *law.extra_rates(t, y[0], y[1], y[2:])])

    def turns(_t: float, y: FloatArray) -> float:
        return float(y[1])

    turns.terminal, turns.direction = True, -side  # type: ignore[attr-defined]
    return solve_ivp(rates, (start, end), state, events=turns, **options)


def _waiting(
    law: Driven, _side: float, start: float, end: float, state: FloatArray, options: dict[str, Any]
) -> Any:
    """Integrate the extra states until a torque overcomes the friction at rest."""
    from scipy.integrate import solve_ivp

    def rates(t: float, y: FloatArray) -> FloatArray:
        return np.array([0.0, 0.0, *law.extra_rates(t, y[0], 0.0, y[2:])])

    def event(side: float) -> Any:
        def leaves(t: float, y: FloatArray) -> float:
            return side * law.acceleration(t, y[0], 0.0, side, y[2:])

        leaves.terminal, leaves.direction = True, 1.0  # type: ignore[attr-defined]
        return leaves

    return solve_ivp(rates, (start, end), state, events=[event(1.0), event(-1.0)], **options)
