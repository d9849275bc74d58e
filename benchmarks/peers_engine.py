"""Eq. 8 as a user would integrate it with other libraries: the peers of `benchmarks/engine.py`.

Every peer gets Eq. 8 itself, once for each sign of the velocity, and restarts at each turning
point, which is the honest way through the jump of the friction. Nothing here is shared with
pendpipe's engine.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from pendpipe.arrays import FloatArray
    from pendpipe.dynamics import Eq8


def forces(model: Eq8) -> tuple[float, float, float, float]:
    """Return f_c, f_h, f_q and 2 b_v of Eq. 8."""
    omega = model.angular_frequency
    return (
        0.5 * math.pi * omega * model.coulomb,
        0.5 * math.pi * model.hysteretic,
        0.5 * math.pi * model.quadratic / omega,
        2.0 * model.viscous,
    )


def solve_ivp_turning_points(
    model: Eq8, angle_rad: float, count: int
) -> Callable[[], tuple[FloatArray, FloatArray]]:
    """Return scipy's DOP853 at rtol 1e-12 with a terminal event a half cycle."""
    from scipy.integrate import solve_ivp

    f_c, f_h, f_q, damping = forces(model)
    omega2 = model.angular_frequency**2
    longest = 2.0 * math.pi / model.angular_frequency

    def turn(_t: float, state: FloatArray, _sign: float) -> float:
        return float(state[1])

    turn.terminal = True  # type: ignore[attr-defined]

    def rates(_t: float, state: FloatArray, sign: float) -> tuple[float, float]:
        x, v = state
        square = omega2 * x * x + v * v
        friction = f_c + f_h * math.sqrt(square) + f_q * square
        return v, -omega2 * x - friction * sign - damping * v

    def run() -> tuple[FloatArray, FloatArray]:
        times, angles = [0.0], [angle_rad]
        sign = -math.copysign(1.0, angle_rad)
        while len(times) < count:
            turn.direction = -sign  # type: ignore[attr-defined]
            solution = solve_ivp(
                rates, (times[-1], times[-1] + longest), (angles[-1], 0.0), method="DOP853",
                rtol=1e-12, atol=1e-18, events=turn, args=(sign,),
            )  # fmt: skip
            times.append(solution.t_events[0][0])
            angles.append(solution.y_events[0][0][0])
            sign = -sign
        return np.array(times), np.array(angles)

    return run


def heyoka_integrators(model: Eq8, angle_rad: float, tolerance: float) -> Any:
    """Return heyoka's Taylor integrator with a terminal event where the velocity vanishes.

    The sign of the friction is the parameter 0, turned over by the event's callback.
    """
    import heyoka as hy

    f_c, f_h, f_q, damping = forces(model)
    omega2 = model.angular_frequency**2
    x, v = hy.make_vars("x", "v")
    square = omega2 * x**2 + v**2
    friction = f_c + f_h * hy.sqrt(square) + f_q * square
    system = [(x, v), (v, -omega2 * x - friction * hy.par[0] - damping * v)]
    log: list[tuple[float, float]] = []

    def turn(integrator: Any, slope: int) -> bool:
        log.append((integrator.time, integrator.state[0]))
        integrator.pars[0] = slope
        return True

    event = hy.t_event(v, callback=turn)
    integrator = hy.taylor_adaptive(
        system, [angle_rad, 0.0], pars=[-math.copysign(1.0, angle_rad)], tol=tolerance,
        t_events=[event],
    )  # fmt: skip
    return integrator, log


def heyoka_turning_points(
    model: Eq8, angle_rad: float, until_s: float, tolerance: float = 1e-13
) -> Callable[[], tuple[FloatArray, FloatArray]]:
    """Return a run of heyoka to a time, noting its turning points; built once, outside the run."""
    integrator, log = heyoka_integrators(model, angle_rad, tolerance)

    def run() -> tuple[FloatArray, FloatArray]:
        log.clear()
        _reset(integrator, angle_rad)
        integrator.propagate_until(until_s)
        # The release itself may count as a turning point, or not.
        turned = np.array([(0.0, angle_rad), *(entry for entry in log if entry[0] > 0.0)])
        return turned[:, 0], turned[:, 1]

    return run


def heyoka_samples(
    model: Eq8, angle_rad: float, time_s: FloatArray, tolerance: float = 1e-13
) -> Callable[[], FloatArray]:
    """Return heyoka's propagate_grid at the given times."""
    integrator, log = heyoka_integrators(model, angle_rad, tolerance)

    def run() -> FloatArray:
        log.clear()
        _reset(integrator, angle_rad)
        return np.asarray(integrator.propagate_grid(time_s)[-1])[:, 0]

    return run


def _reset(integrator: Any, angle_rad: float) -> None:
    """Put the pendulum back to its release."""
    integrator.time = 0.0
    integrator.state[:] = [angle_rad, 0.0]
    integrator.pars[0] = -math.copysign(1.0, angle_rad)
    integrator.reset_cooldowns()
